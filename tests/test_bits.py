"""The same bits: a motion computed in every way that there is here."""

import json
import re
import shutil

import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.core.row import ROWS
from cgraph.extend import OPS
from dynamics.scenes import of_model
from dynamics.scenes.start import moving_start, with_start
from dynamics.verification import same_bits as module
from tests.bits import same_bits
from tests.slow import slow
from viz.cli import main
from viz.models.live_motion import adjustable


def pushed():
    """Equations of first order with time and functions."""
    return dyn.OdeSystem(lambda x, t: [x[1], -cg.sin(x[0]) + 0.1 * cg.cos(t) * x[0] ** 2], ["x", "v"])


def open_masses():
    """A mechanism whose masses and gravity are parameters, which a run may not build in."""
    return adjustable(dyn.scenes.load("triple_pendulum")).model


MODELS = {
    "open masses": open_masses,
    "triple_pendulum": lambda: dyn.scenes.load("triple_pendulum"),
    "pushed": pushed,
    "free": lambda: dyn.Mechanism([dyn.Body("base", dyn.Joint("free"), mass=2.0, center=[0.1, 0.0, 0.2],
                                            inertia=[[1, 0, 0], [0, 1.5, 0], [0, 0, 2]])]),
}  # fmt: skip


@pytest.mark.parametrize("name", ["pushed", *slow("triple_pendulum", "free", "open masses")])
def test_every_way_has_the_same_bits(name):
    found = same_bits(moving_start(of_model(MODELS[name]())))
    assert found.passed, str(found)
    names = {way.name for way in found.ways}
    assert {"loop in Python", "another process"} <= names
    assert ("C" in names) == any(map(shutil.which, module.COMPILERS))
    assert ("WebAssembly, baseline compiler" in names) == (shutil.which("node") is not None)
    assert ("simulate in Python" in names) == ("simulate in machine code" in names) == (name != "free")
    json.dumps(found.to_dict())


@pytest.mark.skipif(not any(map(shutil.which, module.COMPILERS)), reason="no C compiler")
def test_another_order_of_sums_is_seen_and_what_is_missing_is_said(monkeypatch):
    # Of -ffast-math what changes sums: the whole, when linked, has the process drop subnormal numbers from then on.
    loose = ("-O3", "-fassociative-math", "-freciprocal-math", "-fno-signed-zeros", "-fno-trapping-math")
    monkeypatch.setattr(module, "FLAGS", ("-std=c99", *loose, "-shared", "-fPIC"))
    scene = dyn.scenes.load("triple_pendulum")
    motion = module._Motion(scene)
    assert motion._c() != motion._simulate("python")
    monkeypatch.setattr(module.shutil, "which", lambda name: None)
    found = same_bits(scene)
    assert found.passed
    assert "C: none of cc, gcc, clang is installed" in found.left_out
    assert "WebAssembly, baseline compiler: node is not installed" in found.left_out
    assert "left out: C: none of" in str(found)


def test_a_motion_that_does_not_stay_finite_is_an_error():
    blows_up = of_model(dyn.OdeSystem(lambda x, t: [x[0] * x[0]], ["x"]))
    with pytest.raises(ValueError, match="does not stay finite over 1000 steps"):
        same_bits(with_start(blows_up, {"x": 10.0}))


OWN = """\
import cgraph as cg
import dynamics as dyn
from cgraph.extend import Op, register

values = lambda x: x * x * x, lambda x: x * x * x
register(Op("cube_of_bits", 1, *values, lambda y, x: (3.0 * x * x,), samples=((0.6,),), COLUMNS), replace=True)
model = dyn.OdeSystem(lambda x, t: [x[1], -cg.cube_of_bits(x[0])], ["x", "v"])
"""


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """The command on a model whose operation has these columns: its status, and what it prints."""

    def run(columns):
        (tmp_path / "own_of_bits.py").write_text(OWN.replace("COLUMNS", columns))
        status = main(["certify", "--bits", "own_of_bits.py:model"])
        return status, capsys.readouterr().out

    monkeypatch.chdir(tmp_path)
    yield run
    for table in (OPS, ROWS):
        table.pop("cube_of_bits", None)


def test_an_operation_of_a_models_file_is_run_where_it_can_be_and_what_it_lacks_is_said(command):
    status, told = command("")
    assert status == 0
    assert re.search(r"another process +\n", told)
    assert "left out: another process" not in told
    node = (
        "cube_of_bits, which no page has: its row needs the column `javascript`" if shutil.which("node") else "node is"
    )
    assert f"left out: WebAssembly, baseline compiler: {node}" in told.replace("operation 'cube_of_bits' calls ", "")
    if any(map(shutil.which, module.COMPILERS)):
        assert "left out: C: operation 'cube_of_bits' has no text in C" in told


@pytest.mark.skipif(not any(map(shutil.which, module.COMPILERS)) or not shutil.which("node"), reason="no compiler")
def test_what_a_compiler_or_node_says_of_an_operation_is_told(command):
    status, told = command("c='cube_of(', javascript='(x) => x *'")
    assert status == 0
    assert re.search(r"left out: C: \w+ failed: motion.c:\d+:\d+: error: .*expected", told)
    assert "left out: WebAssembly, baseline compiler: node failed: SyntaxError: " in told
    status, told = command("c='no_function_of_bits({0})', javascript='(x) => x * x * x'")
    assert "left out: C: " in told
    assert "no_function_of_bits" in told
    assert "WebAssembly, optimizing compiler\n" in told
    assert command("javascript='(x) => x * x'")[0] == 2
