"""Verification: equations that hold whatever the model is, and agreement with other software."""
