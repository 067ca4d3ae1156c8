"""`cgraph report --stability`: the table of stiff and extreme cases, as a page."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from . import library
from .arguments import answer, say, unless_json

NAME = "stability"  # of the files


def run(options: argparse.Namespace) -> int:
    """Write the page and print the table; 1 for a row beyond its bound without a known reason."""
    if options.out is not None:
        library.check_can_plot()
    begin = time.perf_counter()
    found = library.stability.run(options.quick, say)
    content = library.stability.to_dict(found, time.perf_counter() - begin, options.quick)
    files: dict[Path, str | bytes] = {}
    text = library.stability_table.text(found)
    if options.out is not None:
        files |= library.document_files(
            options.out, NAME, library.stability_page.document(content), content, library.stability.to_csv(found)
        )
        text = f"{text}\n{[*files][-1]}"
    answer(unless_json(options, content, text), files, folder=options.out)
    unexplained = [f"{each.case} by {each.method}" for each in found if not each.explained]
    if unexplained:
        say(f"beyond its bound without a known reason: {', '.join(unexplained)}")
    return 1 if unexplained else 0
