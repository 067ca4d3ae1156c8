"""`cgraph scenes`: the scenes, with the size of their graphs."""

import argparse
from typing import Any

import dynamics as dyn
from cgraph import _shared

from .arguments import answer, unless_json
from .command import Command, flag


def add(parser: Command) -> None:
    """The command's arguments."""
    flag(parser, "--json", "print as JSON")


def run(options: argparse.Namespace) -> None:
    """Print two lines a scene."""
    rows: list[dict[str, Any]] = [
        {
            "name": scene.name,
            "about": scene.about,
            "coordinates": scene.system.n,
            "inverse_nodes": len(dyn.inverse_dynamics(scene).nodes),
            "forward_nodes": len(dyn.forward_dynamics(scene).nodes),
        }
        for scene in map(dyn.scenes.load, dyn.scenes.names())
    ]
    lines = [
        f"{row['name']:16} {row['about']}\n{'':16} coordinates: {row['coordinates']}, inverse dynamics "
        f"{_shared.counted(row['inverse_nodes'], 'node')}, "
        f"forward dynamics {_shared.counted(row['forward_nodes'], 'node')}"
        for row in rows
    ]
    answer(unless_json(options, rows, "\n".join(lines)))
