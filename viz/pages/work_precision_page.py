"""The page of run time beside error: plots, tables and words from the plain data of a report."""

from collections.abc import Sequence

from .. import theme
from ..plots.direct_labels import COLORS, Line, PlotPanel, labeled
from ..plots.plot import to_adaptive_svg
from .document import Block, Document, Paragraph, Picture, ReportData, Section, Table, left_out

EQUAL, CHOSEN = "equal steps", "chosen steps"
RIGHT = "(smaller to the right)"
DRAWN = 3.0  # errors above are no motion of this kind any more


def work_precision(content: ReportData) -> Document:
    """The document of one report."""
    time = "Run time against error at the end: lower and further right is better. The same scales in all panels."
    drift = "Run time against the largest change of energy over the instants, relative to the largest kinetic energy."
    sections = [
        _fastest(content),
        _times(content, "time", "Run time against error", "error", "error at the end", time),
        _orders(content),
    ]
    if content["conservative"]:
        sections.append(_times(content, "energy", "Energy", "drift", "change of energy", drift))
    sections += [_points(content), _absent(content)]
    return Document(f"Error and run time: {content['name']}", _introduction(content), sections)


def _introduction(content: ReportData) -> list[Block]:
    times = content["times"]
    size = "natural size" if content["relative_to"] == "given" else "largest value"
    noisy = "The load of the machine was {:.1f} before and {:.1f} after: above its cores, times are noisy."
    busy = "" if None in content["load"] else noisy.format(*content["load"])
    stiff = "; stiff" if content["stiff"] else ""
    return [
        *left_out(content["left_out"]),
        Paragraph(
            f"{_sentence(content['about'])} {content['states']} states, to t = {content['t_end']:g} s{stiff}; the "
            f"graph of the rate has {content['nodes']} nodes."
        ),
        Paragraph(
            f"Errors are differences from an exact motion of {len(times)} instants, of each state relative to its "
            f"{size}. It was made by: {_sentence(content['reference'])} Its own error is "
            f"{_power(content['reference_error'])}."
        ),
        Paragraph(
            "Times are the shortest of runs that take turns, warm, from the start to the end of the motion: nothing is "
            f"derived or compiled in them. {_sentence(content['machine'])} {busy}"
        ),
    ]


def _fastest(content: ReportData) -> Section:
    rows = [[_power(each["error"]), _time(each["seconds"]), each["name"]] for each in content["targets"]]
    if not rows:
        return Section("fastest", "Fastest for an error", [Paragraph("No method came near the exact motion.")])
    table = Table("The fastest run with an error at the end of at most", ["error", "run time", "method"], rows)
    note = Paragraph("Only the settings in the table of all points were tried.")
    return Section("fastest", "Fastest for an error", [table, note])


def _times(content: ReportData, anchor: str, heading: str, x: str, axis: str, caption: str) -> Section:
    """Run times against the column x, of equal and of chosen steps."""
    panels = [
        PlotPanel(kind, f"{axis} {RIGHT}", "run time [s]", [_line(curve, x, "seconds") for curve in curves])
        for kind, curves in _of_kind(content).items()
    ]
    return Section(anchor, heading, [_picture(anchor, panels, caption)])


def _picture(name: str, panels: Sequence[PlotPanel], caption: str, shared: bool = True) -> Block:
    """The panels that have points, or words where there is nothing to draw."""
    drawn = [panel for panel in panels if any(len(line.x) for line in panel.lines)]
    if not drawn:
        return Paragraph("No run gave numbers to draw.")
    return Picture(name, to_adaptive_svg(labeled(drawn, shared=shared)), caption)


def _of_kind(content: ReportData) -> dict[str, list[ReportData]]:
    """{equal or chosen steps: curves}."""
    return {kind: [curve for curve in content["curves"] if curve["kind"] == kind] for kind in (EQUAL, CHOSEN)}


def _line(curve: ReportData, x: str, y: str) -> Line:
    """A curve's points in two of their columns, those without a number or far off left out."""
    shown = [(point[x], point[y]) for point in curve["points"] if point[x] and point[y] and _drawn(point)]
    color = theme.METHODS.index(curve["name"])  # the same on every page
    return Line(curve["name"], [a for a, _ in shown], [b for _, b in shown], color, color >= len(COLORS))


def _drawn(point: ReportData) -> bool:
    return point["error"] < DRAWN and point["largest"] is not None and point["largest"] < 10.0 * DRAWN


def _orders(content: ReportData) -> Section:
    panels = []
    for kind, curves in _of_kind(content).items():
        equal = kind == EQUAL
        columns = ("step", "largest") if equal else ("knob", "error")
        x, y = ("step [s]", "largest error") if equal else ("relative tolerance", "error at the end")
        lines = [_line(curve, *columns) for curve in curves]
        knobs = sorted({point["knob"] for curve in curves for point in curve["points"]}, reverse=True)
        if not equal and len(knobs) > 1:
            lines.append(Line("error = tolerance", knobs, knobs, None))
        panels.append(PlotPanel(kind, f"{x} {RIGHT}", y, lines))
    rows = [
        [
            curve["name"],
            curve["kind"],
            "-" if curve["order"] is None else str(curve["order"]),
            "-" if curve["fitted"] is None else f"{curve['fitted']:.2f}",
            curve["stopped"],
        ]
        for curve in content["curves"]
    ]
    header = ["integrator", "steps", "declared order", "fitted", "no finer because of"]
    words = (
        "The fitted order of equal steps is the slope of the largest error over the three finest steps above rounding. "
        "Of chosen steps it is the slope of the error at the end over the mean step, which the choice of steps blurs."
    )
    return Section(
        "orders",
        "Error against step and tolerance",
        [
            _picture("orders", panels, "Error against step, and against tolerance: smaller is right and down.", False),
            Table("Orders", header, rows),
            Paragraph(words),
        ],
    )


def _points(content: ReportData) -> Section:
    blocks: list[Block] = [Paragraph("The same figures are in the CSV and JSON files.")]
    header = ["steps or tolerance", "steps", "rejected", "evaluations", "shortest", "median", "error at the end"]
    header += ["largest error", *["change of energy"] * content["conservative"]]
    errors = ("error", "largest", *["drift"] * content["conservative"])
    for curve in content["curves"]:
        rows = []
        for point in curve["points"]:
            knob = str(int(point["knob"])) if curve["kind"] == EQUAL else _power(point["knob"])
            counts = ["-" if point[what] is None else str(point[what]) for what in ("steps", "rejected", "evaluations")]
            times = [_time(point["seconds"]), _time(point["median"])]
            rows.append([knob, *counts, *times, *[_power(point[what]) for what in errors]])
        blocks.append(Table(curve["name"], header, rows, folded=True))
    return Section("points", "All points", blocks)


def _absent(content: ReportData) -> Section:
    rows = [[name, why] for name, why in content["absent"].items()]
    table = Table("Methods without a point", ["method", "why"], rows)
    block: Block = table if rows else Paragraph("Every method that was asked has points.")
    return Section("absent", "What is not there", [block])


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
