"""Common parts of the pictures of gradients: an objective, and the lines of their numbers."""

from __future__ import annotations

import numpy as np

from tensegrity import objective


def sample(trace, step):
    """A trace after a step (0: the start), as an objective."""

    def rule(t, y):
        slope = np.zeros_like(y)
        slope[0, step] = 1
        return float(y[0, step]), slope

    return objective.of([trace], rule)


def numbers(values):
    """A table of named numbers."""
    return {"quantity": list(values), "value": [float(x) for x in values.values()]}


def lines(name, tables):
    """Lines of the group's table, from the numbers of a picture."""
    pairs = zip(*tables["numbers"].values(), strict=True)
    return [{"picture": name, "quantity": k, "value": float(x)} for k, x in pairs]
