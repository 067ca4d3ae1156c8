"""The directive `names`: the reference of the names of a package that its lines list, each as what it is."""

import inspect
from importlib import import_module

from sphinx.util.docutils import SphinxDirective

WITH_INHERITED = ("Compiled", "Contact", "Force", "JointForce", "Mechanism")  # of bases without a page


class Names(SphinxDirective):
    """```{names} dynamics``` and below it, in any number of lines, names of that package or module."""

    required_arguments = 1
    has_content = True

    def run(self):
        """The nodes that autodoc makes."""
        package = self.arguments[0]
        lines = [line for name in " ".join(self.content).split() for line in _directive(package, name)]
        return self.parse_text_to_nodes("```{eval-rst}\n" + "\n".join(lines) + "\n```\n")


def _directive(package, name):
    """Lines of reStructuredText."""
    value = getattr(import_module(package), name)
    if inspect.ismodule(value):
        elsewhere = ", ".join(set(vars(value)) & set(import_module(package).__all__))  # has an entry of its own
        members = ["   :members:", "   :imported-members:", f"   :exclude-members: {elsewhere}"]
        return [f".. automodule:: {package}.{name}", *members, ""]
    if inspect.isclass(value):
        inherited = ["   :inherited-members:"] if name in WITH_INHERITED else []
        return [f".. autoclass:: {package}.{name}", "   :members:", *inherited, ""]
    if callable(value):
        return [f".. autofunction:: {package}.{name}", ""]
    own = "" if type(value).__module__ == "builtins" else inspect.getdoc(type(value))  # not Python's of a tuple
    listed = ", ".join([f"``{each}``" for each in value])
    return [f".. py:data:: {package}.{name}", "", *([f"   {own}", ""] if own else []), f"   {listed}.", ""]


def setup(app):
    """Called by Sphinx."""
    app.add_directive("names", Names)
    return {"parallel_read_safe": True}
