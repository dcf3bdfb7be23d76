"""The bonds of a scene in the form of arrays, and their order in the loop.

A bond has a law, the two rows that it joins, and parameters, in common with others, of its own, or
of its own in each scene of a batch.  Rows are the sites, then the walls.  The loop notes the
elongation range of every bond with parameters of its own, and of every run of other bonds.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.codegen import is_long
from tensegrity.engine.inertia import RowOperations
from tensegrity.readonly import fixed

PAIR, WALL = 0, 1
KINDS = ("pair", "wall")
SHORT = 64  # in a chain, fewer consecutive equal bonds may be part of a run of unequal ones
FEW = 4  # most such short groups of a law that remain runs of their own
GROUP = 8  # as in simd.c
BLOCK = 64  # as in simd.c


@dataclass(frozen=True, eq=False)
class Bonds:
    """Bonds between neighbours on a line, or contacts in any pattern.

    Attributes
    ----------
    laws : tuple of Law
        The different laws that occur.
    law : ndarray of int, (springs,)
        Index into `laws` of each different spring.
    parameters : ndarray, (springs, most parameters of any law)
    group : ndarray of int, (bonds,) or (bonds, batch)
        The spring of each bond; the springs of a bond in all scenes of a batch have one law.
    inverse_mass : ndarray, (sites,), (sites, batch), or of a network also (sites, dim)
        [1/kg], 0 for a held site; with a coupling the inverse of its pivots.
    contacts : Contacts, optional
        Contacts of a network; the bonds of a chain join neighbours.
    kinks : ndarray, (kinks, springs, 4), optional
        The kinks of each different spring, `Potential.kinks`; NaN after its last one.
    coupling : RowOperations, optional
        Of bonds with mass: accelerations are `inverse_mass` times the forces after these.
    heavy : tuple of int
        The bonds with mass.
    cable : ndarray of int, (bonds,), optional
        The cable over sites of which each bond is a segment, -1 of others.  The elongation of all
        its segments is the mean of theirs.
    stretch : float, optional
        Of a ring what its elongations sum up to [m]: one more bond joins the last site to the
        first.
    """

    laws: tuple
    law: np.ndarray
    parameters: np.ndarray
    group: np.ndarray
    inverse_mass: np.ndarray
    contacts: Contacts | None = None
    kinks: np.ndarray | None = None
    coupling: RowOperations | None = None
    heavy: tuple = ()
    cable: np.ndarray | None = None
    stretch: float | None = None

    @property
    def independent(self):
        """Whether accelerations follow from the forces of single bonds: no bond has mass, or is a
        segment of a cable over sites."""
        return self.coupling is None and self.cable is None

    @property
    def dim(self):
        """Number of coordinates of a site; 0 on a line."""
        return 0 if self.contacts is None else self.contacts.load.shape[1]

    @property
    def mobility(self):
        """Bounds of the inverse masses [1/kg], (sites,), those themselves without a coupling."""
        return self.inverse_mass if self.coupling is None else self.coupling.mobility

    @property
    def noted(self):
        """Number of ranges that the loop notes: of the elongation of each different spring; with a
        law of both ends, of each coordinate, of the differences of free ones."""
        return self.dim if geometry.own(self.laws) else len(self.law)

    @property
    def law_of_bond(self):
        """Index into `laws`; (bonds,)."""
        first = self.group if self.group.ndim == 1 else self.group[:, 0]
        return self.law[first]

    @cached_property
    def runs(self):
        """The order of the bonds in the loop."""
        runs = line_runs(self) if self.contacts is None else net_runs(self)
        return Runs(*(fixed(getattr(runs, field.name)) for field in fields(Runs)))

    @cached_property
    def in_pattern(self):
        """A ring as contacts, which the reverse loop takes; others as they are."""
        if self.stretch is None:
            return self
        each, none = np.arange(len(self.group)), np.zeros((len(self.group), 1))
        turn, gap = none.copy(), none[:, 0].copy()
        turn[-1], gap[-1] = len(each), self.stretch
        contacts = Contacts(
            each, (each + 1) % len(each), gap, np.ones(len(each)), each[:, None] + 0.0, none,
            none[:0], shift=turn,
        )  # fmt: skip
        return replace(self, contacts=contacts, stretch=None)

    @cached_property
    def layouts(self):
        """Cache of layouts, by loop and number of threads."""
        return {}

    @cached_property
    def own(self):
        """For each law the indices of the parameters that differ within a run; None where no run
        has bonds with an elongation range of their own."""
        differing = [None] * len(self.laws)
        for k in np.flatnonzero(self.runs.own):
            values = self.parameters[np.unique(self.group[self.runs.members(k)])]
            differ = np.flatnonzero(np.any(values != values[0], axis=0)).tolist()
            law = self.runs.law[k]
            differing[law] = tuple(sorted({*differ, *(differing[law] or ())}))
        return tuple(differing)


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a network; rows are sites, then walls, and a spare one.

    Attributes
    ----------
    first, second : ndarray of int, (contacts,)
        Rows that a contact joins; the first of a wall contact is the wall.
    gap, length : ndarray, (contacts,)
        Elongation at the reference places [m]; length [m], 0 of contacts with walls.
    positions : ndarray, (sites, dim)
        Reference places [m], whose differences are the separations of pairs.
    load : ndarray, (sites, dim)
        Constant forces [N].
    normals : ndarray, (walls, dim)
        Of the walls.
    shift : ndarray, (contacts, dim), optional
        What is added to the separation of a pair [m], where its second end is an image of a site.
    crowding : ndarray of int, (sites,), optional
        Approximate number of sites of higher numbers with which each may have contacts, where the
        list changes during a run; the same for all lists of a scene.
    """

    first: np.ndarray
    second: np.ndarray
    gap: np.ndarray
    length: np.ndarray
    positions: np.ndarray
    load: np.ndarray
    normals: np.ndarray
    crowding: np.ndarray | None = None
    shift: np.ndarray | None = None

    @property
    def walls(self):
        return len(self.normals)

    @property
    def rows(self):
        """Number of sites and walls, and one more."""
        return len(self.load) + self.walls + 1

    @cached_property
    def kind(self):
        """Index into `KINDS` of each contact; (contacts,)."""
        return fixed(np.where(self.first < len(self.load), PAIR, WALL).astype(np.uint8))

    def ends_of(self, some):
        """Rows that some contacts join, (some, 2)."""
        return np.stack([self.first[some], self.second[some]], axis=1)

    @cached_property
    def places(self):
        """Reference places of the sites [m], the normals of walls, and 0; (rows + 1, dim)."""
        spare = np.zeros((2, self.load.shape[1]))
        return fixed(np.concatenate([self.positions, self.normals, spare]))

    @cached_property
    def geometry(self):
        """`geometry_of` all contacts."""
        return fixed(self.geometry_of(slice(None)))

    def geometry_of(self, some):
        """Geometry of some contacts: reference separation [m], or normal of the wall; initial gap
        and length [m]; on a line the sign of the separation.

        Parameters
        ----------
        some : slice or ndarray of int

        Returns
        -------
        ndarray, (dim + 2, some)
        """
        first, second, pair = self.first[some], self.second[some], self.kind[some] == PAIR
        arguments = np.empty((self.load.shape[1] + 2, len(first)))
        for row, place in zip(arguments[:-2], self.places.T, strict=True):
            row[:] = np.where(pair, place[second] - place[first], place[first])
        if self.shift is not None:
            arguments[:-2, pair] += self.shift[some][pair].T
        if len(arguments) == 3:
            arguments[0, pair] = np.sign(arguments[0, pair])
        arguments[-2], arguments[-1] = self.gap[some], self.length[some]
        return arguments


@dataclass(frozen=True, eq=False)
class Runs:
    """Bonds in runs of one law, and in a network of one kind.

    Attributes
    ----------
    source : ndarray of int, (places,)
        The bond at each place.
    first : ndarray of int, (runs + 1,)
        First place of each run.
    law, own, kind : ndarray of int, (runs,)
        Its law, whether bonds have parameters of their own, and the kind of its contacts.
    """

    source: np.ndarray
    first: np.ndarray
    law: np.ndarray
    own: np.ndarray
    kind: np.ndarray

    def members(self, run):
        """The bonds of a run."""
        return self.source[self.first[run] : self.first[run + 1]]


def line_runs(bonds):
    """Runs of a chain: consecutive equal bonds, many short such groups joined to one run."""
    group = bonds.group[:, None] if bonds.group.ndim == 1 else bonds.group
    law = bonds.law_of_bond
    steps = np.any(group[1:] != group[:-1], axis=1)
    first = np.concatenate([[0], np.flatnonzero(steps) + 1, [len(group)]])
    laws = law[first[:-1]]
    varied = np.any(group != group[:, :1], axis=1)[first[:-1]]
    short = np.diff(first) < SHORT
    joins = varied.copy()
    for number in range(len(bonds.laws)):
        mine = laws == number
        if (short & mine).sum() > FEW:
            joins |= short & mine
        if joins[mine].any() and is_long(bonds.laws[number]):
            joins |= mine  # so that the law is compiled once
    ends = np.flatnonzero((laws[1:] != laws[:-1]) | ~(joins[1:] & joins[:-1])) + 1
    begins = np.concatenate([[0], ends]).astype(int)
    own = joins[begins].astype(int)
    return Runs(
        np.arange(len(group)), np.append(first[begins], len(group)), laws[begins], own,
        np.full(len(begins), PAIR),
    )  # fmt: skip


def net_runs(bonds):
    """Contacts in runs of one kind and law, segments of cables apart from other bonds."""
    number = bonds.law_of_bond * len(KINDS) + bonds.contacts.kind
    if bonds.cable is not None:
        number = 2 * number + (bonds.cable >= 0)
    numbers = np.unique(number)
    members = [np.flatnonzero(number == one) for one in numbers]
    own = np.array([np.ptp(bonds.group[part]) > 0 for part in members], dtype=int)
    law, kind = np.divmod(numbers if bonds.cable is None else numbers // 2, len(KINDS))
    for one in np.unique(law[own > 0]):
        if is_long(bonds.laws[one]):
            own[law == one] = 1  # so that the law is compiled once
    first = np.cumsum([0, *map(len, members)])
    source = np.concatenate([np.zeros(0, np.int32), *members], dtype=np.int32)
    return Runs(source, first, law, own, kind)


def parameters(bonds, runs, own, batch=1):
    """Fields of a scene that hold parameters.

    Parameters
    ----------
    bonds : Bonds
    runs : Runs
    own : sequence of (tuple of int or None)
        For each law the indices of parameters that each bond has of its own; see `Bonds.own`.
    batch : int, optional
        Number of scenes.

    Returns
    -------
    dict of ndarray
        "shared", parameters common to a run, (runs, most); "own", those of single bonds; "own_at",
        where these begin for each run.
    """
    places = np.zeros(len(runs.law), dtype=np.int64)
    shared = np.zeros((len(runs.law), bonds.parameters.shape[1]))
    columns, at = [np.zeros(0)], 0
    for k, law in enumerate(runs.law):
        springs = springs_of_places(bonds, runs, k, batch)
        shared[k] = bonds.parameters[springs[0]]
        places[k] = at
        if runs.own[k]:
            columns.append(bonds.parameters[:, list(own[law])][springs].T.ravel())
            at += columns[-1].size
    columns.append(np.zeros(GROUP))  # SIMD loads may read beyond the last one
    return {"shared": shared, "own": np.concatenate(columns), "own_at": places}


def springs_of_places(bonds, runs, run, batch=1):
    """The spring of each place of a run that has parameters of its own.

    Parameters
    ----------
    bonds : Bonds
    runs : Runs
    run : int
    batch : int, optional
        Number of scenes.

    Returns
    -------
    ndarray of int, (places,)
        Of each bond in each scene, or of a block where every scene has one spring in the run.
    """
    springs = bonds.group[runs.members(run)]
    if springs.ndim == 2 and BLOCK % batch == 0 and np.all(springs == springs[0]):
        return np.resize(springs[0], min(BLOCK, springs.size))
    return np.repeat(springs, batch) if springs.ndim == 1 else springs.ravel()


def segments(bonds):
    """The segments of cables over sites, one cable after the other."""
    if bonds.cable is None:
        return np.zeros(0, dtype=int)
    return np.argsort(bonds.cable, kind="stable")[np.sum(bonds.cable < 0) :]


def of_cables(bonds, listed):
    """Fields of a scene with the segments of cables over sites.

    Parameters
    ----------
    bonds : Bonds
    listed : ndarray of int
        The bond of each entry.

    Returns
    -------
    dict of ndarray
    """
    none, count = np.zeros(0, dtype=int), len(bonds.runs.law)
    if bonds.cable is None:
        names = "strand_at", "strand_place", "mean_entry", "mean_at"
        fields = dict.fromkeys(names, none) | {"strand_geometry": np.zeros(0)}
        return fields | {"strung": np.zeros(count, dtype=int)}
    order, entries = segments(bonds), bonds.cable[listed]
    cables, by_cable = np.arange(bonds.cable.max() + 2), np.argsort(entries, kind="stable")
    return {
        "strand_geometry": bonds.contacts.geometry_of(order).T,
        "strand_at": np.searchsorted(bonds.cable[order], cables),
        "strand_place": np.argsort(bonds.runs.source)[order],
        "mean_entry": by_cable,
        "mean_at": np.searchsorted(entries[by_cable], cables),
        "strung": bonds.cable[bonds.runs.source[bonds.runs.first[:-1]]] >= 0,
    }


def integers(array):
    return np.ascontiguousarray(array, dtype=np.int64)


def by_spring(group, springs, low, high):
    """Elongation ranges of springs from those of their bonds.

    Parameters
    ----------
    group : ndarray of int, (bonds,)
        The spring of each bond.
    springs : int
        Number of springs.
    low, high : ndarray, (bonds,)
        Smallest and largest elongation of each bond [m].

    Returns
    -------
    ndarray, (springs, 2)
        [m]; inf and -inf for a spring without bonds.
    """
    if springs == 1 and low.size:
        return np.array([[low.min(), high.max()]])
    ranges = np.empty((springs, 2), dtype=low.dtype)
    ranges[:, 0], ranges[:, 1] = np.inf, -np.inf
    np.minimum.at(ranges[:, 0], group, low)
    np.maximum.at(ranges[:, 1], group, high)
    return ranges
