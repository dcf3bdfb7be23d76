"""The common base of chains, guides and packs of beads: parts, bead numbers, recorded rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity import Run, TensegrityError, check
from tensegrity.engine import forces
from tensegrity.printing import concise
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from granular.beads import Bead, Striker
    from tensegrity import Force
    from tensegrity.typing import Array, Indices

MANY = 6  # parts that are not all named in print


class Crystal:
    """A scene of beads in named parts.

    Attributes
    ----------
    beads : sequence of Bead
        One for each site that is a bead, the striker first where there is one.
    parts : dict of str to sequence of int
        Sites of each part, in the paper's counting order.
    striker : Striker or None
    """

    beads: Sequence[Bead]
    parts: Mapping[str, Sequence[int]]
    striker: Striker | None
    wall_names: tuple[str, ...]
    _arguments: dict[str, Any]
    _losses: Sequence[Force]  # of contacts that dissipate
    _carried: Any  # by each contact at elongation 0 [N]
    _pressed: Any  # overlap of each contact there [m]
    if TYPE_CHECKING:
        sites: int
        bonds: Indices

        shape: tuple[int, ...]

        def _with_walls(self) -> WithWalls: ...

    __str__ = concise

    def __repr__(self) -> str:
        counts = [f"{name}: {len(sites)}" for name, sites in self.parts.items()]
        parts = ", ".join(counts if len(counts) < MANY else [*counts[:2], "...", counts[-1]])
        struck = "" if self.striker is None else f", struck at {self.striker.speed:g} m/s"
        return f"{type(self).__name__}({parts}{struck}) on {super().__repr__()}"

    def contact_forces(self, u: ArrayLike, v: ArrayLike | None = None) -> Array:
        """Compressive force in each contact [N], (..., contacts): those of `bonds`, and behind them
        those with the walls of a guide or a pack.

        Contacts that may form are those of `listed(u)`.  Contacts that dissipate need the
        velocities v [m/s] too, of the shape of u.
        """
        u, of = check.rows("displacements", u, self.shape), dynamics(self)
        loads = self._carried - of.evaluate("tension", u)
        if not self._losses:
            return loads
        r, rate = of.elongations(u), forces.rates(of.contact_bonds, u, needed_velocities(self, v))
        for loss in self._losses:
            sign, first = (1, len(self.bonds)) if loss.on == "walls" else (-1, 0)
            at = np.asarray(loss.at, dtype=int) + first
            if len(at):
                loads[..., at] += sign * loss.values(r[..., at], rate[..., at])
        return loads

    def overlaps(self, u: ArrayLike) -> Array:
        """Overlap of each contact of `bonds`, as in `contact_forces` [m], < 0 for a gap."""
        u = check.rows("displacements", u, self.shape)
        return self._pressed - dynamics(self).listed(u).scene.elongation(u)

    def site(self, part: str, number: int) -> int:
        """Site of the bead with that number, from 1, in a part.

        Raises
        ------
        TensegrityError
            An unknown part, or a number that it does not have.
        """
        sites = members(self, part)
        number = check.whole(f"bead of {part}", number, least=1)
        if number > len(sites):
            raise TensegrityError(f"bead {number} of {part} must be at most {len(sites)}")
        return sites[number - 1]

    def distance(self, part: str, numbers: tuple[int, int]) -> float:
        """Length of the path through touching beads of a part between two numbers [m], > 0."""
        if not isinstance(numbers, (tuple, list)) or len(numbers) != 2:
            raise TensegrityError(f"numbers {numbers!r} of {part} must be two different beads")
        first, second = sorted(self.site(part, n) for n in numbers)
        if first == second:
            raise TensegrityError(f"numbers {numbers!r} of {part} must be two different beads")
        beads = beads_by_site(self)
        diameters = [beads[s].diameter for s in range(first, second + 1)]
        return sum(diameters) - (diameters[0] + diameters[-1]) / 2


class WithWalls(NamedTuple):
    """The contacts of beads with walls.

    Attributes
    ----------
    contacts : ndarray of int
        Their numbers among all contacts.
    sites, walls : ndarray of int
        The bead of each, and the wall, an index into `wall_names`.
    """

    contacts: Indices
    sites: Indices
    walls: Indices


def members(scene: Crystal, part: str) -> Sequence[int]:
    """Sites of a part; TensegrityError if there is no such part."""
    if not isinstance(part, str) or part not in scene.parts:
        raise TensegrityError(f"part {check.shown(part)} is not one of {', '.join(scene.parts)}")
    return scene.parts[part]


def site_name(scene: Crystal, site: int) -> str:
    """Words for a site: its part and its number in it, from 1."""
    for part, sites in scene.parts.items():
        if site in sites:
            known = f"bead {sites.index(site) + 1} of {part}"
            return "the striker" if part == "striker" else known
    return f"site {site}"


def beads_by_site(scene: Crystal) -> dict[int, Bead]:
    """The bead of each site that is one; the others stand for the walls of a chain."""
    return dict(enumerate(scene.beads, start=int("start wall" in scene.parts)))


def crystal_of(run: Any) -> Crystal:
    """The scene of a run, if it is one of beads."""
    if not isinstance(run, Run):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run")
    if not isinstance(run.scene, Crystal):
        raise TensegrityError(
            f"the scene of the run is {type(run.scene).__name__}, not a chain, a guide or a "
            "pack of beads"
        )
    return run.scene


def rows(run: Run, sites: Iterable[int], name: str = "u") -> Array:
    """Displacements of all sites, or their velocities "v"; those named must have been recorded.

    Parameters
    ----------
    run : Run
    sites : iterable of int
    name : {"u", "v"}, optional

    Returns
    -------
    ndarray, (T, sites[, dim])
        0 where nothing was recorded.

    Raises
    ------
    TensegrityError
        One of `sites` was not recorded.
    """
    missing = sorted(set(sites) - set(run.sites))
    if missing:
        raise TensegrityError(f"site {missing[0]} is needed and was not recorded")
    if run.sites == tuple(range(run.scene.sites)):
        return getattr(run, name)
    table = np.zeros((len(run.t), run.scene.sites, *run.u.shape[2:]))
    table[:, list(run.sites)] = getattr(run, name)
    return table


def whole(run: Run) -> tuple[Array, Array]:
    """Displacements and velocities of all sites in their order, whatever the record's; (T, sites[,
    dim]) each.

    Raises
    ------
    TensegrityError
        A site was not recorded.
    """
    u = rows(run, range(run.scene.sites))
    return u, run.v[:, np.argsort(run.sites)]


def needed_velocities(scene: Any, v: ArrayLike | None) -> Array:
    """The velocities on which the forces of contacts that dissipate depend, checked."""
    if v is None:
        raise TensegrityError("the forces of contacts that dissipate depend on v: give v")
    return check.rows("velocities", v, scene.shape)
