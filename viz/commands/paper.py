"""`cgraph paper`: the paper's figures and its table, measured, in one folder."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from ..paper.write_paper import write_paper
from .arguments import Commands


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("paper", help="the paper's six figures and its table, measured, in one folder")
    parser.add_argument("--out", type=Path, default=Path("paper"), help="folder to fill (default: paper)")
    parser.add_argument("--quick", action="store_true", help="times of fewer evaluations, and shorter chains")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON on standard output")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the folder."""
    data = write_paper(options.out, lambda line: print(line, file=sys.stderr, flush=True), quick=options.quick)
    if options.json:
        print(json.dumps(data, indent=1))
