"""Programs: graphs run in order and in loops over one memory of numbers, such as an integrator over its rate."""

from .choose_runner import runner
from .loop import Loop, loop
from .program import Call, Factor, If, Map, Program, Solve, Statement, Sum, While
from .runner import Record, Runner

__all__ = [
    "Call",
    "Factor",
    "If",
    "Loop",
    "Map",
    "Program",
    "Record",
    "Runner",
    "Solve",
    "Statement",
    "Sum",
    "While",
    "loop",
    "runner",
]
