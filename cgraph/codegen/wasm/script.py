"""The JavaScript beside a WebAssembly module: it is called with arrays and names, and no address can be wrong."""

from __future__ import annotations

import json
from collections.abc import Mapping

from ...core.graph import Graph
from ...util.require import require_graph
from ...util.version import __version__
from ...writing.structure_hash import structure_hash
from ..explicit_method import Tableau, checked_methods
from .functions import page_functions

_TEXT = """\
// __N_OUT__ outputs of __N_IN__ inputs, for the module that cgraph.to_wasm wrote of them. cgraph __VERSION__, structure
// hash __HASH__. cgraph claims no rights in this text and in the module.

export const inputs = __INPUTS__;
export const outputs = __OUTPUTS__;
export const methods = __METHODS__; // of equal steps
export const choosing = __CHOOSING__; // methods that choose their steps, too

/** Numbers of all inputs, given as an array in their order or as an object by their names. */
function numbers(x) {
  const some = x !== null && typeof x === "object";
  const listed = Array.isArray(x) || ArrayBuffer.isView(x);
  const values = listed ? Array.from(x) : some ? inputs.map((name) => x[name]) : [];
  const right = some && values.length === inputs.length;
  if (!right || !values.every((value) => typeof value === "number")) {
    throw new TypeError(`needed are numbers of ${inputs.join(", ")}, got ${some ? JSON.stringify(x) : x}`);
  }
  return values;
}

function number(what, value) {
  if (typeof value !== "number" || Number.isNaN(value)) throw new TypeError(`${what} must be a number, got ${value}`);
  return value;
}

function known(method, among) {
  if (among.includes(method)) return method;
  throw new RangeError(`the module has steps by ${among.join(", ") || "no method"}, got ${method}`);
}

/** The functions of a module: its bytes, or the response of `fetch`. */
export async function load(source) {
  const bytes = typeof source?.arrayBuffer === "function" ? await source.arrayBuffer() : source;
  const { exports } = (await WebAssembly.instantiate(bytes, { math: __MATH__ })).instance;
  const at = (byte, count) => new Float64Array(exports.memory.buffer, byte, count);
  const given = (x) => at(0, inputs.length).set(numbers(x));
  return {
    /** The outputs. */
    evaluate(x) {
      given(x);
      exports.evaluate(0, 8 * inputs.length);
      return at(8 * inputs.length, outputs.length).slice();
    },
    /** The inputs after n steps of size h by a method: the state and the time are those at the end. */
    step(method, x, h, n) {
      if (!Number.isInteger(n) || n < 0) throw new TypeError(`n must be a whole number, not below 0, got ${n}`);
      given(x);
      exports[known(method, methods)](0, number("h", h), n);
      return at(0, inputs.length).slice();
    },
    /** The inputs after a span by steps that an estimate of the error chooses, and the step to go on with. */
    stepTo(method, x, span, { h = span / 100, rtol = 1e-9, atol = 1e-10, most = 100000 } = {}) {
      given(x);
      const options = Object.entries({ span, h, rtol, atol, most }).map(([name, value]) => number(name, value));
      const next = exports[`${known(method, choosing)}_to`](0, ...options);
      if (Number.isNaN(next)) throw new RangeError(`${most} steps by ${method} were not enough`);
      return { x: at(0, inputs.length).slice(), h: next };
    },
  };
}
"""


def wasm_script(graph: Graph, methods: Mapping[str, Tableau] | None = None, *, time: str = "t") -> str:
    """JavaScript beside a module of `to_wasm`: an ES module that loads it and calls it with arrays, or with names.

    It exports the names `inputs`, `outputs` and `methods`, and `load`, of the bytes or of what `fetch` answers, which
    gives evaluate(x), step(method, x, h, n) and stepTo(method, x, span, {h, rtol, atol, most}): x has a number for each
    input, in their order, or by name. What is no such thing is refused, where the bare exports of the module take a
    missing address for 0 and write over the inputs.

    Parameters
    ----------
    graph, methods, time
        As `to_wasm` was given them.

    Returns
    -------
    str
        The text of a file such as arm.mjs.

    Raises
    ------
    GraphError, TypeError
        As of `to_wasm`.
    ValueError
        For an operation that calls a function which neither the module nor JavaScript has.

    Examples
    --------
    >>> import cgraph as cg
    >>> text = cg.wasm_script(cg.Graph([cg.variable("x")], {"y": cg.variable("x") + 1.0}))
    >>> [line for line in text.splitlines() if line.startswith("export const inputs")]
    ['export const inputs = ["x"];']
    """
    require_graph("wasm_script", graph)
    chosen = checked_methods(methods, graph, time)
    filled = {
        "N_IN": str(len(graph.inputs)),
        "N_OUT": str(len(graph.outputs)),
        "VERSION": __version__,
        "HASH": structure_hash(graph),
        "INPUTS": json.dumps(graph.input_names),
        "OUTPUTS": json.dumps([*graph.outputs]),
        "METHODS": json.dumps([*chosen]),
        "MATH": page_functions(graph),
        "CHOOSING": json.dumps([name for name, each in chosen.items() if len(getattr(each, "error", ())) == 1]),
    }
    text = _TEXT
    for key, value in filled.items():
        text = text.replace(f"__{key}__", value, 1)
    return text
