"""Observables of a run of beads: sensor and wall forces, speeds, overlaps and energies.

A sensor in a bead measures the force across its middle plane (eq. (5) of the paper): half the sum
of the forces of its contacts, each projected on the bead's displacement (derived in
`derivations.ledger_paper`, entry "paper.eq5").  Contact forces are positive in compression.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from granular.contact_network import (
    Crystal,
    beads_by_site,
    contacts_of,
    crystal_of,
    kinetic,
    rows,
    wall_forces,
    wall_sites,
    whole,
)
from tensegrity import TensegrityError, check
from tensegrity.measure.observables import speed_in
from tensegrity.measure.records import first_peak, largest_peak
from tensegrity.printing import Lines, Printed, span
from tensegrity.runs.run import Run
from tensegrity.typing import Array


@overload
def sensor_force(run: Run, part: str, number: int) -> Array: ...
@overload
def sensor_force(run: Run, part: Sequence[int]) -> Array: ...
def sensor_force(run: Run, part: str | Sequence[int], number: int | None = None) -> Array:
    """Force measured by a sensor inside a bead, eq. (5) of the paper.

    Parameters
    ----------
    run : Run
        Of a chain, a guide or a pack of beads, with the beads and their neighbours recorded.
    part : str or sequence of int
        Name of a part, such as "stem 1"; or the sites of several beads.
    number : int
        Number of the bead in that part, from 1.

    Returns
    -------
    ndarray, (T,) or (T, sites)
        [N], >= 0; 0 for a bead that the wave has not reached.

    Raises
    ------
    TensegrityError
        Not a run, or one of a scene without beads; no such bead; the bead or a neighbour was not
        recorded.

    Examples
    --------
    >>> from granular import Bead, Striker, chain, materials, sensor_force, simulate
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> beads = chain([bead] * 20, striker=Striker(bead, speed=0.5), end=materials["steel"])
    >>> run = simulate(beads, beads.start(), t_end=4e-4, tol=1e-6)
    >>> print(f"{sensor_force(run, 'chain', 10).max():.1f} N")
    64.2 N
    """
    scene = crystal_of(run)
    if isinstance(part, str):
        return _sensed(run, [scene.site(part, number)])[:, 0]  # type: ignore[arg-type]
    if number is not None:
        raise TensegrityError(f"number {check.shown(number)} belongs to a part given by its name")
    sites = check.sequence("sites", part, "sites")
    if not sites:
        raise TensegrityError("sites is empty: no sensor to read")
    for site in sites:
        check.whole("site", site, least=0, below=scene.sites)
    return _sensed(run, sites)


def _sensed(run: Run, sites: Sequence[int]) -> Array:
    """Sensor forces of beads by their sites, (T, sites) [N]."""
    contacts = contacts_of(crystal_of(run))
    near = sorted({k for site in sites for k in contacts.neighbours(site)})
    return contacts.sensed(rows(run, near), rows(run, near, "v"), sites)


def wall_force(run: Run, name: str, each: bool = False) -> Array:
    """Contact force on a wall.

    Parameters
    ----------
    run : Run
        Of a chain, a guide or a pack, with all beads recorded that can touch the wall; an error
        names the first one that is missing.
    name : str
        Such as "floor"; "start" or "end" of a chain.  Forces on walls of the same name are added.
    each : bool, optional
        Whether to return the contribution of every site, in the order of the sites.

    Returns
    -------
    ndarray, (T,) or (T, sites)
        [N], compression > 0.

    Raises
    ------
    TensegrityError
        No such wall; a bead that can touch it was not recorded.

    Examples
    --------
    >>> from granular import Bead, Striker, chain, materials, simulate, wall_force
    >>> steel = materials["steel"]
    >>> bead = Bead(diameter=10e-3, material=steel)
    >>> beads = chain([bead] * 20, striker=Striker(bead, speed=0.5), end=steel)
    >>> run = simulate(beads, beads.start(), t_end=5e-4, tol=1e-6)
    >>> f"{wall_force(run, 'end').max():.1f} N"
    '176.3 N'
    """
    scene = crystal_of(run)
    each = check.truth("each", each)
    u, v = (rows(run, wall_sites(scene, name), one) for one in "uv")
    forces = wall_forces(scene, u, name, v)
    return forces if each else forces.sum(axis=-1)


@speed_in.register
def _of_crystal(scene: Crystal, run: Run, where: Any, numbers: Any, between: Any) -> float:
    """Speed of the leading pulse between two sensors of a part [m/s]."""
    distance = crystal_of(run).distance(where, numbers)
    first, second = (first_peak(run.t, sensor_force(run, where, n), between)[0] for n in numbers)
    if first == second:
        raise TensegrityError(f"beads {numbers} of {where} peak at the same instant, {first:g} s")
    return distance / (second - first)


def overlaps(run: Run, part: str | None = None) -> tuple[float, float]:
    """Largest and mean peak overlap of the contacts between beads of a part (None: all) [m].

    Peaks between recorded instants count too, as in `tensegrity.largest_peak`.
    """
    scene = crystal_of(run)
    u = rows(run, range(scene.sites))
    chosen = contacts_of(scene).within(part)
    if not chosen:
        raise TensegrityError(f"part {part!r} has no contact of two of its beads")
    peaks = [largest_peak(run.t, overlap)[1] for overlap in scene.overlaps(u)[:, chosen].T]
    return max(peaks), float(np.mean(peaks))


@dataclass(frozen=True, eq=False, repr=False)
class BeadEnergies(Printed):
    """Distribution of the energy among beads, at each recorded instant.

    The energy of a bead is its kinetic energy, half the energy of each contact with another bead
    and the whole energy of its contacts with walls; the potentials of gravity and of a preload are
    not included.

    Attributes
    ----------
    kinetic, stored : ndarray, (T, beads)
        Kinetic and contact energy of each bead, in the order of the sites, without those that
        represent the walls of a chain [J].
    parts : dict of str to ndarray, (T,)
        Energy of each part [J]: kinetic, and half that of each contact of two beads; "walls" is
        the energy of all contacts with walls.  The sum is the total energy.
    """

    kinetic: Array
    stored: Array
    parts: dict[str, Array]

    def _lines(self) -> Lines:
        rows, beads = self.kinetic.shape
        yield f"energies of {beads} beads at {rows} instants"
        yield from (f"  {name}: {span(energy, 'J')}" for name, energy in self.parts.items())

    @property
    def fractions(self) -> Array:
        """Fraction of the energy in each bead, (T, beads); every row adds up to 1.

        Raises
        ------
        TensegrityError
            A row without energy, or a bead with less than 0: contacts that attract bind it.
        """
        energies = self.kinetic + self.stored
        if np.any(energies < 0):
            raise TensegrityError(
                f"energy {energies.min():g} J of a bead must be at least 0: attraction binds it, "
                "and it has no share of the whole"
            )
        total = energies.sum(axis=-1, keepdims=True)
        if not np.all(total > 0):
            raise TensegrityError(f"energy {total.min():g} J of a row must be above 0")
        return energies / total

    @property
    def effective_number(self) -> Array:
        """Number of beads among which the energy is spread, exp of the entropy of `fractions`;
        (T,)."""
        fractions = self.fractions
        logs = np.log(np.where(fractions > 0, fractions, 1.0))
        return np.exp(-np.sum(fractions * logs, axis=-1))

    @property
    def participation_ratio(self) -> Array:
        """Number of beads among which the energy is spread, 1 over the sum of squared
        `fractions`; (T,)."""
        return 1 / np.sum(self.fractions**2, axis=-1)

    @property
    def virial_ratio(self) -> Array:
        """Kinetic energy over kinetic and contact energy; (T,).

        Its mean over a long time is 5/9 for a line of Hertz beads that just fills the room between
        two walls, without gravity or preload: the potential is homogeneous of degree 5/2 in the
        displacements, whether or not contacts open, and these stay bounded, so that
        2 <T> = 5/2 <V> (virial theorem).
        """
        kinetic, stored = self.kinetic.sum(axis=-1), self.stored.sum(axis=-1)
        return kinetic / (kinetic + stored)


def energies(run: Run) -> BeadEnergies:
    """Energies of all beads and parts during a run.

    Parameters
    ----------
    run : Run
        Of a scene of beads, with all sites recorded.

    Returns
    -------
    BeadEnergies

    Raises
    ------
    TensegrityError
        Not a run of beads; a site that was not recorded.

    Examples
    --------
    >>> from granular import Bead, Striker, chain, energies, materials, simulate
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> beads = chain([bead] * 20, striker=Striker(bead, speed=0.5), end=materials["steel"])
    >>> energy = energies(simulate(beads, beads.start(), t_end=2e-4, tol=1e-6))
    >>> print(f"{1e3 * energy.kinetic[0].sum():.3f} mJ, {energy.effective_number[-1]:.2f} beads")
    0.524 mJ, 2.46 beads
    """
    scene = crystal_of(run)
    u, v = whole(run)
    contacts, beads = contacts_of(scene), list(beads_by_site(scene))
    inside = contacts.bead_energies(u, v)
    parts = {
        part: inside[:, list(sites)].sum(axis=1)
        for part, sites in scene.parts.items()
        if part != "wall"
    }
    moving, stored = kinetic(scene, v)[:, beads], contacts.stored(u)[:, beads]
    return BeadEnergies(moving, stored, {**parts, "walls": contacts.wall_energy(u)})
