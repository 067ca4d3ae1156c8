"""The page of the stability table: verdicts, figures beside bounds, and reasons, from the plain data of a report."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .. import theme
from ..plots.plot import empty_figure, style, to_adaptive_svg
from .document import Block, Document, Paragraph, Picture, ReportData, Section, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FROM, TO = 1e-12, 1e13  # shares of a bound that are drawn; what is outside is drawn at the border
SHARES = "Figures over their bounds: to the right of the line, a bound is not met."
WIDTH, LINE, FRAME = 10.0, 0.17, 1.0  # inches: of a picture, of each case, and for the axis


def document(content: ReportData) -> Document:
    """The document of one report."""
    sections = [_limits(content), *[_section(section) for section in content["sections"] if section["rows"]]]
    return Document("Stiff and extreme cases", _introduction(content), sections)


def _rows(content: ReportData) -> list[ReportData]:
    return [row for section in content["sections"] for row in section["rows"]]


def _introduction(content: ReportData) -> list[Block]:
    counts = Counter(row["verdict"] for row in _rows(content))
    verdict = f"{counts['meets']} of {len(_rows(content))} rows meet their bounds"
    verdict += f"; limits with a known reason: {counts['limit']}; unexplained: {counts['unexplained']}"
    quick = " A quick run: some of the cases, shorter runs, shorter arms." if content["quick"] else ""
    load = "" if content["load"] is None else f" The load of the machine was {content['load']:.1f} at the end."
    machine = " ".join(str(content["machine"]).split())
    return [
        Paragraph(f"{verdict}.", point=True, warning=counts["unexplained"] > 0),
        Paragraph(
            "Every row is a case that is hard for arithmetic or for an integrator: what was measured, the bound that "
            f"was set beforehand, and whether the one is within the other.{quick}"
        ),
        Paragraph(f"{content['date']}, {content['seconds']:.0f} s in all. {machine}.{load}"),
    ]


def _limits(content: ReportData) -> Section:
    """The reasons, each once, with the rows that it is of."""
    groups: dict[str, list[ReportData]] = {}
    for row in _rows(content):
        if row["verdict"] != "meets":
            groups.setdefault(row["reason"] or row["stopped"] or "No reason is known.", []).append(row)
    if not groups:
        return Section("limits", "Limits", [Paragraph("All rows meet their bounds.")])
    blocks: list[Block] = []
    for reason, rows in groups.items():
        blocks.append(Paragraph(reason if rows[0]["reason"] else f"Unexplained. {reason}"))
        cells = [cell for row in rows for cell in _lines(row, missed=True)]
        blocks.append(Table("Beyond their bounds", _HEADER[:2] + _HEADER[3:6], [c[:2] + c[3:6] for c in cells]))
    return Section("limits", "Limits", blocks)


_HEADER = ["case", "method", "verdict", "figure", "value", "bound", "steps", "time [s]"]


def _section(section: ReportData) -> Section:
    name, rows = section["name"], section["rows"]
    anchor = re.sub(r"[^a-z]+", "-", name.lower())
    shown = len(_HEADER) if any(row["steps"] or row["rejected"] for row in rows) else 6
    lines = [line[:shown] for row in rows for line in _lines(row)]
    hard = dict.fromkeys([f"{row['case']}: {row['about']}" for row in rows])
    figures = [figure for row in rows for figure in row["measurements"]]
    bounds = dict.fromkeys([f"{figure['quantity']}: {figure['why']}" for figure in figures])
    return Section(
        anchor,
        name,
        [
            Paragraph(section["about"]),
            Picture(anchor, to_adaptive_svg(shares(rows)), SHARES),
            Table("Verdicts", _HEADER[:shown], lines),
            Table("What is hard", ["case"], [[case] for case in hard], folded=True),
            Table("Why these bounds", ["figure"], [[bound] for bound in bounds], folded=True),
        ],
    )


def _lines(row: ReportData, missed: bool = False) -> list[list[str]]:
    """A line of cells for each figure, or for those beyond their bounds; what they share stands in the first."""
    measured: list[list[str]] = []
    for figure in row["measurements"]:
        if not (missed and figure["meets"]):
            bound = "" if figure["bound"] == "inf" else _number(figure["bound"])
            value = _number(figure["value"]) + ("" if figure["meets"] else " ✗")
            unit = "" if str(figure["unit"]).startswith("of ") else f" [{figure['unit']}]"  # a share has none
            measured.append([figure["quantity"] + unit, value, bound])
    first, *others = measured or [["", "", ""]]
    steps = f"{row['steps']} + {row['rejected']}" if row["rejected"] else f"{row['steps']}"
    shared = [row["case"], row["method"], row["verdict"], *first, steps, f"{row['seconds']:.2f}"]
    return [shared, *[["", "", "", *cells, "", ""] for cells in others]]


def _number(value: float | str) -> str:
    """Two digits; NaN and infinities are texts in the data."""
    if isinstance(value, str):
        return value
    return f"{value:.1e}" if value and not 0.01 <= abs(value) < 1000.0 else f"{value:.2g}"


def shares(rows: Sequence[ReportData]) -> Figure:
    """Every figure over its bound, a line for each case, on one logarithmic axis; those beyond 1 in another color."""
    names = list(dict.fromkeys(row["case"] for row in rows))
    measured = [(row["case"], each) for row in rows for each in row["measurements"] if each["bound"] != "inf"]
    points = [(_share(each), names.index(case), each["meets"]) for case, each in measured]
    with style():
        figure = empty_figure(WIDTH, FRAME + LINE * len(names))
        axis = figure.subplots()
        axis.set_xscale("log")
        axis.axvline(1.0, color=theme.LINE, linewidth=1.0)
        axis.hlines(range(len(names)), FROM, TO, color=theme.GRAY, linewidth=0.3)
        for meets, color, marker in ((True, theme.BLUE, "o"), (False, theme.SPURIOUS, "X")):
            chosen = [(x, y) for x, y, met in points if met is meets]
            x, y = ([point[k] for point in chosen] for k in (0, 1))
            axis.plot(x, y, marker, color=color, markersize=4.5, clip_on=False)
        axis.set_yticks(range(len(names)), names, fontsize=8)
        axis.tick_params(axis="y", length=0)
        axis.set(xlim=(FROM, TO), ylim=(len(names) - 0.5, -0.5), xlabel="figure over its bound")
    return figure


def _share(figure: ReportData) -> float:
    """The figure over its bound, within what is drawn; what is no number at the far end."""
    value, bound = float(figure["value"]), float(figure["bound"])
    if value != value:
        return TO
    share = value / bound if bound else (TO if value else FROM)
    return min(max(share, FROM), TO)
