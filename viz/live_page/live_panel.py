"""The panel of a live motion, for any page, and a page of it alone: nothing loaded, no script but its own."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Json

from .. import theme
from ..pages import html
from ..pages.html import Page, Panel, asset
from ..pages.operations import expression

TIME = "t"  # the input that is the time, if there is one
GROUPS = {"q": "positions", "qd": "velocities", "p": "momenta", "tau": "torques"}  # of inputs: their letters
ENERGY, ENERGIES = "energy", 3  # the group of the meters that the strip shows, and how many these are


@dataclass(frozen=True, eq=False)
class Live:
    """A motion that a page computes as it is watched.

    rate: the state equation, whose first inputs are the state.  start: {input: value}.  dt: the first step [s].
    methods: as `dynamics.integrators.TABLEAUS`.  shown: outputs for each meter, then x and y of each point [m].
    meters: (name, unit, group), first kinetic, potential and total energy.  notes: {group of meters: a sentence}.
    radii: of spheres of contacts.  parents: of each point the one that it hangs on, or -1.
    scales: {input: reach of its slider}, by default three times the value, or 1.  limits: {input: (lower, upper)}.
    names, units: {input: what a person calls it, and its unit}.
    Raises ValueError for an input without a finite value.
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
    notes: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    radii: Sequence[float] = ()

    def __post_init__(self) -> None:
        for name in self.rate.input_names:
            if not math.isfinite(self.start[name]):
                raise ValueError(f"start needs a finite value of every input, and has none of {name}")

    def to_dict(self) -> dict[str, Json]:
        """Data for the script of the page."""
        return {
            "shownCount": len(self.shown.outputs),
            "states": len(self.rate.outputs),
            "time": self.rate.input_names.index(TIME) if TIME in self.rate.input_names else -1,
            "inputs": [self._input(name) for name in self.rate.input_names],
            "meters": [{"called": name, "unit": unit, "group": group} for name, unit, group in self.meters],
            "energy": ENERGIES - 1 if any(group == ENERGY for _, _, group in self.meters) else -1,
            "notes": dict(self.notes),
            "parents": list(self.parents),
            "radii": list(self.radii),
            "methods": list(self.methods),
            "dt": float(self.dt),
        }

    def _input(self, name: str) -> dict[str, Json]:
        value = float(self.start[name])
        scale = float(self.scales.get(name, 3.0 * abs(value) or 1.0))
        kind = GROUPS.get(name.rstrip("0123456789")) if name[-1:].isdecimal() else None
        other = "state" if name in self.rate.input_names[: len(self.rate.outputs)] else "parameters"
        group = kind or other
        low = 0.0 if group == "parameters" and value > 0.0 else -scale  # a mass, a length, gravity
        lower, upper = self.limits.get(name, (-math.inf, math.inf))
        low = min(lower, value) if math.isfinite(lower) else min(low, upper - scale)
        high = max(upper, value) if math.isfinite(upper) else max(scale, low + scale)
        if not low < high:
            low, high = value - scale, value + scale
        called, unit = self.names.get(name, name), self.units.get(name, "")
        return {"name": name, "called": called, "unit": unit, "value": value, "low": low, "high": high, "group": group}


SCRIPTS = ("machine.js", "run.js", "course.js", "live.js")


def panel(live: Live, begin: str = "startLive();") -> Panel:
    """The panel of a live motion, for a page whose style has --text, --back, --soft and --edge.

    The page's scripts need elements.js, address.js and, of contacts, surfaces.js.
    begin: JavaScript that begins it, or says when to.
    """
    colors = {"kinetic": theme.BLUE, "potential": theme.ORANGE, "right": theme.GREEN, "wrong": theme.SPURIOUS}
    variables = ":root{" + "".join(f"--live-{name}:{color};" for name, color in colors.items()) + "}\n"
    dark = f"@media (prefers-color-scheme: dark){{:root{{--live-kinetic:{theme.SKY_BLUE};}}}}\n"
    run = f"{functions(live)}{asset(__package__, *SCRIPTS)}\n{begin}"
    script = f"{{\n{run}\n}}"  # in a block it shares no name with a page's
    style = f"{variables}{dark}{asset(__package__, 'live.css')}"
    return Panel(asset(__package__, "live.html"), style, run=script, data={"live-data": live.to_dict()})


def functions(live: Live) -> str:
    """The constant LIVE of a script: `rate` and `shown`, as modules of `cg.to_js`."""
    rate, shown = cg.to_js(live.rate, live.methods, time=TIME), cg.to_js(live.shown)
    return f"const LIVE = {{\nrate: {expression(rate)},\nshown: {expression(shown)},\n}};\n"


def page_text(live: Live, title: str, about: str = "") -> Page:
    """One page on which a motion is computed as it is watched.

    title: its heading.  about: what to see, a sentence or two.
    """
    shown = panel(live)
    words = f"<p>{escape(about)}</p>\n" if about else ""
    body = f"<main>\n<h1>{escape(title)}</h1>\n{words}{shown.body}</main>"
    touching = len(live.shown.outputs) > len(live.meters) + 2 * len(live.parents)
    shared = asset(html.__package__, "elements.js", "address.js", *["surfaces.js"] * touching)
    script = f'"use strict";\n{shared}\n{shown.run}'
    return html.compose(title, body, f"{asset(__package__, 'alone.css')}{shown.style}", script, shown.data)
