"""Inverse dynamics by the formulations of the paper and by velocities, and the verdict on them."""
