"""Moduli of a lattice about its state: macroscopic stiffness, stress, and speeds of long waves.

With the energy W(x, a) of a cell the relaxed stiffness over the lattice vectors is
H = W_aa - W_ax W_xx^-1 W_xa, the inverse without rigid motions.  Long waves along a direction
follow from K(kappa) to second order in kappa over the rigid motions, which in a column include the
rotation about its axis.  Under stress the acoustic tensor is not symmetrised.
Source: D. C. Wallace, Thermodynamics of Crystals (1972), chapter 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import FASTEST, bloch_matrix
from tensegrity.lattices.cell import Cell
from tensegrity.minimum import ZERO
from tensegrity.printing import filled, span
from tensegrity.typing import Array

WORK = 1e-7  # force on a motion without stiffness that counts as zero, over the largest stiffness
NOISE = 1e-13  # of the unrelaxed stiffness: round-off of the square of a speed
ALONG = 1e-9  # largest part of a direction outside the lattice, over its length


@dataclass(frozen=True, eq=False)
class Moduli:
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
    lattice: Cell = field(repr=False)
    frequency: float = 0.0

    def __str__(self) -> str:
        d = len(self.lattice.vectors)
        stress, per = ("N/m^2" if d == 3 else "N/m" if d == 2 else "N"), "kg/m" + f"^{d}" * (d > 1)
        tangent, pulled = span(self.tangent, stress), np.abs(self.tangent).max()
        parts = [
            f"moduli at {self.frequency:.6g} rad/s, density {self.density:.6g} {per}",
            f"  tangent {tangent}, stress {span(self.stress, stress, pulled)}",
        ]
        mixed = np.sqrt(np.abs(self.axial * self.torsional))  # N m
        units = {"axial": ("N", 0), "coupling": ("N m", mixed), "torsional": ("N m^2", 0)}
        parts += [
            f"  {name} {span(getattr(self, name), *of)}"
            for name, of in units.items()
            if np.isfinite(getattr(self, name))
        ]
        return filled("\n".join(parts))

    __repr__ = __str__

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
        n = check.vector("direction", direction, (self.lattice.dim,))
        if not n.any():
            raise TensegrityError("direction has length 0, must be above 0")
        n = n / np.abs(n).max()  # its square is then representable
        n = n / np.linalg.norm(n)
        off = n - np.linalg.pinv(self.lattice.vectors) @ (self.lattice.vectors @ n)
        if np.abs(off).max() > ALONG:
            raise TensegrityError(f"direction {check.shown(direction)} leaves the vectors' span")
        stiff, inertia, scale = _long_waves(self.lattice, n, self.frequency)
        root = np.linalg.inv(np.linalg.cholesky(inertia))
        squares = np.linalg.eigvalsh(root @ stiff @ root.T)
        squares[np.abs(squares) <= NOISE * scale] = 0
        return np.asarray(np.sign(squares) * np.sqrt(np.abs(squares)))


def moduli(lattice: Cell, frequency: float = 0.0) -> Moduli:
    """Moduli of a lattice about its own state.

    Parameters
    ----------
    lattice : Lattice
        With its nodes in equilibrium; a macroscopic stress is allowed.
    frequency : float, optional
        Angular frequency of the internal motions [rad/s], whose inertia is included; that of the
        cell as a whole is not.

    Returns
    -------
    Moduli

    Raises
    ------
    TensegrityError
        Bad input.
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
    check.kind("lattice", lattice, Cell)
    frequency = check.number("frequency", frequency, least=0, below=FASTEST, unit="rad/s")
    lattice.refuse_unbalanced()
    dim, inner = lattice.dim, lattice.positions.size
    whole = lattice.hessian()
    mixed = whole[:inner, inner:]
    h = whole[inner:, inner:] - _followed(lattice, mixed, frequency, float(np.abs(whole).max()))
    h = h.reshape(len(lattice.vectors), dim, len(lattice.vectors), dim)
    a = lattice.vectors
    tangent = np.einsum("aj,aibk,bl->ijkl", a, h, a) / lattice.size
    stress = lattice.stress
    stiffness = tangent - np.einsum("ik,jl->ijkl", np.eye(dim), stress)
    axial = coupling = torsional = np.nan
    if len(a) == 1:
        n = a[0] / lattice.size
        stiff = _long_waves(lattice, n, frequency)[0]
        axial = float(n @ stiff[:dim, :dim] @ n)
        if len(stiff) > dim:
            coupling, torsional = float(n @ stiff[:dim, -1]), float(stiff[-1, -1])
    density = float(lattice.mass.sum()) / lattice.size
    return Moduli(
        tangent, stress, stiffness, density, axial, coupling, torsional, lattice, frequency
    )


def _followed(lattice: Cell, mixed: Array, frequency: float, scale: float) -> Array:
    """Reduction of the stiffness by internal motions under the forces `mixed` (nodes dim, count);
    `scale` is the size that such forces can have."""
    inner = lattice.positions.size
    root = np.sqrt(np.repeat(lattice.mass, lattice.dim))
    squares, vectors = np.linalg.eigh(lattice.hessian()[:inner, :inner] / (root * root[:, None]))
    pulled = vectors.T @ (mixed / root[:, None])
    soft = np.abs(squares) <= ZERO * inner * np.abs(squares).max(initial=0.0)
    work = float(np.abs(pulled[soft]).max(initial=0.0))
    if work > WORK * scale / root.min():
        raise EquilibriumError(
            f"no moduli: strain does work on a motion without stiffness, {work * root.min():.3g} "
            f"over {scale:.3g}; prestress may stiffen it"
        )
    hard = pulled[~soft]
    return np.asarray((hard.conj().T / (squares[~soft] - frequency**2)) @ hard)


def _long_waves(lattice: Cell, n: Array, frequency: float) -> tuple[Array, Array, float]:
    """Stiffness and inertia of long waves along a unit vector over the rigid motions, per size of
    a cell, and the largest square of a speed without internal motions.

    The motions are translations, and in columns the rotation of 1 rad about the axis.
    """
    matrix, dim = bloch_matrix(lattice, weighted=False), lattice.dim
    motions = np.kron(np.ones((lattice.nodes, 1)), np.eye(dim))
    if dim == 3 and len(lattice.vectors) == 1:
        arms = lattice.positions - np.average(lattice.positions, axis=0, weights=lattice.mass)
        turn = np.cross(lattice.vectors[0] / lattice.size, arms)
        if np.abs(turn).max() > ALONG * lattice.span:
            motions = np.column_stack([motions, turn.ravel()])
    along = matrix.offsets @ (lattice.vectors @ n)
    first, second = matrix.at(1j * along), matrix.at(-(along**2) / 2 + 0j)
    stiff = (motions.T @ second @ motions).real
    largest = float(np.abs(matrix.parts).max()) * lattice.span
    followed = _followed(lattice, first @ motions, frequency, largest).real
    inertia = motions.T @ (np.repeat(lattice.mass, dim)[:, None] * motions)
    scale = float(np.abs(stiff).max() / np.diag(inertia).min())
    return (stiff - followed) / lattice.size, inertia / lattice.size, scale
