"""Bridges: graphs as functions of other libraries, and compiled graphs called from within them."""
