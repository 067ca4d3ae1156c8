"""Rosenbrock methods: each stage one linear equation with the exact Jacobian, for stiff systems.

(I / (gamma h) - J) U_i = f(t + c_i h, x + sum_j a_ij U_j) + sum_j (C_ij / h) U_j + h d_i df/dt. The last stages start
where the one before arrived, so that the step arrives one U further, and that U is the estimate of its error.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Factor, Map, Solve, Statement

from .elementwise import SAME, identity, weighted
from .explicit import stage_time
from .jacobian_statements import jacobian_statements
from .problem import Problem, state_jacobian, time_derivative
from .step import Step
from .step_control import lost, measured
from .tableau import Row


@dataclass(frozen=True)
class Rosenbrock:
    """The numbers, in the form of the equation above. dense: row k the weights of the U in h_k of the dense output.

    x + s (x_new - x) + s (1 - s) (h_1 + s h_2 + s^2 h_3 ..).
    """

    order: int
    gamma: float
    c: Row
    d: Row
    a: tuple[Row, ...]
    slopes: tuple[Row, ...]  # C
    dense: tuple[Row, ...]


# Steinebach, BIT Numerical Mathematics 63 (2023) 27: order 5, stiffly accurate and L-stable.
RODAS5P = Rosenbrock(
    5,
    gamma=0.21193756319429014,
    c=(0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0),
    d=(0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0, 0, 0),
    a=(
        (),
        (3.0,),
        (2.849394379747939, 0.45842242204463923),
        (-6.954028509809101, 2.489845061869568, -10.358996098473584),
        (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
        (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946),
    ),
    slopes=(
        (),
        (-14.155112264123755,),
        (-17.97296035885952, -2.859693295451294),
        (147.12150275711716, -1.41221402718213, 71.68940251302358),
        (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
        (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
        (
            *(30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623),
            -28.087943162872662,
        ),
        (
            *(37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002),
            *(-54.66780262877968, -9.48861652309627),
        ),
    ),
    dense=(
        (
            *(25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073),
            *(1.1241088310450404, 0.4272876194431874, -0.17202221070155493),
        ),
        (
            *(-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044),
            *(15.98066361424651, -6.789040303419874, -6.710236069923372),
        ),
        (
            *(11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654),
            *(-59.78993625266729, -0.15582684282751913, 4.883087185713722),
        ),
    ),
)


def rosenbrock_step(method: Rosenbrock, problem: Problem) -> Step:
    """The step; where it has derivatives, its Jacobian is written out."""
    m, last, degree = problem.size, f"U{len(method.c) - 1}", len(method.dense) + 1
    now, on_the_way = jacobian_statements(problem)
    both = Graph(cg.variables("error lost"), {"error": cg.variable("error") + cg.variable("lost")})
    names = [("h_", degree - 1), ("dense", degree)]
    return Step(
        {**_lengths(method, problem), **on_the_way, "sum": 1, "lost": 1},
        [_matrix(method.gamma), Factor("matrix", "pivots"), *_stages(method, problem)],
        prepare=[*now, *_time_slope(problem)],
        start=[identity(m)],
        error=[*measured(last, m), lost("matrix", "lost"), Call(both, ("error", "lost"), ("error",))],
        estimate=method.order,
        dense=_dense(method),
        dense_lengths={f"{name}{k + 1}": m for name, count in names for k in range(count)},
        smooth=[Call(state_jacobian(problem), ("x", "t", "p"), ("jacobian",)), *_time_slope(problem)],
    )


def _time_slope(problem: Problem) -> list[Statement]:
    """df/dt, where there is one."""
    return [Call(time_derivative(problem), ("x", "t", "p"), ("time_slope",))] if problem.timed else []


def _stages(method: Rosenbrock, problem: Problem) -> list[Statement]:
    return [statement for k in range(len(method.c)) for statement in _stage(method, problem, k)]


def _lengths(method: Rosenbrock, problem: Problem) -> dict[str, int]:
    m, stages = problem.size, [f"U{k}" for k in range(len(method.c))]
    lengths = dict.fromkeys(("unit", "jacobian", "matrix"), m * m) | dict.fromkeys(("pivots", "at", "rate", *stages), m)
    return lengths | {"time_slope": m if problem.timed else 0, "at_t": 1}


def _matrix(gamma: float) -> Map:
    unit, h, slope = cg.variables("unit h slope")
    return Map(Graph([unit, h, slope], {"w": unit / (gamma * h) - slope}), ("unit", "h", "jacobian"), ("matrix",))


def _stage(method: Rosenbrock, problem: Problem, k: int) -> list[Statement]:
    """Register U{k}; and, with the last, x_new."""
    last = len(method.c) - 1
    body: list[Statement] = []
    if k == 0:
        body.append(Map(SAME, ("x",), ("at",)))
    elif k < len(method.a):
        body.append(_sum("at", "x", method.a[k]))
    else:  # on from where the stage before arrived
        body.append(_sum("at", "at", (*[0.0] * (k - 1), 1.0)))
    body += [stage_time("at_t", method.c[k]), Call(problem.rate, ("at", "at_t", "p"), ("rate",))]
    weights = method.slopes[k]
    used = [j for j, weight in enumerate(weights) if weight]
    rate, h, slope, *nodes = inputs = cg.variables(["rate", "h", "slope", *(f"u{j}" for j in used)])
    right = rate + weighted(nodes, [weights[j] for j in used]) / h if used else rate
    names = ["rate", "h", "time_slope", *(f"U{j}" for j in used)]
    if problem.timed and method.d[k]:
        right = right + method.d[k] * (h * slope)
    else:
        inputs, names = [rate, h, *nodes], [names[0], names[1], *names[3:]]
    body += [Map(Graph(inputs, {"r": right}), tuple(names), (f"U{k}",)), Solve("matrix", "pivots", f"U{k}")]
    if k == last:
        body.append(_sum("x_new", "at", (*[0.0] * k, 1.0)))
    return body


def _sum(target: str, base: str, weights: Row) -> Map:
    """target = base + sum of weight * U."""
    used = [j for j, weight in enumerate(weights) if weight]
    x, *nodes = cg.variables(["x", *(f"u{j}" for j in used)])
    graph = Graph([x, *nodes], {"y": x + weighted(nodes, [weights[j] for j in used])})
    return Map(graph, (base, *[f"U{j}" for j in used]), (target,))


def _dense(method: Rosenbrock) -> list[Statement]:
    """The powers of s in x + s (x_new - x) + s (1 - s) (h_1 + s h_2 + ..)."""
    slopes = tuple([f"U{k}" for k in range(len(method.c))])
    x, x_new, *parts = cg.variables(["x", "x_new", *(f"h_{k + 1}" for k in range(len(method.dense)))])
    powers = [x_new - x + parts[0]]
    powers += [after - before for before, after in itertools.pairwise(parts)]
    powers.append(-parts[-1])
    body: list[Statement] = []
    for k, weights in enumerate(method.dense):
        nodes = cg.variables([f"u{j}" for j in range(len(slopes))])
        body.append(Map(Graph(nodes, {"h": weighted(nodes, weights)}), slopes, (f"h_{k + 1}",)))
    names = ("x", "x_new", *[f"h_{k + 1}" for k in range(len(parts))])
    graph = Graph([x, x_new, *parts], {f"{k}": node for k, node in enumerate(powers)})
    return [*body, Map(graph, names, tuple([f"dense{k + 1}" for k in range(len(powers))]))]
