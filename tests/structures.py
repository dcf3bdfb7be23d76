"""Structures that several tests share."""

from dataclasses import dataclass

import numpy as np

from tensegrity import Prism, Structure, catalogue


def icosahedron(prestrain=0.1, k_bar=100.0):
    """Six bars, 24 strings of length sqrt 6; None leaves it without prestress."""
    s = catalogue.expandable_octahedron(4.0, 0.0, k_bar)
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
    s = catalogue.snelson_x(prestrain=prestrain, k_bar=10.0)
    return s.at(np.pad(s.positions, [(0, 0), (0, dim - 2)]))


def turned(rng, dim):
    """A random rotation, (dim, dim)."""
    turn = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    return turn


def with_strings_at_rest(seed):
    """A random structure of which strings are exactly at their natural length: all members, or
    those that are added to a structure under prestress."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        prestrain = rng.uniform(0.01, 0.2)
        prism = Prism(1.0, rng.uniform(0.5, 1.5), prestrain, 1.0, 5.0, 50.0)
        s = prism.structure() if seed % 4 == 1 else icosahedron(prestrain)
        s = s.at(s.positions @ turned(rng, 3).T)
        joined, count = {tuple(sorted(e)) for e in s.ends.tolist()}, int(rng.integers(1, 4))
    else:
        dim, nodes = int(rng.integers(2, 4)), int(rng.integers(4, 9))
        x = rng.normal(size=(nodes, dim))
        tree = [(int(rng.integers(0, i)), i) for i in range(1, nodes)]
        bars = [e for e in tree if rng.random() < 0.5]
        strings = [e for e in tree if e not in bars]
        k_bar, mass = rng.uniform(5, 50, len(bars)), rng.uniform(0.5, 2, nodes)
        s = Structure(x, bars=bars, strings=strings, k_bar=k_bar, mass=mass)
        joined, count = set(tree), int(rng.integers(1, dim * nodes))
    others = [(i, j) for j in range(s.nodes) for i in range(j) if (i, j) not in joined]
    added = [others[k] for k in rng.permutation(len(others))[:count]]
    loose = Structure(s.positions, bars=s.ends[: s.bars], strings=[*s.ends[s.bars :], *added])
    lengths = np.append(s.natural_lengths, loose.lengths[len(s.ends) :])
    k_added = rng.uniform(0.5, 5, len(added))
    given = {"k_bar": s.stiffnesses[: s.bars], "k_string": [*s.stiffnesses[s.bars :], *k_added]}
    return loose.at(loose.positions, natural_lengths=lengths, mass=s.mass, **given)


@dataclass(frozen=True)
class Frame:
    """Another frame: turned, of another size, moved, nodes in another order."""

    turn: np.ndarray
    size: float
    shift: np.ndarray
    order: np.ndarray

    @classmethod
    def of(cls, s, rng):
        size = 10.0 ** rng.uniform(-6, 6)
        shift = size * rng.uniform(-10, 10, s.dim)
        return cls(turned(rng, s.dim), size, shift, rng.permutation(s.nodes))

    def nodes(self, numbers):
        """Numbers here of nodes there."""
        return np.argsort(self.order)[np.asarray(numbers)]

    def vectors(self, v):
        """Vectors of nodes (..., nodes, dim) there, not scaled."""
        return v[..., self.order, :] @ self.turn.T

    def structure(self, s):
        ends = self.nodes(s.ends)
        return s.at(
            self.size * self.vectors(s.positions) + self.shift,
            bars=ends[: s.bars],
            strings=ends[s.bars :, ::-1],
            mass=s.mass[self.order],
            natural_lengths=self.size * s.natural_lengths,
        )
