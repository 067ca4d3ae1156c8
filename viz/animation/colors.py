"""Colors of an animation, on white or on dark."""

from __future__ import annotations

from dataclasses import dataclass

from .. import theme


@dataclass(frozen=True)
class Colors:
    """page, text, and faint: what stands still or was wanted; wrong: the one color of what is wrong; series."""

    page: str
    text: str
    faint: str
    wrong: str
    links: tuple[str, ...]
    series: tuple[str, ...]


LIGHT = Colors(
    theme.WHITE,
    theme.TEXT,
    theme.tint(theme.GRAY, 0.55),
    theme.SPURIOUS,
    theme.LINKS,
    tuple(each for each in theme.SERIES if each not in (theme.YELLOW, theme.SPURIOUS)),
)
DARK = Colors(
    theme.DARK_PAGE,
    theme.DARK_TEXT,
    "#5C6066",
    "#FF8A4D",
    tuple(theme.tint(each, 0.7) for each in theme.LINKS),
    tuple(
        theme.WHITE if each == theme.BLACK else theme.tint(each, 0.8)
        for each in theme.SERIES
        if each not in (theme.YELLOW, theme.SPURIOUS)
    ),
)
