"""`cgraph equations`: Lagrangian, momenta, and torques or accelerations of a scene as formulas, in text or LaTeX."""

import argparse

from . import library
from .arguments import FORMULATIONS, MOMENTUM_FORM, answer, counting, formulation, scene_of, takes_a_scene, verdict_of
from .command import Command, flag

DIGITS = 6


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--formulation", type=formulation, choices=FORMULATIONS, help="of the torque (default: chain_rule)"
    )
    flag(which, "--forward", "accelerations, and multipliers of constraints, in place of the torque")
    flag(which, "--momentum", f"{MOMENTUM_FORM}, in place of the torque")
    parser.add_argument(
        "--lines", type=counting, default=200, metavar="N", help="of each block, at most (default: 200)"
    )
    parser.add_argument(
        "--digits", type=counting, default=DIGITS, metavar="N", help=f"of numbers (default: {DIGITS}; 17 are all)"
    )
    flag(parser, "--latex", "print as LaTeX")


def run(options: argparse.Namespace) -> int:
    """Print the equations, and of a formulation the verdict; 1 where it is not the torque of the chain rule."""
    scene = scene_of(options)
    if scene.ode is not None and options.formulation is not None:
        raise ValueError(f"{scene.name} is a system of first order: it has no torque, so no --formulation of it")
    options.formulation = options.formulation or "chain_rule"
    of = "accelerations" if options.forward else "momenta" if options.momentum else "torque"
    equations = library.model_equations(scene, of=of, formulation=options.formulation)
    written = library.equations_latex if options.latex else library.equations_text
    text = written(equations, options.lines, options.digits)
    verdict = verdict_of(options, scene)
    differs = verdict is not None and verdict.differs
    if differs:
        remark = "\n".join([f"% {line}" if options.latex else line for line in str(verdict).splitlines()])
        text = f"{text}\n\n{remark}"
    answer(text)
    return 1 if differs else 0
