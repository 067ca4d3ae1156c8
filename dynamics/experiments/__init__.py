"""Experiments: figures measured on scenes, as plain data for a page, a plot, a table or a test."""
