"""Animations: frames drawn from points and curves, and files of them."""
