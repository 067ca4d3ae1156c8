"""Dependence: inputs that nothing uses, and outputs that do not depend on what they should."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..names import Name, Names, joined
from ..reachability import ancestors
from .finding import Finding


def unused_inputs(names: Names) -> list[Finding]:
    """The inputs that no output depends on."""
    used = set(names.graph.nodes)
    unused = [node for node in names.graph.inputs if node not in used]
    return [
        Finding(
            "unused input", f"Nothing uses the input {names.text(node)}.", (node,), data={"input": names.text(node)}
        )
        for node in unused
    ]


def missing_dependences(names: Names, depends: Mapping[Name, Name | Sequence[Name]]) -> list[Finding]:
    """The outputs that do not depend on each of the nodes declared for them."""
    findings = []
    for output, declared in depends.items():
        sink = names.output(output)
        reached = ancestors([sink])
        inputs = [names.text(node) for node in names.graph.inputs if node in reached]
        for node in names.group(declared):
            if node not in reached:
                output_name = names.shown(names.meant(output)) if isinstance(output, str) else names.text(sink)
                name = names.text(node)
                text = f"{output_name} does not depend on {name}; it is made from {joined(inputs, 12) or 'numbers'}."
                data = {"output": output_name, "input": name, "made_from_inputs": inputs}
                findings.append(Finding("missing dependence", text, (sink, node), data=data))
    return findings
