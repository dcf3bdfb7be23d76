"""Structures that several tests share."""

import numpy as np

from tensegrity import Structure


def icosahedron(prestrain=0.1, k_bar=100.0):
    """Six bars, 24 strings of length sqrt 6; None leaves it without prestress."""
    corners = [(0, a, b) for a in (-1, 1) for b in (-2, 2)]
    nodes = np.array([np.roll(p, shift) for shift in range(3) for p in corners], dtype=float)
    far = np.linalg.norm(nodes[:, None] - nodes, axis=2)
    bars, strings = (
        np.argwhere(np.triu(np.abs(far - length) < 1e-9)).tolist() for length in (4.0, 6**0.5)
    )
    s = Structure(nodes, bars=bars, strings=strings, k_bar=k_bar, k_string=1.0)
    return s if prestrain is None else s.prestressed(prestrain={6: prestrain})


def upright(s, triangles=((0, 4, 8), (3, 7, 11))):
    """An icosahedron turned so that two opposite triangles of strings lie across the z axis."""
    low, high = (s.positions[list(t)].mean(axis=0) for t in triangles)
    axis = (high - low) / np.linalg.norm(high - low)
    first = s.positions[triangles[1][0]] - high
    first = first / np.linalg.norm(first)
    frame = np.array([first, np.cross(axis, first), axis])
    return s.at((s.positions - low) @ frame.T)


def cross(dim=2, prestrain=0.1):
    """The planar X: a unit square of strings with two bars along its diagonals."""
    corners = np.zeros((4, dim))
    corners[:, :2] = [[0, 0], [1, 0], [1, 1], [0, 1]]
    strings = [(0, 1), (1, 2), (2, 3), (3, 0)]
    s = Structure(corners, bars=[(0, 2), (1, 3)], strings=strings, k_bar=10.0, k_string=1.0)
    return s.prestressed(prestrain={2: prestrain})
