"""Lint: independence and its blame, dependence, singular points in a box, cancellation at a point."""

import json
import math
from itertools import combinations

import mpmath
import pytest
from hypothesis import assume, given, settings, strategies as st

import cgraph as cg
import dynamics as dyn
from cgraph import lint
from cgraph.explain.lint.cancellation import rounded
from cgraph.explain.names import Names
from cgraph.operations.operation import OPS
from tests import high_precision
from tests.each_row import each_row
from tests.strategies import Case, cases, examples
from tests.tolerances import EQUATIONS

x, y, z = cg.variables("x y z")


def arm(n: int) -> dyn.Mechanism:
    return dyn.planar_arm([1.0] * n, [1.0] * n)


def state(n: int) -> tuple[str, str]:
    return " ".join(f"q{i}" for i in range(n)), " ".join(f"qd{i}" for i in range(n))


@each_row(("n", "simplify"), [(1, True), (2, False), (4, True), (9, True), (9, False)])
def test_by_definition_the_blame_is_one_edge_for_each_joint_and_by_the_chain_rule_there_is_a_proof(n, simplify):
    for formulation in ("chain_rule", "chain_rule_literal"):
        found = lint(dyn.inverse_dynamics(arm(n), formulation, simplify=simplify), independent=state(n))
        assert found.ok
        assert len(found.proofs) == 2
        assert all("no path leads" in proof for proof in found.proofs)
    graph = dyn.inverse_dynamics(arm(n), "by_definition", simplify=simplify)
    found = lint(graph, independent=state(n), function="L")
    (finding,) = found.findings
    assert not found.ok
    assert [each["text"] for each in finding.data["cut"]] == [f"qd{i} * dt -> q{i}" for i in range(n)]
    assert [edge.target.name for edge in finding.edges] == [f"q{i}" for i in range(n)]
    assert finding.data["paths"] == [f"qd{i} -> qd{i} * dt -> q{i}" for i in range(n)]
    assert finding.data["corrupted"] == [{"derivative": f"dL/dqd{i}", "gains": f"dt * dL/dq{i}"} for i in range(n)]
    assert found.nodes == dyn.spurious_nodes(graph)
    assert found.edges == set(finding.edges) <= set(graph.edges)


def test_the_report_on_one_joint():
    found = lint(dyn.inverse_dynamics(arm(1), "by_definition"), independent=("q0", "qd0"), function="L")
    assert str(found) == (
        "q0 depends on qd0. Without this edge there is no path:\n"
        "  qd0 * dt -> q0  through it dL/dqd0 gains dt * dL/dq0\n"
        "tau0 contains what was gained; 6 nodes of 21 serve nothing else.\n"
        "Holds: no path leads from q0 to qd0, made from qd0_old, qdd0 and dt alone."
    )
    assert str(lint(dyn.inverse_dynamics(arm(1), "chain_rule"), independent=("q0", "qd0"))) == (
        "Holds: no path leads from qd0 to q0: q0 is an input.\n"
        "Holds: no path leads from q0 to qd0: qd0 is an input.\n"
        "Note: Nothing uses the input qd0."
    )


def test_the_gain_is_what_the_derivative_has_too_much():
    """dL/dqd taken through the embedding, by differences, is p + dt dL/dq, as the report says."""

    def energy(q: cg.Node, qd: cg.Node) -> cg.Node:
        return 0.5 * qd * qd * cg.cos(q) - q * q

    old, v, dt = cg.variables("old v dt")
    q = cg.with_name(v * dt + old, "q")
    graph = cg.Graph([old, v, dt], {"L": energy(q, v)})
    (finding,) = lint(graph, independent=("q", "v"), function="L").findings
    assert finding.data["corrupted"] == [{"derivative": "dL/dv", "gains": "dt * dL/dq"}]
    at = {"old": 0.3, "v": 1.1, "dt": 0.05}
    through = high_precision.directional(graph, at, {"v": 1.0})["L"]
    apart = cg.Graph([x, y], {"L": energy(x, y)})
    point = {"x": 1.1 * 0.05 + 0.3, "y": 1.1}
    p, g = (high_precision.directional(apart, point, {name: 1.0})["L"] for name in ("y", "x"))
    assert float(through) == pytest.approx(float(p + 0.05 * g), rel=EQUATIONS)
    assert "No derivative" not in str(finding)  # no tag tells, so nothing is claimed
    assert "would" not in str(finding)


def test_a_relation_that_no_derivative_went_through_is_said_to_be_harmless():
    graph = dyn.inverse_dynamics(arm(2), "kinetic_only_exact")
    (finding,) = lint(graph, independent=state(2)).findings
    assert "dqd0 would gain dt * df/dq0" in str(finding)
    assert str(finding).endswith("No derivative in this graph was taken that way.")
    assert finding.data["derivatives_through"] == 0


def reaches(edges: set[cg.Edge], sources: set[cg.Node], sinks: set[cg.Node]) -> bool:
    seen = set(sources)
    while new := {edge.target for edge in edges if edge.source in seen} - seen:
        seen |= new
    return bool(seen & sinks)


@settings(max_examples=examples(100))
@given(cases(max_operations=9), st.data())
def test_the_cut_is_one_of_the_smallest(case: Case, data):
    """Against all sets of edges, tried one by one."""
    inner = [node for node in case.graph.nodes if node.args]
    assume(inner)
    sink = data.draw(st.sampled_from(inner))
    source = data.draw(st.sampled_from([node for node in case.graph.nodes if node is not sink]))
    found = lint(case.graph, independent=[(sink, source)])
    findings = [finding for finding in found.findings if finding.kind == "dependence"]
    edges = set(case.graph.edges)
    connected = [(a, b) for a, b in ((source, sink), (sink, source)) if reaches(edges, {a}, {b})]
    assert len(findings) == len(connected) == 2 - len(found.proofs)
    for finding, (a, b) in zip(findings, connected, strict=True):
        assert not reaches(edges - set(finding.edges), {a}, {b})
        for smaller in combinations(edges, min(len(finding.edges) - 1, 2)):
            assert reaches(edges - set(smaller), {a}, {b})


def test_of_cuts_of_one_size_the_one_nearest_to_the_dependent_is_blamed():
    graph = cg.Graph([x], {"f": cg.exp(cg.cos(cg.sin(x)))})
    (finding,) = lint(graph, independent=("f", "x")).findings
    assert finding.data["cut"][0]["text"] == "cos(sin(x)) -> exp(cos(sin(x)))"
    assert finding.data["paths"] == ["x -> sin(x) -> cos(sin(x)) -> exp(cos(sin(x)))"]


def test_groups_may_be_given_in_many_ways():
    graph = cg.Graph([x, y, z], {"f": cg.with_name(x * y, "two words") + z})
    for pairs in (("x y", "z"), [("x, y", "z")], [(["x", "y"], "z")], [((x, "y"), z)], [("x", "z"), ("y", "z")]):
        assert lint(graph, independent=pairs).ok
    lists = ((["x"], ["y"]), (["x", "y"], ["z", "z"]), (("x", "y"), [z]), ([x], "z"), (["x"], ("y", "z")))
    for pair in lists:
        found = lint(graph, independent=pair)
        assert found.proofs == lint(graph, independent=[pair]).proofs
        assert found.ok
    assert not lint(cg.Graph([x, y], {"f": x * y}), independent=(["x", "y"], ["f", "f"])).ok  # not x of y and f of f
    assert not lint(graph, independent=("two words", "x")).ok


AMBIGUOUS = (("x", "y"), ("y", "z")), ValueError, "one pair of groups or two pairs; give groups as strings or lists"
REFUSED = [
    *[(("independent", pairs), error, words) for pairs, error, words in (
        ("x y", TypeError, "expected pairs of groups"),
        (["x", "y", "z"], ValueError, "each entry must be a pair of groups, got 'x'"),
        ([("x", "y", "z")], ValueError, "each entry must be a pair"),
        ([("x y", "y z")], cg.GraphError, "y is in both groups"),
        ([("x", "w")], cg.GraphError, "nothing in the graph is called 'w'"),
        AMBIGUOUS,
        ([("x", "")], ValueError, "a group needs at least one name"),
        ([(3, "x")], TypeError, "a group is a name or several, or nodes; got int: 3"),
    )],
    *[(("box", {"x": interval}), ValueError, "box: input 'x' needs")
      for interval in ((1.0, 0.0), (math.nan, 1.0), (0.0,), "01", None, (True, 2))],
    (("box", {"w": (0.0, 1.0)}), cg.GraphError, "box: the graph has no input w"),
    *[(("digits", digits), ValueError, "digits must be a positive number") for digits in (0.0, -1.0, math.nan, "4")],
]  # fmt: skip


@each_row(("given", "error", "words"), REFUSED)
def test_what_makes_no_sense_is_refused(given, error, words):
    name, value = given
    at = {"at": dict.fromkeys("xyz", 1.0)} if name == "digits" else {}
    with pytest.raises(error, match=words):
        lint(cg.Graph([x, y, z], {"f": x * y + z}), **{name: value}, **at)


def test_a_report_is_json():
    graph = dyn.inverse_dynamics(arm(3), "by_definition")
    found = lint(
        graph,
        independent=state(3),
        depends={"tau0": "q0_old"},
        box={"dt": (0.0, math.inf)},
        at=dict.fromkeys(graph.input_names, 0.5),
    )
    again = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert again["ok"] is False
    assert [each["kind"] for each in again["findings"]] == [finding.kind for finding in found.findings]
    edge = again["findings"][0]["cut"][0]["edge"]
    assert graph.nodes[edge[0]] in graph.nodes[edge[1]].args


def test_missing_dependence_and_unused_inputs_are_named():
    graph = cg.Graph([x, y, z], {"f": x + 1.0, "g": x * y})
    found = lint(graph, depends={"f": "x y", "g": ["x", y]})
    assert [str(finding) for finding in found.findings] == ["f does not depend on y; it is made from x."]
    assert [str(note) for note in found.notes] == ["Nothing uses the input z."]
    assert lint(graph).ok
    assert lint(graph, depends={"g": "x y"}).ok
    with pytest.raises(cg.GraphError, match="'h'"):
        lint(graph, depends={"h": "x"})


def test_a_zero_of_either_sign_bounds_a_domain():
    for zero in (0.0, -0.0):
        low, high = OPS["pow"].interval((zero, 2e-9), (-1.0, 5.0))
        assert 0.0 <= low <= 1e-40
        assert high == math.inf


@settings(max_examples=examples(150))
@given(cases(), st.data())
def test_no_slope_in_a_box_is_infinite_without_a_finding(case, data):
    graph = case.graph
    box = {}
    at = {}
    for name, value in case.values.items():
        below, above = (data.draw(st.sampled_from((0.0, 0.1, 0.5, 3.0))) for _ in range(2))
        box[name] = (value - below, value + above)
        at[name] = data.draw(st.floats(*box[name]))
    if lint(graph, box=box).ok:
        values = cg.Graph(graph.inputs, {str(i): node for i, node in enumerate(graph.nodes)})
        assert all(math.isfinite(value) for value in values.evaluate(at).values())
        slopes = cg.Graph(graph.inputs, {str(i): edge.partial for i, edge in enumerate(graph.edges)} | {"one": 1.0})
        assert all(math.isfinite(slope) for slope in slopes.evaluate(at).values())


POINTS = (
    (cg.sqrt(x), (0.0, 1.0), "the slope is infinite at 0"),
    (cg.sqrt(x), (-1.0, 1.0), "there is no value below 0"),
    (cg.sqrt(x), (1e-300, 1.0), None),
    (cg.sqrt(x * x + y * y), (-1.0, 1.0), "the slope is infinite at 0"),
    (cg.sqrt(x * x + 1.0), (-1.0, 1.0), None),
    (1.0 / x, (-1.0, 2.0), "the divisor can be 0"),
    (1.0 / x, (0.5, 2.0), None),
    (1.0 / (2.0 + cg.cos(x)), (-100.0, 100.0), None),
    (cg.log(x), (0.0, 1.0), "value and slope are infinite at 0"),
    (cg.log(cg.exp(x)), (-5.0, 5.0), None),
    (cg.log1p(x), (-1.0, 1.0), "value and slope are infinite at -1"),
    (cg.tan(x), (1.5, 1.6), "infinite at odd multiples of pi/2"),
    (cg.tan(x), (-1.5, 1.5), None),
    (cg.tan(cg.atan(x)), (0.0, 1e20), "infinite at odd multiples of pi/2"),  # but for rounding
    (cg.asin(x), (0.0, 1.0), "the slope is infinite at -1 and 1"),
    (cg.acos(x), (0.0, 2.0), "there is no value beyond -1 and 1"),
    (cg.asin(x), (-0.9, 0.9), None),
    (cg.atan2(y, x), (-1.0, 1.0), "the slope is unbounded where both arguments are 0"),
    (cg.atan2(y + 2.0, x), (-1.0, 1.0), None),
    (cg.hypot(x, y), (-1.0, 1.0), "there is no slope where both arguments are 0"),
    (cg.hypot(x, y + 2.0), (-1.0, 1.0), None),
    (x**2, (-1.0, 1.0), None),
    (x**-2, (-1.0, 1.0), "the base can be 0 under a negative power"),
    (x**-2, (0.1, 1.0), None),
    (x**0.5, (0.0, 1.0), "the slope is infinite where the base is 0"),
    (x**1.5, (0.0, 1.0), None),
    (x**1.5, (-1.0, 1.0), "there is no value at a negative base"),
)


def test_singular_points_in_a_box_are_found_and_others_are_not():
    for node, box, reason in POINTS:
        found = lint(cg.Graph([x, y], {"f": node}), box={"x": box, "y": box})
        assert found.ok is (reason is None)
        if reason is not None:
            (finding,) = found.findings
            assert reason in str(finding)
            assert finding.nodes == (node,)


def test_a_finding_in_a_box_tells_the_arguments_and_the_tags():
    with cg.tag("link 2"):
        graph = cg.Graph([x, y], {"f": 1.0 / (x - y)})
    assert str(lint(graph, box={"x": (-1.0, 2.0)})) == (
        "%2 = 1 / %1  [link 2]: the divisor can be 0; x - y is within [-inf, inf]."
    )
    assert (
        str(lint(graph, box={"x": (1.0, 2.0), "y": 0.5})) == "Holds: no slope is unbounded in the box, of 2 operations."
    )


@settings(max_examples=examples(100))
@given(cases(max_operations=15))
def test_the_error_bound_holds_at_50_digits(case: Case):
    """Of inputs moved by half a unit in the last place, one of the points that the bound allows for."""
    assume(high_precision.kink_distance(case.graph, case.values) > 1e-6)
    found = rounded(Names(case.graph), case.values)
    moved = {name: mpmath.mpf(value) * (1 + mpmath.mpf(2) ** -53) for name, value in case.values.items()}
    exact = high_precision.node_values(case.graph, moved)
    for node in case.graph.nodes:
        assert abs(mpmath.mpf(found.values[node]) - exact[node]) <= found.errors[node] * 1.0001 + 1e-300


def test_cancellation_is_found_where_it_happens():
    with cg.tag("sag"):
        small = 1.0 - cg.cos(x)
    graph = cg.Graph([x], {"f": small / (x * x) + 3.0})
    (finding,) = lint(graph, at={"x": 1e-6}).findings
    assert finding.nodes == (small,)
    assert str(finding) == ("%2 = 1 - %1  [sag]: 1 - 0.9999999999995 leaves 5e-13; 12 digits are lost here, 3 remain.")
    better = cg.Graph([x], {"f": 2.0 * (cg.sin(0.5 * x) / x) ** 2 + 3.0})
    assert lint(better, at={"x": 1e-6}).ok
    assert lint(graph, at={"x": 1.0}).ok
    assert lint(graph, at={"x": 1e-6}, digits=13.0).ok


def test_what_is_exact_cancels_without_loss():
    graph = cg.Graph([x], {"f": (cg.constant(3.0) - 3.0) + x, "g": x - x})
    assert [finding.nodes for finding in lint(graph, at={"x": 0.1}).findings] == [(graph.outputs["g"],)]
    assert "leaves 0; 16 digits are lost here, 0 remain" in str(lint(graph, at={"x": 0.1}))


GUARDED = {  # what somebody wrote: whether its slope at a point is of that point alone
    "equal": (cg.where(cg.equal(x, 0), 1, cg.sin(x) / x), True),
    "not equal, within": (cg.where((x > -1) * cg.not_equal(x - y, 0), cg.sin(x - y) / (x - y), 1), True),
    "not 0": (cg.where(x, cg.sin(x) / x, 1), True),
    "size by sign": ((-2 * cg.sign(x) * x) ** 2, True),
    "region": (cg.where(x < 1e-4, 1, cg.sin(x) / x), False),
    "mode": (cg.where(cg.equal(y, 2), cg.sin(x), x), False),
    "signs": (cg.where(cg.equal(cg.sign(x), cg.sign(y)), x, y), False),
    "drag": (-cg.sign(x) * x**2 * y - cg.sign(x) * y, False),
    "own rules": (x**y * abs(x) + cg.maximum(x, cg.log(y)) + cg.interp(x, [0, 1, 2], [y, 2, y], "monotone"), False),
}


@each_row("name", GUARDED)
def test_guards_by_equality_are_blamed_and_the_rules_of_the_library_are_not(name):
    f, guarded = GUARDED[name]
    found = lint(cg.Graph([x, y], {"f": f}))
    assert [each.kind for each in found.findings] == ["guard by equality"] * guarded
    assert guarded or all(lint(derived(found.graph)).ok for derived in (cg.gradient, cg.hessian, cg.jvp))


def test_deep_graphs_need_no_recursion():
    node = x
    for _ in range(5_000):
        node = cg.sin(node) + y
    graph = cg.Graph([x, y, z], {"f": node})
    found = lint(
        graph, independent=("f", "x"), depends={"f": "x"}, box={"x": (0.0, 1.0)}, at={"x": 0.5, "y": 0.1, "z": 0}
    )
    assert [finding.kind for finding in found.findings] == ["dependence"]
    assert len(str(found.findings[0])) < 10**6
