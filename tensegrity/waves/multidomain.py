"""Waves whose peak is beyond a kink of the force, such as a loss of contact: a multidomain method.

Where the elongation passes the kink, at the distance X from the peak, the tension as a function of
x has a kink or a root, so that Fourier series converge slowly; the elongation has a singularity of
two orders higher there, and another one at each further site.  The points X + j and -X + j, j an
integer, divide the line into cells that a shift by one site maps onto each other.  In each cell all
functions are polynomials in a coordinate whose nodes are denser towards its ends, and
K T = W(x + 1) - 2 W(x) + W(x - 1), W'' = T, is exact on the nodes.  Newton's method solves
m c^2 r = K T and r(X) = kink for given X, and X is adjusted to the required amplitude, speed or
energy.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import legendre

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.root import root
from tensegrity.waves.cosines import Grid, cosine_sum
from tensegrity.waves.family import half_length

BEFORE, START = 0.99, 0.05  # size of the initial wave over the kink, and its distance X
NODES, FINER = (16, 32, 48, 64), 8  # nodes per cell; additional nodes for the residual
CROWDING = 3  # order of the zeros of dx/dt at the ends of a cell
ITERATIONS, CONVERGED = 40, 1e-13  # of Newton's method, and its relative tolerance
SEARCHES, ADJUSTED = 60, 4e-16  # secant steps in X, and their relative tolerance
FIRST, FARTHEST = 1e-3, 0.25  # first relative change of X; largest change in sites
TARGET, LARGEST = 1e-13, 1e-12  # residual aimed at, and the largest that is accepted
POINTS = 4096  # points of the uniform output grid


class Mesh:
    """Cells and nodes for a kink at the distance X >= 0 from the peak.

    Attributes
    ----------
    edges : ndarray, (cells + 1,)
        Borders of the cells, in sites.
    x : ndarray, (n,)
        Nodes at x > 0.
    mean : ndarray, (n, n)
        Matrix of K on the nodal values of an even function.
    at_kink, at_peak : ndarray, (n,)
        Row vectors of the value of K at X, and of the function at 0.
    weights : ndarray, (n,)
        Weights of the integral over the line.
    """

    def __init__(self, kink, half_length, nodes):
        from scipy.special import beta, betainc

        whole, sites = math.floor(kink), math.ceil(half_length) + math.ceil(kink)
        near = min(kink - whole, 1 - kink + whole)
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
        cell = int(np.argmin(np.abs(self.edges - kink)))
        row = np.zeros(size + 4 * nodes)
        row[cell * nodes : (cell + 5) * nodes] = blocks[cell % 2][1]
        self.at_kink = self._folded(row[2 * nodes : -2 * nodes])
        row = np.zeros(size)
        middle = slice(cells // 2 * nodes, (cells // 2 + 1) * nodes)
        row[middle] = legendre.legvander(np.zeros(1), nodes - 1)[0] @ self.to_series
        self.at_peak = self._folded(row)

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
        """A functional of all nodal values, restricted to those of an even function at x > 0."""
        half = row.shape[-1] // 2
        return row[..., half:] + row[..., :half][..., ::-1]


def _running(t, nodes):
    """Integrals from 0 to t of the Legendre polynomials in 2 t - 1, (len(t), nodes)."""
    return np.stack(
        [legendre.legval(2 * t - 1, legendre.legint(row, lbnd=-1)) / 2 for row in np.eye(nodes)], -1
    )


class Integrals:
    """A wave given by the first and second integrals from x to infinity of the tension over m c^2,
    an even function on a mesh; its mean over one site is du/dx."""

    def __init__(self, mesh, values):
        self.mesh, self.values = mesh, values  # at the nodes with x > 0
        self.grid = Grid(POINTS, float(mesh.edges[-1]))
        self._edges = mesh.edges[len(mesh.edges) // 2 - 1 :]  # starting with the cell of the peak
        values = np.concatenate([values[: mesh.nodes // 2][::-1], values]).reshape(-1, mesh.nodes)
        widths = np.diff(self._edges)[:, None]
        series = (values * mesh.rate * widths) @ mesh.to_series.T
        self._once = _integrated_to_infinity(series)
        at_nodes = legendre.legval(legendre.leggauss(mesh.nodes)[0], self._once.T)
        series = (at_nodes * mesh.rate * widths) @ mesh.to_series.T
        self._twice = _integrated_to_infinity(series)

    def once(self, x):
        """Integral of the function from x to infinity."""
        return np.where(x < 0, 2 * self._at(self._once, 0.0 * x), 0.0) + np.sign(
            np.where(x == 0, 1.0, x)
        ) * self._at(self._once, np.abs(x))

    def twice(self, x):
        """Integral of `once` from x to infinity."""
        more = np.where(x < 0, -2 * x * self._at(self._once, 0.0 * x), 0.0)
        return more + self._at(self._twice, np.abs(x))

    def elongation(self, x):
        """r [m] at distances x from the peak: K applied to the function."""
        return self.twice(x + 1) - 2 * self.twice(x) + self.twice(x - 1)

    def rate(self, x):
        """du/dx [m]."""
        return self.once(x - 0.5) - self.once(x + 0.5)

    def displacement(self, x):
        """u [m], 0 far ahead."""
        x = np.clip(x, -self.grid.half_length - 1, self.grid.half_length + 1)
        return self.twice(x + 0.5) - self.twice(x - 0.5)

    def on_grid(self):
        """Elongation and du/dx at the points of the grid."""
        return self.elongation(self.grid.x), self.rate(self.grid.x)

    @property
    def shift(self):
        """Displacement far behind [m]."""
        return float(-2 * self.once(np.zeros(())))

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


def _integrated_to_infinity(series):
    """Series of the integrals from a point of each cell to infinity."""
    integrals = -legendre.legint(series, lbnd=1, axis=1) / 2
    whole = legendre.legval(-1.0, integrals.T)
    integrals[:, 0] += np.cumsum(whole[::-1])[::-1] - whole
    return integrals


def _newton(side, mesh, size, squared):
    """Sizes of elongation on the nodes, and m c^2, by Newton's method."""
    n = len(size)
    for _ in range(ITERATIONS):
        tension, slope = side.force(size), side.slope(size)
        matrix = np.empty((n + 1, n + 1))
        matrix[:n, :n] = -mesh.mean * slope
        matrix[range(n), range(n)] += squared
        matrix[n, :n] = -mesh.at_kink * slope
        matrix[:n, n], matrix[n, n] = size, side.kink
        gap = np.append(
            squared * size - mesh.mean @ tension, squared * side.kink - mesh.at_kink @ tension
        )
        step = np.linalg.solve(matrix, gap)
        size, squared = size - step[:n], squared - step[n]
        if np.abs(step).max() < CONVERGED * (squared + size.max()):
            return size, squared
    raise ResolutionError(
        f"no wave found whose peak is beyond the kink of the force at {side.kink:g} m: "
        f"the last Newton step is {np.abs(step).max():.1e}"
    )


def may_cross_kink(side, name, value):
    """Whether a wave can have its peak beyond a kink.

    Parameters
    ----------
    side : Family
    name : {"amplitude", "above", "energy"}
    value : float
        The target; see `by_target`.

    Returns
    -------
    bool
    """
    low = side.kink if name == "amplitude" else 0.0
    return side.kink < side.rising_part.top and low <= value < side.rising_part.bound(name)


def multidomain_wave(side, name, value):
    """The wave of a family whose peak is beyond a kink.

    Parameters
    ----------
    side : Family
    name, value
        The target; see `by_target`.

    Returns
    -------
    tuple
        m c^2 [N/m], m c^2/V''(0) - 1, peak elongation [m], energy [J], residual, `Integrals`.

    Raises
    ------
    TensegrityError
        There is no such wave.
    ResolutionError
        The finest mesh does not resolve the wave.
    """
    kink = side.kink
    try:
        profile = side.wave(kink + min(side.rising_part.top - kink, kink) / 2)
    except TensegrityError:  # the Fourier series does not converge: begin before the kink
        profile = side.wave(BEFORE * kink)
    known = profile.grid.half_length
    length = max(half_length(profile.law, profile.nu), known)
    peak = abs(profile.law.reference)
    series = profile.grid.coefficients(profile.rho * peak)

    def size(x):
        return cosine_sum(series, profile.grid.wave_numbers, np.minimum(x, known))

    place = START if peak <= kink else root(lambda x: kink - float(size(np.array(x))), 0.0, known)
    squared = profile.mu * profile.law.secant

    def energy(mesh, size):
        return float(mesh.weights @ (size * side.force(size) / 2 + side.stored(size)))

    reached = {
        "amplitude": lambda mesh, size, squared: float(mesh.at_peak @ size),
        "above": lambda mesh, size, squared: squared - side.rest,
        "energy": lambda mesh, size, squared: energy(mesh, size),
    }[name]
    slope = math.inf  # of the gap in X
    for nodes in NODES:
        before = None
        for _ in range(SEARCHES):
            mesh = Mesh(place, length, nodes)
            start = size(mesh.x) * kink / float(size(np.array(place)))
            sizes, squared = _newton(side, mesh, start, squared)
            size = Integrals(mesh, side.force(sizes) / squared).elongation
            gap = reached(mesh, sizes, squared) / value - 1
            if before and before[0] != place:
                slope = (gap - before[1]) / (place - before[0])
            step = -gap / slope if 0 < slope < math.inf else -math.copysign(FIRST * place, gap)
            if abs(gap) < ADJUSTED or abs(step) < ADJUSTED * place:
                break
            before = place, gap
            place += max(-place / 2, min(step, FARTHEST))
        fine = Mesh(place, length, nodes + FINER)
        elongation = size(fine.x)
        tension = side.force(elongation)
        residual = float(np.abs(squared * elongation - fine.mean @ tension).max() / tension.max())
        peak = side.sign * float(mesh.at_peak @ sizes)
        if residual <= (TARGET if nodes < NODES[-1] else LARGEST) and abs(gap) < LARGEST:
            gain = (squared - side.rest) / side.rest if side.rest else math.inf
            shape = Integrals(mesh, side.sign * side.force(sizes) / squared)
            return squared, gain, peak, energy(mesh, sizes), residual, shape
    raise ResolutionError(
        f"{name} {value:g}: residual {residual:.1e} with {nodes} nodes in a cell must be at most "
        f"{LARGEST:g}: the wave with a peak of {peak:.9g} m, "
        f"beyond the kink of the force at {side.sign * kink:g} m, is not resolved"
    )
