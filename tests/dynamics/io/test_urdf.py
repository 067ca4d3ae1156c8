"""Mechanisms read from URDF: numbers of the file, frames, what is left out, and a sentence for what is wrong."""

import re
import sys
from pathlib import Path

import numpy as np
from pytest import approx, importorskip, mark, raises, warns

import cgraph as cg
import dynamics as dyn
from dynamics import Mechanism, MechanismError
from dynamics.io.load import compiled
from dynamics.io.read_urdf import from_rpy
from dynamics.multibody.algebra.spatial import rotation
from tests.dynamics.mechanisms import random_inertia
from tests.dynamics.models import error
from tests.each_row import each_row
from tests.tolerances import EQUATIONS, LAST_BITS

Array = np.ndarray
pytestmark = mark.filterwarnings("ignore:.*left out:dynamics.MechanismWarning")

LINK = """<link name="{0}"><inertial><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
<inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.15"/></inertial>
<visual><geometry><mesh filename="package://nowhere/{0}.stl"/></geometry></visual></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><axis xyz="{4}"/><limit lower="-1" upper="1" effort="9" velocity="9"/>
<dynamics damping="{5}"/></joint>"""
URDF = f"""<?xml version="1.0"?><robot name="arm"><link name="base"/>{"".join(LINK.format(f"l{i}") for i in (1, 2, 3))}
{JOINT.format("j1", "revolute", "base", "l1", "0 0 1", 0.1)}{JOINT.format("j2", "continuous", "l1", "l2", "0 1 0", 0.2)}
{JOINT.format("j3", "prismatic", "l2", "l3", "1 0 0", 0.3)}</robot>"""


def turned(roll: float, pitch: float, yaw: float) -> Array:
    """The rotation of URDF's rpy: about fixed x, then y, then z."""
    x, y, z = np.eye(3)
    return rotation(z, yaw) @ rotation(y, pitch) @ rotation(x, roll)


def link(name: str, mass: float = 0.0, inertia: Array | None = None, origin: str = "") -> str:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = (np.zeros((3, 3)) if inertia is None else inertia).tolist()
    moments = f'ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"'
    inside = f'<inertial>{origin}<mass value="{mass!r}"/><inertia {moments}/></inertial>'
    return f'<link name="{name}">{inside if mass or inertia is not None else ""}</link>'


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def robot(*elements: str) -> str:
    return f'<robot name="r">{"".join(elements)}</robot>'


def mass_matrix(mechanism: Mechanism) -> Array:
    """M at q = 0."""
    n = mechanism.system.n
    at = {f"{name}{i}": 0.0 for name in ("q", "qd") for i in range(n)}
    return np.reshape(list(dyn.mass_matrix(mechanism).evaluate(at).values()), (n, n))


def test_urdf_needs_no_mujoco(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert dyn.load_urdf(URDF).coordinates == ("j1", "j2", "j3")


def test_fixed_frames_keep_their_names_and_places() -> None:
    origin = '<origin xyz="0 0.3 0.5" rpy="0 0 1.5707963"/>'
    frames = link("tool0"), joint("to tool0", "fixed", "l3", "tool0", origin)
    loaded = dyn.load_urdf(URDF.replace("</robot>", "".join(frames) + "</robot>"))
    at = {"q0": 0.3, "q1": -0.2, "q2": 0.4}
    place = loaded.position("tool0").evaluate(at)
    assert place == approx(loaded.position("l3", (0.0, 0.3, 0.5)).evaluate(at), rel=LAST_BITS)
    assert loaded.position("base").evaluate(at) == {"x": 0.0, "y": 0.0, "z": 0.0}


@mark.parametrize("angle", ["1.5708", "1.5707963", "3.14159", "-1.570796", "0.3"])
def test_angles_are_those_of_the_file(angle: str) -> None:
    """Nearly a quarter turn is not a quarter turn."""
    text = robot(link("base"), link("a"), joint("j", "fixed", "base", "a", f'<origin rpy="{angle} 0 {angle}"/>'))
    (_, body) = dyn.load_urdf(text).bodies
    c, s = np.cos(float(angle)), np.sin(float(angle))
    expected = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    assert np.asarray(body.joint.orientation) == approx(expected, rel=0, abs=LAST_BITS)
    assert np.any(np.asarray(body.joint.orientation) % 1.0)


def test_a_quarter_turn_to_the_last_digit_is_one() -> None:
    assert from_rpy(np.pi / 2, -np.pi / 2, np.pi).tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


def test_an_orientation_may_be_a_quaternion() -> None:
    text = robot(link("base"), link("a"), joint("j", "fixed", "base", "a", '<origin quat_xyzw="0 0 2 2"/>'))
    assert np.asarray(dyn.load_urdf(text).bodies[1].joint.orientation) == approx(turned(0, 0, np.pi / 2))


def random_urdf(rng: np.random.Generator, n: int) -> str:
    """A tree of n hinges, slides and welds, with every frame turned."""

    def numbers(*size: int) -> str:
        return " ".join(map(repr, rng.normal(size=size).tolist()))

    def origin() -> str:
        return f'<origin xyz="{numbers(3)}" rpy="{numbers(3)}"/>'

    elements = [link("base", 2.0, np.eye(3))]
    for i in range(n):
        kind = "fixed" if i in (2, 5) else str(rng.choice(["continuous", "revolute", "prismatic"]))
        parent = f"l{rng.integers(max(0, i - 3), i)}" if i else "base"
        elements.append(link(f"l{i}", rng.uniform(0.5, 2), random_inertia(rng), origin()))
        inside = f'{origin()}<axis xyz="{numbers(3)}"/><dynamics damping="{rng.uniform()!r}"/>'
        elements.append(joint(f"j{i}", kind, parent, f"l{i}", f"{inside}<limit effort='9' velocity='9'/>"))
    return robot(*elements)


@mark.parametrize("seed", range(5))
def test_mujoco_reads_the_same(seed: int) -> None:
    """Mass matrix, bias and damping of its own model of the file, from torques."""
    module = importorskip("mujoco")
    text, rng = random_urdf(np.random.default_rng(seed), 8), np.random.default_rng((seed, 1))
    ours, mj = dyn.load_urdf(text), compiled(text)
    order = [mj.joint(name).id for name in ours.coordinates]
    data, inverse, worst = module.MjData(mj), cg.compile(dyn.inverse_dynamics(ours), "python"), 0.0
    mj.opt.disableflags |= int(module.mjtDisableBit.mjDSBL_CONSTRAINT)
    for _ in range(5):
        x = rng.uniform(-1.0, 1.0, (3, mj.nv))
        data.qpos[order], data.qvel[order], data.qacc[order] = x
        module.mj_inverse(mj, data)
        worst = max(worst, error(inverse(x.ravel()), data.qfrc_inverse[order]))
    assert worst < EQUATIONS


def test_what_acts_from_outside_is_left_out_with_a_warning() -> None:
    shape = "<collision><geometry><box size='1 1 1'/></geometry></collision>"
    text = robot(
        link("base"),
        link("a", 1.0, np.eye(3)).replace("</link>", f"{shape}</link>"),
        joint("j", "revolute", "base", "a", '<limit lower="-1" upper="2"/><dynamics friction="0.25"/>'),
        "<transmission name='t'/><gazebo/><gazebo/>",
    )
    with warns(dyn.MechanismWarning) as said:
        loaded = dyn.load_urdf(text)
    assert loaded.left_out == (
        "contacts",
        "joint limits (j)",
        "friction loss (j: 0.25)",
        "what is not read (<transmission>; <gazebo>)",
    )
    assert [str(each.message) for each in said] == [f"the given text: left out {'; '.join(loaded.left_out)}"]
    assert said[0].filename == __file__


@mark.parametrize(("taken", "called"), [("j", "base"), ("base", "base'")])
def test_the_root_link_floats_on_request(taken: str, called: str) -> None:
    """Its joint has its name, or one that no other has; MuJoCo and Pinocchio find the same equations."""
    text = URDF.replace('<link name="base"/>', LINK.format("base")).replace(
        '"j1"', f'"{taken}1"'.replace("base1", "base")
    )
    mechanism = dyn.load_urdf(text, floating=True)
    assert mechanism.coordinates[:4] == tuple(f"{called}.{name}" for name in ("x", "y", "z", "qw"))
    assert mechanism.velocities[6:] == dyn.load_urdf(text).coordinates
    importorskip("mujoco")
    certificate = dyn.certify(mechanism, 1, twin=compiled(text, floating=True))
    assert certificate.passed, str(certificate)


def test_a_root_link_called_world_floats_as_any_other() -> None:
    heavy = URDF.replace('<link name="base"/>', LINK.format("base"))
    other, world = (dyn.load_urdf(heavy.replace('"base"', f'"{name}"'), floating=True) for name in ("base", "world"))
    assert [name.replace("world'.", "base.") for name in world.coordinates] == [*other.coordinates]
    assert {body.name for body in world.bodies} == {"world'", "l1", "l2", "l3"}
    point = dict.fromkeys(dyn.mass_matrix(other).input_names, 0.3) | {"q3": 1.0, "q4": 0.0, "q5": 0.0, "q6": 0.0}
    assert dyn.mass_matrix(world).evaluate(point) == dyn.mass_matrix(other).evaluate(point)
    taken = heavy.replace('"base"', '"world"').replace('"l3"', '"world\'"')
    assert {body.name for body in dyn.load_urdf(taken, floating=True).bodies} == {"world'", "world''", "l1", "l2"}
    importorskip("mujoco")
    assert compiled(heavy.replace('"base"', '"world"'), floating=True).nq == 10


NO_AXIS = "<axis xyz='0 0 0'/>"  # which has no meaning there


def test_what_cannot_float_is_said() -> None:
    hung = robot(
        link("world"),
        link("a", 1.0, np.eye(3)),
        joint("j", "floating", "world", "a", "<origin xyz='0 0 1'/>" + NO_AXIS),
    )
    assert dyn.load_urdf(hung).coordinates == tuple([f"j.{name}" for name in ("x", "y", "z", "qw", "qx", "qy", "qz")])
    assert np.asarray(dyn.load_urdf(hung).bodies[0].joint.position).tolist() == [0.0, 0.0, 1.0]
    importorskip("mujoco")
    with raises(MechanismError, match="in MuJoCo a free joint has the axes and the origin of the world"):
        compiled(hung)


def test_moments_that_no_body_has_are_a_warning_and_count() -> None:
    """Kinetic energy is positive with them, so that the equations of a tree hold."""
    text = robot(link("base"), link("a", 1.0, np.diag([1.0, 2.0, 4.0])), joint("j", "continuous", "base", "a"))
    said = "body 'a': no body has principal moments [1.0, 2.0, 4.0]: the largest exceeds the sum of the others"
    with warns(dyn.MechanismWarning, match=f"^{re.escape(said)}$"):
        loaded = dyn.load_urdf(text)
    assert mass_matrix(loaded) == approx(1.0)
    assert np.asarray(loaded.moving[0].joint.axis).tolist() == [1.0, 0.0, 0.0]  # where none is written


def test_moments_below_rounding_of_the_mass_may_be_negative() -> None:
    """As a program writes a point mass that it has moved about; ten times as much is a mistake."""
    for factor in (1.0, 1e6):
        text = link("a", 0.5, factor * np.diag([-5e-20, -5e-20, 0.0]), '<origin xyz="0 0 0.03"/>')
        text = robot(link("base"), text, joint("j", "continuous", "base", "a"))
        if factor == 1.0:
            assert mass_matrix(dyn.load_urdf(text)) == approx(0.5 * 0.03**2)
        else:
            with raises(
                MechanismError, match=r"a mechanism cannot have moments of inertia below 0 \(a: -5e-14 kg m\^2\)"
            ):
                dyn.load_urdf(text)


@mark.parametrize("unit", [1e-6, 1.0, 1e6])
@each_row("digits", [4, 6, 7])
@mark.filterwarnings("ignore:body 'a'. no body has principal moments:dynamics.MechanismWarning")
def test_moments_that_rounding_makes_negative_are_zero_and_said(digits: int, unit: float) -> None:
    """Moments of thin rods, (m, m, 0) turned at random, as they are printed; ten last places more are a mistake."""
    rng = np.random.default_rng(digits)
    kinds = set()
    for _ in range(12):
        turn = turned(*rng.uniform(-3.0, 3.0, 3))
        exact = turn @ np.diag([unit, unit, 0.0]) @ turn.T
        place = 10.0 ** (np.floor(np.log10(np.abs(exact).max())) + 1 - digits)
        for off in (0.0, 10.0 * place):
            values = (exact - off * np.eye(3))[np.triu_indices(3)]
            entries = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), values, strict=True)
            printed = " ".join(f'{entry}="{value:.{digits - 1}e}"' for entry, value in entries)
            inside = f'<origin xyz="0.1 0.2 0.3"/><mass value="{unit!r}"/><inertia {printed}/>'
            text = robot(BASE, f'<link name="a"><inertial>{inside}</inertial></link>', HINGE)
            if off:
                with raises(MechanismError, match="cannot have moments of inertia below 0"):
                    dyn.load_urdf(text)
            loaded = dyn.load_urdf(text, ignore=bool(off))
            inertia = np.asarray(next(body for body in loaded.bodies if body.name == "a").inertia)
            assert np.linalg.eigvalsh(inertia)[0] >= -1e-15 * unit
            assert np.abs(inertia - exact).max() <= 40.0 * place
            kinds.add((bool(off), any("below 0 (a: -" in each for each in loaded.left_out)))
    assert kinds == {(False, False), (False, True), (True, True)}


AXIS = '<axis xyz="0 1 0"/><origin xyz="0.1 0 0.2"/>'


def fingers(**mimics: str) -> str:
    """A knuckle and what follows it: an inner and an outer link, another finger on a slide, and a cap that is fixed."""
    kinds = {"knuckle": "revolute", "inner": "continuous", "outer": "revolute", "slide": "prismatic", "cap": "fixed"}
    parents = {"knuckle": "palm", "inner": "knuckle", "outer": "inner", "slide": "palm", "cap": "palm"}
    links = [link(name, 0.3, 1e-3 * np.eye(3), '<origin xyz="0 0.02 0.05"/>') for name in ("palm", *kinds)]
    joints = [
        joint(f"{name} joint", kind, parents[name], name, AXIS + mimics.get(name, "")) for name, kind in kinds.items()
    ]
    return robot(*links, *joints)


def mimic(leader: str, numbers: str = "") -> str:
    return f'<mimic joint="{leader} joint" {numbers}/>'


def test_joints_that_mimic_others_are_coupled() -> None:
    """A chain of three and one on a slide, against the chain rule in the torque of a tree: one freedom is left."""
    lines = {"inner": (-2.0, 0.1), "outer": (0.5, 0.0), "slide": (0.03, -0.01)}
    leaders = {"inner": "knuckle", "outer": "inner", "slide": "knuckle"}
    given = {name: f'multiplier="{a}" offset="{b}"' for name, (a, b) in lines.items()} | {"outer": 'multiplier="0.5"'}
    loaded = dyn.load_urdf(fingers(**{name: mimic(leaders[name], given[name]) for name in lines}))
    assert [loop.label for loop in loaded.loops] == ["inner to knuckle", "outer to inner", "slide to knuckle"]
    order = [each.removesuffix(" joint") for each in loaded.coordinates]
    ratio, start = {"knuckle": 1.0}, {"knuckle": 0.4}
    for name, (a, b) in lines.items():
        ratio[name], start[name] = a * ratio[leaders[name]], a * start[leaders[name]] + b
    along, q = (np.array([each[name] for name in order]) for each in (ratio, start))
    u, tau = 1.3 * along, np.array([0.3, -0.2, 0.1, 2.0])
    at = {f"{kind}{i}": x for kind, row in (("q", q), ("qd", u), ("tau", tau)) for i, x in enumerate(row.tolist())}
    tree = Mechanism(loaded.bodies)
    mass, force = (
        np.array(list(graph(tree).evaluate({name: at[name] for name in graph(tree).input_names}).values()))
        for graph in (dyn.mass_matrix, dyn.bias)
    )
    expected = along @ (tau - force) / (along @ mass.reshape(4, 4) @ along)
    found = dyn.forward_dynamics(loaded).evaluate(at)
    assert [found[f"qdd{i}"] for i in range(4)] == approx((along * expected).tolist(), rel=1e-12)


CANNOT = [
    ({"inner": mimic("thumb")}, "joints that mimic one that is not there (inner joint after thumb joint)"),
    (
        {"inner": mimic("outer"), "outer": mimic("inner"), "slide": mimic("inner")},
        "joints that mimic one another in a circle (inner joint after outer joint, outer joint after inner joint)",
    ),
    ({"slide": mimic("slide")}, "one another in a circle (slide joint after slide joint)"),
    (
        {"inner": mimic("cap")},
        "joints that mimic others where one of both has not one coordinate (inner joint after cap joint)",
    ),
]


@each_row(("mimics", "what"), CANNOT)
def test_a_coupling_that_cannot_be_is_refused_or_left_out_by_name(mimics: dict[str, str], what: str) -> None:
    with raises(MechanismError, match=re.escape(f"{what} (the option ignore leaves this out)") + "$"):
        dyn.load_urdf(fingers(**mimics))
    loaded = dyn.load_urdf(fingers(**mimics), ignore=True)
    assert loaded.left_out[0].endswith(what)
    assert len(loaded.loops) == len(mimics) - 1 - what.count(",")


HINGE = joint("j", "continuous", "base", "a", '<axis xyz="0 0 1"/>')
A, BASE = link("a", 1.0, np.eye(3)), link("base")
NO_AXES = ("0 1", "0 nan 1", "0 1_0 1")
WRONG = [
    ("<robot>", "the given text is not XML: no element found: line 1, column 7"),
    ("<mujoco/>", "a URDF's root element is <robot>, the given text has <mujoco>"),
    (robot('<xacro:include filename="$(find a)/b.xacro"/>'), "this is xacro, not URDF: expand it first"),
    (robot(BASE, A, HINGE.replace("joint", "drake:joint")), "<drake:joint> 'j' of the type 'continuous' is not URDF"),
    ("<robot/>", "a robot needs a link, and there is none"),
    (robot(BASE, "<link/>"), "a link has no name"),
    (robot(BASE, A, A, HINGE), "two links have the name 'a'"),
    (robot(BASE, HINGE), "joint 'j' names the link 'a', which is not there"),
    (robot(BASE, A, HINGE.replace('<child link="a"/>', "")), "joint 'j' has no child link"),
    (robot(BASE, A), "a robot is one tree, and 2 links are no joint's child: base, a"),
    (robot(BASE, A, HINGE, joint("k", "fixed", "base", "a")), "link 'a' is the child of two joints, 'j' and 'k'"),
    (robot(A, joint("j", "fixed", "a", "a")), "every link is a joint's child"),
    (
        robot(BASE, A, link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")),
        "body 'a' is its own ancestor, by way of 'b'",
    ),
    (
        fingers(inner=mimic("knuckle", 'multiplier="two"')),
        "joint 'inner joint': multiplier of <mimic> needs one finite number, got 'two'",
    ),
    (robot(BASE, A, HINGE.replace(' type="continuous"', "")), "joint 'j' has no type, and URDF has"),
    (robot(BASE, A, HINGE.replace("continuous", "screw")), "joint 'j' is of the type screw, and URDF has"),
    (robot(BASE, A, HINGE.replace("continuous", "a&#10;b")), r"joint 'j' is of the type 'a\nb', and URDF"),
    (robot(BASE, A, HINGE.replace(' xyz="0 0 1"', "")), "joint 'j': <axis> has no xyz"),
    (robot(BASE, A, HINGE.replace("0 0 1", "0 0 0")), "body 'a': axis must not be zero"),
    *[(robot(BASE, A, HINGE.replace("0 0 1", x)), f"<axis> needs 3 finite numbers, got {x!r}") for x in NO_AXES],
    (robot(BASE, A.replace('"1.0"', '"${m}"', 1), HINGE), "value of <mass> is '${m}': this is xacro, not URDF"),
    (robot(BASE, A.replace('ixy="0.0"', ""), HINGE), "link 'a': <inertia> has no ixy"),
    (robot(BASE, A.replace('<mass value="1.0"/>', ""), HINGE), "'a' has an <inertial> without <mass>"),
    (robot(BASE, A.replace('"1.0"', '"-1.0"', 1), HINGE), "body 'a': mass must be finite and at least 0"),
    *[
        (robot(BASE, A.replace('"1.0"', f'"{other}"', 1), HINGE), f"one finite number, got '{other}'")
        for name, other in {"Arabic": "٣", "full width": "１.５", "Devanagari": "१"}.items()
    ],
    (robot(BASE, A.replace('"1.0"', '"1e308"'), HINGE), "'a': inertia about the joint is beyond float64"),
    (robot(BASE, A, HINGE.replace("<axis", "<origin/><origin/><axis")), "'j' has 2 elements <origin>"),
    (robot(BASE, link("a"), HINGE), "body 'a' has no mass, carries no mass, and its joint"),
    (
        robot(BASE, link("world", 1.0, np.eye(3)), HINGE.replace('"a"', '"world"')),
        "a body needs a name other than 'world'",
    ),
]


@each_row(("text", "message"), WRONG)
def test_what_is_wrong_is_one_sentence(text: str, message: str, tmp_path: Path) -> None:
    with raises(MechanismError, match=re.escape(message)) as caught:
        dyn.load_urdf(text, ignore=True)
    assert "\n" not in str(caught.value)
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    with raises(MechanismError, match=re.escape(str(file))):
        dyn.load_urdf(file)


@mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
def test_a_file_is_read_in_the_encoding_that_it_declares(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "arm.urdf"
    name = encoding.removesuffix("-sig")
    text = URDF.replace('version="1.0"', f'version="1.0" encoding="{name}"').replace("l3", "glied_ä")
    file.write_bytes(text.encode(encoding))
    assert dyn.load_urdf(file).bodies[-1].name == "glied_ä"
    assert dyn.load_urdf(f"\ufeff\n{text}").bodies[-1].name == "glied_ä"


TRANSMISSION = """<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="j">
<hardwareInterface>effort</hardwareInterface></joint><actuator name="m">{}</actuator></transmission>"""
ROTOR = '<drake:rotor_inertia value="0.01"/>'
FULL = robot(
    BASE,
    A.replace("</link>", '<collision><geometry><sphere radius="0.1"/></geometry></collision></link>'),
    link("b", 1.0, np.eye(3), '<origin xyz="0 0 1"/>'),
    HINGE.replace("</joint>", '<limit effort="1"/><dynamics damping="1" friction="1"/><calibration/></joint>'),
    joint("k", "prismatic", "a", "b", AXIS + '<mimic joint="j"/><limit lower="0" upper="1"/><safety_controller/>'),
    '<mujoco><option gravity="0 0 -1"/></mujoco><sensor:camera/><gazebo><springStiffness>3</springStiffness></gazebo>',
    TRANSMISSION.format(f"{ROTOR}<mechanicalReduction>3</mechanicalReduction>"),
)


def test_every_element_and_attribute_is_taken_or_named() -> None:
    """An odd attribute in each element is named, or all of the element is."""
    for tag in re.finditer(r"<(?!type|hardware)[\w:]+", FULL):
        odd = f'{FULL[: tag.end()]} odd="1"{FULL[tag.end() :]}'
        said = "; ".join(dyn.load_urdf(odd, contacts="compliant").left_out)
        assert re.search(rf"{tag[0]}( \w+)* odd>|{tag[0]}>|<gazebo> with{tag[0].replace('<', ' ')}", said), tag[0]
    unread = "<calibration> of j; <safety_controller> of k; <sensor:camera>; <gazebo> with springStiffness; "
    assert f"what is not read ({unread}<mechanicalReduction> of t)" in dyn.load_urdf(FULL).left_out


@mark.parametrize(
    ("actuator", "inertia"), [("", 1.01), (ROTOR, 1.02), (f'{ROTOR}<drake:gear_ratio value="100"/>', 101.01)]
)
def test_a_rotor_adds_gear_squared_times_its_inertia(actuator: str, inertia: float) -> None:
    """As Drake 1.51 finds it; behind an effort of 0 it has no actuator."""
    turning = link("a", 1.0, 0.01 * np.eye(3), '<origin xyz="1 0 0"/>')
    text = robot(BASE, turning, HINGE.replace("</joint>", '<limit effort="1"/></joint>'), TRANSMISSION.format(actuator))
    assert mass_matrix(dyn.load_urdf(text)) == approx(inertia, rel=LAST_BITS)
    assert mass_matrix(dyn.load_urdf(text.replace('"1"', '"0"'))) == approx(1.01, rel=LAST_BITS)
    importorskip("mujoco")
    assert dyn.certify(dyn.load_urdf(text), 1, twin=text).passed


NOTHING = [
    ("fixed", '<dynamics friction="0.3" damping="1"/><limit/>', "what is not read (<dynamics> of j; <limit> of j)"),
    ("revolute", '<limit effort="0" velocity="0"/>', "limits whose ends are one number (j)"),
    ("prismatic", '<limit lower="1" upper="-1."/>', "limits that cannot be (j)"),
    ("revolute", '<limit lower="-1e9" upper="inf"/><dynamics friction="0"/>', ""),
    ("continuous", '<limit lower="0" upper="0"/>', "what is not read (<limit lower upper> of j)"),
    ("continuous", '<dynamics friction="-1"/>', "friction loss (j: -1)"),
    ("planar", '<dynamics friction="1"/><limit/>', "friction loss (j: 1)"),
    ("floating", '<limit lower="-1" upper="1"/>', "what is not read (<limit> of j)"),
]


@each_row(("kind", "inside", "said"), NOTHING)
def test_limits_and_friction_without_effect_are_named_and_refuse_nothing(kind: str, inside: str, said: str) -> None:
    bare, given = (robot(BASE, link("c", 1.0, np.eye(3)), joint("i", "continuous", "base", "c"), A,
                         joint("j", kind, "base", "a", each)) for each in ("", inside))  # fmt: skip
    loaded = dyn.load_urdf(given, limits=(1e3, 1.0), friction=0.0)
    assert (loaded.forces, loaded.left_out[:1]) == ((), (said,) * bool(said))
    assert dyn.forward_dynamics(loaded).listing() == dyn.forward_dynamics(dyn.load_urdf(bare)).listing()


SLIDES = {"1 0 0": ((0, 0, -1), (0, 1, 0)), "1 1 0": ((0.5, -0.5, -(0.5**0.5)), (-0.5, 0.5, -(0.5**0.5)))}


@mark.parametrize("axis", [*SLIDES, "0 1 0", "0 0 -1", "1 2 -30", "spherical"])
def test_planar_and_spherical_joints_are_those_of_mujoco(axis: str) -> None:
    kind, inside = "spherical" if axis == "spherical" else "planar", '<dynamics damping="0.2"/>'
    inside += f'<axis xyz="{axis}"/>' * (kind == "planar")
    text = robot(BASE, link("a", 1.0, np.eye(3), '<origin xyz="0.1 0.2 0.3"/>'), joint("j", kind, "base", "a", inside))
    mechanism = dyn.load_urdf(text)
    if kind == "planar":
        assert mechanism.coordinates == ("j.x", "j.y", "j.angle")
        assert dyn.load_urdf(text.replace('"0.2"', '"1 2 3"')).system.damping == (1.0, 2.0, 3.0)
        slides = np.array([body.joint.axis for body in mechanism.parts[-3:-1]])
        assert slides == approx(np.array(SLIDES.get(axis, slides)), rel=0, abs=LAST_BITS)
    importorskip("mujoco")
    certificate = dyn.certify(mechanism, 1, twin=compiled(text))
    assert certificate.passed, str(certificate)
