"""One verdict: of any scene the headline, what is painted, tables, the notebook and the typed page say the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from pytest import approx

import dynamics as dyn
from cgraph._shared import remarks_of
from tests.dynamics.equations.test_verdict import NAMED
from tests.dynamics.textbook import TEXTBOOK
from tests.slow import slow
from tests.viz.typed.typed_script import run_typed
from viz import typed_text
from viz.models.inspection import PAPER, inspection
from viz.models.node_classes import formulation_classes

ROUNDING = 1e-9  # of numbers of size 1 to 100
CHASSIS = dyn.Body("chassis", dyn.Joint("free", name="base"), mass=2.0, inertia=(0.1, 0.2, 0.3))
WHEEL = dyn.Body(
    "wheel", dyn.Joint("revolute", axis=(0, 1, 0), name="axle"), parent="chassis", mass=0.5, center=(0.1, 0, 0)
)
MODELS: dict[str, Callable[[], dyn.Model]] = {
    **{name: lambda name=name: dyn.scenes.load(name) for name in dyn.scenes.names()},
    **TEXTBOOK,
    **{name: lambda name=name: NAMED[name][0] for name in NAMED},
    "wheel on a chassis": lambda: dyn.Mechanism([CHASSIS, WHEEL]),
}
QUICK = ("spring_mass", "triple_pendulum", *NAMED, "hoop", "wedge")


@pytest.mark.parametrize("name", [*QUICK, *slow(*[name for name in MODELS if name not in QUICK])])
def test_every_page_and_table_has_the_same_verdict(name: str) -> None:
    scene = dyn.scenes.of_model(MODELS[name]())
    if not any(scene.q):  # where an angle may be at its pole, and a radius 0
        scene = replace(scene, q=tuple([0.3 + 0.1 * i for i in range(len(scene.q))]))
    versions = inspection(scene, t_end=1e-3).versions
    sizes, right = dyn.formulation_sizes(scene), dyn.inverse_dynamics(scene, "chain_rule")
    text = typed_text(scene, q=list(scene.q)) if scene.system.n <= 3 and not scene.mechanism else ""
    for formulation in PAPER:
        verdict, version = dyn.formulation_verdict(scene, formulation), versions[formulation]
        painted = [bool(version.marked), bool(version.blamed), bool(version.off)]
        assert (version.flawed, any(painted)) == (verdict.differs, verdict.differs)
        assert painted == [bool(verdict.nodes), bool(verdict.edges), bool(verdict.excess)]
        assert version.about.startswith(verdict.summary)
        assert (", the torque is wrong at every dt" in version.about, ", the torque is right: " in version.about) == (
            verdict.differs,
            not verdict.differs,
        )
        row = sizes["tau", formulation]
        assert (row.spurious_nodes, row.missing_terms) == (len(verdict.nodes), len(verdict.missing))
        assert any(row[3:]) == verdict.differs
        class_of = formulation_classes([verdict])(verdict.graph)
        assert sum([class_of(node) == "spurious" for node in verdict.graph.nodes]) == len(verdict.nodes)
        shown = remarks_of(dyn.inverse_dynamics(scene, formulation))
        assert (len(shown.nodes), len(shown.edges)) == (len(verdict.nodes), len(verdict.edges))
        if text:
            found = run_typed("(text, name) => formulation(parsed(text), name)", text, formulation)
            assert (found["differs"], found["off"]) == (verdict.differs, list(verdict.excess))
        for output, each in verdict.excess.items():
            at = verdict.at | dict.fromkeys({*right.input_names} - {*verdict.at}, 0.0)
            assert right.evaluate({key: at[key] for key in right.input_names})[output] == approx(
                each.right, abs=ROUNDING
            )
            assert each.torque - each.right == approx(each.value, abs=ROUNDING)
