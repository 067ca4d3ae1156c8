"""The page of run time beside error: plots, tables and words from the plain data of a report."""

from __future__ import annotations

from collections.abc import Sequence

from .. import theme
from ..plots.direct_labels import COLORS, Line, PlotPanel, bars, labeled
from ..plots.plot import to_adaptive_svg
from .document import Block, Document, Paragraph, Picture, ReportData, Section, Table, left_out

EQUAL, CHOSEN = "equal steps", "chosen steps"
DRAWN = 3.0  # errors above are no motion of this kind any more


def work_precision(content: ReportData) -> Document:
    """The document of one report."""
    sections = [_fastest(content), _against_time(content), _orders(content)]
    if content["conservative"]:
        sections.append(_energy(content))
    if any(start["seconds"] is not None for start in content["cold"]):
        sections.append(_cold(content))
    sections += [_points(content), _absent(content)]
    return Document(f"Error and run time: {content['name']}", _introduction(content), sections)


def _introduction(content: ReportData) -> list[Block]:
    times = content["times"]
    stiff = "; stiff" if content["stiff"] else ""
    return [
        *left_out(content["left_out"]),
        Paragraph(
            f"{_sentence(content['about'])} {content['states']} states, to t = {content['t_end']:g} s{stiff}; the "
            f"graph of the rate has {content['nodes']} nodes."
        ),
        Paragraph(
            f"Errors are differences from an exact motion of {len(times)} instants, of each state relative to its "
            f"{_sized(content)}. It was made by: {_sentence(content['reference'])} Its own error is "
            f"{_power(content['reference_error'])}."
        ),
        Paragraph(
            "Times are the shortest of runs that take turns, warm, from the start to the end of the motion: nothing is "
            f"derived or compiled in them. {_sentence(content['machine'])} {_busy(content)}"
        ),
    ]


def _sized(content: ReportData) -> str:
    return {"given": "natural size"}.get(content["relative_to"], "largest value")


def _busy(content: ReportData) -> str:
    before, after = content["load"]
    if before is None or after is None:
        return ""
    return f"The load of the machine was {before:.1f} before and {after:.1f} after: above its cores, times are noisy."


def _fastest(content: ReportData) -> Section:
    rows: list[list[str]] = []
    groups = list(dict.fromkeys(target["group"] for target in content["targets"]))
    for error in dict.fromkeys(target["error"] for target in content["targets"]):
        fastest = {target["group"]: target for target in content["targets"] if target["error"] == error}
        rows.append([_power(error), *[_target(fastest.get(group)) for group in groups]])
    brackets = "In brackets: run time over that of cgraph, above 1 where cgraph is faster. " if len(groups) > 1 else ""
    note = f"{brackets}Only the settings in the table of all points were tried."
    if not rows:
        return Section("fastest", "Fastest for an error", [Paragraph("No contender came near the exact motion.")])
    table = Table("The fastest run with an error at the end of at most", ["error", *groups], rows)
    return Section("fastest", "Fastest for an error", [table, Paragraph(note)])


def _target(target: ReportData | None) -> str:
    if target is None:
        return "-"
    ratio = "" if target["group"] == "ours" or target["ratio"] is None else f" [{_digits(target['ratio'])}]"
    name = target["name"].removeprefix("MuJoCo ").removeprefix("heyoka ")
    return f"{_time(target['seconds'])} {name}{ratio}"


def _against_time(content: ReportData) -> Section:
    panels, best = _panels(content, "error", "error at the end")
    caption = "Run time against error at the end: lower and further right is better. The same scales in all panels."
    if best:
        caption += f" Dashed among the others: our {' and '.join(best)}, for comparison."
    return Section("time", "Run time against error", [_picture("time", panels, caption)])


def _picture(name: str, panels: Sequence[PlotPanel], caption: str, shared: bool = True) -> Block:
    """The panels that have points, or words where there is nothing to draw."""
    drawn = [panel for panel in panels if any(len(line.x) for line in panel.lines)]
    if not drawn:
        return Paragraph("No run gave numbers to draw.")
    return Picture(name, to_adaptive_svg(labeled(drawn, shared=shared)), caption)


def _grouped(content: ReportData) -> dict[tuple[str, bool], list[ReportData]]:
    """{(equal or chosen steps, whether they are ours): curves}."""
    kinds = [(kind, ours) for kind in (EQUAL, CHOSEN) for ours in (True, False)]
    return {each: [curve for curve in content["curves"] if (curve["kind"], curve["ours"]) == each] for each in kinds}


def _panel(kind: str, ours: bool, x: str, y: str, lines: list[Line]) -> PlotPanel:
    return PlotPanel(f"{'ours' if ours else 'others'}, {kind}", f"{x} (smaller to the right)", y, lines)


def _panels(content: ReportData, x: str, name: str) -> tuple[list[PlotPanel], list[str]]:
    """Run times against x, which has that name, of ours and the others, of equal and of chosen steps.

    Besides, which of ours stand among the others.
    """
    panels: list[PlotPanel] = []
    shown: list[str] = []
    groups = _grouped(content)
    for (kind, ours), curves in groups.items():
        lines = [_line(curve, x, "seconds", *_look(curve)) for curve in curves]
        best = [] if ours or not curves else _best(groups[kind, True], content)
        shown += [curve["name"] for curve in best]
        lines += [_line(curve, x, "seconds", _look(curve)[0], True, "ours: ") for curve in best]
        panels.append(_panel(kind, ours, name, "run time [s]", lines))
    return panels, shown


def _best(ours: Sequence[ReportData], content: ReportData) -> list[ReportData]:
    """The one of ours that is fastest at the smallest error that any of them reaches within a factor of a hundred."""
    reached = [(min(point["error"] for point in curve["points"]), curve) for curve in ours if curve["points"]]
    if not reached:
        return []
    bound = 100.0 * max(min(error for error, _ in reached), 1e-13)
    times = [
        (min(point["seconds"] for point in curve["points"] if point["error"] <= bound), k)
        for k, (error, curve) in enumerate(reached)
        if error <= bound
    ]
    return [reached[min(times)[1]][1]]


def _line(curve: ReportData, x: str, y: str, color: int | str, dashed: bool, before: str = "") -> Line:
    """A curve's points in two of their columns, those without a number or far off left out."""
    shown = [(point[x], point[y]) for point in curve["points"] if point[x] and point[y] and _drawn(point)]
    name = before + curve["name"].removeprefix("MuJoCo ")
    return Line(name, [a for a, _ in shown], [b for _, b in shown], color, dashed)


def _look(curve: ReportData) -> tuple[int | str, bool]:
    """Color and dashes of a curve, the same on every page: one for every method of ours, and every maker of others."""
    if not curve["ours"]:
        color = [color for begin, color in theme.MAKERS.items() if curve["name"].startswith(begin)]
        return next(iter(color), theme.GRAY), False
    name = curve["name"].partition(" ")[0]
    number = theme.METHODS.index(name) if name in theme.METHODS else len(theme.METHODS)
    return number, number >= len(COLORS)


def _drawn(point: ReportData) -> bool:
    return point["error"] < DRAWN and point["largest"] is not None and point["largest"] < 10.0 * DRAWN


def _orders(content: ReportData) -> Section:
    panels = []
    for (kind, ours), curves in _grouped(content).items():
        equal = kind == EQUAL
        columns = ("step", "largest") if equal else ("knob", "error")
        axes = ("step [s]", "largest error") if equal else ("relative tolerance", "error at the end")
        lines = [_line(curve, *columns, *_look(curve)) for curve in curves]
        knobs = sorted({point["knob"] for curve in curves for point in curve["points"]}, reverse=True)
        if not equal and len(knobs) > 1:
            lines.append(Line("error = tolerance", knobs, knobs, None))
        panels.append(_panel(kind, ours, *axes, lines))
    rows = [
        [
            curve["name"],
            curve["kind"],
            "-" if curve["order"] is None else str(curve["order"]),
            "-" if curve["fitted"] is None else f"{curve['fitted']:.2f}",
            "ours" if curve["model_error"] is None else _power(curve["model_error"]),
            curve["stopped"],
        ]
        for curve in content["curves"]
    ]
    header = ["integrator", "steps", "declared order", "fitted", "difference of rates", "no finer because of"]
    words = (
        "The fitted order of equal steps is the slope of the largest error over the three finest steps above rounding. "
        "Of chosen steps it is the slope of the error at the end over the mean step, which the choice of steps blurs. "
        "The difference of rates is the model's own error: the largest difference of the contender's rates from ours "
        "along the exact motion, relative to the largest rate of the same state. An integrator cannot come nearer to "
        "the exact motion than that allows."
    )
    return Section(
        "orders",
        "Error against step and tolerance",
        [
            _picture("orders", panels, "Error against step, and against tolerance: smaller is right and down.", False),
            Table("Orders, and the error of the model apart from that of the integrator", header, rows),
            Paragraph(words),
        ],
    )


def _energy(content: ReportData) -> Section:
    panels, _ = _panels(content, "drift", "change of energy")
    caption = "Run time against the largest change of energy over the instants, relative to the largest kinetic energy."
    return Section("energy", "Energy", [_picture("energy", panels, caption)])


def _cold(content: ReportData) -> Section:
    known = sorted(
        [start for start in content["cold"] if start["seconds"] is not None], key=lambda start: start["seconds"]
    )
    ours = next((start["seconds"] for start in known if start["name"] == "ours"), None)
    svg = to_adaptive_svg(
        bars([start["name"] for start in known], [start["seconds"] for start in known], "cold start [s]")
    )
    rows = [
        [
            start["name"],
            start["about"],
            _time(start["seconds"]),
            _time(start["median"]),
            "-" if ours is None else _digits(start["seconds"] / ours),
            _time(start["loading"]),
            str(start["turns"]),
        ]
        for start in known
    ]
    header = ["", "what", "shortest", "median", "times ours", "loading", "turns"]
    words = (
        "From a model to the end of its first run, each in a process of its own that finds nothing compiled: deriving, "
        "compiling and running. Loading the packages is apart."
    )
    failed = [Paragraph(f"{start['name']}: {start['status']}.") for start in content["cold"] if start["status"]]
    picture = Picture("cold", svg, "Cold starts, on a logarithmic scale.")
    return Section("cold", "Cold start", [Paragraph(words), picture, Table("Cold starts", header, rows), *failed])


def _points(content: ReportData) -> Section:
    blocks: list[Block] = [Paragraph("The same figures are in the CSV and JSON files.")]
    header = ["steps or tolerance", "steps", "rejected", "evaluations", "shortest", "median", "error at the end"]
    header += ["largest error", *(["change of energy"] if content["conservative"] else [])]
    for curve in content["curves"]:
        rows = []
        for point in curve["points"]:
            knob = str(int(point["knob"])) if curve["kind"] == EQUAL else _power(point["knob"])
            counts = ["-" if point[what] is None else str(point[what]) for what in ("steps", "rejected", "evaluations")]
            row = [
                knob,
                *counts,
                _time(point["seconds"]),
                _time(point["median"]),
                _power(point["error"]),
                _power(point["largest"]),
            ]
            rows.append([*row, *([_power(point["drift"])] if content["conservative"] else [])])
        blocks.append(Table(f"{curve['name']}: {curve['about']}", header, rows, folded=True))
    return Section("points", "All points", blocks)


def _absent(content: ReportData) -> Section:
    return Section(
        "absent",
        "What is not there",
        [
            Table(
                "Contenders without a point",
                ["contender", "why"],
                [[name, why] for name, why in content["absent"].items()],
            )
        ]
        if content["absent"]
        else [Paragraph("Every contender that was asked has points.")],
    )


def _sentence(text: str) -> str:
    text = " ".join(text.split())
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}"


def _power(value: float | None) -> str:
    """Two digits and a power of ten."""
    return "-" if value is None else "0" if value == 0.0 else f"{value:.1e}".replace("e-0", "e-").replace("e+0", "e")


def _time(seconds: float | None) -> str:
    """Three digits and the unit that suits."""
    if seconds is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"


def _digits(ratio: float) -> str:
    return f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"
