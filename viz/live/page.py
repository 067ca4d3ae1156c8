"""The panel of a live motion, for any page, and a page of it alone: nothing loaded, no script but its own."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import cgraph as cg
from cgraph import Graph, GraphError
from cgraph.extend import Json, is_finite, real_number, require_graph, require_mapping, require_sequence, require_texts

from .. import theme
from ..pages import html
from ..pages.html import Page, Panel, asset

TIME = "t"  # the input that is the time, if there is one
GROUPS = (
    ("q", "positions"),
    ("qd", "velocities"),
    ("p", "momenta"),
    ("tau", "torques"),
)  # of inputs, by the start of their names
ENERGIES = 3  # the meters that the strip shows
NEEDED = ("rk4", "dopri5")  # the method at first, and that of the reference


@dataclass(frozen=True, eq=False)
class Live:
    """A motion that a page computes as it is watched.

    Parameters
    ----------
    rate : Graph
        The state equation: its first inputs are the state, and output k is the rate of input k.
    start : mapping of str to float
        A value of every input.
    shown : Graph, optional
        Over the same inputs: an output for each meter, and then x and y of each point [m].
    meters : sequence of (str, str, str)
        Name, unit and group of each meter; the first three are kinetic, potential and total energy.
    parents : sequence of int
        Of each point the earlier one that it hangs on, or -1.
    scales : mapping of str to float, optional
        {input: how far its slider reaches to both sides of 0}. Default three times the value, or 1.
    dt : float
        The step at first, short enough that the picture is right [s].
    methods : mapping of str to Tableau
        Methods to choose from, such as `dynamics.integrators.TABLEAUS`; rk4 and dopri5 are needed.
    names, units : mapping of str to str, optional
        {input: what a person calls it} and its unit.

    Raises
    ------
    GraphError
        For a graph that is no state equation, or a `shown` of other inputs.
    ValueError
        For an input without a finite value, a dt that is not positive, or points that do not fit `shown`.

    Examples
    --------
    >>> import cgraph as cg
    >>> from viz.live import Live
    >>> from dynamics.integrators import TABLEAUS
    >>> x, v = cg.variables("x v")
    >>> spring = cg.Graph([x, v], {"x_dot": v, "v_dot": -x})
    >>> energies = cg.Graph([x, v], {"K": v * v / 2, "P": x * x / 2, "E": (v * v + x * x) / 2})
    >>> meters = [(name, "J", "energy") for name in energies.outputs]
    >>> Live(spring, {"x": 1.0, "v": 0.0}, energies, meters, dt=0.01, methods=TABLEAUS).to_dict()["states"]
    2
    """

    rate: Graph
    start: Mapping[str, float]
    shown: Graph
    meters: Sequence[tuple[str, str, str]]
    parents: Sequence[int] = ()
    scales: Mapping[str, float] = field(default_factory=dict)
    dt: float = 1e-3
    methods: Mapping[str, Any] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_graph("Live", self.rate)
        require_graph("Live", self.shown)
        inputs = self.rate.input_names
        if self.shown.input_names != inputs:
            raise GraphError(f"shown must have the inputs of rate, {', '.join(inputs)}; it has others or another order")
        if len(self.rate.outputs) > len(inputs):
            raise GraphError(f"rate must be a state equation: {len(self.rate.outputs)} outputs of {len(inputs)} inputs")
        values = require_mapping("start", self.start, "input: value")
        for name in inputs:
            if name not in values or not is_finite(real_number(f"start of {name}", values[name])):
                raise ValueError(f"start needs a finite value of every input, and has none of {name}")
        if not (real_number("dt", self.dt) > 0.0 and math.isfinite(self.dt)):
            raise ValueError(f"dt must be positive and finite, got {self.dt!r} s")
        if missing := [
            name for name in NEEDED if name not in require_mapping("methods", self.methods, "name: Tableau")
        ]:
            raise ValueError(f"methods must have {missing[0]}, as dynamics.integrators.TABLEAUS has")
        self._check_shown()

    def _check_shown(self) -> None:
        """Raise unless meters and points fit the outputs of `shown`."""
        meters = require_sequence("meters", self.meters, "(name, unit, group)")
        parents = require_sequence("parents", self.parents, "numbers of points")
        if len(meters) < ENERGIES or len(meters) + 2 * len(parents) != len(self.shown.outputs):
            raise ValueError(
                f"shown must have an output for each meter, three energies first, and two for each point: "
                f"{len(meters)} meters, {len(parents)} points, {len(self.shown.outputs)} outputs"
            )
        if any([not -1 <= parent < k for k, parent in enumerate(parents)]):
            raise ValueError(f"parents must be -1 or an earlier point, got {list(parents)}")
        for what in ("names", "units"):
            require_texts(what, getattr(self, what))

    def to_dict(self) -> dict[str, Json]:
        """Data for the script of the page."""
        called = theme.called(self.names)
        return {
            "rate": base64.b64encode(cg.to_wasm(self.rate, self.methods, time=TIME)).decode(),
            "shown": base64.b64encode(cg.to_wasm(self.shown)).decode(),
            "shownCount": len(self.shown.outputs),
            "states": len(self.rate.outputs),
            "time": self.rate.input_names.index(TIME) if TIME in self.rate.input_names else -1,
            "inputs": [self._input(name, called.get(name, name)) for name in self.rate.input_names],
            "meters": [
                {"called": theme.called({"": name})[""], "unit": unit, "group": group}
                for name, unit, group in self.meters
            ],
            "energy": ENERGIES - 1,
            "parents": list(self.parents),
            "methods": list(self.methods),
            "dt": float(self.dt),
        }

    def _input(self, name: str, called: str) -> dict[str, Json]:
        value = float(self.start[name])
        scale = float(self.scales.get(name, 3.0 * abs(value) or 1.0))
        kinds = [group for start, group in GROUPS if name.startswith(start) and name.removeprefix(start).isdecimal()]
        group = (
            kinds[0] if kinds else "state" if name in self.rate.input_names[: len(self.rate.outputs)] else "parameters"
        )
        low = 0.0 if group == "parameters" and value > 0.0 else -scale  # a mass, a length, gravity
        unit = self.units.get(name, "")
        return {"name": name, "called": called, "unit": unit, "value": value, "low": low, "high": scale, "group": group}


SCRIPTS = ("machine.js", "run.js", "course.js", "live.js")
EVALUATION = "'wasm-unsafe-eval'"  # in the policy: WebAssembly may be compiled, text may not


def panel(live: Live) -> Panel:
    """The panel of a live motion, for a page whose style has --text, --back, --soft and --edge.

    The page's scripts need elements.js and address.js.
    """
    colors = {"kinetic": theme.BLUE, "potential": theme.ORANGE, "right": theme.GREEN, "wrong": theme.SPURIOUS}
    variables = ":root{" + "".join(f"--live-{name}:{color};" for name, color in colors.items()) + "}\n"
    dark = f"@media (prefers-color-scheme: dark){{:root{{--live-kinetic:{theme.SKY_BLUE};}}}}\n"
    script = f"{{\n{asset(__package__, *SCRIPTS)}\nstartLive();\n}}"  # in a block it shares no name with a page's
    style = f"{variables}{dark}{asset(__package__, 'live.css')}"
    return Panel(
        asset(__package__, "live.html"), style, run=script, allowed=EVALUATION, data={"live-data": live.to_dict()}
    )


def page_text(live: Live, *, title: str = "A motion, live", about: str = "") -> Page:
    """One page on which a motion is computed as it is watched, with sliders, meters of energy and error, and a link.

    The equations and the steps are a WebAssembly module in the page; nothing is loaded from anywhere, and the policy
    lets no script run but the page's own.

    Parameters
    ----------
    live : Live
        What moves.
    title : str
        Heading of the page.
    about : str
        What to see, a sentence or two.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    TypeError
        For what is no Live, or a title or about that is no text.
    """
    if not isinstance(live, Live):
        raise TypeError(f"page_text needs a Live, got {type(live).__name__}: {live!r:.60}")
    for what, text in (("title", title), ("about", about)):
        if not isinstance(text, str):
            raise TypeError(f"{what} of a page must be text, got {type(text).__name__}: {text!r:.60}")
    shown = panel(live)
    words = f"<p>{escape(about)}</p>\n" if about else ""
    body = f"<main>\n<h1>{escape(title)}</h1>\n{words}{shown.body}</main>"
    script = f'"use strict";\n{asset(html.__package__, "elements.js", "address.js")}\n{shown.run}'
    return html.compose(
        title, body, f"{asset(__package__, 'alone.css')}{shown.style}", script, shown.data, shown.allowed
    )
