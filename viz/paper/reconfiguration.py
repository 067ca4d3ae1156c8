"""Figure 10: time to the first torque after a change of structure, and an arm that modules are dragged onto and off."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

import cgraph as cg
from cgraph._shared import Array, Json
from dynamics import Body, Joint, Mechanism, Rows, inverse_dynamics
from dynamics.experiments.timing import spent
from dynamics.io.mujoco_module import mujoco
from dynamics.io.write_mjcf import mujoco_spec
from dynamics.multibody.algebra.spatial import to_quaternion
from dynamics.multibody.bodies.body import WORLD
from dynamics.multibody.joints import TYPES
from dynamics.multibody.rows.blocks import BLOCKS
from dynamics.multibody.rows.kernels import Kernel, flat, inward, outward
from dynamics.multibody.rows.slope_kernels import located
from dynamics.multibody.rows.table import table_of
from dynamics.systems.kinematics import numbered_graph
from dynamics.verification.pinocchio_model import PinocchioModel, pinocchio

from ..pages.document import Block, Markup, Paragraph, Table
from ..pages.html import asset
from ..pages.operations import expression
from ..plots.direct_labels import Line, PlotPanel, labeled
from .mechanisms import turned_arm, turned_body
from .part import Part, plotted

TURNS, FEW, AGREE = 15, 3, 1e-9  # turns of each way, and of the graph; of the largest torque, rounding along an arm
CARRIER = {name: block.register for name, block in BLOCKS.items() if block.table == "parent"}  # blocks of what carries
# Modules of the page, along x on a hinge at their end: its axis, length [m], mass [kg]; and those of its first arm.
MODULES = {"bend": ((0, 1, 0), 0.3, 2.0), "twist": ((1, 0, 0), 0.15, 1.5), "load": ((0, 1, 0), 0.1, 4.0)}
FIRST = (("bend", -0.6), ("twist", 0.9), ("bend", 0.8), ("load", 0.3))  # rad


def _pinocchio(model: Any, motion: Sequence[Array], body: Body) -> Array:
    """Torques by a copy of Pinocchio's model, with a joint and a body appended, and rnea."""
    module, new, joint = pinocchio(), model.copy(), body.joint
    place = module.SE3(np.asarray(joint.orientation), np.array(joint.position))
    at = new.addJoint(new.njoints - 1, module.JointModelRZ(), place, body.name)
    inertia = module.Inertia(body.mass, np.asarray(body.center), np.asarray(body.inertia))
    new.appendBodyToJoint(at, inertia, module.SE3.Identity())
    return np.array(module.rnea(new, new.createData(), *motion))


def _mujoco(specs: Iterator[Any], motion: Sequence[Array], body: Body) -> Array:
    """Torques by the next MjSpec, edited and compiled, and mj_inverse."""
    module, spec, turn = mujoco(), next(specs), to_quaternion(np.asarray(body.joint.orientation))
    new = spec.body(body.parent).add_body(name=body.name, pos=body.joint.position, quat=turn)
    new.mass, new.ipos, new.explicitinertial = body.mass, body.center, True
    new.fullinertia = np.asarray(body.inertia)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    new.add_joint(type=module.mjtJoint.mjJNT_HINGE, axis=body.joint.axis)
    data = module.MjData(model := spec.compile())
    data.qpos, data.qvel, data.qacc = motion
    module.mj_inverse(model, data)
    return np.array(data.qfrc_inverse)


def first_torques(n: int) -> dict[str, float]:
    """{who: milliseconds from an arm of n - 1 hinges, in use, to torques with one more}; ArithmeticError if they differ."""
    base, q, rng = turned_arm(n - 1), np.linspace(-0.5, 0.5, n), np.random.default_rng(n)
    rows, motion, least = Rows(base), (q, 0.0 * q, -q), dict[str, float]()  # at rest: Pinocchio has no dampers

    def by_rows(body: Body) -> Array:
        rows.attach(body)
        return rows.inverse(*motion)

    ways: dict[str, Callable[[Body], Array]] = {"rows": by_rows}
    ways["graph"] = lambda body: np.asarray(cg.compile(inverse_dynamics(base.attach(body)))(np.concatenate(motion)))
    with suppress(ImportError):
        ways["Pinocchio"] = partial(_pinocchio, PinocchioModel(base).model, motion)
    with suppress(ImportError):
        ways["MuJoCo"] = partial(_mujoco, iter([mujoco_spec(base, 1e-3) for _ in range(TURNS)]), motion)
    for turn in range(TURNS):
        body = turned_body(n - 1, base.bodies[-1].name, rng)  # of numbers that no other has: nothing is used again
        rows.inverse(*[each[1:] for each in motion])
        taken = {who: spent(partial(way, body)) for who, way in ways.items() if who != "graph" or turn < FEW}
        rows.detach(body.name)
        for who, each in taken.items():
            least[who] = min(least.get(who, np.inf), 1e3 * each.seconds)
            if not np.abs(each.made - taken["rows"].made).max() <= AGREE * np.abs(each.made).max():
                raise ArithmeticError(f"at n = {n} torques of {who} are {each.made}, of rows {taken['rows'].made}")
    return least


def figure10(counts: Sequence[int] = (2, 3, 5, 10, 20, 30, 50, 100)) -> Part:
    """Figure 10: the first torque after a body is attached, over these numbers of links; and modules to play with."""
    found = [first_torques(n) for n in counts]
    cells = [[f"{n}", *[f"{ms:.2f}" for ms in each.values()]] for n, each in zip(counts, found, strict=True)]
    ends = [f"with {counts[k]} links {', '.join([f'{who} {ms:.2f}' for who, ms in found[k].items()])}" for k in (0, -1)]
    seen = f"Milliseconds to the first torque: {'; '.join(ends)}."
    caption = (
        "Figure 10. From an arm of n − 1 hinges in use to the torques with one more, the least of several times. Rows: a row added. Graph: derived, compiled, "
        "called. Pinocchio: model copied, joint and body appended, its data made, rnea. MuJoCo: MjSpec edited, compiled, mj_inverse. All that are installed agree."
    )
    lines = [Line(who, counts, [each[who] for each in found], k) for k, who in enumerate(found[0])]
    panel = PlotPanel("a body is attached", "links n", "time to the first torque [ms]", lines)
    shown = plotted("first-torque", labeled([panel], columns=1, rising=True), caption, f"Times over links. {seen}")
    table = Table("Milliseconds to the first torque", ["links", *found[0]], cells, folded=True, file="first-torque")
    live = Markup(asset(__package__, "modules.html"), "On the page, modules are dragged onto an arm and off it.")
    script = f"const KERNELS = {{ out: [{_script(outward)}, {_script(located)}], in: {_script(inward)} }};\n"
    data: dict[str, Json] = {"first_torque": dict(zip(map(str, counts), found, strict=True))}
    blocks: list[Block] = [Paragraph(seen, point=True), shown, table, live]
    return Part("change", "Figure 10: robots that change", blocks, data, moves={"modules": _modules()}, script=script)


def _script(make: Callable[..., Kernel]) -> str:
    """The kernel of a hinge as JavaScript, with the blocks that it reads, writes and adds to: of a row, or of what carries it."""
    reads, writes, adds = make(TYPES["revolute"])
    text = cg.to_js(numbered_graph(flat(*reads.values()), flat(*writes.values(), *adds.values())))
    named = [[name in CARRIER, CARRIER.get(name, name)] for name in reads]
    own, others = [[name, len(each)] for name, each in writes.items()], [CARRIER[name] for name in adds]
    return f"{{ ...{expression(text)}, reads: {json.dumps(named)}, writes: {json.dumps(own)}, adds: {json.dumps(others)} }}"


def module(kind: str, on: Body | None = None) -> Body:
    """A module of the page, at the end of another one or at the origin."""
    axis, length, mass = MODULES[kind]
    joint = Joint("revolute", axis=axis, position=2.0 * np.asarray(on.center, float) if on else (0.0, 0.0, 0.0))
    name, parent = (f"{kind} on {on.name}", on.name) if on else (kind, WORLD)
    return Body(name, joint, parent, mass, (length / 2.0, 0.0, 0.0), (0.01, 0.01, 0.01))


def _modules() -> dict[str, Json]:
    """What the page's script reads: the world, the first arm, and the numbers of each kind on each other."""
    pairs = {(on, kind): Mechanism([first := module(on), module(kind, first)]) for on in MODULES for kind in MODULES}
    numbers = {pair: table_of(mechanism).numbers.tolist() for pair, mechanism in pairs.items()}
    kinds = {kind: {WORLD: numbers[kind, kind][0], **{on: numbers[on, kind][1] for on in MODULES}} for kind in MODULES}
    still, axes, up = [0.0] * 6, np.eye(3).ravel().tolist(), [0.0, 0.0, 9.81]
    world: Json = {"kind": WORLD, "tip": still[:3], "motion": still + up, "wrench": still, "place": axes + still}
    return {"kinds": kinds, "world": world, "first": FIRST}
