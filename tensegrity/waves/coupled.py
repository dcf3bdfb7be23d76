"""Lines of equal sites and bonds whose waves have several components: the law of their bonds.

Sites have coordinates with inertias m_k, which are multiplied here by sqrt(m_k/m_0).  Differences
r(x - c t) of free coordinates are of the bond at x, values q(x - c t) of others of sites.  With the
energy V(r(x), q(x - 1/2), q(x + 1/2)) of that bond, which has half of the energies of its sites,
and K the convolution of `travelling`,

    m c^2 r = K V_r,    m c^2 q'' + V_qi(bond at x + 1/2) + V_qj(bond at x - 1/2) = 0.

The quadratic part of V makes rho = P g(rho) of these as of a chain, with a matrix P for each wave
number.  In the eigenvectors of the stiffness of free coordinates that others follow slowly, its
block of these is the inverse of S = nu + lag + rest (1 - K) - K X.  With N the stiffness of the
others minus mu k^2, N_0 at k = 0, E = N_0 - N, and 2 cos(k/2) C that between both kinds,

    X = 4 C^T N_0^-1 (sin^2(k/2) N_0 - E) N^-1 C,

in which nothing cancels at small k.  Where S is singular, w(k) = c k for a linear wave.

Units of alternating handedness have no waves of a family.  With staggered rotations (-1)^j phi_j
they are equal too, with the twist phi_j + phi_(j+1): then w^2 of the second branch of linear waves
is 4 V_tt/m > 0 at k = 0 and bounded, so that the line w = c k crosses it at every speed c, and a
wave excites what moves with it.  Only at isolated speeds could the amplitude of that tail be 0.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.root import root
from tensegrity.scenes.acting import per_coordinate
from tensegrity.scenes.forcing import refuse_heavy_bonds
from tensegrity.scenes.network import Network
from tensegrity.springs.pair_law import PairLaw
from tensegrity.waves.components import DIFFERENCE, scale_of
from tensegrity.waves.cosines import complement

EQUAL = 1e-12  # relative difference of equal separations and masses
SLOWEST, FASTEST, RATES = 1e-2, 60.0, 4000  # decay of a tail: over that of long waves; per site
ALIKE, WIDE = 1e-12, 100.0  # energies when ends are exchanged, at so many scales from rest
SMALL = 300.0  # strains in scales below which forces are integrated from their slopes
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)  # between rest and these
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


class CoupledLaw:
    """The law of the bonds of a line, for a reference amplitude A [m], as `travelling.Scaled`.

    Strains are the differences of free coordinates, then the values of others at the first end and
    at the second, (strains, n), in the unit A.

    Parameters
    ----------
    unit : Network
        One bond, from `unit_of`.

    Attributes
    ----------
    reference : float
        A [m], of the fastest component.
    free, others : ndarray of int
        Numbers of coordinates.
    basis : ndarray, (free, free)
        Eigenvectors of S_0 as columns, that of the fastest sound first.
    secant : float
        Its stiffness [N/m].
    root : ndarray, (dim,)
        Square roots of the inertias over the first.

    Raises
    ------
    TensegrityError
        No coordinate is free, others are not stable at rest, or there is no sound.
    """

    rest = 1.0

    def __init__(self, unit: Network) -> None:
        self.potential, self.reference = unit, 1.0
        self._bonds: dict[int, Any] = {}
        spring: Any = unit.springs[0]
        self._pair = spring.shared(0.5, 0.5) if isinstance(spring, PairLaw) else None
        self.names = self._pair.coordinates if self._pair else ("x", "y", "z")[: unit.dim]
        free = np.array(self._pair.free if self._pair else [True] * unit.dim)
        self.free, self.others = np.flatnonzero(free), np.flatnonzero(~free)
        if not len(self.free):
            raise TensegrityError(
                f"coordinates {self.named} of a column with a wave of permanent form are not "
                "free: another one must be"
            )
        mass = per_coordinate(unit, unit.mass)[0]
        self.root = np.sqrt(mass / mass[0])
        self._of_ends = [*(unit.dim + self.free), *self.others, *(unit.dim + self.others)]
        self._root = self.root[[*self.free, *self.others, *self.others]]
        self.secant = 1.0
        (self.at_rest,) = self._tangents(np.zeros((len(self._root), 1)))
        n, o = len(self.free), len(self.others)
        ends = self.at_rest[n:, n:].reshape(2, o, 2, o)
        self._across, self._own = ends[0, :, 1], ends.sum(axis=(0, 2))
        stable = np.linalg.eigvalsh(self._own)
        if o and not stable[0] > 0:
            raise TensegrityError(
                f"coordinate {self.named} is not stable at rest: its stiffness is {stable[0]:g}"
            )
        coupling = self.at_rest[n : n + o, :n]
        follow = 2 * np.linalg.solve(self._own, coupling)
        soft, vectors = np.linalg.eigh(self.at_rest[:n, :n] - 2 * coupling.T @ follow)
        self.basis, self.secant = vectors[:, ::-1], float(soft[-1])
        if not self.secant > 0:
            raise TensegrityError(
                "the column has no sound: its stiffness against slow changes is 0"
            )
        for name in ("at_rest", "_across", "_own"):
            setattr(self, name, getattr(self, name) / self.secant)
        self._coupling = self.at_rest[n : n + o, :n] @ self.basis
        self.follow = -follow @ self.basis[:, :1]  # of others in long waves
        # to more digits, as these rounded terms cancel where they are much stiffer than sound is
        wide, basis = np.longdouble, self.basis.astype(np.longdouble)
        follow = follow @ basis
        left = 2 * self._coupling.astype(wide) - self._own.astype(wide) @ follow
        follow = follow + np.linalg.solve(self._own, left.astype(float))
        soft = basis.T @ self.at_rest[:n, :n].astype(wide) @ basis - 2 * self._coupling.T @ follow
        self.lag = (1 - np.diag(soft)).astype(float)

    @property
    def steepest(self) -> float:
        """Decay above which a grid ends no earlier; lower beside wave trains, to measure these."""
        return 2.5 if len(self.others) else 6.0

    @property
    def named(self) -> str:
        return ", ".join(self.names[k] for k in self.others)

    @property
    def sound_speed(self) -> float:
        """The fastest [sites/s]."""
        return math.sqrt(self.secant / self.potential.mass.flat[0])

    @cached_property
    def scale(self) -> float:
        """That of the fastest component at which its stiffness changes [m]; see `scale_of`."""
        return scale_of(self._along)

    def _along(self, size: float) -> Any:
        """Stiffness of the fastest component over that at rest, at two opposite elongations [m]."""
        way = self.widened(np.array([[1.0]]))[:, 0]
        bent = self._tangents(np.outer(way, [size, -size]) / self.reference)
        return np.einsum("i,nij,j->n", way, bent, way)

    def widened(self, rho: Any) -> Any:
        """Strains of a long wave with this fastest component."""
        return np.concatenate([self.basis[:, :1] * rho, *[self.follow * rho] * 2])

    @cached_property
    def curvature(self) -> float:
        """Second derivative of the tension of the fastest component [N/m^2]; 0 if it is none."""
        if math.isinf(self.scale):
            return 0.0
        with np.errstate(all="ignore"):
            ends = self._along(self.scale)
        apart = float(ends[0] - ends[1])
        both = np.abs(ends - 1).max()
        return 0.0 if abs(apart) <= DIFFERENCE * both else self.secant * apart / (2 * self.scale)

    @cached_property
    def spread(self) -> float:
        """S of long waves over k^2, in the fastest component without nu; 1/12 of a chain."""
        z = DIFFERENCE
        return float(self.resistance(np.array([z]), 0.0)[0][0, 0, 0] / z)

    def resistance(self, z: Any, nu: float) -> tuple[Any, Any, Any]:
        """S, N^-1 2 cos(k/2) C, and N^-1 for squares z of k, also below 0; (n, rows, columns)."""
        z = z[:, None, None]
        half = np.sqrt(z + 0j) / 2
        box, cosine = np.sinc(half / np.pi).real, np.cos(half).real
        sine2, own = z / 4 * box**2, self._own
        lost = 4 * sine2 * self._across + (1 + nu) * z * np.eye(len(own))
        inverse = np.linalg.inv(own - lost)
        x = np.linalg.solve(own, sine2 * own - lost) @ inverse
        x = 4 * self._coupling.T @ x @ self._coupling
        free = np.diag(self.lag + nu) + np.diag(1 - self.lag) * complement(z / 4, box)
        return free - box**2 * x, 2 * cosine * inverse @ self._coupling, inverse

    def decay(self, nu: float) -> float:
        """Decay of the tail [1/site], the slowest; of long waves if it also oscillates."""

        def singular(k: Any) -> Any:
            free, _, inverse = self.resistance(-(np.atleast_1d(k) ** 2), nu)
            return np.linalg.det(free) / np.linalg.det(inverse)

        about = math.sqrt(max(nu / self.spread, 0.0))
        rates = np.geomspace(SLOWEST * about or SLOWEST, FASTEST, RATES)
        with np.errstate(all="ignore"):
            values = singular(rates)
            ends = np.flatnonzero(values[1:] * values[:-1] < 0)
            if not len(ends):
                return about or FASTEST
            at = int(ends[0])
            return root(lambda k: float(singular(k)[0]), float(rates[at]), float(rates[at + 1]))

    @cached_property
    def long(self) -> Any:
        """Components of long waves, over the first; (n,)."""
        return np.concatenate([[1.0], np.zeros(len(self.free) - 1), self.follow[:, 0]])

    def resonances(self, nu: float) -> list[Any]:
        """Those by which a grid is chosen: none."""
        return []

    def boxed(self, length: float, nu: float) -> float:
        """The half-length of a grid: any will do."""
        return length

    def forces(self, strains: Any) -> Any:
        """Scaled forces, (strains, n)."""
        return self.beyond(strains) + self.at_rest @ strains

    def beyond(self, strains: Any) -> Any:
        """The same without their linear part; of small strains integrated from the slopes, as the
        difference would be round-off of larger terms."""
        slope = self._energies(strains)[1] / (self.secant * self.reference)
        found, small = slope - self.at_rest @ strains, self._small(strains)
        few = strains[:, small]
        found[:, small] = np.einsum("nij,jn->in", self._integrated(few, WEIGHTS), few)
        return found

    def slope(self, strains: Any) -> Any:
        """Derivatives of that, (n, strains, strains)."""
        return self._tangents(strains) - self.at_rest

    def energy(self, strains: Any) -> Any:
        """Scaled energies above that at rest."""
        found = self._energies(strains)[0] - self._energies(0 * strains[:, :1])[0]
        found, small = found / (self.reference**2 * self.secant), self._small(strains)
        few = strains[:, small]
        bent = self._integrated(few, WEIGHTS * (1 - NODES)) + self.at_rest / 2
        found[small] = np.einsum("in,nij,jn->n", few, bent, few)
        return found

    def _small(self, strains: Any) -> Any:
        """At which bonds forces are integrals of their slopes."""
        return np.abs(strains).max(axis=0) * abs(self.reference) < SMALL * self.scale

    def _integrated(self, strains: Any, weights: Any) -> Any:
        """Weighted sums of the slopes at parts NODES of strains, (n, strains, strains)."""
        parts = np.multiply.outer(strains, NODES).reshape(len(strains), -1)
        if not parts.size:
            return np.zeros((0, *self.at_rest.shape))
        slopes = self.slope(parts).reshape(strains.shape[1], len(NODES), *self.at_rest.shape)
        return np.tensordot(weights, slopes, axes=(0, 1))

    def admits(self, rho: Any) -> bool:
        """Whether no bond of springs is turned round."""
        if self._pair:
            return True
        apart = self.potential.positions[1] + self._ends(self.basis @ rho)[:, 1]
        return bool(np.min(apart @ self.potential.positions[1]) > 0)

    def refuse_uneven(self) -> None:
        """Refuse laws that change where the values of others at both ends are exchanged."""
        size = WIDE * self.scale if math.isfinite(self.scale) else 1.0
        one = np.random.default_rng(0).standard_normal((len(self._root), 8)) * size
        one, n, o = one / self.reference, len(self.free), len(self.others)
        back = one[[*range(n), *range(n + o, n + 2 * o), *range(n, n + o)]]
        both = [self.energy(x) for x in (one, back)]
        if np.any(np.abs(both[0] - both[1]) > ALIKE * np.abs(both[0]).max()):
            raise TensegrityError(
                f"the energy of a bond must not change when the values of coordinate {self.named} "
                "at its ends are exchanged, as the wave is even"
            )

    def _ends(self, strains: Any) -> Any:
        """Displacements of both ends, (n, 2, dim)."""
        ends = np.zeros((strains.shape[1], 2 * self.potential.dim))
        ends[:, self._of_ends] = self.reference * strains.T / self._root
        return ends.reshape(len(ends), 2, self.potential.dim)

    def _energies(self, strains: Any) -> tuple[Any, Any]:
        """Energies [J], and gradients [N], (strains, n)."""
        ends = self._ends(strains)
        if self._pair:
            energy, slope = self._pair.evaluate("pair", *ends.swapaxes(0, 1))
            return energy[:, 0], slope[:, self._of_ends].T / self._root[:, None]
        of, u = self._placed(len(ends)), ends.reshape(-1, self.potential.dim)
        slope = -of.forces(u)[1::2].T / self._root[:, None]
        return of.bond_energy(u), slope

    def _tangents(self, strains: Any) -> Any:
        """Second derivatives of the scaled energy, (n, strains, strains)."""
        ends, dim = self._ends(strains), self.potential.dim
        if self._pair:
            blocks = self._pair.tangent(*ends.swapaxes(0, 1))
        else:
            whole = self._placed(len(ends)).stiffness(ends.reshape(-1, dim))
            whole, blocks = whole.tobsr((2 * dim, 2 * dim)), np.zeros((len(ends), 2 * dim, 2 * dim))
            blocks[whole.indices] = whole.data
        blocks = blocks[:, np.array(self._of_ends)[:, None], self._of_ends]
        return blocks / np.outer(self._root, self._root) / self.secant

    def _placed(self, count: int) -> Network:
        """So many bonds apart from each other."""
        if count not in self._bonds:
            positions, ends = np.tile(self.potential.positions, (count, 1)), np.arange(2 * count)
            self._bonds[count] = Network(
                positions, ends.reshape(-1, 2), self.potential.springs[0],
                lengths=self.potential.lengths[0],
            )  # fmt: skip
        return self._bonds[count]


def unit_of(column: Network) -> Network:
    """One bond of a line of equal sites and bonds, from the origin.

    Parameters
    ----------
    column : Network

    Returns
    -------
    Network

    Raises
    ------
    TensegrityError
        Sites, bonds or masses differ, or something else acts on them.
    """
    refuse_heavy_bonds(column, "waves of permanent form")
    n = column.sites
    apart = np.diff(column.positions, axis=0)
    line = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    if n < 2 or not np.array_equal(column.bonds, line):
        raise TensegrityError("a column must have its bonds from each site to the next")
    springs: Any = column.springs
    if column.mass.ndim > 1:  # inner sites share their energy
        springs = [law.shared(1.0, 1.0) for law in springs]
    size = np.abs(apart).max()
    different = {
        "separations": np.abs(apart - apart[0]).max() / size,
        "masses": np.max(np.ptp(column.mass, axis=0) / column.mass[0]),
        "springs": float(any(s != springs[0] for s in springs)),
        "lengths": np.ptp(column.lengths) / size,
    }
    for name, value in different.items():
        if value > EQUAL:
            raise TensegrityError(
                f"{name} of a column with a wave of permanent form must be equal: units of "
                "alternating handedness radiate"
            )
    return Network([0 * apart[0], apart[0]], [[0, 1]], column.springs[0],
                   lengths=column.lengths[0], mass=column.mass[0])  # fmt: skip


def same(unit: Network, other: Network) -> bool:
    """Whether two units from `unit_of` are equal."""
    near = np.abs(unit.positions - other.positions).max() <= EQUAL * np.abs(unit.positions).max()
    equal = unit.springs[0] == other.springs[0] and np.array_equal(unit.mass, other.mass)
    return bool(near and equal and np.array_equal(unit.lengths, other.lengths))
