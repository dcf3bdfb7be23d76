"""Waves of permanent form in columns of plates and one handedness: extension and twist together.

With r(x - c t) the differences of both coordinates from plate to plate, x in units, the equation is
m c^2 r = K T(r), where T is the gradient of a unit's energy and K the convolution with the tent of
one unit: (sin(k/2)/(k/2))^2 in Fourier space, as in a chain.  Profiles are even; Newton's method
starts from the wave of long waves at low speed.
"""

from __future__ import annotations

import numpy as np

from tensegrity import Network, State

PER_UNIT = 8  # points of the grid


class Waves:
    """Waves of a column of one handedness; `half` is half the length of the grid in units."""

    def __init__(self, prism, plates, half=20):
        self.points = np.arange(half * PER_UNIT + 1) / PER_UNIT
        self.mass, n = plates[0], len(self.points)
        pair = prism.column(1, "same", plates=plates)
        positions = np.tile(pair.positions, (n, 1))
        ends = np.arange(2 * n).reshape(n, 2)
        self.units = Network(positions, ends, pair.springs[0])  # n units, apart from each other
        k = np.pi * np.arange(n) / half
        cosines = np.cos(np.outer(self.points, k))
        self.mean = cosines @ (np.sinc(k / (2 * np.pi))[:, None] ** 2 * np.linalg.inv(cosines))
        (first,) = self.tangents(np.zeros((n, 2)))[:1]
        stiffness, shapes = np.linalg.eigh(first)
        self.sound, self.shape = np.sqrt(stiffness / self.mass), shapes.T

    def displaced(self, r):
        return np.stack([np.zeros_like(r), r], axis=1).reshape(-1, 2)

    def gradient(self, r):
        return -self.units.forces(self.displaced(r))[1::2]

    def tangents(self, r):
        """(n, 2, 2)"""
        whole = self.units.stiffness(self.displaced(r)).toarray().reshape(len(r), 4, len(r), 4)
        return np.einsum("njnk->njk", whole)[:, 2:, 2:]

    def small(self, ratio, branch=1):
        """The wave of the Korteweg-de Vries equation at a ratio of its speed to that of sound."""
        e, step = self.shape[branch], 1e-4
        ends = self.tangents(np.outer([step, -step] + [0] * (len(self.points) - 2), e))
        slope = e @ (ends[0] - ends[1]) @ e / (2 * step)
        over = ratio**2 - 1
        size = 3 * self.mass * self.sound[branch] ** 2 * over / slope
        return np.outer(size / np.cosh(np.sqrt(3 * over) * self.points) ** 2, e)

    def solved(self, ratio, r, branch=1):
        """Differences (points, 2) at a speed over that of sound, from a guess; and the residual."""
        stiffness, n = self.mass * (ratio * self.sound[branch]) ** 2, len(r)
        for _ in range(20):
            residual = stiffness * r - self.mean @ self.gradient(r)
            blocks = self.mean[:, None, :, None] * self.tangents(r).transpose(1, 0, 2)[None]
            slope = stiffness * np.eye(2 * n) - blocks.reshape(2 * n, 2 * n)
            step = np.linalg.solve(slope, residual.ravel()).reshape(n, 2)
            r = r - step
            if np.abs(step).max() < 1e-13:
                break
        residual = stiffness * r - self.mean @ self.gradient(r)
        return r, float(np.abs(residual).max() / np.abs(self.gradient(r)).max())

    def launch(self, r, speed, sites, bond):
        """State of a column with the peak of a wave [units/s] at the middle of a bond."""
        n = len(self.points)
        half = (n - 1) / PER_UNIT
        k = np.pi * np.arange(n) / half
        cosines = np.cos(np.outer(self.points, k))
        rates = -np.sin(np.outer(self.points, k)) @ (k[:, None] * np.linalg.solve(cosines, r))
        away = PER_UNIT * (np.arange(sites - 1) - bond)
        near = np.abs(away) < n
        at, side = np.abs(away[near]), np.sign(away[near])[:, None]
        strain, rate = np.zeros((2, sites, 2))  # none beyond the last plate
        strain[:-1][near], rate[:-1][near] = r[at], side * rates[at]
        u, v = (-np.cumsum(x[::-1], axis=0)[::-1] for x in (strain, -speed * rate))
        return State(u, v)
