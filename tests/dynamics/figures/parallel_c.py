"""One evaluation of a graph as C that is run and timed: operation by operation, in vectors, and by two threads."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from cgraph import Graph, Node
from cgraph.extend import topological

OPERATIONS = {"add": "{} + {}", "sub": "{} - {}", "mul": "{} * {}", "div": "{} / {}", "neg": "-{}"}
ROUNDS, CALLS = 200, 20  # the fastest round counts
FLAGS = ("-O1", "-march=native", "-ffp-contract=fast", "-pthread", "-Wno-psabi")

TIMED = """
#define _GNU_SOURCE
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <time.h>
typedef double v4 __attribute__((vector_size(32)));
typedef double v8 __attribute__((vector_size(64)));
static double x[{n_in}], y[{n_out}], s[{n_shared}];
static _Atomic long go, done;
{functions}
static double now(void) {{ struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }}
static void *second(void *unused) {{
  for (long k = 0; k < {total}L; k++) {{
    while (atomic_load(&go) < 2 * k + 1) ;
    up_b(); atomic_store(&done, 2 * k + 1);
    while (atomic_load(&go) < 2 * k + 2) ;
    down_b(); atomic_store(&done, 2 * k + 2);
  }}
  return unused;
}}
static void alone(void) {{ up_a(); up_b(); middle(); down_a(); down_b(); }}
static long turn = 0;
static void together(void) {{
  atomic_store(&go, 2 * turn + 1); up_a();
  while (atomic_load(&done) < 2 * turn + 1) ;
  middle(); atomic_store(&go, 2 * turn + 2); down_a();
  while (atomic_load(&done) < 2 * turn + 2) ;
  turn++;
}}
static void measure(void (*run)(void)) {{
  double best = 1e9, sum = 0;
  for (int i = 0; i < {rounds}; i++) {{
    double start = now();
    for (int k = 0; k < {calls}; k++) run();
    double took = (now() - start) / {calls};
    best = took < best ? took : best;
  }}
  for (int i = 0; i < {n_out}; i++) sum += y[i];
  printf("%.9e %.17g\\n", best, sum);
}}
int main(void) {{
  for (int i = 0; i < {n_in}; i++) x[i] = 0.2 + 0.8 * ((i * 7919) % 1000) / 1000.0;
  measure(plain); measure(by_4); measure(by_8); measure(alone);
  pthread_t thread;
  if (pthread_create(&thread, 0, second, 0)) return 1;
  measure(together);
  return pthread_join(thread, 0);
}}
"""


def times(graph: Graph, first: Collection[Node], first_outputs: Collection[str]) -> dict[str, tuple[float, float]]:
    """{way: seconds of an evaluation, sum of its outputs}: operations one by one, in vectors, by one thread and by two.

    first, first_outputs: the inputs and outputs of the first thread. Raises ValueError for other operations than sums,
    products and quotients, and RuntimeError without a C compiler.
    """
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise RuntimeError("times of threads and vectors need a C compiler: set CC, or put gcc on PATH")
    parts, shared = _by_threads(graph, first, first_outputs)
    functions = [_function("plain", graph, 1), _function("by_4", graph, 4), _function("by_8", graph, 8), *parts]
    text = TIMED.format(
        n_in=len(graph.inputs),
        n_out=len(graph.outputs),
        n_shared=max(1, shared),
        functions="\n".join(functions),
        rounds=ROUNDS,
        calls=CALLS,
        total=ROUNDS * CALLS,
    )
    with tempfile.TemporaryDirectory() as folder:
        source, program = Path(folder, "timed.c"), Path(folder, "timed")
        source.write_text(text, encoding="utf-8")
        subprocess.run([compiler, *FLAGS, "-o", str(program), str(source)], check=True)
        lines = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout.splitlines()
    ways = ("plain", "4 lanes", "8 lanes", "1 thread", "2 threads")
    return {way: (float(line.split()[0]), float(line.split()[1])) for way, line in zip(ways, lines, strict=True)}


def _order(graph: Graph) -> list[Node]:
    """The operations, arguments first."""
    order = [node for node in topological(graph.outputs.values()) if node.args]
    if other := {node.op.name for node in order} - OPERATIONS.keys():
        raise ValueError(f"the graph has {', '.join(sorted(other))}, where sums, products and quotients were needed")
    return order


def _function(name: str, graph: Graph, lanes: int) -> str:
    """A function of all outputs; operations that are made alike, and not of one another, in vectors of some lanes."""
    names = {node: f"x[{i}]" for i, node in enumerate(graph.inputs)}
    vectors: dict[tuple[Node, ...], str] = {}
    lines = []
    for k, alike in enumerate(_alike(graph, lanes)):
        formula = OPERATIONS[alike[0].op.name]
        if len(alike) < lanes or lanes == 1:
            for j, node in enumerate(alike):
                lines.append(f"double t{k}_{j} = {formula.format(*[_text(arg, names) for arg in node.args])};")
                names[node] = f"t{k}_{j}"
            continue
        columns = list(zip(*[node.args for node in alike], strict=True))
        texts = [vectors.get(column) or _vector(column, names, lanes) for column in columns]
        lines.append(f"v{lanes} t{k} = {formula.format(*texts)};")
        vectors[tuple(alike)] = f"t{k}"
        names |= {node: f"t{k}[{j}]" for j, node in enumerate(alike)}
    lines += [f"y[{i}] = {_text(node, names)};" for i, node in enumerate(graph.outputs.values())]
    return f"static void __attribute__((noinline)) {name}(void) {{\n" + "\n".join(lines) + "\n}"


def _vector(column: Sequence[Node], names: Mapping[Node, str], lanes: int) -> str:
    return f"(v{lanes}){{{', '.join([_text(node, names) for node in column])}}}"


def _text(node: Node, names: Mapping[Node, str]) -> str:
    return f"({node.value!r})" if node.value is not None else names[node]


def _alike(graph: Graph, lanes: int) -> list[list[Node]]:
    """The operations in groups of at most so many, by what they are made of but for which inputs, and by depth."""
    kinds: dict[tuple[object, ...], int] = {}
    kind: dict[Node, int] = {}
    depth: dict[Node, int] = {}
    place = {node: i for i, node in enumerate(graph.inputs)}
    for node in graph.inputs:
        kind[node], depth[node] = -1, 0
    groups: dict[tuple[int, int], list[Node]] = {}
    for node in _order(graph):
        moving = [arg for arg in node.args if arg.value is None]
        made_of = (node.op.name, *[-2 if arg.value is not None else kind[arg] for arg in node.args])
        kind[node] = kinds.setdefault(made_of, len(kinds))
        depth[node] = 1 + max([depth[arg] for arg in moving])
        place[node] = min([place[arg] for arg in moving])
        groups.setdefault((depth[node], kind[node]), []).append(node)
    result = []
    for _, group in sorted(groups.items()):
        group.sort(key=lambda node: place[node])
        result += [group[i : i + lanes] for i in range(0, len(group), lanes)]
    return result


def _by_threads(graph: Graph, first: Collection[Node], first_outputs: Collection[str]) -> tuple[list[str], int]:
    """Functions up_a, up_b, middle, down_a, down_b: what is made of the inputs of one thread, what leads to its outputs
    alone, and what is between; and how many numbers they pass to one another.
    """
    order = _order(graph)
    inputs = {node: "a" if node in first else "b" for node in graph.inputs}
    outputs: dict[Node, set[str]] = {}
    for name, node in graph.outputs.items():
        outputs.setdefault(node, set()).add("a" if name in first_outputs else "b")
    for node in reversed(order):
        for arg in node.args:
            outputs.setdefault(arg, set()).update(outputs[node])
    sides: dict[Node, str] = dict(inputs)
    part: dict[Node, str] = {}
    for node in order:
        made_of = {sides[arg] for arg in node.args if arg.value is None}
        sides[node] = made_of.pop() if len(made_of) == 1 else "both"
        if sides[node] != "both":
            part[node] = f"up_{sides[node]}"
        else:
            part[node] = f"down_{min(outputs[node])}" if len(outputs[node]) == 1 else "middle"
    users = _users(order)
    crossing = [node for node in order if any([part[node] != part[user] for user in users[node]])]
    slots = {node: f"s[{i}]" for i, node in enumerate(crossing)}
    ends: dict[Node, list[int]] = {}
    for i, node in enumerate(graph.outputs.values()):
        ends.setdefault(node, []).append(i)
    functions = []
    for name in ("up_a", "up_b", "middle", "down_a", "down_b"):
        names = {node: f"x[{i}]" for i, node in enumerate(graph.inputs)} | slots
        lines = []
        for k, node in enumerate(order):
            if part[node] == name:
                formula = OPERATIONS[node.op.name].format(*[_text(arg, names) for arg in node.args])
                lines.append(f"double t{k} = {formula};")
                lines += [f"{slots[node]} = t{k};"] if node in slots else []
                lines += [f"y[{i}] = t{k};" for i in ends.get(node, ())]
                names[node] = f"t{k}"
        functions.append(f"static void __attribute__((noinline)) {name}(void) {{\n" + "\n".join(lines) + "\n}")
    return functions, len(slots)


def _users(order: Sequence[Node]) -> dict[Node, list[Node]]:
    users: dict[Node, list[Node]] = {node: [] for node in order}
    for node in order:
        for arg in node.args:
            if arg in users:
                users[arg].append(node)
    return users
