"""The extras of the distribution: what the errors about missing packages say."""


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
