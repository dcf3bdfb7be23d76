"""Lattices of the tests: the cells and numbers of `lattices.json`, and lattices of few nodes."""

import json
from pathlib import Path

import numpy as np

from tensegrity import Lattice

CASES = {c["id"]: c for c in json.loads((Path(__file__).parent / "lattices.json").read_text())}


def lattice(name, **other):
    """The cell of a case."""
    cell = CASES[name]["cell"]
    strings = np.array(cell["is_string"])
    order = np.argsort(strings, kind="stable")  # bars first
    members = [cell["members"][m] for m in order]
    members = [(i, j, tuple(o)) for i, j, *o in members]
    k = np.array(cell["k"])[order]
    count = int(np.sum(~strings))
    arguments = {
        "positions": cell["positions"], "vectors": cell["vectors"], "bars": members[:count],
        "strings": members[count:], "k_bar": k[:count], "k_string": k[count:],
        "mass": cell["mass"], "natural_lengths": np.array(cell["natural_length"])[order],
    }  # fmt: skip
    return Lattice(**(arguments | other))


def values(name):
    return CASES[name]["values"]
