"""Scenes: by name, by file, and what neither can be."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics import MechanismError, scenes
from dynamics.multibody.builders import planar_links
from tests.each_row import each_row
from tests.tolerances import LAST_BITS

INERTIAL = '<inertial pos="0.1 0.2 -0.3" mass="1.3" diaginertia="0.3 0.4 0.5"/>'
MJCF = f"""<?xml version="1.0"?><!-- a hinge and a slide --><mujoco><worldbody>
<body name="a"><joint axis="0 1 0"/>{INERTIAL}
<body name="b"><joint type="slide"/>{INERTIAL}</body></body></worldbody></mujoco>"""
URDF = """<?xml version="1.0" encoding="utf-8"?><robot name="arm"><link name="base"/><link name="a"><inertial>
<origin xyz="0.1 0 0.2"/><mass value="1.5"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.15"/></inertial>
<visual><geometry><mesh filename="package://nowhere/a.stl"/></geometry></visual></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(text: str, name: str = "model.xml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def loaded(*arguments: Any, **options: Any) -> scenes.Scene:
    pytest.importorskip("mujoco")
    return scenes.load(*arguments, **options)


@each_row("name", scenes.names())
def test_a_scene_is_called_by_its_name_and_starts_in_a_state_of_its_model(name: str) -> None:
    scene = scenes.load(name)
    assert scene.name == name
    assert len(scene.q) == len(scene.qd) == scene.system.n
    assert scene.left_out == ()
    assert np.isfinite(dyn.simulate(scene, scene.q, scene.qd, 0.01).q).all()


def test_the_triple_pendulum_is_the_paper_s() -> None:
    scene = scenes.load("triple_pendulum")
    assert [(link.mass, link.length) for link in planar_links(scene.model)] == [(1.0, 1.0), (0.8, 0.8), (0.7, 0.7)]
    assert (scene.system.damping, scene.model.gravity) == ((0.1, 0.1, 0.1), (0.0, 0.0, -9.81))
    assert (scene.q, scene.qd) == ((np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.0))
    points = planar_links(scenes.load("triple_pendulum", mass_model="point").model)
    assert {link.inertia for link in points} == {0.0}


@mark.parametrize("n", [1, 4, 10])
def test_a_chain_weighs_a_kilogram_and_is_a_metre_long_however_many_links(n: int) -> None:
    links = planar_links(scenes.load("chain", n=n).model)
    assert len(links) == n
    assert (sum(x.mass for x in links), sum(x.length for x in links)) == approx((1.0, 1.0), rel=LAST_BITS)


READ = "ignore, floating, limits, friction, actuators, contacts"


@each_row(
    ("name", "options", "message"),
    [
        ("chain", {"links": 4}, "scene 'chain' has no option 'links'; its options are n"),
        ("chain", {"name": "x"}, "scene 'chain' has no option 'name'; its options are n"),
        ("spring_mass", {"k": 2.0}, "scene 'spring_mass' has no option 'k'; it has none"),
        ("robot.xml", {"n": 4}, f"scene 'robot.xml' has no option 'n'; its options are {READ}"),
        ("robot.xml", {"path": "x"}, f"scene 'robot.xml' has no option 'path'; its options are {READ}"),
    ],
)
def test_an_unknown_option_is_named_with_those_that_there_are(name: str, options: Any, message: str) -> None:
    with raises(TypeError, match=f"^{re.escape(message)}$"):
        scenes.load(name, **options)


KNOWN = "the scenes are spring_mass, two_link, triple_pendulum, chain, any file that ends"


@each_row(
    ("name", "options", "message"),
    [
        *[("chain", {"n": n}, f"a chain needs at least one link, got {n!r}") for n in (0, -1, 2.5, "3")],
        *[(name, {}, f"there is no scene {name!r}; {KNOWN}") for name in ("swing", "", 3, None, ["chain"])],
    ],
)
def test_a_chain_has_a_whole_number_of_links_and_what_is_no_scene_is_named_with_those(
    name: Any, options: Any, message: str
) -> None:
    with raises(ValueError, match="^" + re.escape(message) + ("$" if options else "")):
        scenes.load(name, **options)


@mark.parametrize("as_given", [str, Path])
def test_a_model_file_is_a_scene_at_rest(file: Any, as_given: type) -> None:
    path = file(MJCF, "crane.xml")
    scene = loaded(as_given(path))
    assert scene.name == "crane"
    assert scene.about == f"2 moving bodies of {path}"
    assert scene.system.coordinates == ("a", "b")
    assert scene.q == scene.qd == (0.0, 0.0)
    assert np.isfinite(dyn.simulate(scene, scene.q, scene.qd, 0.01).q).all()


def test_a_model_of_a_file_starts_where_the_file_has_it(file: Any) -> None:
    """A free body at its place, a hinge at its reference, a ball unturned."""
    free = f"""<body pos="1 2 3" quat="0 0 2 0"><freejoint name="f"/>{INERTIAL}</body>
    <body><joint name="h" axis="0 1 0" ref="90"/>{INERTIAL}</body>
    <body><joint name="b" type="ball"/>{INERTIAL}</body>"""
    scene = loaded(file(f"<mujoco><worldbody>{free}</worldbody></mujoco>"))
    assert scene.q == (1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 0.0, np.pi / 2, 1.0, 0.0, 0.0, 0.0)
    assert scene.qd == (0.0,) * 10
    assert [*scene.mechanism.position("body 1").evaluate({f"q{i}": x for i, x in enumerate(scene.q)}).values()] == [
        1,
        2,
        3,
    ]


def test_the_root_of_a_urdf_may_float(file: Any) -> None:
    heavy = URDF.replace('<link name="base"/>', '<link name="base"><inertial><mass value="2"/><inertia ixx="1" ixy="0"'
                         ' ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>')  # fmt: skip
    scene = scenes.load(file(heavy, "arm.urdf"), floating=True)
    assert scene.q == (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    assert scene.velocities == (*[f"base.{name}" for name in ("vx", "vy", "vz", "wx", "wy", "wz")], "j")
    with raises(MechanismError, match=r"says itself which bodies float$"):
        loaded(file(MJCF), floating=True)


@mark.parametrize("name", ["arm.urdf", "arm.xml", "arm"])
def test_urdf_is_known_by_its_root_element(file: Any, name: str) -> None:
    """And read without its meshes, which MuJoCo's own reader would look for."""
    assert loaded(file(URDF, name)).system.coordinates == ("j",)


def test_a_file_s_name_does_not_hide_a_scene(file: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    path = file(MJCF, "chain")
    monkeypatch.chdir(path.parent)
    assert scenes.load("chain").system.n == 10
    assert loaded("./chain").system.n == 2


@each_row(
    ("text", "message"),
    [
        (None, "there is no file "),
        ("", "{path!r} is empty"),
        ("<mujoco><worldbody>", "MuJoCo cannot read "),
        ("not XML", "{path!r} is not XML, as MJCF and URDF are"),
        ("<robot><link/></robot>", "URDF, {path!r}: a link has no name"),
        ("<mujoco/>", "the mechanism has no joint that moves"),
        (bytes(range(256)), "{path!r} is not XML, as MJCF and URDF are"),
    ],
)
def test_a_file_that_is_no_model_is_one_sentence(tmp_path: Path, text: str | bytes | None, message: str) -> None:
    path = tmp_path / ("nowhere.xml" if text is None else "model.xml")
    if text is not None:
        path.write_bytes(text.encode() if isinstance(text, str) else text)
    with raises(MechanismError, match="^" + re.escape(message.format(path=str(path)))) as caught:
        loaded(path)
    assert "\n" not in str(caught.value)
