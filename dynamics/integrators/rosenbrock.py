"""Rosenbrock methods: each stage one linear equation with the exact Jacobian, for stiff systems.

(I / (gamma h) - J) U_i = f(t + c_i h, x + sum_j a_ij U_j) + sum_j (C_ij / h) U_j + h d_i df/dt. The last stages start
where the one before arrived, so that the step arrives one U further, and that U is the estimate of its error.
"""

from __future__ import annotations

import itertools

from cgraph import Node
from cgraph.extend import Call, Factor, Map, Solve, Statement, added

from .problem import Problem, time_derivative
from .step import Step, Values, combined, each, identity, jacobian_statements, numbered, stage_time, weighted
from .step_control import measured, nonfinite
from .tableau import RowOfWeights

# Rodas5P: Steinebach, BIT Numerical Mathematics 63 (2023) 27, of order 5, stiffly accurate and L-stable. DENSE has the
# weights of the U in h_k of the dense output x + s (x_new - x) + s (1 - s) (h_1 + s h_2 + s^2 h_3).
# fmt: off
GAMMA = 0.21193756319429014
C = (0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0)
D = (0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0, 0, 0)
A: tuple[RowOfWeights, ...] = (
    (),
    (3.0,),
    (2.849394379747939, 0.45842242204463923),
    (-6.954028509809101, 2.489845061869568, -10.358996098473584),
    (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
    (-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946),
)
SLOPES: tuple[RowOfWeights, ...] = (
    (),
    (-14.155112264123755,),
    (-17.97296035885952, -2.859693295451294),
    (147.12150275711716, -1.41221402718213, 71.68940251302358),
    (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471),
    (30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
     -28.087943162872662),
    (37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
     -54.66780262877968, -9.48861652309627),
)
DENSE = (
    (25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
     1.1241088310450404, 0.4272876194431874, -0.17202221070155493),
    (-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
     15.98066361424651, -6.789040303419874, -6.710236069923372),
    (11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
     -59.78993625266729, -0.15582684282751913, 4.883087185713722),
)
# fmt: on


def rodas_step(problem: Problem) -> Step:
    """The step of Rodas5P."""
    m, stages, parts = problem.size, numbered("U", len(C)), numbered("h_", len(DENSE), 1)
    body: list[Statement] = [
        each(lambda unit, h, jacobian: {"matrix": unit / (GAMMA * h) - jacobian}),
        Factor("matrix", "pivots"),
    ]
    for k, stage in enumerate(stages):
        body += [
            _state(A[k]) if k < len(A) else added("at", stages[k - 1], "at"),
            stage_time("at_t", C[k]),
            Call(problem.rate, ("at", "at_t", "p"), ("rate",)),
            _right(problem, k),
            Solve("matrix", "pivots", stage),
        ]
    by_time = [Call(time_derivative(problem), ("x", "t", "p"), ("time_slope",))] if problem.timed else []
    finite = [nonfinite("nonfinite_matrix", "matrix"), added("error", "nonfinite_matrix", "error")]
    return Step(
        body=[*body, added("at", stages[-1], "x_new")],
        prepare=[*jacobian_statements(problem), *by_time],
        start=[identity(m)],
        error=[*measured(stages[-1], m), *finite],
        estimate=5,
        dense=[combined(DENSE, stages, parts), each(_powers, "x", "x_new", *parts)],
    )


def _state(weights: RowOfWeights) -> Map:
    """at = x + sum of weight * U."""
    return each(lambda x, *u: {"at": x + weighted(u, weights) if u else x}, "x", *numbered("U", len(weights)))


def _right(problem: Problem, k: int) -> Map:
    """The right-hand side of stage k, in register U{k}."""

    def right(rate: Node, h: Node, time_slope: Node, *u: Node) -> Values:
        result = rate + weighted(u, SLOPES[k]) / h if u else rate
        return {f"U{k}": result + D[k] * (h * time_slope) if problem.timed and D[k] else result}

    return each(right, "rate", "h", "time_slope", *numbered("U", k))


def _powers(x: Node, x_new: Node, *h: Node) -> Values:
    """The powers of s in x + s (x_new - x) + s (1 - s) (h_1 + s h_2 + ..)."""
    values = [x_new - x + h[0], *[after - before for before, after in itertools.pairwise(h)], -h[-1]]
    return {f"dense{k}": value for k, value in enumerate(values, 1)}
