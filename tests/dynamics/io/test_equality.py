"""Equality constraints of MJCF: the same rows and accelerations as MuJoCo's model has them, but exact; and the rest."""

from typing import Any

import numpy as np
from pytest import approx, importorskip, mark, raises, warns

import cgraph as cg
import dynamics as dyn
from dynamics import Mechanism, MechanismError
from dynamics.equations.states.consistent_state import nearest_state
from tests.slow import slow

mujoco = importorskip("mujoco")
pytestmark = mark.filterwarnings("ignore:.*left out:dynamics.MechanismWarning")

Array = np.ndarray[Any, np.dtype[np.float64]]
CLOSED = 1e-13  # m, rad: MuJoCo's rows where ours are zero
AGREEMENT = 1e-12  # of the largest acceleration: rounding of two codes, and of differences, times a condition number
STENCIL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])  # of a central difference of order 8
STEP = 0.02

INERTIAL = '<inertial pos="0.1 0.2 -0.3" mass="1.3" fullinertia="0.3 0.4 0.5 0.01 0.02 -0.03"/>'
BODIES = f"""<site name="world site" pos="0.2 0.1 0.9" euler="5 6 7"/>
<body name="a" pos="0 0 1" euler="30 0 0"><joint name="ja" axis="0 1 0" ref="30" damping="0.3"/>{INERTIAL}
 <body name="b" pos="0.5 0.1 0" euler="10 20 30">
  <joint name="jb" type="slide" axis="0 1 0" ref="0.1" stiffness="2"/><joint name="jz" pos="0.1 0 0.2"/>{INERTIAL}
  <body name="b2" pos="0.1 0 0">{INERTIAL}<body name="tool" pos="0 0.1 0.1" euler="0 0 40">
   {INERTIAL}<site name="on tool" pos="0.1 0.2 0.3" euler="40 50 60"/></body></body></body></body>
<body name="c" pos="0 1 1" euler="0 0 20"><freejoint/>{INERTIAL}<site name="on c" pos="0 0.1 0"/>
 <body name="d" pos="0.2 0 0.1"><joint name="jd" axis="1 0 1"/>{INERTIAL}</body></body>"""
TENDONS = """<tendon><fixed name="one"><joint joint="ja" coef="2"/><joint joint="jb" coef="-3"/></fixed>
<fixed name="two"><joint joint="jz" coef="0.5"/><joint joint="jd" coef="1"/></fixed></tendon>"""
CONSTRAINTS = {
    "joints": '<joint joint1="jb" joint2="ja" polycoef="0.1 -0.4 0.3 0.2 -0.1"/><joint joint1="jz" joint2="jd"/>',
    "one joint": '<joint joint1="ja" polycoef="0.1 3 4 5 6"/>',
    "connect": '<connect body1="tool" body2="d" anchor="0.1 0.2 0.3"/>',
    "connect a site of the world": '<connect site1="world site" site2="on c"/>',
    "weld of the world": '<weld body1="world" body2="c" relpose="0.1 0.2 0.8 1 0.3 0.5 0"/>',
    "tendons": '<tendon tendon1="one" tendon2="two" polycoef="0.1 -0.4 0.3 0.2 -0.1"/>',
    "one tendon": '<tendon tendon1="one" polycoef="0.1 3 4 5 6"/>',
    "weld of points": '<weld body1="b" body2="c" anchor="0.3 0.1 0.2" torquescale="0"/>',
}
OTHERS = {
    "connect sites": '<connect site1="on tool" site2="on c"/>',
    "weld sites": '<weld site1="on tool" site2="on c"/>',
    "weld": '<weld body1="b2" body2="d" anchor="0.3 0.1 0.2" torquescale="0.2"/>',
    "weld apart": '<weld body1="tool" body2="c" relpose="0.1 0.2 0.3 1 1 0.5 0" anchor="0.2 0.3 -0.1"/>',
    "weld to the world": '<weld body1="d"/>',
}


def text_of(equality: str, option: str = "") -> str:
    return f"<mujoco>{option}<worldbody>{BODIES}</worldbody>{TENDONS}<equality>{equality}</equality></mujoco>"


def rows(model: Any, data: Any, q: Array) -> tuple[Array, Array]:
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return np.array(data.efc_pos), np.array(data.efc_J).reshape(-1, model.nv)


def exact_accelerations(model: Any, q: Array, u: Array, tau: Array) -> Array:
    """udot of M udot - J^T lambda = force, J udot = -Jdot u, of MuJoCo's M, J and force."""
    data = mujoco.MjData(model)
    rate = np.zeros(len(rows(model, data, q)[0]))
    for k, weight in enumerate(STENCIL, 1):
        for side in (1.0, -1.0):
            moved = q.copy()
            mujoco.mj_integratePos(model, moved, u, side * k * STEP)
            rate += side * weight / STEP * (rows(model, data, moved)[1] @ u)
    data.qvel[:], data.qfrc_applied[:] = u, tau
    _, slopes = rows(model, data, q)
    mass = np.empty((model.nv, model.nv))
    for column, unit in zip(mass, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    matrix = np.block([[mass, -slopes.T], [slopes, np.zeros((len(rate), len(rate)))]])
    solved = np.linalg.lstsq(matrix, np.concatenate([data.qfrc_smooth, -rate]), rcond=1e-12)[0]
    return np.asarray(solved[: model.nv])


@mark.parametrize("what", [*CONSTRAINTS, *slow(*OTHERS)])
def test_rows_and_accelerations_are_mujoco_s_but_exact(what: str) -> None:
    text = text_of((CONSTRAINTS | OTHERS)[what])
    model, loaded, rng = mujoco.MjModel.from_xml_string(text), dyn.load_mjcf(text), np.random.default_rng(0)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    start = model.qpos0 + 0.2 * rng.uniform(-1.0, 1.0, model.nq)
    q, u = nearest_state(loaded, start, rng.uniform(-1.0, 1.0, model.nv))
    phi, slopes = rows(model, mujoco.MjData(model), q)
    assert np.abs(phi).max() <= CLOSED
    assert np.abs(slopes @ u).max() <= CLOSED
    tau = rng.uniform(-1.0, 1.0, model.nv)
    expected = exact_accelerations(model, q, u, tau)
    found = cg.compile(dyn.forward_dynamics(loaded), "python")([*q, *u, *tau])[: model.nv]
    assert found == approx(expected, rel=0.0, abs=AGREEMENT * np.abs(expected).max())


GEAR = '<joint name="gear" joint1="jz" joint2="jd"/>'


def test_loops_have_the_names_of_the_constraints_or_of_their_bodies_and_those_too_many_are_named() -> None:
    point = CONSTRAINTS["connect a site of the world"]
    with warns(dyn.ConstraintWarning, match="c to world' x.* and .*b to d'. follow from the others"):
        loaded = dyn.load_mjcf(text_of(point * 2 + GEAR.replace("gear", "b to d") + GEAR.replace('name="gear"', "")))
    assert [loop.label for loop in loaded.loops] == ["c to world", "c to world'", "b to d", "b to d'"]


def test_what_is_soft_inactive_or_off_is_said() -> None:
    joint, off = CONSTRAINTS["one joint"], GEAR.replace("/>", ' active="false"/>')
    with warns(dyn.MechanismWarning, match="left out softness of equality constraints"):
        loaded = dyn.load_mjcf(text_of(joint + off))
    assert loaded.left_out == ("softness of equality constraints (number 0)", "inactive equality constraints (gear)")
    assert len(loaded.loops) == 1
    none = dyn.load_mjcf(text_of(joint + off, '<option><flag equality="disable"/></option>'))
    assert (none.loops, none.left_out) == ((), ())


@mark.parametrize(
    ("equality", "message"),
    [
        (
            GEAR + GEAR.replace('"gear"', '"other"').replace("/>", ' polycoef="0.1 1 0 0 0"/>'),
            "^the given text: the constraints cannot be met: no state was seen where '(gear|other)' is 0$",
        ),
        ('<connect name="x" site1="on c" site2="also on c"/>', "^equality constraint x holds the body 'c' to itself$"),
    ],
)
def test_what_cannot_be_closed_is_one_sentence(equality: str, message: str) -> None:
    more = '<site name="also on c" pos="1 0 0"/><site name="on c"'
    with raises(MechanismError, match=message):
        dyn.load_mjcf(text_of(equality).replace('<site name="on c"', more))


def test_anchors_that_the_compiler_computes_are_closed_where_the_file_has_the_bodies() -> None:
    """At qpos0, whatever the references of joints are."""
    text = text_of(CONSTRAINTS["connect"])
    loaded = dyn.load_mjcf(text)
    start = mujoco.MjModel.from_xml_string(text).qpos0
    q, _ = dyn.consistent_state(loaded, start, np.zeros(loaded.system.n))
    assert q == approx(start, rel=0, abs=1e-15)


def test_the_twin_of_a_mechanism_with_loops_is_its_tree() -> None:
    from tests.mujoco_twin import AskedTwin

    bodies = [dyn.Body(name, dyn.Joint("revolute"), inertia=(1.0, 1.0, 2.0)) for name in "ab"]
    twin = AskedTwin(Mechanism(bodies, loops=[dyn.Loop("coupling", "b", "a", name="gear")]))
    assert twin.inverse(np.zeros(2), np.zeros(2), np.ones(2)) == approx([2.0, 2.0])
    for ask in (lambda: twin.accelerations(*np.zeros((3, 2))), lambda: twin.trajectory(*np.zeros((2, 2)), 1)):
        with raises(MechanismError, match=r"^MuJoCo has soft loops, and so no (accelerations|motions) of loop 'gear'$"):
            ask()
