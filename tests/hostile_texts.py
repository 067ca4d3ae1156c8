"""Texts that would be markup or script where somebody forgot that they are texts, and a page full of them."""

import cgraph as cg
import viz
from viz.inspector import Table, Version

HOSTILE = [
    "</script><script>alert(1)</script>",
    'x"onpointerover="alert(1)',
    "x'onload='alert(1)",
    "<img/src=x/onerror=alert(1)>",
    "{tables}",
    "{title}",
    "$tables",
    "<!--",
    "]]>",
    "&lt;b&gt;",
    "javascript:alert(1)",
]


def hostile_page(text: str) -> str:
    name = text.replace(" ", "_")
    x = cg.variable(name)
    with cg.tag(text):
        node = cg.with_name(cg.sin(x) * 2.0, text)
    graph = cg.Graph([x], {text: node})
    tables = [Table(text, [text, text], [[text, text]])]
    return viz.page([Version(text, graph, text, [node]), Version("b", graph)], title=text, about=text, tables=tables)
