"""The error that a graph raises about itself, and what the errors about missing packages say."""


class GraphError(ValueError):
    """A graph is not well formed, or is asked about inputs, outputs or nodes that it does not have.

    Examples
    --------
    >>> import cgraph as cg
    >>> cg.Graph([], {"y": cg.variable("x")})
    Traceback (most recent call last):
    cgraph.errors.GraphError: the outputs need 'x', not among the inputs (none)
    """


def install(extra: str) -> str:
    """How to get the packages of an extra, as the end of an error's sentence.

    Parameters
    ----------
    extra : str
        Name of an extra of the distribution, such as "viz".

    Returns
    -------
    str
        The command, its argument quoted, since some shells expand brackets.

    Examples
    --------
    >>> from cgraph.extend import install
    >>> install("viz")
    "in a checkout of cgraph, pip install '.[viz]'"
    """
    return f"in a checkout of cgraph, pip install '.[{extra}]'"
