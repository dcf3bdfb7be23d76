"""Files of other programs and instruments: what is read from them, and written for them.

`read` and `write` choose a format by the suffix of a path.  A file is written beside the one that
it replaces, and renamed once it is whole; of what is read nothing is evaluated.
"""

from tensegrity.files.door import read, write

__all__ = ["read", "write"]
