"""Files in which one part at a time is of another kind, another shape, or no number."""

import numpy as np

from tensegrity import State
from tensegrity.runs import archive

parts, written, identity = archive.read, archive.write, archive.identity


def crafted(path, kind, others):
    """Write the file anew with each part exchanged, in turn, and say which; then as it was.

    `others` are more values for some of the parts.
    """
    whole = archive.read(path, kind)
    for name, value in whole.items():
        for other in [*_bent(value), *others.get(name, ())]:
            archive.write(path, kind, whole | {name: other})
            yield name, other
        archive.write(path, kind, {k: x for k, x in whole.items() if k != name})
        yield name, "left out"
    archive.write(path, kind, whole)


def _bent(value):
    yield from ({"x": 1.0}, -1.5, np.array(["x"]))
    if not isinstance(value, str):
        yield "x"
    if isinstance(value, (str, bool, np.ndarray, tuple)):
        yield 3
    if isinstance(value, np.ndarray):
        yield from (value[..., :-1], value[None], value.astype(int), value.astype(np.float32))
        yield np.where(np.arange(value.size).reshape(value.shape) == 0, np.nan, value)
    if isinstance(value, tuple):
        yield from (value[:-1], (*value, 10**6), (*value[:-1], -1), (*value[:-1], 0.5))
    if isinstance(value, State):
        yield State(value.u[:-1], value.v[:-1])
