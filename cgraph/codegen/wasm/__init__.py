"""WebAssembly: a graph as a module that computes it, and steps its motion."""

from .to_wasm import to_wasm

__all__ = ["to_wasm"]
