"""Whether a lattice is stable: waves of all lengths, long waves, and uniform strain.

A grid of wave vectors misses long waves, whose w^2 is small whatever its sign: these are examined
by the acoustic tensor.  Stability under uniform strain at constant stress follows from Wallace's
coefficients B_ijkl = c_ijkl + (delta_ik s_jl + delta_jk s_il + delta_il s_jk + delta_jl s_ik
- 2 delta_kl s_ij)/2, over the space that the lattice vectors span.
Source: Born & Huang, Dynamical Theory of Crystal Lattices, section 12; Wang, Li, Yip, Phillpot &
Wolf 1995, Mechanical instabilities of homogeneous crystals; Geymonat, Mueller & Triantafyllidis
1993, for the first instability as one of long waves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.lattices.bands import bloch_matrix
from tensegrity.lattices.bloch import chunks
from tensegrity.lattices.cell import Cell
from tensegrity.lattices.moduli import NOISE, Moduli, moduli
from tensegrity.minimum import ZERO
from tensegrity.printing import Lines, Printed
from tensegrity.typing import Array

GRID = {1: 192, 2: 24, 3: 12}  # wave vectors along each axis of the zone, by the number of axes
AROUND = {1: 1, 2: 48, 3: 24}  # directions of long waves, and their polar angles
REFINED = 3  # lowest points of a grid from which minima are refined


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Printed):
    """Three tests of a lattice's stability.

    Attributes
    ----------
    wave : float
        Lowest w^2/|k|^2 of waves on a grid of the Brillouin zone, refined [m^2/s^2]; k is the wave
        vector [rad/m], not shorter than the shortest of the grid.  If it is negative, waves grow
        at the rate |k| times the root of its modulus.
    wavenumber : ndarray, (d,)
        Phases per cell of that wave [rad].
    long : float
        Lowest square of the speed of long waves [m^2/s^2], by the acoustic tensor; in columns and
        strips that of axial, torsional and bending waves, so that any compressed one is unstable.
    direction : ndarray, (dim,)
        Direction of those waves, a unit vector.
    strain : float
        Lowest stiffness against uniform strain under constant stress, over the span of the lattice
        vectors [N/m^(d - 1)].
    """

    wave: float
    wavenumber: Array
    long: float
    direction: Array
    strain: float

    @property
    def stable(self) -> bool:
        """Whether no test finds an instability; motions without stiffness count as stable."""
        return self.kind == "stable"

    @property
    def kind(self) -> str:
        """The tests that fail: "long wave", "wave", "strain", several joined by ", "; else
        "stable"."""
        margins = {"long wave": self.long, "wave": self.wave, "strain": self.strain}
        return ", ".join(name for name, value in margins.items() if value < 0) or "stable"

    def _lines(self) -> Lines:
        phases, along = (", ".join(f"{x:.4f}" for x in np.round(values, 4) + 0.0)
                         for values in (self.wavenumber, self.direction))  # fmt: skip
        unit = ("N", "N/m", "N/m^2")[len(self.wavenumber) - 1]
        yield f"Stability: {self.kind}"
        yield f"  waves:          w^2/k^2 >= {self.wave:.6g} m^2/s^2, least at phases ({phases})"
        yield f"  long waves:     c^2 >= {self.long:.6g} m^2/s^2, least along ({along})"
        yield f"  uniform strain: stiffness >= {self.strain:.6g} {unit}"


def stability(cell: Cell) -> Stability:
    """The three tests of a lattice about its own state; see `Lattice.stability`."""
    of = moduli(cell)
    axes, _ = np.linalg.qr(cell.vectors.T)  # orthonormal, in the span of the lattice vectors
    wave, wavenumber = _lowest_wave(cell)
    long, direction = _slowest(of, axes)
    return Stability(wave, wavenumber, long, direction, _softest(of, axes))


def _lowest_wave(cell: Cell) -> tuple[float, Array]:
    """Lowest w^2/|k|^2 away from the limit of long waves, and its phases."""
    matrix, d = bloch_matrix(cell), len(cell.vectors)
    reciprocal = np.linalg.pinv(cell.vectors).T  # k = phases @ reciprocal

    def squares(q: Array) -> Array:
        w = np.concatenate([np.linalg.eigvalsh(matrix.at(matrix.weights(q[of])))[:, 0]
                            for of in chunks(len(q), matrix.parts.shape[-1])])  # fmt: skip
        w[np.abs(w) <= ZERO * matrix.bound] = 0
        return np.asarray(w / np.sum((q @ reciprocal) ** 2, axis=1))

    step = 2 * np.pi / GRID[d]
    across = np.arange(-GRID[d] // 2 + 1, GRID[d] // 2 + 1) * step
    first = np.arange(GRID[d] // 2 + 1) * step  # opposite waves are alike
    q = np.stack(np.meshgrid(first, *[across] * (d - 1), indexing="ij"), axis=-1).reshape(-1, d)
    q = q[np.abs(q).max(axis=1) > step / 2]

    def at(point: Array) -> float:
        short = np.abs(first_zone(point)).max()
        return float(squares(first_zone(point)[None])[0]) if short >= step else np.inf

    value, point = _refined(at, q, squares(q), step)
    return value, first_zone(point)


def first_zone(phases: Array) -> Array:
    """The same phases within (-pi, pi]."""
    return np.asarray(np.pi - (np.pi - phases) % (2 * np.pi))


def _slowest(of: Moduli, axes: Array) -> tuple[float, Array]:
    """Lowest square of the speed of long waves, and the unit vector of their direction."""
    d = axes.shape[1]
    if d == 1:
        slowest = float(of.speeds(axes[:, 0])[0])
        return slowest * abs(slowest), _positive(axes[:, 0])

    def unit(angles: Array) -> Array:
        polar = np.sin(angles[..., 1]) if d == 3 else np.ones(angles.shape[:-1])
        parts = [np.cos(angles[..., 0]) * polar, np.sin(angles[..., 0]) * polar]
        parts += [np.cos(angles[..., 1])] if d == 3 else []
        return np.stack(parts, axis=-1) @ axes.T

    def squares(angles: Array) -> Array:
        n = unit(angles)
        c = np.einsum("ijkl,pj,pl->pik", of.tangent, n, n) / of.density
        return np.linalg.eigvalsh((c + c.swapaxes(1, 2)) / 2)[:, 0]

    step = np.pi / AROUND[d]
    turn = np.arange(AROUND[d] if d == 2 else 2 * AROUND[d]) * step
    tilt = [] if d == 2 else [(np.arange(AROUND[d] // 2) + 0.5) * step]
    angles = np.stack(np.meshgrid(turn, *tilt, indexing="ij"), axis=-1).reshape(-1, d - 1)
    value, at = _refined(lambda a: float(squares(a[None])[0]), angles, squares(angles), step)
    noise = NOISE * len(axes) * float(np.abs(of.lattice.hessian()).max()) * of.lattice.span**2
    return (0.0 if abs(value) <= noise / of.lattice.mass.sum() else value), _positive(unit(at))


def _positive(direction: Array) -> Array:
    """The one of a direction and its opposite whose largest component is positive."""
    return np.asarray(direction * np.sign(direction[np.abs(direction).argmax()]) + 0.0)


def _softest(of: Moduli, axes: Array) -> float:
    """Lowest stiffness against uniform strain under constant stress."""
    c = np.einsum("abcd,ai,bj,ck,dl->ijkl", of.stiffness, axes, axes, axes, axes)
    s, one = axes.T @ of.stress @ axes, np.eye(axes.shape[1])
    b = c + (
        np.einsum("ik,jl->ijkl", one, s) + np.einsum("jk,il->ijkl", one, s)
        + np.einsum("il,jk->ijkl", one, s) + np.einsum("jl,ik->ijkl", one, s)
        - np.einsum("kl,ij->ijkl", one, s) - np.einsum("ij,kl->ijkl", one, s)
    ) / 2  # fmt: skip
    row, column = np.triu_indices(len(one))
    weight = np.where(row == column, 1.0, np.sqrt(2.0))
    whole = b[row[:, None], column[:, None], row, column] * weight[:, None] * weight
    lowest = float(np.linalg.eigvalsh((whole + whole.T) / 2)[0])
    noise = NOISE * float(np.abs(of.lattice.hessian()).max()) * of.lattice.span**2 / of.lattice.size
    return 0.0 if abs(lowest) <= noise else lowest


def _refined(
    of: Callable[[Array], float], points: Array, values: Array, step: float
) -> tuple[float, Any]:
    """The minimum over points of a grid of a given step, refined from the lowest ones."""
    from scipy.optimize import minimize

    best = float(values.min()), points[values.argmin()]
    for start in points[np.argsort(values, kind="stable")[:REFINED]]:
        corners = np.vstack([start, start + step / 2 * np.eye(len(start))])
        options = {"initial_simplex": corners, "xatol": 1e-9, "fatol": 0.0}
        lowest = minimize(of, start, method="Nelder-Mead", options=options)
        if lowest.fun < best[0]:
            best = float(lowest.fun), lowest.x
    return best
