"""The equations of a model as text, LaTeX and HTML."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from html import escape

from cgraph._shared import LATEX, columns, entries_of, fraction, latex_block, number_text, statements
from cgraph.extend import Notation, Op, topological
from dynamics.scenes.scenes import of_model
from dynamics.systems.model import Model

from ..pages.mathml import STYLE, few, typeset
from .equations import Block, Equations, model_equations

SUM, NEGATION, PRODUCT, FUNCTION, LEAF = 1, 2, 2, 3, 4  # how strongly a text binds, as in the rows of operations
DIGITS = 6  # of numbers
ALL_DIGITS = 17
LARGEST = 10  # velocities of a model whose equations a notebook shows
COMMAND = "<code>cgraph equations</code> prints all."


def equations_text(equations: Equations, lines: int, digits: int = DIGITS) -> str:
    """The equations as lines of text, each block below its title; the last line of a block says what is left out."""
    blocks = [_text_block(block, equations, lines, digits) for block in equations.blocks]
    return "\n\n".join([*blocks, *filter(None, [equations.legend, _rounded(equations, digits)])])


def equations_latex(equations: Equations, lines: int, digits: int = DIGITS) -> str:
    """The equations as LaTeX, a block of aligned lines below each title, which is a comment."""
    notation = LATEX._replace(number=partial(number_text, digits=digits))
    blocks = []
    for block in equations.blocks:
        found = statements(block.statements, notation, equations.names, lines)
        comments = [f"% {text}" for text in (block.title, block.about) if text]
        blocks.append("\n".join([*comments, latex_block(found)]))
    return "\n\n".join([*blocks, *[f"% {text}" for text in (equations.legend, _rounded(equations, digits)) if text]])


def equations_html(equations: Equations, lines: int = 12, level: int = 3) -> str:
    """The equations as HTML, a heading of a level and MathML a block; what is wrong has the class of that."""
    parts = []
    for block in equations.blocks:
        about = f"<p>{escape(block.about)}</p>" if block.about else ""
        head = f"<h{level}>{escape(block.title)}</h{level}>{about}"
        shown = typeset(block.statements, equations.names, lines, rest=COMMAND)
        parts.append(f'<div class="equations{" spurious" * block.wrong}">{head}{shown}</div>')
    return "".join([*parts, f"<p>{escape(equations.legend)}</p>" if equations.legend else ""])


def model_html(model: Model) -> str:
    """The Lagrangian and the torque of a model, or its state equation, as a notebook shows them; not of a large one."""
    scene = of_model(model)
    said = f"<p>{escape(repr(model))}</p>"
    if scene.ode is None and scene.system.n > LARGEST:
        return f"{said}<p>Its equations are long: {COMMAND}</p>"
    equations = model_equations(scene)
    blocks = [block for block in equations.blocks if not block.title.startswith(("Momenta", "Conserved"))]
    shown = equations_html(replace(equations, blocks=blocks), level=4)
    return f'<style>{STYLE}</style>{said}<div style="max-width:100%">{shown}</div>'


def _text_block(block: Block, equations: Equations, lines: int, digits: int) -> str:
    found = statements(block.statements, plain(digits), equations.names, lines)
    rows, indent = [], 0
    for left, right in found.equations:
        indent = 2 + len(left) + 3 if left else indent
        rows.append(f"  {left} = {right.strip()}" if left else f"{' ' * indent}{right.strip()}")
    if found.left_out:
        count, total = len(found.left_out), len(found.left_out) + sum([bool(left) for left, _ in found.equations])
        rows.append(f"  ({count} of {total} lines are left out; see --lines: those of {few(found.left_out)})")
    return "\n".join([block.title, *([f"  ({block.about})"] if block.about else []), *rows])


def _rounded(equations: Equations, digits: int) -> str:
    """Sentence on numbers that are shown with fewer digits than they have; empty where none is."""
    ends = [entry for block in equations.blocks for sides in block.statements for entry in entries_of(sides)]
    values = [node.value for node in topological(ends) if node.value is not None]
    off = any(fraction(abs(value)) is None and float(f"{value:.{digits}g}") != value for value in values)
    return f"Numbers are rounded to {digits} digits; see --digits." if off else ""


def plain(digits: int = DIGITS) -> Notation:
    """The notation of text, in which `cg.to_python` and people write: names as they are, with _ for a space."""
    return Notation(_names, partial(_number, digits), _operation, "v{}".format)


def _names(names: Iterable[str]) -> dict[str, str]:
    texts = {name: name.replace("∂", "d").replace(" ", "_") for name in names}
    alike = list(texts.values())
    return {name: text if alike.count(text) == 1 else name for name, text in texts.items()}


def _number(digits: int, value: float) -> tuple[str, int]:
    if (parts := fraction(value)) is not None and value != 0.5:
        return f"{parts[0]}/{parts[1]}", PRODUCT
    return f"{value:.{digits}g}", NEGATION if str(value).startswith("-") else LEAF


def _operation(op: Op, args: Sequence[tuple[str, int]]) -> tuple[str, int]:
    """`a * b`, `-a`, or `name(a, b)`; arguments that bind less than their places ask for in parentheses."""
    row = columns(op)
    if op.name == "pow":
        return "^".join([_within(arg, LEAF) for arg in args]), FUNCTION
    if row.infix is not None:
        symbol, strength = row.infix
        left, right = args
        after = strength if symbol == "*" else strength + 1
        return f"{_within(left, strength)} {symbol} {_within(right, after)}", strength
    if row.signs == (-1,):
        return f"-{_within(args[0], NEGATION)}", SUM
    return f"{op.name}({', '.join([text for text, _ in args])})", LEAF


def _within(arg: tuple[str, int], least: int) -> str:
    text, binds = arg
    return text if binds >= least and not (text.startswith("-") and least > SUM) else f"({text})"
