"""Pages and films of a model."""
