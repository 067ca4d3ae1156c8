"""The balanced order of elimination: pieces by nested dissection leave at the same time, long sums are in blocks."""
