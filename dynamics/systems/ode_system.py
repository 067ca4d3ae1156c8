"""First-order systems: any state equation xdot = f(x, t) and its parameters, as nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import cgraph as cg
from cgraph import Graph, Node, _shared
from cgraph._shared import HoldsNodes
from cgraph.extend import topological

from .arguments import TIME, Parameters, call_user_function, names_of, one_for_each, parameters_of, require_known

RESERVED = (TIME, "dt")


class OdeSystem(HoldsNodes):
    """A system of first-order differential equations, xdot = rate(x, t).

    Parameters
    ----------
    rate : callable
        (x, t) or (x, t, p) to one rate for each state, node or number, in the state's unit per second.
        x: list of n nodes in the order of `states`; t: a node; p: {parameter name: node}.
    states : sequence of str
        The names of the n states, or one string with spaces between them; they are the inputs of the graphs.
    parameters : mapping of str to float
        Each is an input of the graphs, and `simulate` binds it to the value.

    Raises
    ------
    TypeError, ValueError
        Say what was given and what was needed.

    Examples
    --------
    >>> import dynamics as dyn
    >>> decay = dyn.OdeSystem(lambda x, t, p: [-p["k"] * x[0]], ["x"], {"k": 0.5})
    >>> dyn.simulate(decay, [1.0], None, t_end=2.0, method="dopri5").q[-1].round(6)
    array([0.367879])
    """

    velocities: tuple[str, ...] = ()  # the rates of states are no states, see `Model`
    system = mechanism = None  # neither a Lagrangian nor bodies

    def __init__(
        self,
        rate: Callable[..., Sequence[Node | float]],
        states: Sequence[str],
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        self.coordinates = self.states = names_of("a system", "state", states, spaces=False)
        self.n = len(self.states)  # number of states
        if named := [name for name in RESERVED if name in self.states]:
            raise ValueError(f"a state cannot be called {named[0]!r}, which is the name of time; choose another")
        self.parameters = parameters_of(parameters)
        if shared := [name for name in self.states if name in self.parameters]:
            raise ValueError(f"{shared[0]!r} is both a state and a parameter; choose another name for one of them")
        p = Parameters(self.parameters)
        given = call_user_function("rate", rate, self.x, self.t, p)
        self.rates = tuple(one_for_each("rate", given, self.states, "the rate of"))
        names = ", ".join((*self.states, *self.parameters))
        known = {*self.x, self.t, *p.values()}
        require_known("the rate", self.rates, known, f"no state, parameter or t (it has {names})")

    @property
    def ode(self) -> OdeSystem:
        """The system itself, as a `Model` has it."""
        return self

    @cached_property
    def x(self) -> list[Node]:
        """The states, variables of their names."""
        return cg.variables(list(self.states))

    @cached_property
    def t(self) -> Node:
        """Time."""
        return cg.variable(TIME)

    @cached_property
    def extra_inputs(self) -> list[Node]:
        """Inputs that the graph has after the states: t if a rate depends on it, and the parameters."""
        time = [self.t] if self.t in topological(self.rates) else []
        return [*time, *cg.variables(list(self.parameters))]

    @cached_property
    def graph(self) -> Graph:
        """The state equation as written: inputs the states, t if needed, parameters; outputs `<state>_dot`."""
        outputs = {f"{name}_dot": rate for name, rate in zip(self.states, self.rates, strict=True)}
        return Graph([*self.x, *self.extra_inputs], outputs)

    def _repr_html_(self) -> str | None:
        """The equations that a notebook shows as formulas, when a drawing package is installed (extra `viz`)."""
        return _shared.render_html("model", self)

    def __repr__(self) -> str:
        parameters = f", parameters {', '.join(self.parameters)}" if self.parameters else ""
        return f"<OdeSystem of {self.n} state(s) {', '.join(self.states[:6])}{parameters}>"
