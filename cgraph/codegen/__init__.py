"""Compilation: graphs to generated source or machine code that runs without walking nodes."""
