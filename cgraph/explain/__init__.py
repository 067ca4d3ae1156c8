"""Explanations of a graph: what of it is not as declared, why outputs depend on inputs, how two differ."""

from .compare import Comparison, Overlay, compare
from .lint.finding import Finding
from .lint.lint import Lint, lint
from .why import Path, Why, why
from .why_not import WhyNot, why_not

__all__ = ["Comparison", "Finding", "Lint", "Overlay", "Path", "Why", "WhyNot", "compare", "lint", "why", "why_not"]
