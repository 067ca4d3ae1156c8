"""The formulations beside one another: signatures, values where they should agree, and what is spurious."""

from pytest import approx, mark, warns

import cgraph as cg
import dynamics as dyn
from dynamics.equations.formulations.lagrange_terms import INERTIAL
from tests.dynamics.models import MODELS, before, run, states
from tests.formulations import WRONG

ROUNDING = 1e-12  # two orders of summation of the same terms, which may cancel tenfold
EMBEDDED = ("by_definition", "kinetic_only", "kinetic_only_exact")


@mark.parametrize("formulation", dyn.FORMULATIONS)
@mark.parametrize("name", MODELS)
def test_simplification_keeps_the_value_and_never_grows_and_no_right_graph_has_spurious_nodes(
    name: str, formulation: str
) -> None:
    model = MODELS[name]()
    state = before(states(model, 50), dt=0.05)
    for derive in (dyn.inverse_dynamics, dyn.momentum_rate)[: 1 + (formulation in INERTIAL)]:
        derived, simplified = (derive(model, formulation, simplify=each) for each in (False, True))
        assert simplified.input_names == derived.input_names
        assert len(simplified.nodes) <= len(derived.nodes)
        assert run(simplified, state) == approx(run(derived, state), rel=ROUNDING, abs=ROUNDING)
        assert formulation in WRONG or not dyn.spurious_nodes(derived) | dyn.spurious_nodes(simplified)


def test_formulations_by_name_are_shortened_by_no_identity_and_the_default_is() -> None:
    def turning(q, qd, t):  # the point of a rod: cos^2 + sin^2 = 1
        x, z = qd[0] * cg.cos(q[0]), qd[0] * cg.sin(q[0])
        return 0.5 * (x * x + z * z) + 9.81 * cg.cos(q[0])

    rod = dyn.System(turning, ["angle"])
    sizes = {}
    for name in dyn.FORMULATIONS:
        graph = dyn.inverse_dynamics(rod, name)
        derived = cg.simplify(dyn.inverse_dynamics(rod, name, simplify=False))
        assert cg.structure_hash(graph) == cg.structure_hash(derived)
        sizes[name] = len(graph.nodes)
    assert sizes["chain_rule"] > len(dyn.momentum_rate(rod).nodes)  # its difference from dL/dq
    assert len(dyn.inverse_dynamics(rod).nodes) < min(sizes.values()) / 2


@mark.parametrize("formulation", dyn.FORMULATIONS)
def test_every_formulation_has_the_promised_inputs_and_outputs(formulation: str) -> None:
    system = MODELS["driven pendulum"]()
    state = ["q0_old", "qd0_old", "qdd0", "dt"] if formulation in EMBEDDED else ["q0", "qd0", "qdd0"]
    graph = dyn.inverse_dynamics(system, formulation)
    graph.check()
    assert graph.input_names == (*state, "t", "a", "w")
    assert list(graph.outputs) == ["tau0"]
    if formulation in INERTIAL:
        assert list(dyn.momentum_rate(system, formulation).outputs) == ["p0_dot"]


@mark.parametrize("formulation", INERTIAL)
def test_torque_is_momentum_rate_minus_dl_dq_plus_damping_minus_forces(formulation: str) -> None:
    """The difference of the two graphs holds nothing of the formulation but the state that it is taken at."""
    system = MODELS["coupled springs"]()
    state = before(states(system, 20), dt=0.05)
    rest = run(dyn.inverse_dynamics(system, formulation), state) - run(dyn.momentum_rate(system, formulation), state)
    right = run(dyn.inverse_dynamics(system, "chain_rule"), state) - run(dyn.momentum_rate(system), state)
    assert rest == approx(right, rel=ROUNDING, abs=ROUNDING)


def test_a_former_name_is_taken_with_a_warning():
    scene = dyn.scenes.load("spring_mass")
    for of in (dyn.inverse_dynamics, dyn.momentum_rate, lambda model, name: dyn.formulation_verdict(model, name).graph):
        with warns(FutureWarning, match="'euler_embedded' is called 'by_definition' now"):
            found = of(scene, "euler_embedded")
        assert cg.structure_hash(found) == cg.structure_hash(of(scene, "by_definition"))
    assert "euler_embedded" not in dyn.FORMULATIONS
