"""Modules of `cg.to_js` run by Node.js where it is on PATH, else in V8 by mini-racer."""

import base64
import json
import shutil
import subprocess
from typing import Any

import pytest

from viz.pages.operations import expression

NODE = shutil.which("node")
# Numbers as texts: JSON has no infinity, no NaN and no -0.
SHOWN = """
const shown = (found) => JSON.stringify(found, (_, each) => typeof each === "number"
  ? (Object.is(each, -0) ? "-0" : String(each)) : ArrayBuffer.isView(each) ? Array.from(each) : each);
"""


def run_js(text: str, program: str) -> Any:
    """What an expression of JavaScript gives in which `module` is that of the text."""
    if NODE is None:
        engine = pytest.importorskip("py_mini_racer", reason="no Node.js and no mini-racer").MiniRacer()
        found = engine.eval(f'"use strict";{SHOWN}\nconst module = {expression(text)};\nshown({program})')
        engine.close()
    else:
        address = f"data:text/javascript;base64,{base64.b64encode(text.encode()).decode()}"
        main = f'import * as module from "{address}";{SHOWN}\nconsole.log(shown({program}));'
        done = subprocess.run(
            [NODE, "--input-type=module", "-"], input=main, capture_output=True, text=True, check=False, timeout=60
        )
        assert done.returncode == 0, done.stderr[-2000:]
        found = done.stdout
    return floats(json.loads(found))


def floats(found: Any) -> Any:
    if isinstance(found, list):
        return [floats(each) for each in found]
    try:
        return float(found)
    except (TypeError, ValueError):
        return found


def evaluated_by_js(text: str, points: Any) -> list[list[float]]:
    """Rows of outputs at rows of inputs."""
    rows = json.dumps(
        [[repr(float(x)).replace("inf", "Infinity").replace("nan", "NaN") for x in row] for row in points]
    )
    return run_js(text, f"{rows}.map((row) => module.evaluate(row.map(Number)))")  # type: ignore[no-any-return]


def stepped_by_js(text: str, method: str, start: list[float], h: float, n: int) -> list[float]:
    return run_js(text, f'module.steps["{method}"](Float64Array.from({start}), {h!r}, {n})')  # type: ignore[no-any-return]
