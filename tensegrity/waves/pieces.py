"""Waves whose crest is beyond a corner of the force, as where contacts open: solved in pieces.

Where the elongation passes the corner, at the distance X from the crest, the tension has a corner
or a root in x, and no Fourier's series is exact; the elongation has one of two orders more there,
and the same again a site farther.  The places X + j and -X + j, j whole, divide the line into
cells that a shift by one site maps onto each other.  In each cell, in a coordinate that crowds
towards its ends, all is a polynomial; K T = W(x + 1) - 2 W(x) + W(x - 1), W'' = T, is then exact
on the nodes.  Newton's method solves m c^2 r = K T and r(X) = the corner for given X, and X is
what amplitude, speed or energy are adjusted by.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

from tensegrity import check
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.root import root
from tensegrity.waves.family import half_length
from tensegrity.waves.travelling import Grid, cosine_sum
from tensegrity.waves.wave import SolitaryWave

BEFORE, START = 0.99, 0.05  # part of a corner, and the distance X, to begin with from there
NODES, FINER = (16, 32, 48, 64), 8  # in a cell; so many more where the residual is taken
CROWDING = 3  # order of the zeros of dx/dt at the ends of a cell
ITERATIONS, CONVERGED = 40, 1e-13
SEARCHES, ADJUSTED = 60, 4e-16
FIRST, FARTHEST = 1e-3, 0.25  # change of X to begin with, in parts of it; sites, at most
TARGET, LARGEST = 1e-13, 1e-12  # residual aimed at, and the largest that is returned
POINTS = 4096  # of the uniform grid that such a wave shows


class Mesh:
    """Cells and nodes for a corner at the distance X >= 0 from the crest.

    Attributes
    ----------
    edges : ndarray, (cells + 1,)
    x : ndarray, (n,)
        Nodes at x > 0.
    mean : ndarray, (n, n)
        K on the values at nodes of an even function.
    at_corner, at_crest : ndarray, (n,)
        K at X; the value at 0.
    weights : ndarray, (n,)
        Of the integral over the line.
    """

    def __init__(self, corner, half_length, nodes):
        from scipy.special import beta, betainc

        whole, sites = math.floor(corner), math.ceil(half_length) + math.ceil(corner)
        near = min(corner - whole, 1 - corner + whole)
        widths = np.array([2 * near, 1 - 2 * near])  # of even and odd cells
        cells = 4 * sites + 1
        self.edges = (
            -sites - near + np.concatenate([[0.0], np.cumsum(widths[np.arange(cells) % 2])])
        )
        t = (1 + legendre.leggauss(nodes)[0]) / 2
        self.to_series = np.linalg.inv(legendre.legvander(2 * t - 1, nodes - 1))
        rate = (t * (1 - t)) ** (CROWDING - 1) / beta(CROWDING, CROWDING)
        steps = _running(t, nodes) @ self.to_series * rate
        total = _running(np.ones(1), nodes)[0] @ self.to_series * rate
        self.nodes, self.rate = nodes, rate
        full = self.edges[:-1, None] + np.diff(self.edges)[:, None] * betainc(CROWDING, CROWDING, t)
        self.x = full.ravel()[full.size // 2 :]
        self.weights = 2 * np.outer(np.diff(self.edges), total).ravel()[full.size // 2 :]
        blocks = [self._block(np.roll(widths, k), steps, total) for k in (0, 1)]
        size = cells * nodes
        mean = np.zeros((size, size + 4 * nodes))  # two cells beyond each end
        for cell in range(cells // 2, cells):
            part = slice(cell * nodes, (cell + 1) * nodes)
            mean[part, cell * nodes : (cell + 5) * nodes] = blocks[cell % 2][0]
        self.mean = self._folded(mean[size // 2 :, 2 * nodes : -2 * nodes])
        cell = int(np.argmin(np.abs(self.edges - corner)))
        row = np.zeros(size + 4 * nodes)
        row[cell * nodes : (cell + 5) * nodes] = blocks[cell % 2][1]
        self.at_corner = self._folded(row[2 * nodes : -2 * nodes])
        row = np.zeros(size)
        middle = slice(cells // 2 * nodes, (cells // 2 + 1) * nodes)
        row[middle] = legendre.legvander(np.zeros(1), nodes - 1)[0] @ self.to_series
        self.at_crest = self._folded(row)

    def _block(self, widths, steps, total):
        """K at the nodes of a cell, and at its first edge, from the two cells on either side."""
        n = len(total)
        once, starts = np.zeros((5 * n, 5 * n)), np.zeros((6, 5 * n))
        for cell in range(5):
            part, width = slice(cell * n, (cell + 1) * n), widths[cell % 2]
            once[part] = starts[cell]
            once[part, part] += steps * width
            starts[cell + 1] = starts[cell]
            starts[cell + 1, part] += total * width
        twice, edges = once @ once, starts @ once
        low, here, high = (twice[k * n : (k + 1) * n] for k in (0, 2, 4))
        return high - 2 * here + low, edges[4] - 2 * edges[2] + edges[0]

    def _folded(self, row):
        """A functional of all values, of those at x > 0 of an even function."""
        half = row.shape[-1] // 2
        return row[..., half:] + row[..., :half][..., ::-1]


def _running(t, nodes):
    """Integrals from 0 to t of Legendre's polynomials of 2 t - 1, (len(t), nodes)."""
    return np.stack(
        [legendre.legval(2 * t - 1, legendre.legint(row, lbnd=-1)) / 2 for row in np.eye(nodes)], -1
    )


@dataclass(frozen=True, eq=False)
class PiecewiseWave(SolitaryWave):
    """A solitary wave whose crest is beyond a corner of the force, see `waves.pieces`."""

    _integrals: Integrals = field(repr=False, kw_only=True)

    def elongation(self, x):
        """Elongation [m] at distances x from the crest (sites, any shape)."""
        return self._integrals.elongation(check.numbers("x", x, "sites"))

    def rate(self, x):
        """du/dx [m per site] at distances x from the crest: the velocity is -speed times it."""
        return self._integrals.rate(check.numbers("x", x, "sites"))

    def displacement(self, x):
        """u(x) [m], 0 far ahead of the crest (x > 0)."""
        x = np.clip(check.numbers("x", x, "sites"), -self.x[-1] - 1, self.x[-1] + 1)
        return self._integrals.twice(x + 0.5) - self._integrals.twice(x - 0.5)

    @cached_property
    def _on_x(self):
        return self.elongation(self.x)

    @property
    def shift(self):
        """How far a passing wave carries each mass [m], > 0 along its way."""
        return float(-2 * self._integrals.once(np.zeros(())))


class Integrals:
    """Integrals from x to infinity, once and twice, of an even function given on a mesh."""

    def __init__(self, mesh, values):
        self._edges = mesh.edges[len(mesh.edges) // 2 - 1 :]  # from the cell of the crest on
        values = np.concatenate([values[: mesh.nodes // 2][::-1], values]).reshape(-1, mesh.nodes)
        widths = np.diff(self._edges)[:, None]
        series = (values * mesh.rate * widths) @ mesh.to_series.T
        self._once = _left(series)
        at_nodes = legendre.legval(legendre.leggauss(mesh.nodes)[0], self._once.T)
        series = (at_nodes * mesh.rate * widths) @ mesh.to_series.T
        self._twice = _left(series)

    def once(self, x):
        """Integral from x to infinity."""
        return np.where(x < 0, 2 * self._at(self._once, 0.0 * x), 0.0) + np.sign(
            np.where(x == 0, 1.0, x)
        ) * self._at(self._once, np.abs(x))

    def twice(self, x):
        """That of it."""
        more = np.where(x < 0, -2 * x * self._at(self._once, 0.0 * x), 0.0)
        return more + self._at(self._twice, np.abs(x))

    def elongation(self, x):
        """K of the function."""
        return self.twice(x + 1) - 2 * self.twice(x) + self.twice(x - 1)

    def rate(self, x):
        """The function's mean over a site."""
        return self.once(x - 0.5) - self.once(x + 0.5)

    def _at(self, series, x):
        from scipy.special import betaincinv

        x = np.asarray(x)
        inside = np.minimum(x.ravel(), self._edges[-1])
        cell = np.clip(np.searchsorted(self._edges, inside, "right") - 1, 0, len(series) - 1)
        width = np.maximum(self._edges[cell + 1] - self._edges[cell], np.finfo(float).tiny)
        place = np.clip((inside - self._edges[cell]) / width, 0.0, 1.0)
        t = 2 * betaincinv(CROWDING, CROWDING, place) - 1
        value = np.sum(legendre.legvander(t, series.shape[1] - 1) * series[cell], axis=-1)
        return np.where(x < self._edges[-1], value.reshape(x.shape), 0.0)


def _left(series):
    """Series of the integrals from a place in each cell to infinity."""
    found = -legendre.legint(series, lbnd=1, axis=1) / 2
    whole = legendre.legval(-1.0, found.T)
    found[:, 0] += np.cumsum(whole[::-1])[::-1] - whole
    return found


class Law:
    """Size of the tension, its slope and the energy over the size of elongation, on one side."""

    def __init__(self, side):
        self.side, self.sign, self.beyond = side, side.sign, side.beyond

    def tension(self, size):
        return self.side.rest * size + self.sign * self.beyond.tension(self.sign * size)

    def slope(self, size):
        return self.side.rest + self.beyond.stiffness(self.sign * size)

    def energy(self, size):
        return self.side.rest * size * size / 2 + self.beyond.energy(self.sign * size)


def _solved(law, corner, mesh, size, squared):
    """Sizes of elongation on the nodes, and m c^2, by Newton's method."""
    n = len(size)
    for _ in range(ITERATIONS):
        tension = law.tension(size)
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = -mesh.mean * law.slope(size)
        matrix[range(n), range(n)] += squared
        matrix[n, :n] = -mesh.at_corner * law.slope(size)
        matrix[:n, n], matrix[n, n] = size, corner
        gap = np.append(
            squared * size - mesh.mean @ tension, squared * corner - mesh.at_corner @ tension
        )
        step = np.linalg.solve(matrix, gap)
        size, squared = size - step[:n], squared - step[n]
        if np.abs(step).max() < CONVERGED * (squared + size.max()):
            return size, squared
    raise ResolutionError(
        f"the wave whose crest is beyond the corner of the force at {corner:g} m was not found: "
        f"the last iteration still moved {np.abs(step).max():.1e}"
    )


def beyond_corner(side, name, value):
    """Whether a wave of that amplitude, speed or energy may have its crest beyond a corner."""
    low = side.corner if name == "amplitude" else 0.0
    bound = {"amplitude": side.rise.top, "above": side.rise.ceiling}.get(name, math.inf)
    return side.corner < side.rise.top and low <= value < bound


def in_pieces(side, mass, sound, name, value):
    """The wave of a family whose crest is beyond a corner.

    Parameters
    ----------
    side : Family
    mass, sound : float
    name : {"amplitude", "above", "energy"}
    value : float
        Size of the crest [m], m c^2 - V''(0) [N/m] or energy [J].

    Raises
    ------
    TensegrityError
        There is none.
    ResolutionError
        It is not resolved.
    """
    corner = side.corner
    try:
        profile = side.wave(corner + min(side.rise.top - corner, corner) / 2)
    except TensegrityError:  # its series does not settle: begin before the corner
        profile = side.wave(BEFORE * corner)
    law = Law(side)
    known = profile.grid.half_length
    length = max(half_length(profile.law, profile.nu), known)
    series = profile.grid.coefficients(profile.rho * abs(profile.law.reference))

    def size(x):
        return cosine_sum(series, profile.grid.wave_numbers, np.minimum(x, known))

    crest = abs(profile.law.reference)
    place = (
        START if crest <= corner else root(lambda x: corner - float(size(np.array(x))), 0.0, known)
    )
    squared = profile.mu * profile.law.secant

    def excess(mesh, size, squared):
        if name == "amplitude":
            return float(mesh.at_crest @ size) / value - 1
        if name == "above":
            return (squared - side.rest) / value - 1
        return float(mesh.weights @ (size * law.tension(size) / 2 + law.energy(size))) / value - 1

    slope = math.inf  # of the excess in X
    for nodes in NODES:
        before = None
        for _ in range(SEARCHES):
            mesh = Mesh(place, length, nodes)
            start = size(mesh.x) * corner / float(size(np.array(place)))
            sizes, squared = _solved(law, corner, mesh, start, squared)
            size = Integrals(mesh, law.tension(sizes) / squared).elongation
            gap = excess(mesh, sizes, squared)
            if before and before[0] != place:
                slope = (gap - before[1]) / (place - before[0])
            step = -gap / slope if 0 < slope < math.inf else -math.copysign(FIRST * place, gap)
            if abs(gap) < ADJUSTED or abs(step) < ADJUSTED * place:
                break
            before = place, gap
            place += max(-place / 2, min(step, FARTHEST))
        fine = Mesh(place, length, nodes + FINER)
        found = size(fine.x)
        tension = law.tension(found)
        residual = float(np.abs(squared * found - fine.mean @ tension).max() / tension.max())
        if residual <= (TARGET if nodes < NODES[-1] else LARGEST) and abs(gap) < LARGEST:
            return _wave(side, mass, sound, law, mesh, sizes, squared, residual)
    raise ResolutionError(
        f"{name} {value:g}: residual {residual:.1e} with {nodes} nodes in a cell must be at most "
        f"{LARGEST:g}: the wave with a crest of {side.sign * float(mesh.at_crest @ sizes):.9g} m, "
        f"beyond the corner of the force at {side.sign * corner:g} m, is not resolved"
    )


def _wave(side, mass, sound, law, mesh, size, squared, residual):
    speed, grid = math.sqrt(squared / mass), Grid(POINTS, float(mesh.edges[-1]))
    tension = law.tension(size)
    integrals = Integrals(mesh, side.sign * tension / squared)
    rates = grid.coefficients(integrals.rate(grid.x))
    energy = mesh.weights @ (size * tension / 2 + law.energy(size))
    return PiecewiseWave(
        potential=side.potential, mass=mass, x=np.concatenate([-grid.x[:0:-1], grid.x]),
        speed=speed, sound_speed=sound, family=side.name,
        excess=math.expm1(math.log1p((squared - side.rest) / side.rest) / 2)
        if side.rest else math.inf,
        amplitude=side.sign * float(mesh.at_crest @ size), energy=float(energy),
        momentum=float(-mass * speed * 2 * integrals.once(np.zeros(()))),
        residual=residual, _grid=grid, _rates=rates, _integrals=integrals,
    )  # fmt: skip
