"""Operations: the table, a row each, with all that any part of the library knows of them.

Whoever imports this package has the table filled, and graphs that pickle.
"""

from . import records as records, table

abs, round = table.abs_, table.round_  # the rows of the table use Python's
