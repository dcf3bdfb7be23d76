"""Moduli of a lattice about its state, and whether it is stable: strain and long waves.

A macroscopic gradient h moves nodes and lattice vectors together, by h x, and the nodes follow by
internal motions u of their own: h x + u.  The stiffness is H_hh - H_hu (K - w^2 M)^-1 H_uh: only
the internal motions have inertia here, that of h x is the density.  A member adds to H by its own
separation d, as h d, so that nothing depends on the choice of the cell.  In a column a gradient is
also a twist about the axis: the end at r_j then moves by d_z e x r_j as seen from the other one, in
the cylindrical coordinates in which the twisted column is still periodic.
Under stress the acoustic tensor is not symmetrised.

Internal motions follow forces at a frequency, (K - w^2 M) u = f.  Rows and columns are scaled by
the roots of their stiffness plus inertia, so that masses and springs of very different sizes keep
their digits.  An eigenvalue of the scaled matrix that is round-off belongs to a motion without
stiffness, or to one that resonates; it is left out, and is reported where the forces work on it.

A grid of wave vectors misses long waves, whose w^2 is small whatever its sign: for stability these
are examined by the acoustic tensor.  Stability under uniform strain at constant stress follows from
Wallace's coefficients B_ijkl = c_ijkl + (delta_ik s_jl + delta_jk s_il + delta_il s_jk
+ delta_jl s_ik - 2 delta_kl s_ij)/2, over the space that the lattice vectors span.
Source: D. C. Wallace, Thermodynamics of Crystals (1972), chapter 1; Milton & Willis 2007, On
modifications of Newton's second law and linear continuum elastodynamics, for the frequency; for
stability Born & Huang, Dynamical Theory of Crystal Lattices, section 12; Wang, Li, Yip, Phillpot &
Wolf 1995, Mechanical instabilities of homogeneous crystals; Geymonat, Mueller & Triantafyllidis
1993, for the first instability as one of long waves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import FASTEST, bloch_matrix
from tensegrity.lattices.bloch import _sparse_motions, chunks, lowest_waves
from tensegrity.lattices.periodic import ALONG, Medium, UnderGradients
from tensegrity.minimum import DENSE, ZERO
from tensegrity.printing import Lines, Printed, span
from tensegrity.typing import Array, Flags

WORK = 1e-7  # force on a motion without stiffness that counts as zero, over what it could be


def internal_motions(
    stiffness: Array, mass: Array, frequencies: Array, forces: Array, largest: Array
) -> tuple[Array, Flags, Array]:
    """Motions of the nodes under forces.

    Parameters
    ----------
    stiffness : ndarray, (size, size)
        [N/m]
    mass : ndarray, (size,) or (size, size)
        Of each coordinate [kg], or the mass matrix.
    frequencies : ndarray, (...)
        Angular frequencies [rad/s].
    forces, largest : ndarray, (size, count) or (..., size, count)
        Forces, and the sums of the sizes of their parts, which may cancel [N].

    Returns
    -------
    motions : ndarray, (..., size, count)
        [m]; without momentum along motions that are left out.
    unbounded : ndarray of bool, (...)
        Where forces work on a motion that is left out.
    values : ndarray, (..., size)
        Eigenvalues of the scaled matrix, without unit; 0 where they are round-off.
    """
    inertia, diagonal = np.multiply.outer(frequencies**2, mass), mass.ndim == 1
    sizes = np.abs(stiffness).sum(axis=1) + (inertia if diagonal else inertia.sum(axis=-1))
    root = 1 / np.sqrt(np.where(sizes > 0, sizes, 1.0))
    dynamic = stiffness - (inertia[..., None] * np.eye(len(stiffness)) if diagonal else inertia)
    values, vectors = np.linalg.eigh(root[..., None] * dynamic * root[..., None, :])
    modes, soft = root[..., None] * vectors, np.abs(values) <= ZERO * len(stiffness)
    across = modes.swapaxes(-1, -2)
    pulled, could = across @ forces, np.abs(across) @ largest
    unbounded = (soft[..., None] & (np.abs(pulled) > WORK * could)).any(axis=(-1, -2))
    motions = modes @ (pulled / np.where(soft, np.inf, values)[..., None])
    weight = np.diag(np.sqrt(mass)) if diagonal else np.linalg.cholesky(mass).T
    for at in map(tuple, np.argwhere(soft.any(axis=-1))):
        free = modes[at][:, soft[at]]
        motions[at] -= free @ np.linalg.lstsq(weight @ free, weight @ motions[at])[0]
    return motions, unbounded, np.where(soft, 0.0, values)


NOISE = 1e-13  # of the unrelaxed stiffness: round-off of the square of a speed


@dataclass(frozen=True, eq=False, repr=False)
class Moduli(Printed):
    """Moduli of a lattice.

    Attributes
    ----------
    tangent : ndarray, (dim, dim, dim, dim)
        A_ijkl = dP_ij/dF_kl about the state, nodes relaxed [N/m^(d - 1)]: i and k are components
        of force and motion, j and l of normal and gradient.
    stress : ndarray, (dim, dim)
        Macroscopic stress [N/m^(d - 1)], tension > 0; see `Lattice.stress`.
    stiffness : ndarray, (dim, dim, dim, dim)
        c_ijkl = A_ijkl - delta_ik stress_jl, symmetric in ij, in kl and in the pairs.
    density : float
        Mass per length, area or volume of the lattice [kg/m^d].
    axial, coupling, torsional : float
        For columns: force per strain with the twist fixed [N], force per twist per length [N m],
        moment per twist per length [N m^2]; for strips the first one; NaN otherwise.
    """

    tangent: Array
    stress: Array
    stiffness: Array
    density: float
    axial: float
    coupling: float
    torsional: float
    lattice: Medium = field(repr=False)
    frequency: float = 0.0

    def _lines(self) -> Lines:
        d = len(self.lattice.vectors)
        stress, per = ("N/m^2" if d == 3 else "N/m" if d == 2 else "N"), "kg/m" + f"^{d}" * (d > 1)
        tangent, pulled = span(self.tangent, stress), np.abs(self.tangent).max()
        yield f"moduli at {self.frequency:.6g} rad/s, density {self.density:.6g} {per}"
        yield f"  tangent {tangent}, stress {span(self.stress, stress, pulled)}"
        mixed = np.sqrt(np.abs(self.axial * self.torsional))  # N m
        units = {"axial": ("N", 0), "coupling": ("N m", mixed), "torsional": ("N m^2", 0)}
        for name, of in units.items():
            if np.isfinite(getattr(self, name)):
                yield f"  {name} {span(getattr(self, name), *of)}"

    def speeds(self, direction: Sequence[float] | Array) -> Array:
        """Speeds of long waves [m/s].

        Parameters
        ----------
        direction : array_like, (dim,)
            In the span of the lattice vectors; of any length.

        Returns
        -------
        ndarray, (dim,), of columns (4,) with the rotation about the axis
            Ascending.  A growing motion, whose squared speed is negative, has minus the root of
            its modulus.

        Raises
        ------
        TensegrityError
            If the direction is 0 or outside the span of the lattice vectors.
        """
        cell = self.lattice.cell
        n = check.vector("direction", direction, (cell.dim,))
        if not n.any():
            raise TensegrityError("direction has length 0, must be above 0")
        n = n / np.abs(n).max()  # its square is then representable
        n = n / np.linalg.norm(n)
        off = n - np.linalg.pinv(cell.vectors) @ (cell.vectors @ n)
        if np.abs(off).max() > ALONG:
            raise TensegrityError(f"direction {check.shown(direction)} leaves the vectors' span")
        stiff, sizes, arms = _gradients(self.lattice, self.frequency)
        each = np.eye(self.lattice.components)
        along, inertia = np.kron(each, n[:, None]), np.full(len(each), self.density)
        if arms is not None:  # a twist of 1 rad
            mass, arms = self.lattice._at_rest()[1], arms.ravel()
            turned = float(arms @ (mass @ arms if mass.ndim > 1 else mass * arms)) / cell.size
            along, inertia = np.pad(along, (0, 1)), np.append(inertia, turned)
            along[-1, -1] = 1
        root = 1 / np.sqrt(inertia)
        squares = np.linalg.eigvalsh(root[:, None] * (along.T @ stiff @ along) * root)
        squares[np.abs(squares) <= NOISE * np.max(sizes @ along**2 * root**2)] = 0
        return np.asarray(np.sign(squares) * np.sqrt(np.abs(squares)))


@checked
def moduli(
    lattice: Medium, frequency: Annotated[float, ">= 0", f"< {FASTEST}", "rad/s"] = 0.0
) -> Moduli:
    """Moduli of a lattice about its own state.

    Parameters
    ----------
    lattice : Lattice
        With its nodes in equilibrium; a macroscopic stress is allowed.
    frequency : float, optional
        Angular frequency of a uniform strain [rad/s], which the nodes of a cell follow with their
        inertia.  That of the strain itself, which moves nodes and lattice vectors together, is the
        density.  Moduli do not depend on which cell describes the lattice.

    Returns
    -------
    Moduli

    Raises
    ------
    TensegrityError
        Bad input, or a frequency at which the nodes within a cell resonate.
    EquilibriumError
        The nodes are not in equilibrium, or strain does work on a motion without stiffness, as in
        a mechanism under load.

    Examples
    --------
    The triangular lattice of springs is isotropic with equal Lame constants:

    >>> from tensegrity import Lattice, moduli
    >>> pairs = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (1, -1))]
    >>> tri = Lattice([(0, 0)], [(1, 0), (0.5, 0.75**0.5)], bars=pairs, k_bar=1)
    >>> m = moduli(tri)
    >>> (m.speeds([1, 2])**2).round(4).tolist(), float(m.stiffness[0, 0, 1, 1].round(4))
    ([0.375, 1.125], 0.433)
    """
    lattice.refuse_unbalanced()
    dim, components, stress = lattice.cell.dim, lattice.components, lattice.stress
    stiff, _, arms = _gradients(lattice, frequency)
    count, shape = components * dim, (components, dim, components, dim)
    tangent = stiff[:count, :count].reshape(shape)
    stiffness = tangent - np.einsum("ik,jl->ijkl", np.eye(components), stress)
    axial = coupling = torsional = np.nan
    if len(lattice.vectors) == 1:
        n = lattice.vectors[0] / lattice.cell.size
        stretch = np.outer(n, n).ravel()
        axial = float(stretch @ stiff[:count, :count] @ stretch)
        if arms is not None:
            coupling, torsional = float(stretch @ stiff[:-1, -1]), float(stiff[-1, -1])
    return Moduli(
        tangent, stress, stiffness, lattice.density, axial, coupling, torsional, lattice, frequency
    )


def motions_under_gradients(
    lattice: Medium, frequency: float = 0.0
) -> tuple[UnderGradients, Array]:
    """The internal motions that follow macroscopic gradients of 1.

    Parameters
    ----------
    lattice : Medium
    frequency : float, optional
        [rad/s]

    Returns
    -------
    UnderGradients, and ndarray, (size, gradients)
        What the gradients do to a cell, and the motions, reversed [m].

    Raises
    ------
    TensegrityError, EquilibriumError
        As of `moduli`.
    """
    of = lattice._under_gradients()
    inner, mass = lattice._at_rest()
    if isinstance(inner, np.ndarray):
        at = np.array(frequency)
        motions, unbounded, _ = internal_motions(inner, mass, at, of.forces, of.largest)
    else:
        axes = np.arange(lattice.components if not frequency else 0)
        rigid = (lattice._coordinates()[1][:, None] == axes).astype(float)
        motions, unbounded = _sparse_motions(inner - frequency**2 * mass, of.forces, rigid)
    if unbounded and frequency:
        raise TensegrityError(
            f"frequency {frequency:.12g} rad/s is a resonance of the nodes within a cell: moduli "
            "are infinite there"
        )
    if unbounded:
        raise EquilibriumError(
            "no moduli: strain does work on a motion without stiffness; prestress may stiffen it"
        )
    return of, motions


def _gradients(lattice: Medium, frequency: float) -> tuple[Array, Array, Array | None]:
    """Stiffness against macroscopic gradients h_kl, then the twist of a column, per size of a cell;
    the sums of the sizes of the parts of its diagonal; and the arms of the twist."""
    of, motions = motions_under_gradients(lattice, frequency)
    relaxed = (of.whole + of.whole.T) / 2 - of.forces.T @ motions
    return relaxed / lattice.cell.size, of.sizes / lattice.cell.size, of.arms


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
        at the rate |k| times the root of its modulus.  Infinite where there are long waves only.
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


def stability(cell: Medium) -> Stability:
    """The three tests of a lattice about its own state; see `Lattice.stability`."""
    of = moduli(cell)
    axes, _ = np.linalg.qr(cell.vectors.T)  # orthonormal, in the span of the lattice vectors
    none = np.inf, np.zeros(len(cell.vectors))
    wave, wavenumber = none if cell._affine else _lowest_wave(cell)
    long, direction = _slowest(of, axes)
    return Stability(wave, wavenumber, long, direction, _softest(of, axes))


def _lowest_wave(cell: Medium) -> tuple[float, Array]:
    """Lowest w^2/|k|^2 away from the limit of long waves, and its phases."""
    sparse, d = math.prod(cell._unknowns) > DENSE, len(cell.vectors)
    matrix = bloch_matrix(cell, sparse=sparse)
    reciprocal = np.linalg.pinv(cell.vectors).T  # k = phases @ reciprocal

    def lowest(q: Array) -> Array:
        if sparse:
            return np.array([lowest_waves(matrix, phase, 1)[0][0] for phase in q])
        return np.asarray(np.linalg.eigvalsh(matrix.scaled(matrix.weights(q))[0])[:, 0])

    def squares(q: Array) -> Array:
        w = np.concatenate([lowest(q[of]) for of in chunks(len(q), matrix.size)])
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
    noise = NOISE * len(axes) * of.lattice._under_gradients().sizes.max()
    noise /= of.density * of.lattice.cell.size
    return (0.0 if abs(value) <= noise else value), _positive(unit(at))


def _positive(direction: Array) -> Array:
    """The one of a direction and its opposite whose largest component is positive."""
    return np.asarray(direction * np.sign(direction[np.abs(direction).argmax()]) + 0.0)


def _softest(of: Moduli, axes: Array) -> float:
    """Lowest stiffness against uniform strain under constant stress."""
    if of.lattice.components < of.lattice.cell.dim:
        return float(np.linalg.eigvalsh(of.tangent[0, :, 0])[0])
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
    noise = NOISE * of.lattice._under_gradients().sizes.max() / of.lattice.cell.size
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
