"""Steps of explicit Runge-Kutta methods in C: a loop over the stages, with one call of the rate."""

from ..explicit_method import Tableau, weighted_sum
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
