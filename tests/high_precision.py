"""An independent evaluator: values and derivatives of a graph in mpmath, by operation name."""

from collections.abc import Callable, Mapping, Sequence

import mpmath
from mpmath import mp, mpf

import cgraph as cg
from cgraph._shared import columns
from cgraph.extend import OPS

DIGITS = 50
Number = float | mpf

# Of an operation that is neither an operator nor here: mpmath's function of its name, else the row's own.
_WRITTEN: dict[str, Callable[..., mpf]] = {
    "abs": lambda a: -a if a < 0 else a,
    "minimum": lambda a, b: min(a, b),
    "maximum": lambda a, b: max(a, b),
    "less": lambda a, b: mpf(a < b),
    "less_equal": lambda a, b: mpf(a <= b),
    "equal": lambda a, b: mpf(a == b),
    "not_equal": lambda a, b: mpf(a != b),
    "where": lambda c, a, b: a if c != 0 else b,
    "cbrt": lambda a: mpmath.sign(a) * mpmath.cbrt(abs(a)),  # mpmath's is the complex one
    "round": mpmath.nint,
    "fmod": lambda a, b: mpmath.sign(a) * mpmath.fmod(abs(a), abs(b)),  # mpmath's has the sign of b
    "logistic": lambda a: 1 / (1 + mpmath.exp(-a)),
    "log2": lambda a: mpmath.log(a, 2),
    "exp2": lambda a: mpf(2) ** a,
    "zero_safe_mul": lambda a, b: a * b,  # the zero rule matters for infinities only, which have no place here
}
OPERATIONS: dict[str, Callable[..., mpf]] = {
    op.name: op.operator or _WRITTEN.get(op.name) or getattr(mpmath, op.name, op.precise) for op in OPS.values()
}

# An argument in which the function is a step, so that a derivative in it means nothing: the condition of `where`.
STEPS = {(op.name, 0) for op in OPS.values() if op.piece is not None and op.arity == 3}


def node_values(graph: cg.Graph, values: Mapping[str, Number], digits: int = DIGITS) -> dict[cg.Node, mpf]:
    """The value of every node of the graph, at the given inputs, to so many digits."""
    env: dict[cg.Node, mpf] = {}
    with mp.workdps(digits):
        for node in graph.nodes:
            if node.op.name == "variable":
                env[node] = mpf(values[str(node.name)])
            elif node.op.name == "constant":
                env[node] = mpf(node.value)
            else:
                env[node] = OPERATIONS[node.op.name](*(env[arg] for arg in node.args))
    return env


def evaluate(graph: cg.Graph, values: Mapping[str, Number], digits: int = DIGITS) -> dict[str, mpf]:
    env = node_values(graph, values, digits)
    return {name: env[node] for name, node in graph.outputs.items()}


def kink_distance(graph: cg.Graph, values: Mapping[str, Number]) -> float:
    """How far the nearest jump or kink is; a derivative, or a comparison after rounding, means nothing on it.

    A node compared with itself and operations on constants alone stay where they are, and do not count.
    """
    env = node_values(graph, values)
    jumps = [
        columns(node.op).jumps(*[env[arg] for arg in node.args])
        for node in graph.nodes
        if columns(node.op).jumps is not None and any(arg.op.name != "constant" for arg in node.args)
    ]
    distances = [abs(each - mpmath.nint(each)) for each in jumps]
    distances += [
        abs(env[node.args[0]] - (env[node.args[1]] if node.op.arity == 2 else 0))
        for node in graph.nodes
        if columns(node.op).piece is not None
        and node.op.arity < 3  # the condition of `where` is a comparison, which counts itself
        and len(set(node.args)) == node.op.arity
        and any(arg.op.name != "constant" for arg in node.args)
    ]
    return float(min(distances, default=mpf(1)))


def partial(function: Callable[..., mpf], point: Sequence[Number], orders: Sequence[int]) -> mpf:
    """The partial derivative of these orders in each argument, by mpmath.diff at 50 digits."""
    with mp.workdps(DIGITS):
        return mpmath.diff(function, tuple(map(mpf, point)), tuple(orders))


def directional(graph: cg.Graph, values: Mapping[str, Number], direction: Mapping[str, Number]) -> dict[str, mpf]:
    """The derivative of every output along a direction: a central difference with step 1e-20, error about 1e-40."""
    with mp.workdps(80):
        h = mpf(10) ** -20
        ahead, behind = (
            evaluate(graph, {k: mpf(x) + sign * h * mpf(direction.get(k, 0)) for k, x in values.items()}, 80)
            for sign in (1, -1)
        )
        return {name: (ahead[name] - behind[name]) / (2 * h) for name in ahead}


def _sensitivities(graph: cg.Graph, env: Mapping[cg.Node, mpf]) -> dict[cg.Node, list[mpf]]:
    """|d node / d argument| for every argument of every node, by central differences."""
    with mp.workdps(DIGITS):
        h = mpf(10) ** -20
        result = {}
        for node in graph.nodes:
            point = [env[arg] for arg in node.args]
            function = OPERATIONS.get(node.op.name)
            result[node] = [
                abs(function(*_moved(point, i, h)) - function(*_moved(point, i, -h))) / (2 * h)
                if (node.op.name, i) not in STEPS
                else mpf(0)
                for i in range(len(point))
            ]
        return result


def _moved(point: Sequence[mpf], i: int, h: mpf) -> list[mpf]:
    return [x + h if j == i else x for j, x in enumerate(point)]


def path_size(graph: cg.Graph, values: Mapping[str, Number], direction: Mapping[str, Number]) -> dict[str, float]:
    """For each output, the sum over paths from the inputs of |product of partials| |direction|.

    What a directional derivative would be without cancellation: the scale of its rounding errors.
    """
    env = node_values(graph, values)
    sizes: dict[cg.Node, mpf] = {}
    for node, partials in _sensitivities(graph, env).items():
        if node.args:
            sizes[node] = mpmath.fsum(p * sizes[arg] for p, arg in zip(partials, node.args, strict=True))
        else:
            sizes[node] = mpf(abs(direction.get(str(node.name), 0.0)))
    return {name: float(sizes[node]) for name, node in graph.outputs.items()}


def rounding_size(graph: cg.Graph, values: Mapping[str, Number]) -> dict[str, float]:
    """For each output, the sum over nodes of |d output / d node| |node|, paths taken in absolute value.

    A running error bound: evaluating with relative error e in each operation moves the output by at most about
    e times this.
    """
    env = node_values(graph, values)
    sizes: dict[cg.Node, mpf] = {}
    for node, partials in _sensitivities(graph, env).items():
        carried = mpmath.fsum(p * sizes[arg] for p, arg in zip(partials, node.args, strict=True))
        sizes[node] = carried + abs(env[node])
    return {name: float(sizes[node]) for name, node in graph.outputs.items()}
