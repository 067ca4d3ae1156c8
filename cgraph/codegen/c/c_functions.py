"""The functions in C: of a graph's statements, and of steps of Runge-Kutta methods, with one call of the rate."""

from collections.abc import Mapping, Sequence

from ...core.node import VARIABLE, Node
from ...operations.operation import columns
from ..explicit_method import Tableau, weighted_sum
from ..statements import statements
from .c_numbers import CNumbers

_STEPS = """\
void {name}_{method}({type} *{NAME}_RESTRICT x, {type} h, unsigned long n)
{{
    {type} at[{NAME}_N_IN], slope[{stages}][{NAME}_N_OUT];{start}
    unsigned long step;
    int stage, i;

    for (i = 0; i < {NAME}_N_IN; i++) {{
        at[i] = x[i];
    }}
    for (step = 1; step <= n; step++) {{
        for (stage = 0; stage < {stages}; stage++) {{
            switch (stage) {{
{cases}
            default:
                break;
            }}
            {name}(at, slope[stage]);
        }}
        for (i = 0; i < {NAME}_N_OUT; i++) {{
            x[i] = x[i] + h * ({ahead});
            at[i] = x[i];
        }}{end}
    }}
}}
"""
_CASE = """\
            case {stage}:
                for (i = 0; i < {NAME}_N_OUT; i++) {{
                    at[i] = x[i] + h * ({ahead});
                }}{clock}
                break;"""


def functions(
    name: str,
    nodes: Sequence[Node],
    places: Mapping[Node, str],
    results: Sequence[tuple[str, Node]],
    numbers: CNumbers,
) -> list[str]:
    """Text of the function `name`, after that of the functions it calls.

    places: for each input its place in x.  results: places in y, and their nodes. Raises ValueError for an operation
    that has no text in C, and for a constant beyond the numbers.
    """
    kind, keyword = numbers.type, f"{name.upper()}_RESTRICT"
    found = statements(
        nodes,
        places,
        results,
        numbers.text,
        lambda op: numbers.operation(op).replace("{name}", name),
        f"const {kind}",
        lambda node: f" /* {comment(node.name)} */" if node.name else "",
    )
    texts = dict.fromkeys([numbers.adapted(columns(op).c_helper) for op in found.ops])
    helpers = [text.format(name=name) for text in texts if text]
    body = found.direct
    if len(found.parts) > 1:
        called = [f"{name}_part_{k}" for k in range(1, len(found.parts) + 1)]
        body = [f"{kind} w[{max(found.size, 1)}];", *body, *[f"{function}(x, w, y);" for function in called]]
        arrays = f"const {kind} *{keyword} x, {kind} *{keyword} w, {kind} *{keyword} y"
        unused = ["(void)x, (void)w, (void)y;"]  # a part need not touch all three
        helpers += [
            _function(f"static void {function}({arrays})", unused + part)
            for function, part in zip(called, found.parts, strict=True)
        ]
    else:
        body += [line for part in found.parts for line in part]
        if not any([node.op is VARIABLE for node in nodes]):
            body.insert(0, "(void)x;")
    return [*helpers, _function(f"void {name}(const {kind} *{keyword} x, {kind} *{keyword} y)", body)]


def _function(signature: str, body: Sequence[str]) -> str:
    return "\n".join([signature, "{", *[f"    {line}" for line in body], "}", ""])


def comment(text: str) -> str:
    """The text, as it may stand between /* and */."""
    printable = "".join([character if character.isprintable() else "?" for character in text])
    return printable.replace("*/", "* /").replace("/*", "/ *")


def declaration(name: str, method: str, numbers: CNumbers) -> str:
    """What the header says of the steps."""
    return (
        f"\n/* n steps of size h by {method} from x[{name.upper()}_N_IN], whose state and time are those at the end "
        f"afterwards. */\nvoid {name}_{method}({numbers.type} *x, {numbers.type} h, unsigned long n);\n"
    )


def steps(name: str, method: str, tableau: Tableau, numbers: CNumbers, time: str | None) -> str:
    """Text of the function of (x, h, n).  time: the place of the time in x."""
    cases = []
    for stage, (c, weights) in enumerate(zip(tableau.c, tableau.a, strict=True)):
        if stage:
            clock = f"\n                at[{time}] = x[{time}] + {numbers.text(float(c))} * h;" if time else ""
            cases.append(_CASE.format(NAME=name.upper(), stage=stage, ahead=_sum(weights, numbers), clock=clock))
    return _STEPS.format(
        name=name,
        NAME=name.upper(),
        method=method,
        type=numbers.type,
        stages=len(tableau.b),
        cases="\n".join(cases),
        ahead=_sum(tableau.b, numbers),
        start=f"\n    const {numbers.type} start = x[{time}];" if time else "",
        end=f"\n        x[{time}] = start + ({numbers.type})step * h;\n        at[{time}] = x[{time}];" if time else "",
    )


def _sum(weights: tuple[float, ...], numbers: CNumbers) -> str:
    return weighted_sum(weights, numbers.text, lambda k: f"slope[{k}][i]")
