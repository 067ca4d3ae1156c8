"""Multibody: trees of rigid bodies on joints, their motion, energy, forces and changes of structure."""
