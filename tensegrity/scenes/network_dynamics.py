"""Quantities derived from a network for its runs: its bonds and contacts with their geometry, its
energies, and bounds on its stiffness and frequencies; see `tensegrity.scenes.dynamics`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine.bonds import Bonds, Contacts
from tensegrity.readonly import fixed
from tensegrity.scenes.clearance import neighbour_counts
from tensegrity.scenes.dynamics import Dynamics, dynamics, varied
from tensegrity.scenes.near_pairs import blocks
from tensegrity.scenes.neighbour_list import contacts_with
from tensegrity.scenes.scene import State
from tensegrity.typing import Array, Indices

AT_ONCE = 2_000_000  # largest number of contacts times rows in one list: some tens of megabytes
LISTS, FEW = 2, 10_000  # lists of contacts that are cached, for scenes of at most FEW sites


class NetworkDynamics(Dynamics):
    """Quantities derived from a network for its runs.

    Attributes
    ----------
    cables : tuple of tuple of int
        The bonds that are segments of each cable over sites.
    walls_alone : bool
        Whether sites press all walls, and never touch each other.
    """

    def __init__(self, scene: Any) -> None:
        super().__init__(scene)
        self.wall_count = len(scene.walls)
        self.spring_lengths = scene._lengths
        self.walls_alone = scene._walls_alone
        self.cables = scene._cables

    @cached_property
    def turns(self) -> bool:  # type: ignore[override]
        """Whether bonds can rotate."""
        return self.dim > 1

    @cached_property
    def contact_bonds(self) -> Bonds:
        """Bonds and wall contacts with their geometry."""
        scene, springs = self.scene, self.springs
        normals = np.array([wall.normal for wall in scene.walls]).reshape(-1, self.dim)
        contacts = Contacts(
            first=scene._ends[:, 0],
            second=scene._ends[:, 1],
            gap=scene._gaps,
            length=scene._lengths,
            positions=scene.positions,
            load=scene.loads,
            normals=normals,
            crowding=self.neighbour_counts,
        )
        weights, coupling = self.inverse
        heavy = () if coupling is None else tuple(np.flatnonzero(scene.bond_mass).tolist())
        table, kinks = springs.table, springs.kinks
        cable = None
        if scene._cables:
            cable = np.full(len(springs.group), -1)
            for number, segments in enumerate(scene._cables):
                cable[list(segments)] = number
        return Bonds(*table, springs.group, weights, contacts, kinks, coupling, heavy, cable)

    @cached_property
    def energies_in_one_call(self) -> Any:
        """As of `Dynamics`; compiled for bonds of two sites."""
        return None if self.cables else super().energies_in_one_call

    @cached_property
    def loop_bonds(self) -> Bonds:
        """Bonds in the form of the compiled loop: that of a chain, if the network is one."""
        scene, bonds, count = self.scene, self.contact_bonds, np.arange(len(self.scene.bonds))
        row = [count, count + 1]
        if (
            self.dim == 1 and scene.mass.ndim == 1 and scene.bond_mass is None
            and self.sites == len(count) + 1 and scene.radius is None
            and np.array_equal(scene.bonds.T, row) and not scene.walls and not scene.loads.any()
            and np.all(np.diff(scene.positions[:, 0]) > 0) and not scene._gaps.any()
            and not scene._cables
        ):  # fmt: skip
            return replace(bonds, contacts=None)
        return bonds

    @cached_property
    def neighbour_counts(self) -> Indices | None:
        """Number of neighbours of higher index that each site nearly touches at the reference
        positions; None if sites have no radius, since the list of contacts is then complete."""
        radius = self.scene.radius
        return None if radius is None else fixed(neighbour_counts(self.scene.positions, radius))

    @cached_property
    def clearance(self) -> Any:
        """Detector of unlisted contacts; None if sites have no radius."""
        return self.scene._clearance(self.follows)

    def refuse_unlisted(self, u: Array) -> None:
        """Refuse displacements at which unlisted sites or walls touch."""
        if self.clearance is not None:
            self.clearance.check(u)

    def listings(self, u: Array) -> Iterator[tuple[slice, Any]]:
        """Iterate over slices of u (T, sites, dim), each with the contacts that can act in it."""
        row = 0
        while row < len(u):
            listed = self.listed(u[row])
            most = max(1, AT_ONCE // (len(listed.scene.springs) + 1))
            last = row + self._valid(u[row : row + most])
            yield slice(row, last), listed
            row = last

    def _valid(self, u: Array) -> int:
        """For how many rows of u the list of the first one is complete."""
        return len(u)

    @property
    def unchanged(self) -> dict[str, Any]:
        """Cached quantities that do not depend on springs, by name."""
        kept: dict[str, Any] = {"neighbour_counts": self.neighbour_counts}
        if self.mass_matrix is not None:
            kept |= {"mass_matrix": self.mass_matrix, "inverse": self.inverse}
        return kept

    # the engine's view

    @property
    def cost(self) -> int:
        """Cost of one evaluation of all forces, in bonds of a chain."""
        return 3 * len(self.scene.springs) + self.sites

    def rows(self, state: State) -> tuple[Array, Array]:
        """u and v in the form of the compiled loop: sites, followed by walls and a spare row."""
        if self.loop_bonds.contacts is None:
            return super().rows(state)
        u, v = np.zeros((2, self.loop_bonds.contacts.rows, self.dim))
        u[: self.sites], v[: self.sites] = state.u, state.v
        return u, v

    def _of_bonds(self, u: Array, v: Array) -> Array:
        if self.mass_matrix is None:
            return super()._of_bonds(u, v)
        kinetic = np.sum(self.kinetic(v).reshape(len(v), -1), axis=-1)
        return super()._of_bonds(u, np.zeros_like(v)) + kinetic

    # bounds, and descriptions of places for messages

    @cached_property
    def zero_length_elongation(self) -> Array:
        """Elongation [m] at which the ends of each different spring's shortest bond meet."""
        shortest, pairs = np.full(len(self.springs), np.inf), len(self.scene.bonds)
        np.minimum.at(shortest, self.springs.group[:pairs], self.scene.lengths)
        return fixed(-shortest)

    def bond_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s], given the contacts' stiffnesses [N/m].

        Gershgorin's theorem for M^-1 K: the block of a bond appears twice in the rows of a site,
        that of a wall contact once.
        """
        return self._frequency_bound(lambda some: stiffness[some])

    def spring_frequency_bound(self, stiffness: Array) -> float:
        """The same, given the stiffness of each distinct spring, (springs,)."""
        if np.isinf(stiffness).any():
            return np.inf  # the two sites of a bond coincide
        return self._frequency_bound(lambda some: stiffness[self.springs.group[some]])

    def _frequency_bound(self, stiffness_of: Callable[[slice], Array]) -> float:
        """The same, given a function of some contacts, whose stiffnesses it returns [N/m]."""
        contacts: Any = self.contact_bonds.contacts
        total, pairs = np.zeros(contacts.rows), len(self.scene.bonds)
        for ends in (contacts.first, contacts.second):
            for some in blocks(len(ends)):
                twice = 1 + (np.arange(some.start, some.start + len(ends[some])) < pairs)
                np.add.at(total, ends[some], twice * stiffness_of(some))
        return float(np.sqrt(np.max(total[: self.sites] * self.inverse_mass)))

    def _where(self, contact: int) -> str:
        bonds = self.scene.bonds
        if contact < len(bonds):
            i, j = bonds[contact].tolist()
            return f"between sites {i} and {j}"
        site, wall = self.scene.wall_contacts[contact - len(bonds)].tolist()
        return f"between site {site} and wall {wall}"

    def where_stiffest(self, u: Array, ranges: Array) -> str:
        """Describe the contact with the largest elongation in magnitude, or one whose two sites
        coincide."""
        if not len(self.scene.springs):
            return ""
        separation = ranges[:, 0] - self.zero_length_elongation
        if np.any(separation <= 0):
            cables = self.contact_bonds.cable
            segments = np.flatnonzero(self.springs.group == np.argmin(separation))
            if cables is not None and (cables[segments] >= 0).all():
                pairs, x = self.scene.bonds[segments], self.scene.positions + u
                nearest = np.argmin(np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1))
                i, j = pairs[nearest].tolist()
                return (
                    f"where two pulleys run together, sites {i} and {j} of a cable: the line "
                    "between them turns by more than a right angle within a step"
                )
            return f"{self.where_extreme(int(np.argmin(separation)), u, 0)}, which coincide"
        spring = int(np.nanargmax(np.max(np.abs(ranges), axis=1)))
        return self.where_extreme(spring, u, int(ranges[spring, 1] > -ranges[spring, 0]))


class FollowingDynamics(NetworkDynamics):
    """Quantities derived from a network whose contacts form and open.

    A new list of them begins once a site has moved by half the skin, the gap up to which the list
    is complete.

    Attributes
    ----------
    law : NewContactLaw
        Force law of contacts that form during the run.
    """

    follows = True

    def __init__(self, scene: Any) -> None:
        super().__init__(scene)
        self.law = scene._law
        self._lists: tuple[Any, ...] = ()

    @property
    def kinked(self) -> Any:
        """The law of the contacts that form, which has the kink of all of them."""
        return self.law

    def listed(self, u: Array) -> Any:
        """Dynamics with a fixed list of the contacts that can act near displacements u; the most
        recent lists are cached."""
        near = self.clearance.near(np.asarray(u, dtype=float))
        for of, known in self._lists:
            if all(map(np.array_equal, of, near)):
                return known
        made = self._with_contacts(*near)
        self._lists = ((near, made), *self._lists)[: LISTS if self.sites <= FEW else 1]
        return made

    def nearest(self, u: Array) -> Any:
        """Dynamics with contacts between each site and its nearest ones, and with all walls."""
        return self._with_contacts(*self.clearance.with_near_contacts(u))

    def energies(self, u: Array, v: Array) -> Array:
        """Total energy of each state [J], (states,); u and v (states, sites, dim)."""
        parts = [listed.energies(u[rows], v[rows]) for rows, listed in self.listings(u)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _valid(self, u: Array) -> int:
        valid: int = self.clearance.rows_valid(u)
        return valid

    def _with_contacts(self, pairs: Indices, walls: Indices) -> Any:
        """Dynamics with these contacts in addition to the scene's own, all of them fixed."""
        if not len(pairs) and not len(walls):
            return self._alone
        return self._fixed(**contacts_with(self.scene, pairs, walls))

    @cached_property
    def _alone(self) -> Any:
        return self._fixed()

    def _fixed(self, **changed: Any) -> Any:
        """Dynamics of the changed scene with a fixed list of contacts and no detector."""
        near = dynamics(varied(self.scene, _law=None, **changed))
        near.__dict__.update(self.unchanged, clearance=None)
        return near
