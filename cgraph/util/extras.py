"""The extras of the distribution: what the errors about missing packages say."""


def install(extra: str) -> str:
    """How to get the packages of an extra, such as "viz", as the end of an error's sentence.

    The argument of the command is quoted, since some shells expand brackets.

    >>> from cgraph.extend import install
    >>> install("viz")
    "in a checkout of cgraph, pip install '.[viz]'"
    """
    return f"in a checkout of cgraph, pip install '.[{extra}]'"
