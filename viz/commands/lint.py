"""`cgraph lint`: are q and qd independent of one another in a scene's equations? A proof, or what is to blame."""

from __future__ import annotations

import argparse

import cgraph as cg
from dynamics import ConstraintLint, conserved_momenta, display_names, lint_constraints, state_equation
from dynamics.equations.both_forms import HAMILTON, LAGRANGE

from .. import theme
from ..models.constant_momenta import constant_momentum
from ..models.open_loops import tree_alone
from .arguments import (
    Commands,
    answer_and_draw,
    check_picture,
    equations_of,
    may_draw_and_print,
    scene_of,
    state_names,
    takes_a_scene,
    takes_equations,
    unless_json,
)
from .point_arguments import REST, box, filled, point
from .sizes import size_data, size_table


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "lint",
        help="check that q and qd are independent in a scene's equations; status 1 and the blame if they are not",
    )
    takes_a_scene(parser)
    takes_equations(parser)
    parser.add_argument(
        "--box",
        type=box,
        metavar="A=LOW:HIGH,...",
        help="look for slopes that could be unbounded in this box of inputs",
    )
    parser.add_argument(
        "--at", type=point, metavar="A=1,B=2", help=f"look for sums that lose digits at this point; {REST}"
    )
    may_draw_and_print(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the proof or the blame; 1 where anything is not as declared."""
    check_picture(options)
    scene = scene_of(options)
    graph, what = equations_of(options, scene)
    q, qd = state_names(graph, scene, momentum=options.momentum)
    report = cg.lint(
        graph,
        independent=[(q, qd)] if q and qd else [],
        box=options.box,
        at=None if options.at is None else filled(graph, scene, options.at),
        function="L",
        names=display_names(scene),
    )
    none = "coordinates" if qd else "momenta" if options.momentum else "velocities"
    proof = str(report) if q and qd else f"Holds: the equations have no {none}.\n{report}"
    held = lint_constraints(scene) if scene.ode is None else ConstraintLint({}, {})
    if str(held):
        proof = f"{proof}\n{held}"
    conserved = conserved_momenta(scene) if scene.ode is None else ()
    proof += "".join([f"\n{constant_momentum(name)}" for name in conserved])
    sizes = size_data({LAGRANGE: state_equation(scene), HAMILTON: graph}) if options.momentum else {}
    proof += f"\n{size_table(sizes)}" if sizes else ""
    alone = "" if options.forward else tree_alone(scene)
    proof = f"{proof}\n{alone}" if alone else proof
    data = {"scene": scene.name, "equations": what, "of_the_tree": bool(alone)} | report.to_dict()
    data |= {"constraints": held.to_dict(), "conserved": list(conserved), "ok": report.ok and held.ok}
    data |= {"sizes": sizes} if sizes else {}
    answer_and_draw(
        options,
        unless_json(options, data, proof),
        graph,
        marked=report.nodes,
        marked_label="to blame",
        marked_edges=report.edges,
        names=theme.called(display_names(scene)),
        caption=f"{scene.name}: {what}",
    )
    return 0 if report.ok and held.ok else 1
