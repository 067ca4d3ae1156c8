"""The error that a graph raises about itself."""


class GraphError(ValueError):
    """A graph that is not well formed, or is used with inputs or outputs that it does not have."""
