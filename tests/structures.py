"""Structures that several tests share."""

from dataclasses import dataclass

import numpy as np

from tensegrity import Prism, Structure, catalogue, held


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


def _cable(rng):
    """Pieces in a row, the two ends to be held."""
    pieces, dim = int(rng.integers(2, 12)), int(rng.integers(2, 4))
    x = np.zeros((pieces + 1, dim))
    x[:, 0] = np.cumsum(np.append(0, rng.uniform(0.5, 1.5, pieces)))
    return x, [], [(i, i + 1) for i in range(pieces)], [0, pieces], None


def _truss(rng):
    """Triangles of bars in a row, two nodes to be held."""
    nodes = int(rng.integers(4, 10))
    x = np.array([(0.5 * i, 0.8 * (i % 2)) for i in range(nodes)])
    x += rng.uniform(-0.1, 0.1, x.shape)
    bars = [(i, i + j) for i in range(nodes) for j in (1, 2) if i + j < nodes]
    return x, bars, [], [0, 1], np.zeros(len(bars))


def _net(rng):
    """A saddle of strings, its border to be held."""
    m = int(rng.integers(3, 6))
    number = np.arange(m * m).reshape(m, m)
    inner = number[1:-1, 1:-1].ravel().tolist()
    along = [*zip(number[:, :-1].ravel(), number[:, 1:].ravel(), strict=True),
             *zip(number[:-1].ravel(), number[1:].ravel(), strict=True)]  # fmt: skip
    pairs = [(int(i), int(j)) for i, j in along if i in inner or j in inner]
    used = sorted({n for pair in pairs for n in pair})
    x = np.array([(n // m, n % m, 0.2 * (n // m - n % m) * (n // m + n % m - m + 1) / m)
                  for n in used])  # fmt: skip
    strings = [(used.index(i), used.index(j)) for i, j in pairs]
    return x, [], strings, [k for k, n in enumerate(used) if n not in inner], None


def _catalogued(rng):
    """A tensegrity under prestress, some nodes to be held."""
    s, fixed = [
        lambda: (catalogue.expandable_octahedron(1.0), range(3)),
        lambda: (catalogue.tower(int(rng.integers(2, 4))), range(3)),
        lambda: (catalogue.dome(6, 1), range(6)),
        lambda: (catalogue.snelson_x(), range(2)),
    ][int(rng.integers(4))]()
    tensions = s.self_stress().feasible * s.lengths
    return s.positions, s.ends[: s.bars], s.ends[s.bars :], list(fixed), tensions


def stiff_state(rng, far=0.0, strains=(1e-6, 3e-3)):
    """A structure at a laboratory's scale, loads that it carries, and its supports.

    EA is 1e3 to 1e8 N, lengths 1e-5 to 100 m, the largest strain without load as given; `far` is
    the distance from the origin over the length.
    """
    shape = (_cable, _truss, _net, _catalogued)[int(rng.integers(4))]
    x, bars, strings, fixed, tensions = shape(rng)
    dim, members = x.shape[1], len(bars) + len(strings)
    size = 10.0 ** rng.uniform(-5, 2)
    x = size * (x @ turned(rng, dim).T + far * rng.normal(size=dim))
    ea = 10.0 ** rng.uniform(3, 8) * np.exp(rng.uniform(-0.5, 0.5, members))
    strain = np.exp(rng.uniform(*np.log(strains)))
    if tensions is None:
        strained = strain * rng.uniform(0.5, 1, members)
    else:
        strained = strain * tensions / ea / (np.abs(tensions / ea).max() or 1.0)
    natural = Structure(x, bars, strings).lengths / (1 + strained)
    k = np.split(ea / natural, [len(bars)])
    given = {f"k_{name}": of for name, of in zip(("bar", "string"), k, strict=True) if len(of)}
    s = Structure(x, bars, strings, **given, natural_lengths=natural)
    part = 10.0 ** rng.uniform(-3, -0.3 if tensions is None else -1.3)
    free = [n for n in range(s.nodes) if n not in fixed]
    loaded = rng.choice(free, int(rng.integers(1, len(free) + 1)), replace=False)
    loads = {int(n): part * strain * ea.min() * rng.normal(size=dim) for n in loaded}
    return s, loads, held(fixed)
