"""`cgraph report --stability`: the table of stiff and extreme cases, as a page."""

from __future__ import annotations

import argparse
import json
import time

from dynamics.experiments.stability import stability, stability_table

from ..pages import stability as page
from ..pages.write_document import check_writable, write_document
from ..plots.plot import check_can_plot
from .arguments import say

NAME = "stability"  # of the files


def run(options: argparse.Namespace) -> None:
    """Write the page and print the table. Raises RuntimeError for a row beyond its bound without a known reason."""
    check_can_plot()
    check_writable(options.out)
    begin = time.perf_counter()
    found = stability.run(options.quick, say)
    content = stability.to_dict(found, time.perf_counter() - begin, options.quick)
    written = write_document(options.out, NAME, page.document(content), content, stability.to_csv(found))
    print(json.dumps(content, indent=1) if options.json else f"{stability_table.text(found)}\n{written}")
    if unexplained := [f"{each.case} by {each.method}" for each in found if not each.explained]:
        raise RuntimeError(f"beyond its bound without a known reason: {', '.join(unexplained)}")
