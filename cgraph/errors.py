"""The error that a graph raises about itself, and what the errors about missing packages say."""


class GraphError(ValueError):
    """A graph that is not well formed, or is used with inputs or outputs that it does not have."""


def install(extra: str) -> str:
    """How to get the packages of an extra: the end of an error's sentence. Quoted, as some shells expand brackets."""
    return f"in a checkout of cgraph, pip install '.[{extra}]'"
