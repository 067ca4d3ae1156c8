"""The engine of the typed page in V8, without a browser."""

import json
from functools import cache
from typing import Any

from py_mini_racer import MiniRacer

from viz.pages.html import asset
from viz.pages.operations import operations
from viz.typed.text_page import engine

HELPERS = """
const edges = (graph) => graph.nodes.reduce((sum, node) => sum + node.args.length, 0);
/** What a text says, or what is wrong with it. Any other error is a defect. */
function read(text) {
  try {
    return { system: TYPED.parse(text) };
  } catch (error) {
    if (!(error instanceof TYPED.TextError)) return { defect: `${error.stack}` };
    return { wrong: TYPED.explained(text, error) };
  }
}
function parsed(text) {
  const { system, wrong, defect } = read(text);
  if (!system) throw new Error(wrong?.sentence ?? defect);
  return system;
}
const formulation = (system, name) => {
  const found = TYPED.verdict(system, name), { graph, nodes, differs, lines } = found;
  return { nodes: graph.nodes.length, edges: edges(graph), spurious: nodes.size, blamed: found.edges.length, differs,
    lacking: found.lacking !== "", off: found.off, words: [found.sentence, found.why], lines,
    lint: TYPED.lint(system, found), graph };
};
/** Outputs of a graph at {input: number}, and the largest number on the way. */
function outputsAt(graph, at) {
  const values = TYPED.compiled(graph.inputs, graph.nodes)(graph.inputs.map(({ name }) => at[name]));
  const place = new Map(graph.nodes.map((node, i) => [node, i]));
  return { at: Object.fromEntries([...graph.outputs].map(([name, node]) => [name, values[place.get(node)]])),
    largest: Math.max(...values.map(Math.abs)) };
}
"""


@cache
def machine() -> MiniRacer:
    made = MiniRacer()
    made.eval(f'"use strict";\n{operations()}{asset("viz.pages", "graph.js", "slopes.js")}{engine()}\n{HELPERS}')
    return made


def run_typed(function: str, *given: Any) -> Any:
    """What a function of JavaScript returns for arguments that JSON can hold, as JSON holds it."""
    texts = ", ".join([json.dumps(each) for each in given])
    return json.loads(machine().eval(f"JSON.stringify((({function}))({texts}))"))
