"""Cells of masses and springs in a row, with inner masses, and their mirrors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.scenes.scene import SMALLEST_MASS
from tensegrity.springs.pair_law import PairLaw
from tensegrity.springs.potential import Potential
from tensegrity.waves.cell import WIDE, Cell
from tensegrity.waves.nonlinear_part import nonlinear_part


class SpringCell(Cell):
    """A cell of masses, springs between neighbours, and masses that hang on some of them.

    Coordinates are displacements of the masses in their order, then of the inner ones; strains are
    elongations of the springs, then of theirs.

    Parameters
    ----------
    springs : tuple of Potential
        Spring j joins mass j and the next one.
    masses : ndarray, (sites,)
        [kg]
    inner : dict of int to (float, Potential)
        Mass [kg] and spring at a site.

    Raises
    ------
    TensegrityError
        No mirror maps the cell to itself, or a spring does not resist at rest.
    """

    translations = 1

    def __init__(
        self, springs: tuple[Potential, ...], masses: Any, inner: dict[int, tuple[float, Potential]]
    ) -> None:
        self.springs = (*springs, *(spring for _, spring in inner.values()))
        self.sites, self.hosts = len(springs), tuple(inner)
        self.masses = np.array([*masses, *(mass for mass, _ in inner.values())])
        self.unit_mass = float(self.masses[0])
        self.inertia, self.reference = self.masses / self.unit_mass, 1.0
        self.parts = [nonlinear_part(spring) for spring in self.springs]
        self._of = {part: np.array([part is x for x in self.parts]) for part in self.parts}
        self.base = np.eye(len(self.masses))
        self.base[:, 0] = 1.0
        self._mirror(springs, inner)
        rest = np.array([part.rest for part in self.parts])
        self.at_rest, self.secant = np.diag(rest), 1.0
        if rest.any():
            self._refuse_soft(rest)
            self.secant = float(self.slow[1])
            self.at_rest = self.at_rest / self.secant
            del self.slow

    def _refuse_soft(self, rest: Any) -> None:
        soft = np.flatnonzero(~(rest > 0))
        if len(soft):
            raise TensegrityError(
                f"stiffness {rest[soft[0]]:g} N/m of spring {soft[0]} of the cell at rest must be "
                "above 0, as that of others is"
            )

    def _mirror(self, springs: Any, inner: Any) -> None:
        """Rows: means and half differences of the two strains of a pair, of inner ones, which a
        mirror turns round, the other way."""
        n = self.sites
        each, wrong = np.arange(n), []
        for total in range(n):
            bonds, sites = (total - each) % n, (total + 1 - each) % n
            pairs = [(f"mass {i} of {self.masses[i]:g} kg", f"mass {j} of {self.masses[j]:g} kg")
                     for i, j in enumerate(sites) if self.masses[i] != self.masses[j]]  # fmt: skip
            pairs += [(f"spring {i}", f"spring {j}") for i, j in enumerate(bonds)
                      if springs[i] != springs[j]]  # fmt: skip
            pairs += [(f"what hangs on mass {i}", f"that on mass {j}") for i, j in enumerate(sites)
                      if inner.get(i) != inner.get(int(j))]  # fmt: skip
            if not pairs:
                break
            wrong.append(pairs)
        else:
            one, other = min(wrong, key=len)[0]
            raise TensegrityError(
                f"a cell of {n} masses without a mirror has no symmetric wave: {one} must equal "
                f"{other}"
            )
        others = [n + self.hosts.index(sites[host]) for host in self.hosts]
        self.mirrored = np.array([*(sites == each), *(x == n + i for i, x in enumerate(others))])
        size = len(self.springs)
        self.rows, self.odd, at = np.zeros((size, size)), np.zeros(size, dtype=bool), 0
        for i, j in enumerate([*bonds, *others]):
            if i > j:
                continue
            sign = 1.0 if i < n else -1.0
            self.odd[at : at + 2] = (False, True) if i < j else sign < 0
            self.rows[[i, j], at] = 1.0, sign if i < j else 1.0
            at += 1
            if i < j:
                self.rows[[i, j], at] = 1.0, -sign
                at += 1

    def _geometry(self, k: Any) -> Any:
        n, found = self.sites, np.zeros((len(k), len(self.springs), len(self.base)), WIDE)
        half = k / 2
        each: Any = np.arange(self.sites)
        ahead, behind = (np.exp(sign * 1j * half)[:, None] for sign in (1, -1))
        ends: Any = [(each + 1) % n, each]
        for end, phase in zip(ends, (ahead, -behind), strict=True):
            places: Any = (slice(None), each, end)
            np.add.at(found, places, np.broadcast_to(phase, (len(k), n)))
        for i, host in enumerate(self.hosts):
            found[:, n + i, [n + i, host]] = 1.0, -1.0
        found[:, :, 0] = 0.0
        found[:, :n, 0] = np.where(half == 0, 1.0, np.sin(half) / np.where(half == 0, 1, half))[
            :, None
        ]
        return found

    def _each(self, kind: str, strains: Any) -> Any:
        """A function of the nonlinear parts, at elongations in m."""
        found = np.empty_like(strains)
        for part, rows in self._of.items():
            found[rows] = getattr(part, kind)(strains[rows] * self.reference)
        return found

    def beyond(self, strains: Any) -> Any:
        """Scaled forces without their linear part, (strains, n)."""
        return self._each("tension", strains) / (self.reference * self.secant)

    def slope(self, strains: Any) -> Any:
        """Derivatives of that, (n, strains, strains)."""
        bent = self._each("stiffness", strains) / self.secant
        return bent.T[:, :, None] * np.eye(len(bent))

    def _tangents(self, strains: Any) -> Any:
        return self.slope(strains) + self.at_rest

    def energy(self, strains: Any) -> Any:
        """Scaled energies of all bonds together, (n,)."""
        whole = self._each("energy", strains) / self.reference / self.reference / self.secant
        return whole.sum(axis=0) + np.einsum("in,ij,jn->n", strains, self.at_rest, strains) / 2

    def admits(self, rho: Any) -> bool:
        """Whether all elongations are within the domains of the springs."""
        r = self.reference * (self.rows @ rho)
        return all(
            spring.domain[0] < one.min() and one.max() < spring.domain[1]
            for spring, one in zip(self.springs, r, strict=True)
        )


def cell_of(springs: Any, mass: Any, inner: Any) -> SpringCell:
    """The cell that arguments of `solitary_wave` describe.

    Parameters
    ----------
    springs : Potential or sequence of Potential
    mass : float or sequence of float
        [kg]
    inner : dict of int to (float, Potential) or None

    Returns
    -------
    SpringCell

    Raises
    ------
    TensegrityError
        Bad input.
    """
    several = (springs,) if isinstance(springs, Potential) else tuple(
        check.sequence("potential", springs, "springs")
    )  # fmt: skip
    for number, spring in enumerate(several):
        check.kind(f"spring {number}", spring, Potential)
        if isinstance(spring, PairLaw):
            raise TensegrityError("a pair law in a cell: give a row of it, Chain(pair, 2, mass=..)")
    given = mass if isinstance(mass, (Sequence, np.ndarray)) and np.ndim(mass) else (mass,)
    masses = [check.number(f"mass {i}", x, least=SMALLEST_MASS, unit="kg")
              for i, x in enumerate(given)]  # fmt: skip
    n = max(len(several), len(masses))
    if not n or {len(several), len(masses)} - {1, n}:
        raise TensegrityError(f"{len(several)} springs and {len(masses)} masses form no cell")
    if not isinstance(inner or {}, Mapping):
        raise TensegrityError(f"inner {check.shown(inner)} must be a dict of sites")
    hanging = {}
    for site, pair in sorted((inner or {}).items()):
        site = check.whole("site of inner", site, least=0, below=n)
        both = check.sequence(f"inner {site}", pair, "a mass and a spring")
        if len(both) != 2:
            raise TensegrityError(f"inner {site} has {len(both)} entries: give a mass and a spring")
        one, spring = both
        check.kind(f"spring of inner {site}", spring, Potential)
        hanging[site] = (
            check.number(f"mass of inner {site}", one, least=SMALLEST_MASS, unit="kg"), spring,
        )  # fmt: skip
    several = several * n if len(several) == 1 else several
    return SpringCell(several, np.broadcast_to(masses, n), hanging)
