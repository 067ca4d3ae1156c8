"""The page of run time beside error: plots, tables and words from the plain data of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..plots.direct_labels import Line, Panel, bars, labelled
from ..plots.plot import to_adaptive_svg
from .document import Block, Document, Paragraph, Picture, Section, Table

Content = Mapping[str, Any]  # what `to_dict()` of the report gives, or its JSON file
EQUAL, CHOSEN = "equal steps", "chosen steps"
DRAWN = 3.0  # errors above are no motion of this kind any more
MAKERS = {"scipy:": 1, "heyoka": 2, "CVODES": 3, "MuJoCo": 4}  # a colour for what comes from one maker; ours is 0


def work_precision(content: Content) -> Document:
    """The document of one report."""
    sections = [_fastest(content), _against_time(content), _orders(content)]
    if content["conservative"]:
        sections.append(_energy(content))
    if any(each["seconds"] is not None for each in content["cold"]):
        sections.append(_cold(content))
    sections += [_points(content), _made(content)]
    return Document(f"Error and run time: {content['name']}", _introduction(content), sections)


def _introduction(content: Content) -> list[Block]:
    times = content["times"]
    stiff = "; stiff" if content["stiff"] else ""
    return [
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
        *[Paragraph(f"Left out of the model: {each}.") for each in content["left_out"]],
    ]


def _sized(content: Content) -> str:
    return {"own": "value at that instant", "given": "natural size"}.get(content["relative_to"], "largest value")


def _busy(content: Content) -> str:
    before, after = content["load"]
    if before is None or after is None:
        return ""
    return f"The load of the machine was {before:.1f} before and {after:.1f} after: above its cores, times are noisy."


def _fastest(content: Content) -> Section:
    rows: list[list[str]] = []
    groups = list(dict.fromkeys(each["group"] for each in content["targets"]))
    for error in dict.fromkeys(each["error"] for each in content["targets"]):
        found = {each["group"]: each for each in content["targets"] if each["error"] == error}
        rows.append([_power(error), *[_target(found.get(group)) for group in groups]])
    note = "In brackets: times ours, above 1 where ours is faster. Only knobs that were tried count, see all points."
    if not rows:
        return Section("fastest", "Fastest for an error", [Paragraph("No contender came near the exact motion.")])
    table = Table("The fastest run with an error at the end of at most", ["error", *groups], rows)
    return Section("fastest", "Fastest for an error", [table, Paragraph(note)])


def _target(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return "-"
    ratio = "" if found["group"] == "ours" or found["ratio"] is None else f" [{_digits(found['ratio'])}]"
    name = found["name"].removeprefix("MuJoCo ").removeprefix("scipy:").removeprefix("heyoka ")
    return f"{_time(found['seconds'])} {name}{ratio}"


def _against_time(content: Content) -> Section:
    panels, best = _panels(content, _error, "error at the end")
    caption = "Run time against error at the end: lower and further right is better. The same scales in all panels."
    if best:
        caption += f" Dashed among the others: our {' and '.join(best)}, for comparison."
    return Section("time", "Run time against error", [_picture("time", panels, caption)])


def _picture(name: str, panels: Sequence[Panel], caption: str, shared: bool = True) -> Block:
    """The panels, or words where there is nothing to draw."""
    if not panels:
        return Paragraph("No run gave numbers to draw.")
    return Picture(name, to_adaptive_svg(labelled(panels, shared=shared)), caption)


def _panels(content: Content, x: Any, name: str) -> tuple[list[Panel], list[str]]:
    """Run times against x, which has that name, of ours and the others, of equal and of chosen steps.

    Besides, which of ours stand among the others.
    """
    panels: list[Panel] = []
    shown: list[str] = []
    axes = f"{name} (smaller to the right)", "run time [s]"
    for kind in (EQUAL, CHOSEN):
        of_kind = [each for each in content["curves"] if each["kind"] == kind]
        ours, others = ([each for each in of_kind if each["ours"] is mine] for mine in (True, False))
        if ours:
            panels.append(
                Panel(
                    f"ours, {kind}", *axes, [_line(each, x, _seconds, *_look(k, each)) for k, each in enumerate(ours)]
                )
            )
        if others:
            best = _best(ours, content)
            shown += [each["name"] for each in best]
            drawn = [_line(each, x, _seconds, *_look(k, each)) for k, each in enumerate(others)]
            drawn += [_line(each, x, _seconds, 0, True, "ours: ") for each in best]
            panels.append(Panel(f"others, {kind}", *axes, drawn))
    return [each for each in panels if any(len(line.x) for line in each.lines)], shown


def _maker(name: str) -> int:
    return next((colour for begin, colour in MAKERS.items() if name.startswith(begin)), 4)


def _best(ours: Sequence[Mapping[str, Any]], content: Content) -> list[Mapping[str, Any]]:
    """The one of ours that is fastest at the smallest error that any of them reaches within a factor of a hundred."""
    reached = [(min(p["error"] for p in each["points"]), each) for each in ours if each["points"]]
    if not reached:
        return []
    bound = 100.0 * max(min(error for error, _ in reached), 1e-13)
    times = [
        (min(p["seconds"] for p in each["points"] if p["error"] <= bound), k)
        for k, (error, each) in enumerate(reached)
        if error <= bound
    ]
    return [reached[min(times)[1]][1]]


def _line(curve: Mapping[str, Any], x: Any, y: Any, colour: int, dashed: bool, before: str = "") -> Line:
    kept = [(x(p), y(p)) for p in curve["points"] if x(p) and y(p) and _drawn(p)]
    name = before + curve["name"].removeprefix("MuJoCo ")
    return Line(name, [a for a, _ in kept], [b for _, b in kept], colour, dashed)


def _step(point: Mapping[str, Any]) -> Any:
    return point["step"]


def _knob(point: Mapping[str, Any]) -> Any:
    return point["knob"]


def _error(point: Mapping[str, Any]) -> Any:
    return point["error"]


def _largest(point: Mapping[str, Any]) -> Any:
    return point["largest"]


def _seconds(point: Mapping[str, Any]) -> Any:
    return point["seconds"]


def _drift(point: Mapping[str, Any]) -> Any:
    return point["drift"]


def _look(number: int, curve: Mapping[str, Any]) -> tuple[int, bool]:
    """Colour and dashes of a curve: of ours each has its own, of others each maker."""
    return (number, number >= 5) if curve["ours"] else (_maker(curve["name"]), False)


def _drawn(point: Mapping[str, Any]) -> bool:
    return point["error"] < DRAWN and point["largest"] is not None and point["largest"] < 10.0 * DRAWN


def _orders(content: Content) -> Section:
    panels = []
    for kind in (EQUAL, CHOSEN):
        for mine in (True, False):
            curves = [each for each in content["curves"] if each["kind"] == kind and each["ours"] is mine]
            lines = [
                _line(each, _step if kind == EQUAL else _knob, _largest if kind == EQUAL else _error, *_look(k, each))
                for k, each in enumerate(curves)
            ]
            knobs = sorted({p["knob"] for each in curves for p in each["points"]}, reverse=True)
            if kind == CHOSEN and len(knobs) > 1:
                lines.append(Line("error = tolerance", knobs, knobs, None))
            if any(len(line.x) for line in lines):
                x = f"{'step [s]' if kind == EQUAL else 'relative tolerance'} (smaller to the right)"
                y = "largest error" if kind == EQUAL else "error at the end"
                panels.append(Panel(f"{'ours' if mine else 'others'}, {kind}", x, y, lines))
    rows = [
        [
            each["name"],
            each["kind"],
            "-" if each["order"] is None else str(each["order"]),
            "-" if each["fitted"] is None else f"{each['fitted']:.2f}",
            "ours" if each["model_error"] is None else _power(each["model_error"]),
            each["stopped"],
        ]
        for each in content["curves"]
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


def _energy(content: Content) -> Section:
    panels, _ = _panels(content, _drift, "change of energy")
    caption = "Run time against the largest change of energy over the instants, relative to the largest kinetic energy."
    return Section("energy", "Energy", [_picture("energy", panels, caption)])


def _cold(content: Content) -> Section:
    known = sorted([each for each in content["cold"] if each["seconds"] is not None], key=lambda each: each["seconds"])
    ours = next((each["seconds"] for each in known if each["name"] == "ours"), None)
    svg = to_adaptive_svg(bars([each["name"] for each in known], [each["seconds"] for each in known], "cold start [s]"))
    rows = [
        [
            each["name"],
            each["about"],
            _time(each["seconds"]),
            _time(each["median"]),
            "-" if ours is None else _digits(each["seconds"] / ours),
            _time(each["loading"]),
            str(each["turns"]),
        ]
        for each in known
    ]
    header = ["", "what", "shortest", "median", "times ours", "loading", "turns"]
    words = (
        "From a model to the end of its first run, each in a process of its own that finds nothing compiled: deriving, "
        "compiling and running. Loading the packages is apart."
    )
    failed = [Paragraph(f"{each['name']}: {each['status']}.") for each in content["cold"] if each["status"]]
    picture = Picture("cold", svg, "Cold starts, on a logarithmic scale.")
    return Section("cold", "Cold start", [Paragraph(words), picture, Table("Cold starts", header, rows), *failed])


def _points(content: Content) -> Section:
    blocks: list[Block] = [Paragraph("The same figures are in the CSV and JSON files.")]
    header = ["steps or tolerance", "steps", "rejected", "evaluations", "shortest", "median", "error at the end"]
    header += ["largest error", *(["change of energy"] if content["conservative"] else [])]
    for each in content["curves"]:
        rows = []
        for p in each["points"]:
            knob = str(int(p["knob"])) if each["kind"] == EQUAL else _power(p["knob"])
            counts = ["-" if p[what] is None else str(p[what]) for what in ("steps", "rejected", "evaluations")]
            row = [knob, *counts, _time(p["seconds"]), _time(p["median"]), _power(p["error"]), _power(p["largest"])]
            rows.append([*row, *([_power(p["drift"])] if content["conservative"] else [])])
        blocks.append(Table(f"{each['name']}: {each['about']}", header, rows, folded=True))
    return Section("points", "All points", blocks)


def _made(content: Content) -> Section:
    return Section(
        "absent",
        "What is not there",
        [Table("Contenders without a point", ["contender", "why"], [[*each] for each in content["absent"].items()])]
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
