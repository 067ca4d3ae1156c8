"""`cgraph lint`: are these the equations of the chain rule, with q and qd independent? A proof, or what is to blame."""

from __future__ import annotations

import argparse

import cgraph as cg
import dynamics as dyn
from cgraph import _shared

from . import arguments, library
from .command import Command
from .compare import size_table
from .points import REST, filled


def add(parser: Command) -> None:
    """The command's arguments."""
    arguments.takes_equations(parser)
    parser.add_argument(
        "--box",
        type=arguments.box,
        metavar="A=LOW:HIGH,...",
        help="look for slopes that could be unbounded in this box of inputs",
    )
    parser.add_argument(
        "--at", type=arguments.point, metavar="A=1,B=2", help=f"look for sums that lose digits at this point; {REST}"
    )
    arguments.may_draw_and_print(parser)


def run(options: argparse.Namespace) -> int:
    """Print the proof or the blame; 1 where anything is not as declared."""
    arguments.check_picture(options)
    scene = arguments.scene_of(options)
    graph, what, verdict = arguments.equations_of(options, scene)
    at = None if options.at is None else filled(graph, scene, options.at)
    if verdict is not None and verdict.differs and options.at:
        given = at or {}
        others = {name: x for name, x in given.items() if name != "dt" and not name.endswith("_old")}
        after = library.after_step(scene.system, given) | others  # the state after the embedded step
        verdict = dyn.formulation_verdict(scene, options.formulation, after)
    q, qd = arguments.state_names(graph, scene, momentum=options.momentum)
    report = cg.lint(
        graph,
        independent=[(q, qd)] if q and qd else [],
        box=options.box,
        at=at,
        function="K" if options.formulation.startswith("kinetic") else "L",
        names=dyn.display_names(scene),
    )
    # A path from qd to q is the finding of equations that nothing else is known of; of a formulation the verdict tells.
    faults = [each for each in report.findings if verdict is None or each.kind != "dependence"]
    ok = not faults and not (verdict and verdict.differs)
    conserved = dyn.conserved(scene) if scene.ode is None else None
    forms = {library.LAGRANGE: dyn.state_equation(scene), library.HAMILTON: graph} if options.momentum else {}
    sizes = library.form_sizes(forms) if forms else {}
    alone = "" if options.forward else library.tree_alone(scene)
    first_order = "" if scene.ode is None else "Holds: equations of first order have no velocities."
    told = [first_order, lint_text(report, verdict), str(conserved or ""), size_table(sizes) if sizes else "", alone]
    data = {"scene": scene.name, "equations": what, "of_the_tree": bool(alone)} | report.to_dict()
    data |= {"conserved": list(conserved.quantities) if conserved else [], "ok": ok}
    data |= {"verdict": verdict.to_dict()} if verdict else {}
    data |= {"sizes": sizes} if sizes else {}
    arguments.answer_and_draw(
        options,
        arguments.unless_json(options, data, "\n".join(filter(None, told))),
        graph,
        scene,
        marked=(verdict.nodes if verdict else frozenset())
        .union(*[each.nodes for each in faults])
        .intersection(graph.nodes),
        marked_label="to blame",
        marked_edges=(verdict.edges | report.edges if verdict.differs else frozenset()) if verdict else report.edges,
        wrong_outputs=tuple(verdict.excess) if verdict else (),
        caption=f"{scene.name}: {what}",
    )
    return 0 if ok else 1


def lint_text(report: _shared.Lint, verdict: dyn.Verdict | None) -> str:
    """The report with the verdict before it, which tells better than tags what is gained on a path from qd to q."""
    if verdict is None:
        return str(report)
    lines = [str(verdict), *([str(verdict.off)] if verdict.excess else [])]
    for each in report.findings:
        told = str(each)
        lines.append(told.rpartition("\n")[0] if each.data.get("derivatives_through") else told)
    lines += [f"Holds: {proof}" for proof in report.proofs] + [f"Note: {note}" for note in report.notes]
    return "\n".join(lines)
