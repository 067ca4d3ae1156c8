"""Derivatives of the equations of motion by states and forces."""
