"""Drawings of graphs: DOT, and pictures made from it."""
