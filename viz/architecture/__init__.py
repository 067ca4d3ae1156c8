"""Architecture: which folder imports which, on which floor it stands, and what points the wrong way."""
