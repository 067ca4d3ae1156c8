"""Derivatives of programs: forward and reverse mode over statements."""
