"""The balanced order of elimination: pieces by nested dissection, which leave at the same time."""
