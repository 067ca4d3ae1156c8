"""Caches: listed in docs/design.md, at most 25, emptied by one call, and what is made again has the same bits."""

import ast
import copy
import pickle
import re
import weakref
from collections.abc import Iterator

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph._shared import kept_by_first, memo
from cgraph.util.caches import kept_results
from tests.sources import ROOT, sources

HOME = "cgraph.util.caches"
MOST = 25
WEAK = {"cgraph.core.label"}  # has weak tables, which docs/design.md explains
# Tables that a module or a call of `register` fills, by the name that their rows are asked for by.
TABLES = {
    "cgraph.core.row.ROWS",
    "cgraph.operations.operation.OPS",
    "cgraph.core.row.BY_UFUNC",
    "cgraph.program.statement.STATEMENTS",
    "dynamics.equations.equation.EQUATIONS",
    f"{HOME}._memos",
}
CONTAINERS = {"dict", "list", "set", "OrderedDict", "defaultdict", "deque", "Counter"}


def called(node: ast.expr) -> str:
    """The last name of what is called or named: memo of @memo(16), cache of functools.cache."""
    node = node.func if isinstance(node, ast.Call) else node
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def caches(body: list[ast.stmt], home: str) -> Iterator[tuple[str, str]]:
    """(dotted name, "memo" or "kept_by_first") of the functions that keep results."""
    for each in body:
        if isinstance(each, ast.FunctionDef):
            yield from [(f"{home}.{each.name}", called(x)) for x in each.decorator_list if called(x) in KINDS]
        if isinstance(each, ast.Assign) and called(each.value) == "kept_by_first":
            yield f"{home}.{ast.unparse(each.targets[0])}", "kept_by_first"
        if isinstance(each, ast.ClassDef | ast.FunctionDef):
            yield from caches(each.body, f"{home}.{each.name}")


KINDS = {"memo": 0, "kept_by_first": 1}  # number of the table on the page


def listed() -> list[list[str]]:
    """The names in the two tables of docs/design.md: those of the process, and those of an object."""
    page = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    section = page.partition("\n## Caches\n")[2].partition("\n## ")[0]
    of_process, of_objects = re.findall(r"(?:^\|.*\n)+", section, flags=re.MULTILINE)
    return [re.findall(r"`([\w.]+)`", table) for table in (of_process, of_objects)]


def test_every_cache_is_listed_and_there_are_few() -> None:
    found: list[list[str]] = [[], []]
    for source in sources().values():
        for name, kind in [] if source.module == HOME else caches(source.tree.body, source.module):
            found[KINDS[kind]].append(name)
    assert [sorted(names) for names in listed()] == [sorted(names) for names in found]
    assert 0 < len(found[0]) <= MOST


def test_nothing_else_keeps_results() -> None:
    """No other cache of functools, no weak table, no module's or class's own table, no global variable."""
    others = []
    for source in sources().values():
        module, tree = source.module, source.tree
        for node in source.nodes:
            if isinstance(node, ast.ImportFrom) and node.module == "functools" and module != HOME:
                others += [f"{module}: {each.name}" for each in node.names if each.name in ("cache", "lru_cache")]
            if isinstance(node, ast.Attribute) and ast.unparse(node) in ("functools.cache", "functools.lru_cache"):
                others.append(f"{module}: {ast.unparse(node)}")
            if isinstance(node, ast.Name) and node.id.startswith("Weak") and module not in {*WEAK, HOME}:
                others.append(f"{module}: {node.id}")
            if isinstance(node, ast.Global):
                others += [f"{module}: global {name}" for name in node.names]
        for scope in [tree, *[node for node in source.nodes if isinstance(node, ast.ClassDef)]]:
            others += [f"{module}.{name}" for name in empty_containers(scope.body)]
    assert set(others) == TABLES


def empty_containers(body: list[ast.stmt]) -> Iterator[str]:
    """Names that are given an empty container, to be filled later."""
    for each in body:
        if isinstance(each, ast.Assign | ast.AnnAssign):
            value, target = each.value, each.targets[0] if isinstance(each, ast.Assign) else each.target
            literal = isinstance(value, ast.Dict | ast.List) and not [*ast.iter_child_nodes(value)][1:]
            made = isinstance(value, ast.Call) and called(value) in CONTAINERS and not value.args
            if literal or made:
                yield ast.unparse(target)


ARM = ([1.0, 2.0], [1.0, 0.7])


def used() -> list[np.ndarray]:
    arm, q, qd = dyn.planar_arm(*ARM), [0.3, -0.4], [0.1, 0.2]
    pushed = dyn.with_controller(arm, lambda q, qd, t, p: [p["k"] * (0.5 - q[0]), -qd[1]], {"k": 2.0})
    rod = {"constraints": lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0}}
    bob = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1], "x y", **rod)
    runs = [
        dyn.simulate(arm, q, qd, 0.1, dt=0.02, method="gauss6", progress=False),
        dyn.simulate(arm, q, qd, 0.1, method="radau", form="momentum", progress=False),
        dyn.simulate(pushed, q, qd, 0.1, events=[dyn.Event("level", lambda q, qd, t: q[0])], progress=False),
        dyn.simulate(bob, [1.0, 0.0], [0.0, 0.0], 0.1, progress=False),
    ]
    many = dyn.simulate_many(arm, [q, qd], [qd, q], 0.1, dt=0.02, method="rk4", progress=False)
    slope = dyn.gradient(arm, lambda q, qd, t: q[0] ** 2 + qd[1], q, qd, 0.1, dt=0.02)
    graph = dyn.forward_dynamics(arm)
    numbers = [*dyn.linearize_many(arm, [q, qd], [qd, q]), *dyn.arrays_at(arm, graph, q, qd).values()]
    texts = [cg.to_js(graph).encode(), cg.latex(graph).encode(), cg.to_c(graph).source.encode()]
    numbers += [np.frombuffer(text, dtype=np.uint8) for text in texts]
    return [*[run.q for run in runs], *[run.t for run in runs], many.q, *slope.gradients.values(), *numbers]


def test_one_call_empties_all_and_the_bits_are_the_same() -> None:
    cg.clear_caches()
    assert kept_results() == 0
    first = used()
    held = kept_results()
    assert held > 20
    again = used()  # by what is kept
    assert cg.clear_caches() >= held
    assert kept_results() == 0
    anew = used()
    assert kept_results() > 20
    for results in (again, anew):
        assert [(x.shape, x.tobytes()) for x in results] == [(x.shape, x.tobytes()) for x in first]


def test_what_somebody_has_goes_on_without_caches() -> None:
    arm = dyn.planar_arm(*ARM)
    compiled = cg.compile(dyn.forward_dynamics(arm))
    x, y = np.full(compiled.n_in, 0.1), np.empty(compiled.n_out)
    call = compiled.bind(x, y)
    run = dyn.simulate(arm, [0.3, -0.4], [0.1, 0.2], 0.1, progress=False)
    energy = run.energy.copy()
    cg.clear_caches()
    call()
    assert y.tobytes() == compiled(x).tobytes()
    assert run.energy.tobytes() == energy.tobytes()


class Owner:
    def __init__(self, number: float) -> None:
        self.number = number


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda owner: pickle.loads(pickle.dumps(owner))])
def test_a_copy_has_results_of_its_own(copied) -> None:
    owner = Owner(2.0)
    assert (scaled(owner, 3.0), scaled(owner, 3.0), scaled(owner, by=4.0)) == (6.0, 6.0, 8.0)
    other = copied(owner)
    other.number = 5.0
    assert (scaled(other, 3.0), scaled(owner, 3.0)) == (15.0, 6.0)
    owner.number = 7.0  # nobody alters what keeps results; this one is asked whether it does
    assert (scaled(owner, 3.0), scaled(owner, 1.0)) == (6.0, 7.0)


@kept_by_first
def scaled(owner: Owner, by: float) -> float:
    return owner.number * by


def test_results_go_with_their_object_and_a_memo_is_bounded() -> None:
    made = []

    @kept_by_first
    def part(owner: Owner) -> Owner:
        return Owner(owner.number + 1.0)

    @memo(2)
    def square(x: float) -> float:
        made.append(x)
        return x * x

    owner = Owner(1.0)
    result = weakref.ref(part(owner))
    assert part(owner) is result()
    del owner
    assert result() is None
    assert [square(x) for x in (1.0, 2.0, 2.0, 3.0, 1.0)] == [1.0, 4.0, 4.0, 9.0, 1.0]
    assert made == [1.0, 2.0, 3.0, 1.0]
    cg.clear_caches()
    assert square(1.0) == 1.0
    assert made[-2:] == [1.0, 1.0]
