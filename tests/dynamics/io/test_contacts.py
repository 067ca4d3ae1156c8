"""Contacts of robot files: which shapes meet, where, of what material; and what is left out."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pytest import approx, raises

import dynamics as dyn
from dynamics.io.mjcf_contacts import _meetings
from tests.tolerances import EQUATIONS

# All geoms overlap, so that MuJoCo has a contact for every pair that may meet.
CROWD = """<mujoco><option>{flags}</option><default><geom size="1"/></default><worldbody>
<geom name="floor" type="plane" size="1 1 1" friction="0.3"/><geom name="post" type="sphere"/>
<body name="a" pos="0.1 0 0"><freejoint/><geom name="a1" type="sphere" friction="0.7"/>
<geom name="a2" type="capsule" size="1 1" pos="0 .1 0" contype="2" conaffinity="4"/>
<body name="b" pos="0 0.2 0"><joint axis="0 0 1"/><geom name="b1" type="sphere" condim="1" friction="0.9"/>
<geom name="b2" type="box" size="1 1 1" contype="4" conaffinity="2"/>
<body name="c" pos="0 0.1 0.1"><geom name="c1" type="sphere" priority="1" friction="0.1"/>
<body name="d" pos="0 0.1 0"><joint axis="1 0 0"/><geom name="d1" type="sphere" contype="0"/></body></body>
</body></body>
<body name="e" pos="0 0 0.3"><freejoint/><geom name="e1" type="sphere" condim="4"/>
<geom name="e2" type="capsule" size="1 1"/></body></worldbody>
<contact><exclude body1="a" body2="e"/>
<pair geom1="b1" geom2="floor" friction="0.25 0.25 0.1 0.1 0.1" condim="3"/></contact>
</mujoco>"""

LEG = """<robot name="leg"><link name="base"/><link name="leg"><inertial><mass value="2"/><origin xyz="0 0 -0.2"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.2" rpy="0 1.5707963267948966 0"/>
<geometry><capsule radius="0.02" length="0.3"/></geometry></collision>
<collision><origin xyz="0 0 -0.4"/><geometry>{shape}</geometry></collision></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="leg"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


LEFT = "contacts (the option contacts takes those of spheres and capsules)"


def silently(read: Any, *args: Any, **options: Any) -> Any:
    with warnings.catch_warnings(action="ignore", category=dyn.MechanismWarning):
        return read(*args, **options)


@pytest.mark.parametrize("flags", ["", '<flag filterparent="disable"/>'])
def test_the_pairs_and_their_friction_are_those_of_mujoco(flags: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    mj = mujoco.MjModel.from_xml_string(CROWD.format(flags=flags))
    data = mujoco.MjData(mj)
    mujoco.mj_forward(mj, data)
    theirs = {}
    for contact in data.contact[: data.ncon]:
        pair = tuple(sorted((int(contact.geom1), int(contact.geom2))))
        theirs[pair] = (approx(float(contact.friction[0])), int(contact.dim))
    assert _meetings(mj) == theirs
    assert len(theirs) > 8


def test_spheres_and_ends_of_capsules_are_where_mujoco_has_them() -> None:
    """On a tilted plane, of bodies that turn about points other than their origins."""
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><worldbody><geom type="plane" size="1 1 1" pos="0 0 -0.5" euler="20 30 0" friction="0.6"/>
    <body pos="0.1 0 0.2" euler="10 20 30"><joint type="hinge" pos="0.1 0.2 0.3" axis="0 1 1"/>
    <joint name="second" type="hinge" pos="-0.1 0.1 0" axis="1 0 0" ref="20"/>
    <geom name="ball" type="sphere" size="0.05" pos="0.1 -0.2 0.3"/>
    <geom name="rod" type="capsule" size="0.03 0.2" pos="-0.1 0.2 0" euler="40 50 60" contype="0"/></body>
    </worldbody></mujoco>"""
    model = dyn.load_mjcf(text, contacts="compliant")
    assert model.left_out == ()
    mj = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(mj)
    data.qpos[:] = [0.7, -0.4]
    mujoco.mj_forward(mj, data)
    rod, ball = mj.geom("rod").id, mj.geom("ball").id
    half = 0.2 * data.geom_xmat[rod].reshape(3, 3)[:, 2]
    expected = [data.geom_xpos[ball], data.geom_xpos[rod] - half, data.geom_xpos[rod] + half]
    contacts = [each for each in model.forces if isinstance(each, dyn.Contact)]
    for contact, center in zip(contacts, expected, strict=True):
        place = model.position(contact.body, contact.at).evaluate({"q0": 0.7, "q1": -0.4})
        assert list(place.values()) == approx(center.tolist(), abs=EQUATIONS)
        depth = dyn.arrays_at(model, model.contact(contact), q=data.qpos, qd=[0.0, 0.0])["depth"]
        normal = data.geom_xmat[0].reshape(3, 3)[:, 2]
        assert float(depth) == approx(contact.radius - normal @ (center - data.geom_xpos[0]), abs=EQUATIONS)
        assert contact.friction == 1.0  # the larger: that of the ball, by default


def test_two_spheres_touch_where_mujoco_has_it() -> None:
    """Of bodies that move, of one that stands and of the world; those that MuJoCo lets meet, and no others."""
    mujoco = pytest.importorskip("mujoco")
    mj = mujoco.MjModel.from_xml_string(CROWD.format(flags=""))
    data = mujoco.MjData(mj)
    data.qpos[:] += np.random.default_rng(0).normal(scale=0.2, size=mj.nq)
    mujoco.mj_normalizeQuat(mj, data.qpos)
    mujoco.mj_forward(mj, data)
    spheres = [g for g in range(mj.ngeom) if mj.geom_type[g] == mujoco.mjtGeom.mjGEOM_SPHERE]
    met = [each for each in data.contact[: data.ncon] if {int(each.geom1), int(each.geom2)} <= set(spheres)]
    model = silently(dyn.load_mjcf, mj, contacts="compliant")
    pairs = [each for each in model.forces if isinstance(each, dyn.Contact) and each.to_radius is not None]
    touches = [dyn.arrays_at(model, model.contact(each), q=data.qpos, qd=np.zeros(mj.nv)) for each in pairs]
    ours = [[float(each[name]) for name in ("depth", "x", "y", "z")] for each in touches]
    theirs = [[-float(each.dist), *each.pos.tolist()] for each in met]
    assert len(ours) == len(theirs) > 3
    assert np.array(sorted(ours)) == approx(np.array(sorted(theirs)), abs=EQUATIONS)
    assert {each.to for each in pairs} > {"world"}


def test_a_sphere_that_carries_all_sinks_by_a_hundredth_of_its_radius() -> None:
    """In any units, and however strong gravity is."""
    pytest.importorskip("mujoco")
    for radius, mass, gravity in ((0.1, 2.0, 9.81), (1e-3, 1e-4, 1.6)):
        text = f"""<mujoco><option gravity="0 0 {-gravity}"/><worldbody><geom type="plane" size="1 1 1"/>
        <body><joint type="slide" axis="0 0 1"/><geom type="sphere" size="{radius}" mass="{mass}"/></body></worldbody>
        </mujoco>"""
        model = dyn.load_mjcf(text, contacts="compliant")
        rest = {"q0": 0.99 * radius, "qd0": 0.0, "tau0": 0.0}
        assert dyn.forward_dynamics(model).evaluate(rest)["qdd0"] == approx(0.0, abs=EQUATIONS * gravity)
        large = f'size="{3.0 * radius}" pos="0 0 {-radius}"'
        onto = dyn.load_mjcf(text.replace('type="plane" size="1 1 1"', large), contacts="compliant")
        rest["q0"] = (3.0 - 0.01 * 0.75) * radius  # 3/4 = 1 / (1/1 + 1/3)
        assert dyn.forward_dynamics(onto).evaluate(rest)["qdd0"] == approx(0.0, abs=EQUATIONS * gravity)
        A, _ = dyn.linearize(model, [0.99 * radius], [0.0])
        poles = np.linalg.eigvals(A)
        assert (-poles.real / np.abs(poles)).tolist() == approx([0.5 * 1.5**-0.5] * 2, rel=1e-6)  # damped as said


def test_what_is_no_sphere_on_a_plane_is_left_out_and_said() -> None:
    mujoco = pytest.importorskip("mujoco")
    mj = mujoco.MjModel.from_xml_string(CROWD.format(flags=""))
    model = silently(dyn.load_mjcf, mj, contacts="compliant")
    found = [each for each in model.forces if isinstance(each, dyn.Contact)]
    friction = {each.body: each.friction for each in found if each.to_radius is None}
    assert friction == {"a": 0.7, "b": 0.25, "c": 0.1, "d": 1.0, "e": 1.0}
    assert [text.split(" (")[0] for text in model.left_out] == [
        "contacts other than of spheres, and of capsules with planes",
        "torsional and rolling friction of contacts",
    ]
    assert silently(dyn.load_mjcf, mj).left_out == (LEFT,)
    off = mujoco.MjModel.from_xml_string(CROWD.format(flags='<flag contact="disable"/>'))
    assert not silently(dyn.load_mjcf, off, contacts="compliant").forces


def test_spheres_and_capsules_of_a_urdf_stand_on_the_ground() -> None:
    text = LEG.format(shape='<sphere radius="0.05"/>')
    with pytest.warns(dyn.MechanismWarning, match=r"left out joint limits \(slide\)$"):
        model = dyn.load_urdf(text, contacts="compliant")
    contacts = [each for each in model.forces if isinstance(each, dyn.Contact)]
    assert np.array([each.at for each in contacts]).tolist() == [
        approx([-0.15, 0.0, -0.2]),
        approx([0.15, 0.0, -0.2]),
        approx([0.0, 0.0, -0.4]),
    ]
    assert [each.radius for each in contacts] == [0.02, 0.02, 0.05]
    run = dyn.simulate(model, [0.6], [0.0], 2.0)
    assert run.q[-1, 0] == approx(0.4 + 0.99 * 0.05, rel=1e-6)
    q = silently(dyn.scenes.of_file, text, floating=True, contacts="compliant").q
    assert q == approx((0.0, 0.0, 0.45, 1.0, 0.0, 0.0, 0.0, 0.0))  # the lowest sphere touches
    boxed = silently(dyn.load_urdf, LEG.format(shape='<box size="1 1 1"/>'), contacts="compliant")
    assert boxed.left_out == ("joint limits (slide)", "contacts of shapes other than spheres and capsules (leg: box)")
    assert silently(dyn.load_urdf, text).left_out == (LEFT, "joint limits (slide)")


def test_numbers_of_contacts_are_given_or_named() -> None:
    text = LEG.format(shape='<sphere radius="0.05"/>')
    usual = silently(dyn.load_urdf, text, contacts="compliant")
    given = {"stiffness": 3e4, "friction": "mu", "dissipation": 0.5}
    model = silently(dyn.load_urdf, text, contacts=given)
    assert model.parameters == {"mu": 1.0}
    pairs: Any = zip(usual.forces, model.forces, strict=True)
    for own, one in pairs:
        assert {name: getattr(one, name) for name in given} == given
        assert (one.velocity, one.radius) == (own.velocity, own.radius)
    same = silently(dyn.load_urdf, text.replace("0.02", "0.05"), contacts={"stiffness": "k", "friction": "mu"})
    assert same.parameters == {"k": same.bind().forces[0].stiffness, "mu": 1.0}  # type: ignore[union-attr]
    wrong: dict[str, Any] = {
        "stiffness of the contacts is from .* to .*, and the parameter 'k' would have one value": {"stiffness": "k"},
        "there is a parameter 'mu' already": {"friction": "mu", "stiffness": "mu"},
        "a quantity of contacts must be": {"radius": 1.0},
        "stiffness must be": {"stiffness": -1.0},
    }
    for said, contacts in wrong.items():
        with raises(ValueError, match=said):
            dyn.load_urdf(text.replace("0.02", "0.05") if "already" in said else text, contacts=contacts)


def test_where_nothing_touches_or_weighs_it_is_said() -> None:
    rotor = LEG.replace("collision", "visual").format(shape="")
    text = "contacts, as there are none of spheres or capsules of bodies that move"
    with pytest.warns(dyn.MechanismWarning, match=text):
        assert text in dyn.load_urdf(rotor, contacts="compliant").left_out
    point = silently(dyn.load_urdf, LEG.format(shape='<sphere radius="0"/>'), contacts="compliant")
    assert "contacts of shapes other than spheres and capsules (leg: sphere of radius 0)" in point.left_out
    with raises(ValueError, match="contacts must be"):
        dyn.load_urdf(rotor, contacts="rigid")
    with raises(dyn.MechanismError, match="collision of link 'leg': radius and length must not be negative"):
        dyn.load_urdf(LEG.format(shape='<sphere radius="-1"/>'), contacts="compliant")
    pytest.importorskip("mujoco")
    numbers: dict[str, float | str] = {"dissipation": 1.0, "velocity": 0.01, "stiffness": 1e4}
    light, heavy = (CROWD.format(flags=flags) for flags in ('<flag gravity="disable"/>', ""))
    floats, falls = (silently(dyn.load_mjcf, text, contacts=numbers) for text in (light, heavy))
    weightless = replace(falls, gravity=(0.0, 0.0, 0.0))
    assert dyn.inverse_dynamics(floats).listing() == dyn.inverse_dynamics(weightless).listing()
    with raises(dyn.MechanismError, match="of a model without weight need numbers for stiffness"):
        dyn.load_mjcf(light, contacts=numbers | {"stiffness": "k"})
