"""The JavaScript beside a WebAssembly module, run by Node.js."""

import json
import shutil
import subprocess

import pytest

import cgraph as cg
from dynamics.integrators import TABLEAUS
from tests.wasm import instance

X, V, T = cg.variables("x v t")
NODE = shutil.which("node")
GRAPH = cg.Graph([X, V, T], {"x_dot": V, "v_dot": -cg.sin(X) + 0.1 * T})

USE = """
import { readFileSync } from "node:fs";
import { load, inputs, outputs, methods, choosing } from "./swing.mjs";
const swing = await load(readFileSync(new URL("./swing.wasm", import.meta.url)));
const refused = [];
const start = { t: 0, x: 0.7, v: -0.2 };
for (const wrong of [
  () => swing.evaluate(), () => swing.evaluate(null), () => swing.evaluate([1, 2]), () => swing.evaluate({ x: 1 }),
  () => swing.evaluate(["1", 2, 3]), () => swing.step("euler", start, 0.1, 1), () => swing.step("rk4", start),
  () => swing.step("rk4", start, 0.1, 0.5), () => swing.step("rk4", start, undefined, 1),
  () => swing.stepTo("rk4", start, 1), () => swing.stepTo("dopri5", start, 1, { most: 2 }),
]) {
  try { wrong(); refused.push(""); } catch (error) { refused.push(error.message); }
}
console.log(JSON.stringify({
  names: [inputs, outputs, methods, choosing], refused,
  rate: [...swing.evaluate([0.7, -0.2, 0])], typed: [...swing.evaluate(new Float64Array([0.7, -0.2, 0]))],
  stepped: [...swing.step("rk4", start, 0.01, 100)], chosen: [...swing.stepTo("dopri5", start, 1).x],
}));
"""


@pytest.mark.skipif(NODE is None, reason="no Node.js")
def test_a_module_is_called_by_names_and_wrong_arguments_are_refused(tmp_path):
    methods = {name: TABLEAUS[name] for name in ("rk4", "dopri5")}
    (tmp_path / "swing.wasm").write_bytes(cg.to_wasm(GRAPH, methods))
    (tmp_path / "swing.mjs").write_text(cg.wasm_script(GRAPH, methods), encoding="utf-8")
    (tmp_path / "main.mjs").write_text(USE, encoding="utf-8")
    done = subprocess.run([NODE, str(tmp_path / "main.mjs")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["names"] == [["x", "v", "t"], ["x_dot", "v_dot"], ["rk4", "dopri5"], ["dopri5"]]
    here = instance(GRAPH, methods)
    assert found["rate"] == found["typed"] == here(0.7, -0.2, 0.0)
    assert found["stepped"] == here.step("rk4", [0.7, -0.2, 0.0], 0.01, 100)
    assert found["chosen"] == pytest.approx(found["stepped"], abs=1e-8)
    assert found["refused"][:5] == [
        f"needed are numbers of x, v, t, got {given}"
        for given in ("undefined", "null", "[1,2]", '{"x":1}', '["1",2,3]')
    ]
    assert found["refused"][5:] == [
        "the module has steps by rk4, dopri5, got euler",
        "n must be a whole number, not below 0, got undefined",
        "n must be a whole number, not below 0, got 0.5",
        "h must be a number, got undefined",
        "the module has steps by dopri5, got rk4",
        "2 steps by dopri5 were not enough",
    ]
