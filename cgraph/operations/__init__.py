"""Operations: the table, a row each, with all that any part of the library knows of them.

Whoever imports this package has the table filled.
"""

from . import table as table
