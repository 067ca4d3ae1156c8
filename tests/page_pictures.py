"""The pictures that the pages show, into docs/images: `make pictures`, or for some pages

python -m tests.page_pictures docs/gallery.md

They are what the examples of a page write; of a page without examples, what its commands write, an HTML file as a
browser shows it; and figures of the paper. `docs/images/made.json` says for each of what it was made, a digest of the
file that was written, without its numbers: pixels depend on fonts, and so they are not compared.
"""

import contextlib
import hashlib
import json
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from tests.chromium import chromium
from tests.test_docs import PAGES, ROOT, RUN, commands, pictures, run_examples, texts
from viz import cli

WIDTH, HEIGHT, COLORS = 1200, 760, 64  # of the picture of a page
IMAGES = ROOT / "docs" / "images"
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
MADE = IMAGES / "made.json"
PAPER = {f"{name}.svg": f"images/{name}.svg" for name in ("fig1", "fig7b", "fig7c")}  # `cgraph paper` writes them


def main(names: list[str]) -> None:
    """Run the pages and copy what they wrote; of all pages the paper's figures, too."""
    for name in names or [name for name in PAGES if pictures(name)]:
        with tempfile.TemporaryDirectory() as folder:
            (run if name in RUN else run_commands)(name, Path(folder))
            keep(Path(folder), pictures(name))
    if not names:
        with tempfile.TemporaryDirectory() as folder:
            cli.main(["paper", "--out", folder])
            keep(Path(folder), PAPER)


def keep(folder: Path, images: dict[str, str]) -> None:
    """Take the images that a folder has, and note of what each was made.  images: {file that was written: image}."""
    made = json.loads(MADE.read_text(encoding="utf-8")) if MADE.exists() else {}
    for written, image in images.items():
        if take(folder, written, ROOT / "docs" / image):
            made[Path(image).name] = digest(source(folder, written))
    MADE.write_text(json.dumps(dict(sorted(made.items())), indent=1) + "\n", encoding="utf-8")


def source(folder: Path, written: str) -> Path:
    """The file of that name in a folder, or the page that a picture of that name shows."""
    files = [*folder.rglob(written), *folder.rglob(f"{written.rsplit('.', 1)[0]}.html")]
    if not files:
        sys.exit(f"nothing wrote {written}")
    return files[0]


def digest(file: Path) -> str:
    """What a file shows, as a short number: words and code without numbers, of a film its size and frames.

    Of a report, which has no script and measures times, it is titles and style alone.
    """
    if file.suffix in (".gif", ".png"):
        with Image.open(file) as shot:
            return f"{shot.size[0]} x {shot.size[1]}, {getattr(shot, 'n_frames', 1)} frames"
    elif file.suffix == ".svg":
        shown = "\n".join(texts(file))
    else:
        shown = file.read_text(encoding="utf-8")
        if "<script" not in shown:
            shown = "\n".join(re.findall(r"<(?:h[1-3]|style)[^>]*>(.*?)</", shown, re.DOTALL))
    return hashlib.sha256(re.sub(NUMBER, "#", shown).encode()).hexdigest()[:16]


def run(name: str, folder: Path) -> None:
    result = run_examples(name, folder)
    if result.returncode:
        sys.exit(f"{name}: {result.stderr}")


def run_commands(name: str, folder: Path) -> None:
    """The commands of a page; a finding is what some of them show."""
    with contextlib.chdir(folder):
        for command in commands(PAGES[name]):
            if cli.main(shlex.split(command)) == cli.ERROR:
                sys.exit(f"{name}: cgraph {command}")


def take(folder: Path, written: str, image: Path) -> bool:
    """Copy a file, or photograph the page of that name; whether there is a picture now."""
    file = source(folder, written)
    if file.suffix == ".html":
        return photograph(file, image)
    shutil.copy(file, image)
    return True


def photograph(page: Path, image: Path) -> bool:
    """What a browser shows first, in few colors; whether there is a browser."""
    program = chromium()
    if program is None:
        print(f"{image.name} is left as it is: there is no Chromium on PATH")  # noqa: T201
        return False
    options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=3000"]
    size = [f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={image}"]
    subprocess.run([program, *options, *size, page.as_uri()], check=True, capture_output=True, timeout=60)
    with Image.open(image) as shot:
        shot.convert("RGB").quantize(COLORS).save(image, optimize=True)
    return True


if __name__ == "__main__":
    main(sys.argv[1:])
