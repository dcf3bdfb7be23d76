"""Travelling waves of a periodic row, whatever its cell: the linear part of their equation.

A cell has coordinates U_a(x - c t) with inertias M, x in sites, and strains r of its bonds, in
Fourier space r = B(k) U.  With the energy W(r), H = W''(0) and g = W'(r) - H r,

    r = P(k) g,    P = B D^-1 B*,    D = c^2 k^2 M - B* H B.

Of equal masses and springs this is the equation of `travelling`.  A displacement of all sites
enters D as its rate, so that D is finite at k = 0; its inverse is refined in extended precision, as
terms cancel near the sound speed.  P has a pole where w(k) = c k for a linear wave (a resonance): a
tail of this wave number k_r then is on both sides of a wave.  Waves are symmetric: a mirror maps
the cell to itself, and strains are sums of functions that are even or odd about the middle, here
called rows, for which P is real.

On a grid of half-length L = pi (n + 1/2)/k_r the pole is midway between two wave numbers and the
sum over these is the principal value of the integral.  Then the tail is
a sgn(x) Re(i t exp(i k_r x)), with t the residue of P at k_r times the transform of g there.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.root import root
from tensegrity.waves.components import DIFFERENCE, scale_of

SLOWEST, FASTEST, RATES = 1e-2, 60.0, 4000  # decay of a tail: over that of long waves; per site
FINE = 0.01  # steps of wave numbers between which a branch meets c k once
HIGHER = 1.01  # than frequencies at some wave numbers, the largest of all
STEP = 1e-5  # of a wave number, for a derivative by it: an error of 1e-11
BOXES, APART = 12, 0.02  # half-lengths tried; distance of other poles from wave numbers of the grid
WIDE = np.clongdouble


class Cell:
    """The cell of a periodic row, for a reference elongation A [m], as `travelling.Scaled`.

    Subclasses give what stands here, `_geometry`, and forces of strains in units of A.

    Attributes
    ----------
    sites : int
        Of a cell.
    inertia : ndarray, (coordinates,)
        Over a unit of mass.
    at_rest : ndarray, (strains, strains)
        H over `secant`.
    rows : ndarray, (strains, rows)
        Strains of rows; the first one is even.
    odd : ndarray of bool, (rows,)
    base : ndarray, (coordinates, coordinates)
        Coordinates of basis vectors, of which the first `translations` move all sites alike, that
        of the fastest sound first.
    secant, unit_mass : float
        Unit of mass times the square of the fastest sound speed [N/m], and that unit [kg].
    mirrored : ndarray of bool, (coordinates,)
        Which the mirror maps to themselves.
    """

    rest, steepest = 1.0, 6.0
    sites: int
    inertia: Any
    at_rest: Any
    rows: Any
    odd: Any
    base: Any
    translations: int
    secant: float
    unit_mass: float
    reference: float
    mirrored: Any

    def _geometry(self, k: Any) -> Any:
        """Strains of basis vectors, of translations of their rates; (n, strains, coordinates)."""
        raise NotImplementedError

    def _tangents(self, strains: Any) -> Any:
        """Second derivatives of the scaled energy, (n, strains, strains)."""
        raise NotImplementedError

    def _moved(self, k: Any) -> Any:
        """Rows of basis vectors at wave numbers, which may be complex; those of odd rows times i,
        as these are sums of sines."""
        of_strains = np.linalg.inv(self.rows).astype(WIDE) @ self._geometry(np.asarray(k, WIDE))
        return np.where(self.odd, 1j, 1.0)[:, None] * of_strains

    def _between(self, k: Any, mu: Any) -> tuple[Any, Any, Any]:
        """Rows of basis vectors, their adjoint, and D."""
        k = np.asarray(k, WIDE)
        rows = self._moved(k)
        adjoint = self._moved(k.conj()).conj().swapaxes(1, 2)
        moves = np.arange(len(self.base)) < self.translations
        mass = (self.base.T * self.inertia) @ self.base
        powers = np.where(moves, 1.0, (1j * k)[:, None, None])
        inertia = mass * powers * np.where(moves[:, None], 1.0, (-1j * k)[:, None, None])
        bent = (self.rows.T @ self.at_rest @ self.rows).astype(WIDE)
        return rows, adjoint, mu * inertia - adjoint @ bent @ rows

    @cached_property
    def slow(self) -> tuple[Any, Any]:
        """The long wave of the fastest sound, in basis vectors, and mu of that sound: 1, to more
        digits.  At first `secant` may be any."""
        t, one = self.translations, np.zeros(1)
        still = -self._between(one, 0.0)[2][0]
        mass = ((self.base.T * self.inertia) @ self.base)[:t, :t]
        whole = still.real.astype(float)
        follow = -np.linalg.solve(whole[t:, t:], whole[t:, :t])
        soft = whole[:t, :t] + whole[:t, t:] @ follow
        turn = np.linalg.inv(np.linalg.cholesky(mass))
        vector = turn.T @ np.linalg.eigh(turn @ soft @ turn.T)[1][:, -1]
        vector *= np.sign(vector[np.abs(vector).argmax()])
        long = np.concatenate([vector, follow @ vector]).astype(np.longdouble)
        left = (still.real @ long)[t:]
        long[t:] -= np.linalg.solve(whole[t:, t:], left.astype(float))
        return long, long @ still.real @ long / (vector @ mass @ vector)

    @cached_property
    def long(self) -> Any:
        """Rows of the long wave with the rate 1, (rows,)."""
        found = self._moved(np.zeros(1))[0] @ (self.slow[0] / self.slow[0][0])
        return found.real.astype(float)

    @cached_property
    def heft(self) -> float:
        """Inertia of the long wave with the rate 1."""
        t = self.translations
        one = (self.base @ np.append(self.slow[0][:t], np.zeros(len(self.base) - t))).astype(float)
        return float(self.inertia @ (one / float(self.slow[0][0])) ** 2)

    @property
    def sound_speed(self) -> float:
        """The fastest [sites/s]."""
        return math.sqrt(self.secant / self.unit_mass)

    def inverse(self, k: Any, nu: float) -> tuple[Any, Any]:
        """Rows of basis vectors, and D^-1 times their adjoint, at real wave numbers."""
        rows, adjoint, d = self._between(k, self.slow[1] + nu)
        found = np.linalg.inv(d.astype(complex)).astype(WIDE)
        for _ in range(2):
            found = found + found @ (np.eye(len(self.base)) - d @ found)
        return rows, found @ adjoint

    def symbol(self, k: Any, nu: float) -> Any:
        """P, real; (n, rows, rows)."""
        rows, across = self.inverse(k, nu)
        return (rows @ across).real.astype(float)

    def symbol_on(self, grid: Any, nu: float) -> Any:
        """The same on a grid, kept while Newton's method goes on."""
        return self._on(grid, nu)[0]

    def matrices_on(self, grid: Any, nu: float) -> Any:
        """Matrices of P between values of rows on the grid."""
        symbol, made = self._on(grid, nu)
        if not made:
            rows = range(len(self.odd))
            odd = [bool(x) for x in self.odd]
            made += [[grid.between(symbol[:, i, j], (odd[i], odd[j])) for j in rows] for i in rows]
        return made

    def _on(self, grid: Any, nu: float) -> tuple[Any, list[Any]]:
        key = grid, nu
        if key not in self._symbols:
            if len(self._symbols) > 3:
                self._symbols.clear()
            self._symbols[key] = self.symbol(grid.wave_numbers, nu), []
        return self._symbols[key]

    @cached_property
    def _symbols(self) -> dict[Any, tuple[Any, list[Any]]]:
        return {}

    @cached_property
    def spread(self) -> float:
        """Dispersion of long waves: nu + spread k^2 is what resists them."""
        size = self.long @ self.long
        p = self.long @ self.symbol(np.array([math.sqrt(DIFFERENCE)]), 0.0)[0] @ self.long
        return float(size**2 / (self.heft * p * DIFFERENCE))

    def decay(self, nu: float) -> float:
        """Decay of the tail [1/site], the slowest; of long waves if it also oscillates."""

        def singular(rate: Any) -> Any:
            d = self._between(1j * np.atleast_1d(rate), self.slow[1] + nu)[2]
            return np.linalg.det(d.astype(complex)).real

        about = math.sqrt(max(nu / self.spread, 0.0))
        rates = np.geomspace(SLOWEST * about or SLOWEST, FASTEST, RATES)
        with np.errstate(all="ignore"):
            values = singular(rates)
            ends = np.flatnonzero(values[1:] * values[:-1] < 0)
            if not len(ends):
                return about or FASTEST
            at = int(ends[0])
            return root(lambda k: float(singular(k)[0]), float(rates[at]), float(rates[at + 1]))

    def _turn(self, k: Any) -> Any:
        """Basis vectors of coordinates times the roots of their inertias."""
        rates = np.where(np.arange(len(self.base)) < self.translations, 1j * k[:, None], 1.0)
        return rates[:, :, None] * (np.linalg.inv(self.base) / np.sqrt(self.inertia))

    def _elastic(self, k: Any) -> Any:
        """M^-1/2 B* H B M^-1/2, (n, coordinates, coordinates)."""
        k = np.asarray(k, WIDE)
        left = self._turn(k.conj()).conj().swapaxes(1, 2)
        return -(left @ self._between(k, 0.0)[2] @ self._turn(k)).astype(complex)

    def resonances(self, nu: float) -> tuple[tuple[float, int], ...]:
        """Wave numbers [rad/site] and branches of linear waves with w(k) = c k, the longest
        first."""
        if nu not in self._resonances:
            self._resonances[nu] = self._resonant(math.sqrt(float(self.slow[1]) + nu))
        return self._resonances[nu]

    @cached_property
    def _resonances(self) -> dict[float, Any]:
        return {}

    def _resonant(self, speed: float) -> tuple[tuple[float, int], ...]:
        def above(k: Any) -> Any:
            squares = np.linalg.eigvalsh(self._elastic(k))
            return np.sign(squares) * np.sqrt(np.abs(squares)) - speed * k[:, None]

        largest = math.sqrt(max(np.linalg.eigvalsh(
            self._elastic(np.linspace(0, 2 * math.pi, 129)))[:, -1].max(), 0.0))  # fmt: skip
        top = HIGHER * largest / speed
        k = np.linspace(FINE, max(top, 2 * FINE), max(2, math.ceil(top / FINE)))
        gaps, found = above(k), []
        for j, branch in np.argwhere(gaps[1:] * gaps[:-1] < 0).tolist():

            def gap(x: float, branch: int = branch) -> float:
                return float(above(np.array([x]))[0, branch])

            found.append((root(gap, float(k[j]), float(k[j + 1])), branch))
        return tuple(sorted(found))

    def resonant(self, k: float, branch: int, nu: float) -> tuple[Any, Any, float, float]:
        """A linear wave at a resonance: coordinates with the inertia 1, rows, the slope of
        D - and of w^2 - between them.

        Parameters
        ----------
        k, branch : float, int
            Of the resonance.
        nu : float

        Returns
        -------
        tuple
        """
        one = np.array([k])
        vectors = np.linalg.eigh(self._elastic(one))[1][0]
        mode = vectors[:, branch]
        ends = self._elastic(k + STEP * np.array([1.0, -1.0]))
        bend = float((mode.conj() @ (ends[0] - ends[1]) @ mode).real / (2 * STEP))
        shape = mode / np.sqrt(self.inertia)
        basis = np.linalg.inv(self.base) @ shape
        basis[: self.translations] *= 1j * k
        rows = (self._moved(one)[0] @ basis).astype(complex)
        return shape, rows, 2 * (float(self.slow[1]) + nu) * k - bend, bend

    def boxed(self, length: float, nu: float, part: float = 0.5) -> float:
        """A half-length of at least `length` for which the pole at the longest resonance lies at
        this part of a distance between wave numbers, and others not close to one.

        Parameters
        ----------
        length, nu, part : float

        Returns
        -------
        float

        Raises
        ------
        TensegrityError
            There is none.
        """
        waves = [k for k, _ in self.resonances(nu)]
        if not waves:
            return length
        first = math.ceil(waves[0] * length / math.pi - part)
        found = math.pi * (np.arange(first, first + BOXES) + part) / waves[0]
        places = np.outer(found, waves[1:]) / math.pi
        apart = np.abs(places - np.round(places)).min(axis=1, initial=0.5)
        good = np.flatnonzero(apart >= APART)
        if not len(good):
            raise TensegrityError(
                f"resonances at {', '.join(f'{k:.6g}' for k in waves)} rad/site lie within "
                f"{APART:g} of a wave number of every box from {found[0]:.4g} to {found[-1]:.4g} "
                "sites"
            )
        return float(found[good[0]])

    @cached_property
    def scale(self) -> float:
        """Elongation of the long wave [m] at which its stiffness changes; see `scale_of`."""
        return scale_of(self._along)

    def _along(self, size: float) -> Any:
        """Stiffness along the long wave over that at rest, at two opposite elongations [m]."""
        way = self.rows @ self.long
        bent = self._tangents(np.outer(way, [size, -size]) / self.reference)
        return np.einsum("i,nij,j->n", way, bent, way) / (way @ self.at_rest @ way)

    @cached_property
    def curvature(self) -> float:
        """Second derivative of the tension of a long wave over its inertia [N/m^2]; 0 if it is
        none."""
        if math.isinf(self.scale):
            return 0.0
        with np.errstate(all="ignore"):
            ends = self._along(self.scale)
        apart, both = float(ends[0] - ends[1]), np.abs(ends - 1).max()
        return 0.0 if abs(apart) <= DIFFERENCE * both else self.secant * apart / (2 * self.scale)
