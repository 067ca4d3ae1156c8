"""Canvases: pictures drawn by Pillow, their colors, and animations as GIF, APNG or MP4."""

from __future__ import annotations

import io
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import TYPE_CHECKING

from cgraph._shared import install, memo

from .. import theme

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageFont import FreeTypeFont, ImageFont


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


RATE = 25  # frames a second: a GIF counts in hundredths, and browsers slow down what is faster than 50
KINDS = (".gif", ".png", ".apng", ".mp4")
COLORS = 64  # of a palette
_FINE = 2  # pixels drawn for one that is kept, in each direction
_NEAR = 24  # of 765: how far apart two colors may be that cannot be told apart
_SAMPLES = 4  # frames that the palette is chosen from

Point = tuple[float, float]


class Canvas:
    """A picture that is drawn on, in pixels from the upper left."""

    def __init__(self, width: int, height: int, color: str) -> None:
        image, draw, _ = _pillow()
        self.image = image.new("RGB", (_FINE * width, _FINE * height), color)
        self._draw = draw.Draw(self.image)

    def copy(self) -> Canvas:
        """Copy with the same picture."""
        other = Canvas.__new__(Canvas)
        other.image = self.image.copy()
        other._draw = _pillow()[1].Draw(other.image)
        return other

    def put(self, other: Canvas, x: int, y: int) -> None:
        """Put another picture, with its upper left corner there."""
        self.image.paste(other.image, (_FINE * x, _FINE * y))

    def line(self, points: Sequence[Point], color: str, width: float) -> None:
        """A line through points."""
        if len(points) > 1:
            self._draw.line(
                [(_FINE * x, _FINE * y) for x, y in points], color, max(1, round(_FINE * width)), joint="curve"
            )

    def circle(self, center: Point, radius: float, color: str, edge: str | None = None, width: float = 0.0) -> None:
        """A disk, with an edge inside it."""
        x, y = center
        box = [_FINE * (x - radius), _FINE * (y - radius), _FINE * (x + radius), _FINE * (y + radius)]
        self._draw.ellipse(box, color, edge, round(_FINE * width))

    def text(self, at: Point, text: str, color: str, size: int, anchor: str = "lm") -> None:
        """Text with its anchor at a point: l, m or r, and then a, m or s, as Pillow has them."""
        self._draw.text((_FINE * at[0], _FINE * at[1]), text, color, _font(_FINE * size), anchor)

    def width_of(self, text: str, size: int) -> float:
        """Width of a text."""
        return float(self._draw.textlength(text, _font(_FINE * size))) / _FINE

    def picture(self) -> Image:
        """Picture, smoothed."""
        picture: Image = self.image.reduce(_FINE)
        return picture


def encode(frame: Callable[[int], Canvas], count: int, kind: str) -> bytes:
    """An animation of `count` frames at `RATE`, that starts again at its end.  kind: of `KINDS`."""
    if kind == ".mp4":
        return _mp4(frame, count)
    image = _pillow()[0]
    samples = [frame(count * i // _SAMPLES).picture() for i in range(min(_SAMPLES, count))]
    together = image.new("RGB", (samples[0].width, samples[0].height * len(samples)))
    for i, sample in enumerate(samples):
        together.paste(sample, (0, i * sample.height))
    palette = together.quantize(COLORS, dither=image.Dither.NONE)
    page = list(together.getpixel((0, 0)))
    listed = palette.getpalette()
    colors = [listed[i : i + 3] for i in range(0, len(listed), 3)]
    # Pillow takes colors for equal that are close: what is nearly the page is the page
    colors = [
        page if sum([abs(a - b) for a, b in zip(color, page, strict=True)]) < _NEAR else color for color in colors
    ]
    palette.putpalette([channel for color in colors for channel in color])

    def flat(i: int) -> Image:
        return frame(i).picture().quantize(palette=palette, dither=image.Dither.NONE)

    data = io.BytesIO()
    rest = [flat(i) for i in range(1, count)]
    options = {"save_all": True, "append_images": rest, "duration": 1000 // RATE, "loop": 0}
    flat(0).save(data, "GIF" if kind == ".gif" else "PNG", **options)
    return data.getvalue()


def check_can_animate(kind: str) -> None:
    """Raise what an animation of that kind would for a missing package or program: before the work."""
    _pillow()
    if kind == ".mp4":
        _ffmpeg()


def _mp4(frame: Callable[[int], Canvas], count: int) -> bytes:
    """Film by ffmpeg, which gets the frames as they are drawn; sides are even, as its usual colors need."""
    first = frame(0).picture()
    width, height = first.width // 2 * 2, first.height // 2 * 2
    with TemporaryDirectory() as folder:
        target = Path(folder) / "a.mp4"
        command = [_ffmpeg(), "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
        command += ["-r", str(RATE), "-i", "-", "-pix_fmt", "yuv420p", "-movflags", "+faststart", str(target)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            assert run.stdin is not None
            assert run.stderr is not None
            try:
                for i in range(count):
                    run.stdin.write(frame(i).picture().crop((0, 0, width, height)).tobytes())
                run.stdin.close()
            except BrokenPipeError:
                pass
            except BaseException:
                run.kill()
                raise
            said = run.stderr.read().decode(errors="replace")
        if run.returncode or not target.is_file():
            raise RuntimeError(f"ffmpeg cannot write this film: {' '.join(said.split()) or 'it says nothing':.300}")
        return target.read_bytes()


def _ffmpeg() -> str:
    found = shutil.which("ffmpeg")
    if found is None:
        raise RuntimeError("MP4 needs the program ffmpeg on the PATH; .gif and .apng need no program")
    return found


@memo(16)
def _font(size: int) -> FreeTypeFont | ImageFont:
    fonts, folder = _pillow()[2], theme.font_folder()
    font: FreeTypeFont | ImageFont
    font = fonts.load_default(size) if folder is None else fonts.truetype(str(folder / "DejaVuSans.ttf"), size)
    return font


def _pillow() -> tuple[ModuleType, ModuleType, ModuleType]:
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError as error:
        raise ImportError(f"animations need Pillow: {install('viz')}") from error
    return Image, ImageDraw, ImageFont
