"""Passes: sweeps over the rows of a table as statements, and the programs that they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from cgraph import Graph
from cgraph._shared import for_rows, memo
from cgraph.extend import For, Program, Statement, copied, effects, topological

from ...systems.kinematics import numbered_graph
from ..joints import JointType
from . import kernels, slope_kernels
from .blocks import ACCELERATED, BLOCKS, DRIVEN, FREEDOM, PAIRS, STRIDE, WIDE, Block
from .kernels import Kernel

ROWS = ("kind", "count")
Joints = Sequence[JointType]
Making = Callable[[JointType], Kernel]
Parts = list[tuple[str, int]]


@memo(512)
def _graph(make: Making, joint: JointType) -> tuple[Graph, tuple[Parts, Parts, Parts]]:
    """The graph of a kernel, and the blocks with their lengths that it reads, writes and adds to."""
    reads, writes, adds = make(joint)
    outputs = [node for blocks in (writes, adds) for nodes in blocks.values() for node in nodes]
    used = {*topological(outputs)}
    reads = {name: nodes for name, nodes in reads.items() if not used.isdisjoint(nodes)}
    graph = numbered_graph([node for nodes in reads.values() for node in nodes], outputs)
    parts = [[(name, len(nodes)) for name, nodes in blocks.items()] for blocks in (reads, writes, adds)]
    return graph, (parts[0], parts[1], parts[2])


def sweep(
    make: Making,
    joints: Joints,
    *,
    over: tuple[str, str] = ROWS,
    backwards: bool = False,
    elsewhere: Mapping[str, Block] = MappingProxyType({}),
) -> For:
    """The statement that runs a kernel of each of these types of joints over all rows.

    over: registers with their kinds and with how many there are.  elsewhere: other blocks of some names.
    """
    where = {**BLOCKS, **elsewhere}

    def ends(part: Parts) -> list[tuple[str, str, int]]:
        return [(where[name].register, where[name].table, count) for name, count in part if count]

    made = [_graph(make, joint) for joint in joints]
    kinds = [(graph, ends(reads), ends(writes), ends(adds)) for graph, (reads, writes, adds) in made]
    return for_rows(kinds, over, backwards=backwards)


def _outward_at_rest(joint: JointType) -> Kernel:
    return kernels.outward(joint, rest=True)


def inverse(joints: Joints, lifted: bool) -> list[Statement]:
    """tau of q, u and a."""
    lift = [sweep(kernels.lifted, joints)] if lifted else []
    return [
        sweep(kernels.outward, joints, elsewhere=ACCELERATED),
        *lift,
        sweep(kernels.inward, joints, elsewhere=ACCELERATED, backwards=True),
    ]


def forward(joints: Joints, lifted: bool, driven: Mapping[str, Block] = DRIVEN) -> list[Statement]:
    """a of q, u and tau."""
    lift = [sweep(kernels.lifted, joints)] if lifted else []
    return [
        sweep(_outward_at_rest, joints),
        *lift,
        sweep(kernels.eliminate, joints, elsewhere=driven, backwards=True),
        sweep(kernels.accelerate, joints, elsewhere=driven),
    ]


def slopes(joints: Joints, _: bool) -> list[Statement]:
    """tau of q, u and a, with derivatives."""
    by_body = (slope_kernels.placed, slope_kernels.reactions)
    sweeps = [sweep(make, joints, elsewhere=ACCELERATED, backwards=k > 0) for k, make in enumerate(by_body)]
    return [*sweeps, sweep(slope_kernels.pairs, joints[:1], over=("pair", "pairs"))]


def frames(joints: Joints, _: bool) -> list[Statement]:
    """Places of bodies of q."""
    return [sweep(slope_kernels.located, joints)]


def energies(joints: Joints, _: bool) -> list[Statement]:
    """Kinetic and potential energy of q and u."""
    return [copied(None, "energy"), sweep(kernels.energies, joints)]


def program(statements: Sequence[Statement], capacity: int, result: str) -> Program:
    """The program of these statements from x to a result, for so many rows, coordinates and velocities at most.

    x: coordinates, velocities and accelerations or torques, each from a multiple of the capacity on.
    """
    lengths = {"x": 3 * capacity, **used_registers(statements, capacity)}
    return Program(lengths, statements, record=[result])


def used_registers(statements: Sequence[Statement], capacity: int) -> dict[str, int]:
    """Lengths of the registers of statements, without x, for so many rows, coordinates and velocities at most."""
    n, tables = capacity, [block.table for block in BLOCKS.values()]
    lengths = {"kind": n, "count": 1, **dict.fromkeys([*tables, "v", "result"], n), "tau": n, "a": n}
    strides = {"own": STRIDE, "wide": WIDE}
    lengths |= {block.register: strides[block.table] * (n + 1) for block in BLOCKS.values() if block.table in strides}
    lengths |= {"gains": 7 * n, "column": FREEDOM * n, "reaction": FREEDOM * n, "slopes": 3 * n * n, "energy": 2}
    lengths |= {"pairs": 1, **dict.fromkeys(("pair", *PAIRS), n * (n - 1) // 2)}
    used = {name for names in effects(statements) for name in names}
    return {name: lengths[name] for name in lengths if name in used}
