"""Cosine series of functions that are even about x = 0, on a half-line of points.

Functions of several components have these as rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

SINE_RISE = [(-1) ** n / math.factorial(2 * n + 3) for n in range(8, -1, -1)]  # (1 - sin y/y)/y^2


def _cosines(values):
    """Discrete cosine transform of type I: twice the sums of values times cosines, with the end
    values counted once."""
    return np.fft.rfft(np.concatenate([values, values[..., -2:0:-1]], axis=-1)).real


@dataclass(frozen=True)
class Grid:
    """Points x_j = j L/N, j = 0 .. N, and their cosine series."""

    points: int
    half_length: float

    @cached_property
    def x(self):
        return np.arange(self.points + 1) * (self.half_length / self.points)

    @cached_property
    def wave_numbers(self):
        return np.arange(self.points + 1) * (np.pi / self.half_length)

    @cached_property
    def box(self):
        """Symbol of the mean over one site, sin(k/2)/(k/2); K is its square."""
        return np.sinc(self.wave_numbers / (2 * np.pi))

    @cached_property
    def weights(self):
        """Weights of the integral over the whole line, (N + 1,)."""
        w = np.full(self.points + 1, 2 * self.half_length / self.points)
        w[[0, -1]] /= 2
        return w

    def coefficients(self, values):
        """Cosine coefficients of an even function from its values on the grid."""
        a = _cosines(values) / self.points
        a[..., [0, -1]] /= 2
        return a

    def values(self, coefficients):
        """Values on the grid; the inverse of `coefficients`."""
        a = coefficients.copy()
        a[..., [0, -1]] *= 2
        return _cosines(a) / 2

    @cached_property
    def complement(self):
        """Symbol of 1 - K, without cancellation at small wave numbers."""
        return complement((self.wave_numbers / 2) ** 2, self.box)

    def sines(self, coefficients):
        """Values on the grid of a sine series, whose first and last coefficients count nothing."""
        waves = coefficients * (-1j * self.points)
        waves[..., [0, -1]] = 0
        return np.fft.irfft(waves, 2 * self.points)[..., : self.points + 1]

    def sine_coefficients(self, values):
        """Sine coefficients of an odd function from its values on the grid."""
        whole = np.concatenate([values, -values[..., -2:0:-1]], axis=-1)
        return -np.fft.rfft(whole).imag / self.points

    def apply(self, symbol, values):
        """An even convolution, given by its symbol, of values on the grid."""
        return self.values(symbol * self.coefficients(values))

    def smooth(self, values):
        """K applied to values on the grid."""
        return self.apply(self.box**2, values)

    def matrix(self, symbol):
        """Matrix of an even convolution on grid values, (N + 1, N + 1)."""
        n = self.points
        kernel = np.resize(np.fft.irfft(symbol, 2 * n), 2 * n + 1)  # of the whole period
        around = np.concatenate([kernel[n:0:-1], kernel[: n + 1]])
        difference, total = (sliding_window_view(x, n + 1) for x in (around, kernel))  # of places
        matrix = difference[::-1] + total
        matrix[:, [0, -1]] /= 2
        return matrix

    def between(self, symbol, odd):
        """Matrix of a convolution on grid values between functions that are even or odd.

        Parameters
        ----------
        symbol : ndarray, (N + 1,)
            Factor of the coefficients.
        odd : (bool, bool)
            Whether results and arguments are sums of sines.
        """
        if not any(odd):
            return self.matrix(symbol)
        n, mixed = self.points, odd[0] != odd[1]
        waves = symbol * (-1j if mixed else 1.0)
        kernel = np.resize(np.fft.irfft(waves, 2 * n), 2 * n + 1)
        sign = -1.0 if mixed else 1.0
        around = np.concatenate([sign * kernel[n:0:-1], kernel[: n + 1]])
        difference, total = (sliding_window_view(x, n + 1) for x in (around, kernel))
        if odd == (True, False):
            matrix = total - difference[::-1]
        else:
            matrix = difference[::-1] + (1.0 if mixed else -1.0) * total
        if odd[1]:
            matrix[:, [0, -1]] = 0.0
        else:
            matrix[:, [0, -1]] /= 2
        return matrix

    def moved(self, values, other):
        """Values on another grid by the cosine series of these; 0 beyond this grid."""
        a = self.coefficients(values)
        if other.half_length == self.half_length:
            b = np.zeros((*a.shape[:-1], other.points + 1))
            n = min(self.points, other.points) + 1
            b[..., :n] = a[..., :n]
            return other.values(b)
        inside = other.x <= self.half_length
        moved = np.zeros((*a.shape[:-1], other.points + 1))
        moved[..., inside] = cosine_sum(a.T, self.wave_numbers, other.x[inside]).T
        return moved


def complement(square, box):
    """1 - K without cancellation at small wave numbers.

    Parameters
    ----------
    square : ndarray
        (k/2)^2, below 0 where k is imaginary.
    box : ndarray
        sin(k/2)/(k/2).

    Returns
    -------
    ndarray
    """
    near = np.abs(square) < 1
    series = np.polyval(SINE_RISE, np.where(near, square, 1))
    return np.where(near, square * series, 1 - box) * (1 + box)


def cosine_sum(coefficients, wave_numbers, x, function=np.cos):
    """sum_n a_n cos(k_n x), or with another function, in blocks that fit the processor's cache.

    Parameters
    ----------
    coefficients : ndarray, (n,) or (n, components)
        a_n.
    wave_numbers : ndarray, (n,)
        k_n [1/site].
    x : ndarray, any shape
        Sites.
    function : callable, optional
        np.cos or np.sin.

    Returns
    -------
    ndarray, shape of x, or (..., components)
    """
    flat = np.ravel(x)
    result = np.empty((flat.size, *coefficients.shape[1:]))
    for start in range(0, flat.size, 256):
        part = slice(start, start + 256)
        result[part] = function(np.outer(flat[part], wave_numbers)) @ coefficients
    return result.reshape(np.shape(x) + coefficients.shape[1:])


@dataclass(frozen=True)
class Series:
    """A wave given by the cosine coefficients of du/dx, (n,) or (components, n); 0 beyond the
    grid.  The components of what it gives are the last axis."""

    grid: Grid
    rates: np.ndarray

    def elongation(self, x):
        """r [m] at distances x from the peak."""
        return self._sum(self.rates * self.grid.box, x)

    def rate(self, x):
        """du/dx [m]."""
        return self._sum(self.rates, x)

    def displacement(self, x):
        """u [m], 0 far ahead."""
        x = np.clip(x, -self.grid.half_length, self.grid.half_length)
        k = self.grid.wave_numbers[1:]
        wavy = cosine_sum((self.rates[..., 1:] / k).T, k, x, np.sin)
        return wavy + np.multiply.outer(x - self.grid.half_length, self.rates[..., 0])

    def _sum(self, coefficients, x):
        inside = np.abs(x) <= self.grid.half_length
        value = cosine_sum(coefficients.T, self.grid.wave_numbers, np.where(inside, x, 0.0))
        value[~inside] = 0.0
        return value

    def on_grid(self):
        """Elongation and du/dx at the points of the grid."""
        return self.grid.values(self.rates * self.grid.box), self.grid.values(self.rates)

    @property
    def shift(self):
        """Displacement far behind [m]."""
        far = -2 * self.grid.half_length * self.rates[..., 0]
        return far if far.ndim else float(far)
