"""`cgraph type`: a page that a Lagrangian is typed into, and that derives, checks, draws and moves it offline."""

import argparse

from . import library
from .arguments import answer_page, place, writes_a_page
from .command import Command


def add(parser: Command) -> None:
    """The command's arguments."""
    writes_a_page(parser)
    parser.add_argument("--text", type=place, metavar="FILE", help="what the box holds at first, by default an example")


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    library.html_target("--out", options.out)
    text = None if options.text is None else options.text.read_text(encoding="utf-8")
    page = library.typed_page(text)
    answer_page(options, f"{options.out}: a box for a Lagrangian; {len(page.encode()) / 1e6:.2f} MB", page)
