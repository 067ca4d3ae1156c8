"""What is said of mechanisms that cannot be, or are not all of what they were read from."""


class MechanismError(ValueError):
    """A mechanism that cannot be: which body, what was given, and what was needed."""


class MechanismWarning(UserWarning):
    """What a mechanism has not of the file that it was read from, or a body that cannot be, but can be calculated with.

    Examples
    --------
    >>> import warnings
    >>> import dynamics as dyn
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", dyn.MechanismWarning)  # a model that lacks something is no model
    """
