"""The page with its box: small, closed to the net, and able to show what Python has."""

import re
import sys
from pathlib import Path

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.operations.table import zero_safe_mul
from tests.each_row import each_row
from tests.viz.typed.typed_script import run_typed
from viz import cli


def coupled(q, qd, t, p):
    shared = cg.sin(q[0] - q[1]) * p["class"]
    kinetic = 0.5 * qd[0] ** 2 + qd[1] * qd[1] + shared * qd[0] * qd[1] / 3.0
    return kinetic - (-shared) ** 2.0 * cg.hypot(1.0, q[0]) - t * q[1]


OWN = dyn.System(coupled, "theta_1 time", {"class": 0.3}, lambda q, qd, t: [cg.cos(t), 0.0], damping=[0.1, 0.0])
CAM = dyn.System(  # kept below by a measured potential, and pushed by a force that falls with speed
    lambda q, qd, t: 0.5 * qd[0] ** 2 - cg.interp(q[0], [-1.0, 0.0, 0.4, 1.5], [2.0, 0.0, 0.1, 3.0], "monotone"),
    "x",
    forces=lambda q, qd, t: [cg.interp(qd[0], [0.0, 1.0, 2.0], [1.0, 0.8, 0.0])],
)
SYSTEMS = {
    "own": OWN,
    "table": CAM,
    "spring_mass": dyn.scenes.load("spring_mass"),
    "triple_pendulum": dyn.scenes.load("triple_pendulum"),
    "chain of 4": dyn.scenes.load("chain", n=4),
}


@each_row("name", SYSTEMS)
def test_a_system_written_as_text_means_the_same(name):
    """Node for node, as tags, which a text has not, do not change what is made."""
    system = SYSTEMS[name].system
    found = run_typed(
        """(text) => {
          const system = parsed(text), { nodes, edges, graph } = formulation(system, "by_definition");
          const at = Object.fromEntries(graph.inputs.map(({ name }, i) => [name, [0.3, -0.7, 0.45][i % 3]]));
          return { nodes, edges, values: outputsAt(graph, at).at, names: [...system.parameters.keys()] };
        }""",
        viz.typed_text(system, q=[0.1] * system.n),
    )
    graph = dyn.inverse_dynamics(system, "by_definition")
    assert [found["nodes"], found["edges"]] == [len(graph.nodes), len(graph.edges)]
    assert len(found["names"]) == len(system.parameters)
    at = {name: [0.3, -0.7, 0.45][i % 3] for i, name in enumerate(graph.input_names)}
    assert found["values"] == pytest.approx(graph.evaluate(at), rel=1e-12)


ALIASES = re.search(
    r"ALIASES = {(.*?)}", (Path(sys.modules[viz.typed_page.__module__].__file__).parent / "expressions.js").read_text()
)[1]
NAMES = [*re.findall(r"(\w+):", ALIASES), "sin", "π", "ẋ", "öl", "tau", "damping", "time", "lambda", "T", "xdot", "m₁"]


def test_names_that_mean_something_in_a_text_are_renamed():
    """Functions, rates, and lines of the page: as a coordinate, a parameter and the name of a formula."""

    def lagrangian(q, qd, t, p):
        (k,) = p.values()
        inner = cg.with_name(cg.sin(q[0]) * k, name)
        return 0.5 * k * qd[0] ** 2 - inner * inner

    read = "(text) => { const { parameters, start, damping, forces } = parsed(text);"
    read += " return [[...parameters.values()], start.q, start.qd, damping, forces[0].value]; }"
    for name in NAMES:
        system = dyn.System(lagrangian, [name], parameters={name: 2.0})
        assert run_typed(read, viz.typed_text(system, [0.3], [0.4])) == [[2.0], [0.3], [0.4], [0], 0], name


@each_row(
    ("model", "kind", "words"),
    [
        (3, TypeError, "expected a System, a mechanism or a scene, got int: 3"),
        (dyn.scenes.load("chain", n=5), ValueError, "the page takes up to 4 coordinates"),
        (
            dyn.System(lambda q, qd, t: zero_safe_mul(q[0], qd[0]) * qd[0], "x"),
            ValueError,
            "the operation 'zero_safe_mul', which cannot be typed",
        ),
    ],
)
def test_what_cannot_be_typed_is_said(model, kind, words):
    with pytest.raises(kind, match=re.escape(words)):
        viz.typed_text(model)


def test_a_page_has_the_text_of_a_file_as_text(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("L = 1/2*x'^2 # </script><script>alert(1)</script>", encoding="utf-8")
    assert cli.main(["type", "--out", str(tmp_path / "a.html"), "--text", str(tmp_path / "mine.txt")]) == 0
    assert "a.html" in capsys.readouterr().out
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert page == viz.typed_page((tmp_path / "mine.txt").read_text(encoding="utf-8"))
    assert page.count("<script>") == page.count("</script>") - 1 == 1  # beside it the data, which are none


def test_every_example_moves_to_its_end():
    for name, found in run_typed(
        """() => [...TYPED.EXAMPLES].map(([name, text]) => {
          const system = parsed(text), motion = TYPED.motionOf(system), record = TYPED.recordOf(system, motion);
          return [name, { stopped: motion.stopped, change: motion.change, notices: record.notices,
            marked: record.versions.map(({ marked }) => marked.length) }];
        })"""
    ):
        assert (found["stopped"], found["notices"]) == (False, []), name
        assert found["change"] < 1e-6
        assert found["marked"][0] > 0
        assert found["marked"][2] == 0
