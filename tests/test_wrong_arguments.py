"""Every public function, given what makes no sense, says in a sentence what it needs."""

import inspect

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from viz.graph_drawing.render import RenderError

ARM = dyn.planar_arm([1.0], [1.0])
X = cg.variable("x")
JUNK = {
    "None": None,
    "3": 3,
    "text": "a",
    "[]": [],
    "object": object(),
    "mechanism": ARM,
    "class": dyn.System,
    "NaN": float("nan"),
    "node": X,
}
MODULES = {"cgraph": cg, "dynamics": dyn, "viz": viz}
# clear_cache empties the user's; certifying an arm is meant and takes seconds.
LEFT_OUT = {("cgraph", "clear_cache"), ("dynamics", "certify"), ("dynamics", "RecursiveInverseDynamics")}
PYTHON_S_OWN = (
    "object has no",
    "is not iterable",
    "not supported between",
    "is not subscriptable",
    "positional argument",
)


def functions():
    for where, module in MODULES.items():
        for name in module.__all__:
            function = getattr(module, name)
            error = isinstance(function, type) and issubclass(function, Exception)
            if callable(function) and not error and (where, name) not in LEFT_OUT:
                yield pytest.param(function, id=f"{where}.{name}")


def said(function, *args, **named):
    """What a call says against its arguments; None where it takes them."""
    try:
        function(*args, **named)
    except (TypeError, ValueError, RenderError) as error:  # anything else is no answer to a wrong argument
        return str(error)
    return None


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("function", list(functions()))
def test_a_wrong_first_argument_is_told_in_a_sentence(function):
    kinds = (
        inspect.Parameter.POSITIONAL_ONLY,
        inspect.Parameter.POSITIONAL_OR_KEYWORD,
        inspect.Parameter.VAR_POSITIONAL,
    )
    places = [each for each in inspect.signature(function).parameters.values() if each.kind in kinds]
    required = [each for each in places if each.default is each.empty]
    for name, junk in JUNK.items():
        message = said(function, *[junk] * (max(1, len(required)) if places else 0))
        if message is not None:
            assert len(message.split()) > 3, (name, message)
            assert not any(words in message for words in PYTHON_S_OWN), (name, message)


GRAPH_FIRST = [
    (cg.compile, ()),
    (cg.compare, (None,)),
    (cg.double_double, ()),
    (cg.gradient, ()),
    (cg.hessian, ()),
    (cg.hessian_solve, ([], [])),
    (cg.jacobian, ()),
    (cg.jvp, ()),
    (cg.lint, ()),
    (cg.loop, ({},)),
    (cg.simplify, ()),
    (cg.specialize, ({},)),
    (cg.structure_hash, ()),
    (cg.to_c, ()),
    (cg.vjp, ()),
    (cg.why, ("y", "x")),
    (cg.why_not, ("y", "x")),
    (dyn.spurious_nodes, ()),
    (viz.graph_svg, ()),
    (viz.page, ()),
    (viz.to_dot, ()),
]


@pytest.mark.parametrize(("function", "more"), GRAPH_FIRST)
def test_what_needs_a_graph_says_so_and_where_a_model_has_one(function, more):
    for junk in JUNK.values():
        if function is viz.page and junk == []:
            continue  # no version
        assert f"{function.__name__} needs a cg.Graph, got {type(junk).__name__}" in said(function, junk, *more)
    assert said(function, ARM, *more).endswith("forward_dynamics(model) of the package dynamics is one")
    assert said(function, X, *more).endswith("write cg.Graph(inputs, {name: node})")


GRAPH = cg.Graph([X], {"y": cg.sin(X)})
SCENE = (ARM, (0.0,), (0.0,), 1.0)
CASES = {
    "values no mapping": (lambda: GRAPH.evaluate([1.0]), "evaluate takes a mapping"),
    "wrt empty": (lambda: cg.gradient(GRAPH, wrt=[]), "wrt must name at least one input"),
    "wrt a number": (lambda: cg.jvp(GRAPH, wrt=3), "wrt must name inputs"),
    "a chain too long": (lambda: dyn.scenes.load("chain", n=10**12), "more than can be derived"),
    "half a link": (lambda: dyn.scenes.load("chain", n=2.5), "at least one link, got 2.5"),
    "kind of a joint": (lambda: dyn.Joint("screw"), "must be one of fixed, prismatic, revolute, got 'screw'"),
    "start too long": (lambda: dyn.scenes.Scene("s", "", ARM, (0.0, 0.0), (0.0,), 1.0), "q needs 1 finite numbers"),
    "start of text": (lambda: dyn.scenes.Scene("s", "", ARM, ("a",), (0.0,), 1.0), "q"),
    "time backwards": (lambda: dyn.scenes.Scene("s", "", ARM, (0.0,), (0.0,), -1.0), "t_end must be positive"),
    "scene of nothing": (lambda: dyn.scenes.Scene("s", "", None, (0.0,), (0.0,), 1.0), "needs a model, got NoneType"),
    "states of text": (lambda: dyn.certify(ARM, states="a"), "states must be"),
    "a class for a model": (lambda: dyn.certify(dyn.System), "got the class System"),
    "a class to be solved": (lambda: dyn.inverse_dynamics(dyn.System), "got the class System"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_value_is_told(case):
    call, words = CASES[case]
    assert words in said(call)
