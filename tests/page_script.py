"""The page's JavaScript in V8, without a browser: for tests of what it computes."""

import json
from functools import cache
from typing import Any

from py_mini_racer import MiniRacer

from viz.inspector.page import scripts

# Elements that keep what they are told, so that formulas and pictures can be looked at.
DOCUMENT = """
const made = (_, name) => ({ name, at: {}, dataset: {}, inside: [], textContent: "",
  setAttribute(key, value) { this.at[key] = value; }, append(...more) { this.inside.push(...more); },
  appendChild(each) { this.inside.push(each); return each; }, replaceChildren(...each) { this.inside = each; },
  getBoundingClientRect: () => ({ width: 930, height: 580 }) });
globalThis.document = { createElementNS: made, createElement: (name) => made("", name) };
"""


@cache
def machine(operations: int) -> MiniRacer:
    """V8 with the page's scripts, for so many operations in their table."""
    engine = MiniRacer()
    engine.eval(f'"use strict";\n{DOCUMENT}\n{scripts()}')
    return engine


def run_script(function: str, *given: Any) -> Any:
    """What a function of JavaScript returns for arguments that JSON can hold, as JSON holds it."""
    from cgraph.extend import OPS

    texts = ", ".join([json.dumps(each) for each in given])
    return json.loads(machine(len(OPS)).eval(f"JSON.stringify((({function}))({texts}))"))
