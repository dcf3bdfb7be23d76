"""Lines of the numbers of the pictures of gradients."""

from __future__ import annotations


def numbers(values):
    """A table of named numbers."""
    return {"quantity": list(values), "value": [float(x) for x in values.values()]}


def lines(name, tables):
    """Lines of the group's table, from the numbers of a picture."""
    pairs = zip(*tables["numbers"].values(), strict=True)
    return [{"picture": name, "quantity": k, "value": float(x)} for k, x in pairs]
