"""Mechanisms read from MJCF: MuJoCo's own accelerations, the frames and defaults, and what is left out."""

import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import importorskip, mark, raises, warns

import cgraph as cg
import dynamics as dyn
from dynamics import Body, Joint, Mechanism, MechanismError
from tests.dynamics.models import error
from tests.each_row import each_row
from tests.tolerances import EQUATIONS

mujoco = importorskip("mujoco")

REAL_MODELS = 1e-11  # likewise: 1e-12 where M has the condition 2e8, a fly of 132 joints, and 6e-13 for all others
recent = mark.skipif(not hasattr(mujoco.mjtDisableBit, "mjDSBL_SPRING"), reason="before 3.3.5 MuJoCo has other flags")
pytestmark = mark.filterwarnings("ignore:.*left out:dynamics.MechanismWarning")
OFF = ("CONSTRAINT", "ACTUATION")  # what acts on a mechanism from outside


def compiled(text: str) -> Any:
    return mujoco.MjModel.from_xml_string(text)


def alone(model: Any) -> Any:
    """MuJoCo's model without what a mechanism cannot have, and without what acts on it from outside."""
    for name in OFF:
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    model.opt.enableflags = 0
    model.opt.density = model.opt.viscosity = 0.0
    for what in ("stiffness", "damping", "armature"):
        getattr(model, f"tendon_{what}")[:] = 0.0
    return model


def disagreement(model: Any, mechanism: Mechanism, count: int = 10) -> float:
    """The largest error against MuJoCo of accelerations, torques, mass matrix and bias, with qpos as q, qvel as qd."""
    nq, n, data, rest = mechanism.system.nq, mechanism.system.n, mujoco.MjData(model), mujoco.MjData(model)
    assert (nq, n) == (model.nq, model.nv)
    forward, inverse, inertia, bias = (
        cg.compile(graph(mechanism), "python")
        for graph in (dyn.forward_dynamics, dyn.inverse_dynamics, dyn.mass_matrix, dyn.bias)
    )
    rng, worst = np.random.default_rng(n), 0.0
    for _ in range(count):
        data.qpos[:] = rng.uniform(-1.0, 1.0, nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        qd, given = rng.uniform(-1.0, 1.0, (2, n))
        x = [*data.qpos, *qd]
        data.qvel[:], data.qacc[:], data.qfrc_applied[:] = qd, given, 0.0
        mujoco.mj_inverse(model, data)
        worst = max(worst, error(inverse([*x, *given]), np.array(data.qfrc_inverse)))
        data.qfrc_applied[:] = given
        mujoco.mj_forward(model, data)
        rest.qpos[:] = data.qpos
        mujoco.mj_forward(model, rest)  # whose passive forces are those of springs
        columns = np.empty((n, n))
        for column, unit in zip(columns, np.eye(n), strict=True):
            mujoco.mj_mulM(model, data, column, unit)
        worst = max(worst, error(forward([*x, *given]), np.array(data.qacc)), error(inertia(x), columns.ravel()))
        theirs = data.qfrc_bias - rest.qfrc_passive
        size = np.abs(theirs).max() + (np.abs(columns) @ np.abs(given)).max()  # beside which it may be rounding
        worst = max(worst, float(np.abs(bias(x) - theirs).max() / size))
    return worst


def agrees(text: str) -> Mechanism:
    """The mechanism of MJCF text, seen to agree with MuJoCo's model of it."""
    mechanism = dyn.load_mjcf(text)
    assert disagreement(compiled(text), mechanism) < EQUATIONS
    return mechanism


def mjcf(worldbody: str, rest: str = "") -> str:
    return f"<mujoco>{rest}<worldbody>{worldbody}</worldbody></mujoco>"


INERTIAL = '<inertial pos="0.1 0.2 -0.3" mass="1.3" fullinertia="0.3 0.4 0.5 0.01 0.02 -0.03"/>'
HINGE = f'<body name="a"><joint name="j"/>{INERTIAL}</body>'


def test_any_name_comes_back() -> None:
    names = ["a/b", 'say "hi"', "<&>"]
    mechanism = Mechanism([Body(name, Joint("revolute", (0, 1, 0)), mass=1.0, center=(1, 0, 0)) for name in names])
    assert [body.name for body in dyn.load_mjcf(dyn.to_mjcf(mechanism)).bodies] == names


def test_a_model_by_hand_agrees() -> None:
    """Degrees, classes, euler angles, two joints and offset anchors on a body, references, springs, armature, welds."""
    text = mjcf(
        f"""
        <frame pos="0 0 1" euler="10 20 30">
          <body name="base" pos="0.1 0 0" quat="1 2 3 4">
            <body name="upper" gravcomp="1.5" pos="0.3 0 0" euler="0 90 0" childclass="arm">
              <joint name="yaw" axis="0 0 1" pos="0.1 0.2 0.3" ref="25" springref="40"/>
              <joint name="pitch" axis="1 2 0" pos="-0.2 0 0.1" ref="-10"/>
              <joint name="out" type="slide" axis="0 1 1" ref="0.3" springref="0.1" stiffness="3"/>
              <inertial pos="0 0 0.4" mass="2" diaginertia="0.1 0.2 0.25"/>
              <body name="tool" gravcomp="0.4" pos="0 0.1 0.5" axisangle="1 1 0 70"><geom type="box" size=".1 .2 .05"/>
                <body pos="0 0.2 0"><joint pos="0 0 0.1" axis="1 0 0"/>{INERTIAL}</body>
              </body>
            </body>
          </body>
        </frame>
        <body name="cart"><joint type="slide" axis="1 0 0" damping="0.3"/><geom size="0.1"/></body>
        """,
        """<option gravity="1 2 -9"/><compiler angle="degree"/>
        <default><default class="arm"><joint damping="0.2" armature="0.05" stiffness="1.5"/></default></default>""",
    )
    mechanism = agrees(text)
    assert mechanism.system.coordinates == ("yaw", "pitch", "out", "body 4", "cart")
    assert [body.name for body in mechanism.moving] == ["upper yaw", "upper pitch", "upper", "body 4", "cart"]
    assert np.asarray(mechanism.gravity).tolist() == [1.0, 2.0, -9.0]


@recent
@mark.parametrize(("flag", "joint"), [("gravity", ""), ("damper", 'damping="2"'), ("spring", 'stiffness="2"')])
def test_what_the_options_switch_off_is_off(flag: str, joint: str) -> None:
    body = f'<body><joint axis="0 1 0" {joint}/>{INERTIAL}</body>'
    on, off = agrees(mjcf(body)), agrees(mjcf(body, f'<option><flag {flag}="disable"/></option>'))
    assert len(dyn.inverse_dynamics(off).nodes) < len(dyn.inverse_dynamics(on).nodes)


@mark.filterwarnings("ignore:MuJoCo on the given text")  # of bodies without mass
def test_names_are_mujoco_s_or_new_ones() -> None:
    mechanism = dyn.load_mjcf(
        mjcf(
            f"""<body name="body 2"><joint/>{INERTIAL}</body><body><joint name="x"/><joint/>{INERTIAL}</body>
            <body name="c"><joint/>{INERTIAL}</body><body name="d"><joint name="c"/>{INERTIAL}</body>"""
        )
    )
    assert mechanism.system.coordinates == ("body 2", "x", "body 2'", "c'", "c")
    assert [body.name for body in mechanism.moving] == ["body 2", "body 2' x", "body 2'", "c", "d"]


def test_a_path_a_text_and_a_model_are_the_same(tmp_path: Path) -> None:
    file = tmp_path / "model.xml"
    file.write_text(mjcf(HINGE), encoding="utf-8")
    graphs = [
        dyn.inverse_dynamics(dyn.load_mjcf(each)) for each in (file, str(file), mjcf(HINGE), compiled(mjcf(HINGE)))
    ]
    assert len({repr(graph.evaluate({"q0": 0.3, "qd0": 0.2, "qdd0": 0.1})) for graph in graphs}) == 1


@mark.parametrize("load", [dyn.load_mjcf, dyn.load_urdf])
def test_a_file_of_another_kind_is_called_by_its_kind(load: Any, tmp_path: Path) -> None:
    files = {"": "is empty$", "<sdf/>": "has <sdf>: it is SDF$", "version https://git-lfs.x": "is a pointer of Git LFS"}
    files["<robot/>" if load is dyn.load_mjcf else "<mujoco/>"] = "which load_(urdf|mjcf) reads$"
    for text, said in files.items():
        (tmp_path / "model.xml").write_text(text)
        with raises(MechanismError, match=said):
            load(tmp_path / "model.xml")


@mark.parametrize("load", [dyn.load_mjcf, dyn.load_urdf])
@each_row(
    "source", ["robot\n" * 5000, "x" * 5000, "<robot name='\ud800'/>", "a\0b", "\ud800", "", "<", "<!--", 3, "a://b"]
)
def test_what_cannot_be_read_is_one_sentence(load: Any, source: str) -> None:
    what = "cannot be read: File name|is not XML: |there is no file|got an empty text|got int|is an address"
    with raises(MechanismError, match=what) as told:
        load(source)
    assert "\n" not in str(told.value)
    assert len(str(told.value)) < 300


@mark.parametrize(
    "text",
    [
        "<mujoco><worldbody>",
        "<mujoco><nonsense/></mujoco>",
        mjcf('<body><joint axis="1"/></body>'),
        mjcf(f'<body name="b">{HINGE}{INERTIAL}</body>').replace(
            "</mujoco>", '<equality><connect body1="b" body2="world" anchor="&#9;"/></equality></mujoco>'
        ),  # which MuJoCo itself does not explain
    ],
)
def test_bad_mjcf_is_one_sentence(text: str, tmp_path: Path) -> None:
    with raises(MechanismError, match=r"^(MuJoCo cannot read the given text|the given text is not XML): \S.*\S$"):
        dyn.load_mjcf(text)
    file = tmp_path / "bad.xml"
    file.write_text(text, encoding="utf-8")
    with raises(MechanismError, match=r"^MuJoCo cannot read '.*bad\.xml': \S.*\S$"):
        dyn.load_mjcf(file)


NAMED = {
    "included": '<include file="{0}"/>',
    "a mesh": '<asset><mesh name="m" file="{0}"/></asset>',
    "a texture": '<asset><texture name="m" type="cube" fileright="{0}"/></asset>',
    "a field": '<asset><hfield name="m" file="{0}"/></asset>',
    "a model": '<asset><model name="m" file="{0}"/></asset>',
}


@mark.parametrize("element", NAMED.values(), ids=NAMED)
def test_a_text_reads_no_other_files(element: str, tmp_path: Path, monkeypatch: Any) -> None:
    (tmp_path / "inside").mkdir()
    monkeypatch.chdir(tmp_path / "inside")
    other = tmp_path / "other.xml"
    other.write_text(mjcf(f'<body name="b">{HINGE}{INERTIAL}</body>'), encoding="utf-8")
    for name in (str(other), "../other.xml", "other.xml"):
        with raises(MechanismError, match=f"^the given text names the file '{re.escape(name)}', and a text reads no"):
            dyn.load_mjcf(f"<mujoco>{element.format(name)}</mujoco>")


def test_a_file_reads_those_that_it_includes(tmp_path: Path) -> None:
    body = mjcf(f'<body name="b">{HINGE}{INERTIAL}</body>')
    (tmp_path / "b.xml").write_text(body, encoding="utf-8")
    (tmp_path / "a.xml").write_text('<mujoco><!-- a -- b --><include file="b.xml"/></mujoco>', encoding="utf-8")
    assert dyn.load_mjcf(tmp_path / "a.xml").coordinates == dyn.load_mjcf(body).coordinates


@mark.parametrize("count", [("100000000",), ("1000", "11"), ("9000", "1"), ("1e300",)])
def test_more_copies_than_are_made_in_seconds_are_refused(count: tuple[str, ...], tmp_path: Path) -> None:
    site = "<site/>"
    for each in count:
        site = f'<replicate count="{each}" offset="0 0 1">{site}</replicate>'
    text = mjcf(f'<body name="b">{HINGE}{INERTIAL}{site}{site if count == ("9000", "1") else ""}</body>')
    (tmp_path / "b.xml").write_text(text, encoding="utf-8")
    (tmp_path / "a.xml").write_text('<mujoco><include file="b.xml"/></mujoco>', encoding="utf-8")
    for source in (text, tmp_path / "a.xml"):
        with raises(MechanismError, match=r" asks for \S+ copies by `count`, at most 10000 are made$"):
            dyn.load_mjcf(source)
    assert dyn.load_mjcf(text.replace(f'"{count[0]}"', '"3"')).coordinates == ("j",)


BALL = f'<body name="b"><joint name="ball" type="ball" stiffness="2"/>{INERTIAL}</body>'
FREE = f'<body name="f" pos="0 0 2"><freejoint name="root"/>{INERTIAL}{HINGE}</body>'
TENDON = '<tendon><fixed name="string" armature="3"><joint joint="j" coef="1"/></fixed></tendon>'
SPATIAL = '<spatial name="string"><site site="one"/><site site="two"/></spatial>'
HELD = f'<tendon>{SPATIAL}</tendon><equality><tendon tendon1="string"/></equality></mujoco>'
SITES = '<site name="one"/><site name="two" pos="1 0 0"/>'
NOT_MODELLED = [
    (mjcf(BALL.replace('type="ball"', 'type="free"')), "springs of free joints, or of turned ball joints (ball)"),
    (mjcf(HINGE).replace("</mujoco>", TENDON + "</mujoco>"), "tendons with a spring, damper or mass (string)"),
    (mjcf(HINGE + SITES).replace("</mujoco>", HELD), "equality constraints of the type tendon (number 0)"),
    (mjcf(HINGE, '<option density="1.2"/>'), "a fluid (density or viscosity)"),
]


@each_row(("text", "what"), NOT_MODELLED)
def test_what_is_not_modelled_is_refused_by_name_or_left_out_on_request(text: str, what: str) -> None:
    message = f"a mechanism cannot have {what} (the option ignore leaves this out)"
    with raises(MechanismError, match=f"^{re.escape(message)}$"):
        dyn.load_mjcf(text)
    with warns(dyn.MechanismWarning, match=f"^the given text: left out {re.escape(what)}$"):
        mechanism = dyn.load_mjcf(text, ignore=True)
    assert mechanism.left_out == (what,)
    assert len(mechanism.moving) == 1


def test_a_joint_has_one_damping_and_one_armature() -> None:
    """A program can give each degree of freedom of MuJoCo's model another."""
    model = compiled(mjcf(FREE))
    model.dof_damping[4] = 0.1
    what = "joints with several dampings or armatures (root)"
    with raises(MechanismError, match=re.escape(what)):
        dyn.load_mjcf(model)
    assert dyn.load_mjcf(model, ignore=True).left_out == (what,)


@mark.parametrize("name", ["root", ""])
def test_free_and_ball_joints_move_as_mujoco_s(name: str) -> None:
    """At the place that the file gives the free body, and anywhere else: its coordinates are its place in the world."""
    text = mjcf(FREE.replace("root", name).replace(HINGE, HINGE + BALL))
    mechanism = dyn.load_mjcf(text)
    called = name or "f"
    assert mechanism.coordinates[:4] == (f"{called}.x", f"{called}.y", f"{called}.z", f"{called}.qw")
    assert (mechanism.system.nq, mechanism.system.n) == (12, 10)
    assert not name or disagreement(compiled(text), mechanism, 3) < EQUATIONS  # the same equations


@mark.parametrize(
    ("text", "flag"),
    [
        (mjcf(f'<body><joint frictionloss="0.1"/>{INERTIAL}</body>'), "frictionloss"),
        (mjcf(f'<body><joint frictionloss="0.1"/>{INERTIAL}</body>'), "constraint"),
        (mjcf(HINGE, '<equality><joint joint1="j" polycoef="0.1 0 0 0 0"/></equality>'), "equality"),
        (mjcf(f'<body gravcomp="1"><joint/>{INERTIAL}</body>'), "gravity"),
    ],
)
def test_what_the_options_switch_off_is_not_missed(text: str, flag: str) -> None:
    loaded = dyn.load_mjcf(text.replace("<mujoco>", f'<mujoco><option><flag {flag}="disable"/></option>'))
    assert loaded.left_out == ()


ACTUATORS = """<actuator><motor joint="j"/><position name="servo" joint="j" kp="50" kv="2" gear="3"/>
<velocity joint="j" kv="4"/><general joint="j" gainprm="2" ctrllimited="true" ctrlrange="0.5 1"/></actuator>"""


def test_what_acts_from_outside_is_left_out_with_a_warning_and_no_error() -> None:
    """An actuator that acts with no input is told from a motor by its force."""
    text = mjcf(
        '<geom type="plane" size="1 1 1"/>'
        '<body><joint name="j" range="-30 30" frictionloss="0.1"/><geom size="0.1" pos="0.2 0 0"/></body>'
    ).replace("</mujoco>", f"{ACTUATORS}</mujoco>")
    with warns(dyn.MechanismWarning) as said:
        loaded = dyn.load_mjcf(text)
    servos = "servo: -50 length -2 velocity times gear 3, number 2: -4 velocity, number 3: input at least 0.5"
    assert loaded.left_out == (
        "contacts (the option contacts takes those of spheres and capsules)",
        "joint limits (j)",
        "friction loss (j: 0.1)",
        "actuators (1)",
        f"actuators that act with no input ({servos})",
    )
    assert [str(each.message) for each in said] == [f"the given text: left out {'; '.join(loaded.left_out)}"]
    assert said[0].filename == __file__
    assert dyn.scenes.Scene("a", "", loaded, (0.0,), (0.0,), 1.0).left_out == loaded.left_out


@mark.parametrize("number", ["nan", "inf"])
@each_row("attribute", ["stiffness", "damping", "armature", "ref", "pos", "axis"])
def test_a_number_that_is_not_finite_is_one_sentence(
    tmp_path: Path, monkeypatch: Any, capfd: Any, attribute: str, number: str
) -> None:
    monkeypatch.chdir(tmp_path)
    value = f"{number} 0 0" if attribute in ("pos", "axis") else number
    text = mjcf(f'<body name="a"><joint {attribute}="{value}"/>{INERTIAL}</body>')
    with raises(MechanismError, match="finite"):
        dyn.load_mjcf(text)
    assert list(tmp_path.iterdir()) == []  # MuJoCo's own log
    assert capfd.readouterr() == ("", "")


def test_other_warnings_of_mujoco_are_python_s(monkeypatch: Any) -> None:
    read = mujoco.MjModel.from_xml_string

    def odd(text: str) -> Any:
        mujoco.get_mju_user_warning()("this is odd\n")
        return read(text)

    monkeypatch.setattr(mujoco.MjModel, "from_xml_string", odd)
    before = mujoco.get_mju_user_warning()
    with warns(UserWarning, match="^MuJoCo on the given text: this is odd$"):
        dyn.load_mjcf(mjcf(HINGE))
    assert mujoco.get_mju_user_warning() is before


def files() -> Iterator[Path]:
    """The XML files of gymnasium and dm_control, where they are installed."""
    for package in ("gymnasium", "dm_control"):
        spec = importlib.util.find_spec(package)
        if spec and spec.submodule_search_locations:
            yield from sorted(Path(spec.submodule_search_locations[0]).rglob("*.xml"))


REAL = list(files())


@mark.slow
@mark.timeout(600)  # the equations of 132 freedoms take a minute
@mark.parametrize("file", REAL, ids=[f"{file.parent.name}/{file.name}" for file in REAL])
def test_models_of_gymnasium_and_dm_control_agree(file: Path, record_property, monkeypatch, tmp_path: Path) -> None:
    """Those that MuJoCo reads and that have a joint; what a mechanism cannot have is taken out of both."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings about them to a file beside us
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as what:
        pytest.skip(f"a fragment, or an asset that the wheel does not hold: {what}")
    if not model.njnt:
        pytest.skip("nothing moves")
    mechanism = dyn.load_mjcf(alone(model), ignore=True)
    worst = disagreement(model, mechanism, count=5)
    record_property("worst", worst)
    assert worst <= REAL_MODELS
