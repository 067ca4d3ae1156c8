"""The pictures that the pages show, into docs/images: `make pictures`, or for some pages

python -m tests.page_pictures docs/gallery.md

They are what the examples of a page write; of a page without examples, what its commands write, an HTML file as a
browser shows it.
"""

import contextlib
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from tests.chromium import chromium
from tests.test_docs import PAGES, ROOT, RUN, commands, pictures, run_examples
from viz import cli

WIDTH, HEIGHT, COLORS = 1200, 760, 64  # of the picture of a page


def main(names: list[str]) -> None:
    """Run the pages and copy what they wrote."""
    for name in names or [name for name in PAGES if pictures(name)]:
        with tempfile.TemporaryDirectory() as folder:
            (run if name in RUN else run_commands)(name, Path(folder))
            for written, image in pictures(name).items():
                take(Path(folder), written, ROOT / "docs" / image)


def run(name: str, folder: Path) -> None:
    """The examples of a page."""
    result = run_examples(name, folder)
    if result.returncode:
        sys.exit(f"{name}: {result.stderr}")


def run_commands(name: str, folder: Path) -> None:
    """The commands of a page; a finding is what some of them show."""
    with contextlib.chdir(folder):
        for command in commands(PAGES[name]):
            if cli.main(shlex.split(command)) == cli.ERROR:
                sys.exit(f"{name}: cgraph {command}")


def take(folder: Path, written: str, image: Path) -> None:
    """Copy a file, or photograph the page of that name."""
    stem, kind = written.rsplit(".", 1)
    if files := [*folder.rglob(written)]:
        shutil.copy(files[0], image)
    elif kind == "png":
        photograph(next(folder.rglob(f"{stem}.html")), image)
    else:
        sys.exit(f"nothing wrote {written}")


def photograph(page: Path, image: Path) -> None:
    """What a browser shows first, in few colors."""
    program = chromium()
    if program is None:
        print(f"{image.name} is left as it is: there is no Chromium on PATH")  # noqa: T201
        return
    options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=3000"]
    size = [f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={image}"]
    subprocess.run([program, *options, *size, page.as_uri()], check=True, capture_output=True, timeout=60)
    with Image.open(image) as shot:
        shot.convert("RGB").quantize(COLORS).save(image, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
