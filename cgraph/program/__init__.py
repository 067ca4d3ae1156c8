"""Programs: graphs run in order and in loops over one memory of numbers, such as an integrator over its rate."""

from .loop import Loop, loop
from .program import Call, Factor, If, Map, Program, Solve, Statement, Sum, While
from .runner import Runner, runner

__all__ = [
    "Call",
    "Factor",
    "If",
    "Loop",
    "Map",
    "Program",
    "Runner",
    "Solve",
    "Statement",
    "Sum",
    "While",
    "loop",
    "runner",
]
