"""`cgraph scenes`: the scenes, with the size of their graphs."""

from __future__ import annotations

import argparse

from dynamics import forward_dynamics, inverse_dynamics, scenes

from .arguments import Commands, answer, unless_json


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("scenes", help="the scenes, with the size of their graphs")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print two lines a scene."""
    rows = []
    for name in scenes.names():
        scene = scenes.load(name)
        inverse, forward = inverse_dynamics(scene).counts(), forward_dynamics(scene).counts()
        rows.append(
            {
                "name": name,
                "about": scene.about,
                "coordinates": scene.system.n,
                "inverse_nodes": inverse.nodes,
                "forward_nodes": forward.nodes,
            }
        )
    lines = [
        f"{row['name']:16} {row['about']}\n{'':16} coordinates: {row['coordinates']}, inverse dynamics "
        f"{row['inverse_nodes']} nodes, forward dynamics {row['forward_nodes']} nodes"
        for row in rows
    ]
    answer(unless_json(options, rows, "\n".join(lines)))
