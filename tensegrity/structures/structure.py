"""A structure of bars and strings: description, prestress, stiffness, modes, and its scene.

Members are straight, and their tension is proportional to their elongation, unless bars buckle or
a member has a law.  Their mass, if they have any, is uniform along them; all other masses are at
the nodes.  Source: the talk, part III, "Elastic problem", for members; Pellegrino & Calladine 1986
for self-stress and mechanisms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.frames import Frames
from tensegrity.printing import Lines, Printed, listed, span
from tensegrity.scenes.network import Network
from tensegrity.scenes.walls import Wall
from tensegrity.springs.potential import Potential
from tensegrity.springs.power_law import PowerLaw
from tensegrity.structures.framework import member_ends, rigid_plates
from tensegrity.structures.member_frames import of_structure
from tensegrity.structures.member_springs import network
from tensegrity.structures.segments import paths
from tensegrity.structures.settling import equilibrium_positions
from tensegrity.structures.shape import Shape
from tensegrity.structures.statics import StructureModes
from tensegrity.structures.supports import Supports
from tensegrity.typing import Count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tensegrity.scenes.force import Force
    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.scenes.network import Network
    from tensegrity.structures.problem import StructureProblem


def floor_law(stiffness: Any) -> Potential:
    """The force law of a wall that a stiffness [N/m] stands for."""
    if stiffness is None:
        raise TensegrityError("walls need a wall_law: a Potential of the distance, or a stiffness")
    return PowerLaw(check.number("wall_law", stiffness, above=0, unit="N/m"), 1.0)


SOFT = 1e-12  # eigenvalues below this fraction of the largest stiffness are round-off


class Structure(Printed, Shape):
    """Nodes joined by bars and strings.

    Parameters
    ----------
    positions : array_like, (nodes, dim)
        Positions of the nodes [m]; dim is 2 or 3.
    bars, strings : sequence of (int, int)
        The two nodes that each member joins.  Arrays over members hold bars first, then strings.
    k_bar, k_string : float or array_like, (bars,) or (strings,), optional
        Spring constants, EA over natural length [N/m], > 0; by default 100 and 1.
    mass : float or array_like, (nodes,), optional
        Mass at each node [kg], > 0, by default 1; where members have mass >= 0, by default 0.
    natural_lengths : array_like, (members,), optional
        Unstressed lengths [m]; by default the lengths at the positions.
    platforms : sequence of sequences of int, optional
        The nodes on each rigid plate inside the structure.  Platforms are smooth and guided along
        the last axis, so that their nodes move along it together.  They exist in statics only.
    EA_bar, EA_string : float or array_like, (bars,) or (strings,), optional
        Axial stiffnesses [N], > 0, instead of k_bar, k_string.  Where EA is given, it stays as it
        is when natural lengths change, as of a cable on a winch.
    buckling : float or array_like, (bars,), optional
        Loads at which bars buckle [N], > 0; by default none does.
    plateau : float, optional
        Stiffness of a bar after buckling over that before, >= 0 and < 1.
    law : Potential or dict of int to Potential, optional
        Energy as a function of the elongation from the natural length: one for all strings, or
        {member: Potential}; strings remain slack below their natural length.  The stiffness of
        such a member is that at its natural length, and stands for it in scales.
    cables : sequence of sequences of int, optional
        The nodes along each cable, over which it runs without friction: one tension, from the sum
        of the lengths of its segments.  Cables are strings that are numbered after the others, and
        k_string, EA_string and natural lengths have them in this order.
    bar_mass, string_mass : float or array_like, (bars,) or (strings,), optional
        Mass of each bar and string [kg], >= 0, uniform along it; by default 0, as of cables.

    Attributes
    ----------
    positions, natural_lengths, stiffnesses, mass, member_mass : ndarray
        As given, (nodes, dim), (members,), (members,), (nodes,) and (members,).
    EA : ndarray, (members,)
        Stiffnesses times natural lengths [N].
    keeps_EA : ndarray of bool, (members,)
        Whose EA was given.
    ends : ndarray of int, (members, 2)
        The two nodes of each member.
    is_string : ndarray of bool, (members,)
        Which members are strings.

    Raises
    ------
    TensegrityError
        If a member has no length, a node is in no member, both k and EA of bars or strings are
        given, or a number is outside its bounds.

    Notes
    -----
    A bar with its mass lumped at its ends turns with three times its inertia, m l^2/4 for m l^2/12;
    frequencies are too low by up to sqrt(3).  With `bar_mass` they are exact, but steps shorter, by
    up to sqrt(3), as the highest frequency of a bar is sqrt(12 k/m) for sqrt(4 k/m).

    The stiffness of a string jumps at its natural length.  In `slack`, `stiffness`, `modes`,
    `is_stable` and the modes of the `network` a string counts as taut down to 1e-10 below its
    natural length, with the stiffness that it has when lengthened.  The result therefore does not
    depend on round-off, even for positions 1e5 times the structure's size from the origin; but
    for a motion that only shortens such strings the stiffness is an upper bound.  Equilibrium
    paths decide on these strings by the direction in which the path leaves.  Forces and energies
    contain no such margin.

    Examples
    --------
    A cross of two bars in a square of four strings:

    >>> from tensegrity import Structure
    >>> corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    >>> sides = [(0, 1), (1, 2), (2, 3), (3, 0)]
    >>> cross = Structure(corners, bars=[(0, 2), (1, 3)], strings=sides)
    >>> stress = cross.self_stress().feasible
    >>> stress.round(6).tolist()
    [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0]
    >>> stressed = cross.prestressed(prestrain={2: 0.05})
    >>> stressed.tensions.round(4).tolist()
    [-0.0673, -0.0673, 0.0476, 0.0476, 0.0476, 0.0476]
    >>> stressed.is_stable(), stressed.modes(2).eigenvalues.round(4).tolist()
    (True, [1.9048, 2.0952])
    """

    shift = 0.0

    @checked
    def __init__(
        self,
        positions: ArrayLike,
        bars: Sequence[tuple[int, int]] = (),
        strings: Sequence[tuple[int, int]] = (),
        k_bar: ArrayLike | None = None,
        k_string: ArrayLike | None = None,
        mass: ArrayLike | None = None,
        natural_lengths: ArrayLike | None = None,
        platforms: Sequence[Sequence[int]] = (),
        *,
        EA_bar: ArrayLike | None = None,
        EA_string: ArrayLike | None = None,
        buckling: ArrayLike | None = None,
        plateau: Annotated[float, ">= 0", "< 1"] = 0.0,
        law: Potential | Mapping[int, Potential] | None = None,
        cables: Sequence[Sequence[int]] = (),
        bar_mass: ArrayLike | None = None,
        string_mass: ArrayLike | None = None,
    ) -> None:
        self._set_positions(positions)
        nodes = self.nodes
        pairs = [
            member_ends(name, ends, nodes) for name, ends in (("bar", bars), ("string", strings))
        ]
        self.platforms = rigid_plates(platforms, nodes)
        size = float(np.ptp(self.positions, axis=0).max())
        stiff = {"bar": (k_bar, EA_bar), "string": (k_string, EA_string)}
        if isinstance(law, Potential) and (k_string is not None or EA_string is not None):
            raise TensegrityError("law of all strings and k_string or EA_string: give one of them")
        given = stiff, (mass, bar_mass, string_mass), natural_lengths, size, law
        self._set_members(pairs, *given, buckling, plateau, paths(cables, nodes))

    # structures made from this one

    def at(self, positions: ArrayLike, **other: Any) -> Structure:
        """A copy of the structure at other positions, with other arguments replaced by name; where
        natural lengths change, EA stays as it is if it was given, and else the spring constant."""
        own: dict[str, Any] = {
            "bars": self.ends[: self.bars],
            "strings": self.ends[self.bars : self.bars + self.strings],
            "cables": self.cables,
            **self._masses(),
            "natural_lengths": self.natural_lengths,
            "platforms": self.platforms,
            "law": self.law,
            "buckling": self.buckling,
            "plateau": self.plateau,
        }
        return Structure(positions, **(own | self._stiff_unless(other) | other))

    def relaxed(self) -> Structure:
        """The structure at the equilibrium of its natural lengths, by minimising the energy.

        Raises
        ------
        EquilibriumError
            If no member is stressed there.
        """
        loads = np.zeros_like(self.positions)
        x = equilibrium_positions(self.members, self.freedom(None), self.positions, loads)
        relaxed = self.at(x)
        if not (np.abs(relaxed.tensions) > 1e-12 * self.stiffnesses * self.natural_lengths).any():
            longest = np.max(self.lengths / self.natural_lengths)
            most = f"largest tension {np.abs(relaxed.tensions).max():.3g} N"
            raise EquilibriumError(
                "these natural lengths leave all members without stress: no prestress holds a "
                f"shape ({most}; before, lengths were up to {longest:.6g} of natural ones)"
            )
        return relaxed

    # stiffness

    def stiffness(self) -> Any:
        """Tangent stiffness [N/m] at the positions, a SciPy sparse array (nodes dim, nodes dim);
        slack strings contribute nothing, strings at their natural length count as taut."""
        from scipy.sparse import csr_array

        return csr_array(self.members.tangent(self.positions))

    @checked
    def modes(self, count: Count = 6, supports: Supports | None = None) -> StructureModes:
        """The softest modes that the supports permit, without rigid motions.

        Parameters
        ----------
        count : int, optional
            Number of modes.
        supports : Supports, optional
            By default none.

        Returns
        -------
        StructureModes
        """
        freedom = self.freedom(supports)
        tangent, mass = self.members.tangent(self.positions), self._inertia(freedom)
        squares, vectors = freedom.lowest(tangent, mass, count)
        if mass.ndim == 1 and (mass == mass[0]).all():
            values = squares * mass[0]
        else:
            values = freedom.lowest(tangent, np.ones(self.positions.size), count)[0]
        shapes = vectors.T.reshape(-1, *self.positions.shape)
        largest = np.sqrt(np.einsum("kni,kni->kn", shapes, shapes).max(axis=1))
        frequencies = np.sign(squares) * np.sqrt(np.abs(squares))
        total = freedom.motions.shape[1] - freedom.rigid.shape[1]
        return StructureModes(values, frequencies, shapes / largest[:, None, None], self, total)

    def is_stable(self, supports: Supports | None = None) -> bool:
        """Whether the tangent stiffness is positive definite over the motions that the supports
        permit, except rigid ones.  Strings at their natural length count as taut."""
        freedom = self.freedom(supports)
        if freedom.motions.shape[1] == freedom.rigid.shape[1]:
            return True  # nothing can move
        tangent = self.members.tangent(self.positions)
        values = freedom.lowest(tangent, np.ones(self.positions.size), 1)[0]
        return bool(values[0] > SOFT * self.stiffnesses.max())

    def problem(
        self,
        supports: Supports | None = None,
        loads: Mapping[int, Sequence[float]] | None = None,
        *,
        branch: str = "stable",
        max_load: float = math.inf,
        max_shortening: float = math.inf,
    ) -> StructureProblem:
        """The problem whose path `equilibrium_path` follows, with the same arguments.

        Parameters
        ----------
        supports, loads, branch, max_load, max_shortening
            See `tensegrity.equilibrium_path`.

        Returns
        -------
        StructureProblem

        Raises
        ------
        TensegrityError
            If an argument is outside its bounds, or there are neither loads nor an upper plate.
        EquilibriumError
            If the loads do no work, do work on a rigid motion, or determine no path at the start.
        """
        from tensegrity.structures.path import loaded

        return loaded(self, supports, branch, loads, max_load, max_shortening)

    @checked
    def network(
        self,
        *,
        held: Sequence[int] = (),
        drive: Mapping[int, Drive] | None = None,
        damping: Damping | None = None,
        forces: Sequence[Force] = (),
        natural_lengths: Mapping[int, Any] | None = None,
        walls: Sequence[Wall] = (),
        wall_law: Potential | float | None = None,
        gravity: float = 0.0,
    ) -> Network:
        """The structure as a network for `simulate`.

        Strings carry tension only, bars tension and compression, up to their buckling load if they
        have one; both keep their masses.  They have no thickness and pass through each other.
        Displacements are measured from the positions.  A cable over nodes is a bond for each of its
        segments, which all have its tension, after the bonds of the other members.

        Parameters
        ----------
        held : sequence of int, optional
            Nodes that are fixed.
        drive, damping, forces : optional
            As of `Network`.
        natural_lengths : dict, optional
            {member: SymPy expression of t} [m]: natural lengths that change, each in its own way.
            The member keeps EA if that was given, and else k, or its law of the elongation; its
            buckling load stays.  The run records the work done on
            what hangs outside the drum, at the rate -(T + T^2/(2 EA)) or, where k or a law is kept,
            -T times that of the natural length.
        walls : sequence of Wall, optional
            Unbounded walls that the nodes press, without friction; nodes do not touch each other.
        wall_law : Potential or float, optional
            The force of a node on a wall as a function of its distance from it, or the stiffness
            [N/m] of one in proportion to the depth behind it.
        gravity : float, optional
            Acceleration against the last axis [m/s^2], as loads.

        Returns
        -------
        Network

        Raises
        ------
        TensegrityError
            If there are platforms, which a network cannot have, a wall cuts the positions, a
            natural length is not above 0 at the start, or an argument is refused by `Network`.
            `simulate` refuses natural lengths that reach 0 within the run.
        """
        if self.platforms:
            raise TensegrityError(
                f"{len(self.platforms)} platforms: a structure with rigid plates has statics only"
            )
        given: dict[str, Any] = {"held": held, "drive": drive, "damping": damping, "forces": forces}
        if len(check.sequence("walls", walls, "Walls")):
            law = wall_law if isinstance(wall_law, Potential) else floor_law(wall_law)
            given |= {"walls": walls, "wall_spring": law, "contacts": "walls"}
        elif wall_law is not None:
            raise TensegrityError("wall_law given, but no walls")
        if gravity:
            given["loads"] = np.zeros(self.positions.shape)
            given["loads"][:, -1] = -gravity * self.weighing_mass
        return network(self, natural_lengths, **given)

    def frames(self) -> Frames:
        """Positions, and tension, force density, slackness and stiffness of the members, as
        `tensegrity.files.write` puts them into files; one instant."""
        return of_structure(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Bars thick, taut strings in the colours of their tension, slack strings dashed and red.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            With projection "3d" for a structure in space; by default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or not of the dimension of the structure.
        """
        drawn: Axes = plotting.axes(ax, in_space=self.dim == 3)
        each = self.cable_segments.each
        members = each(self.is_string), each(self.slack), each(self.tensions)
        plotting.members(drawn, self.positions, self.segments, *members)
        return drawn

    _size = (4.0, 3.2)

    def _draw(self, figure: Any) -> None:
        self.plot(plotting.subplot(figure, self.dim == 3))

    def _lines(self) -> Lines:
        yield repr(self)
        for name, chosen in (("bars", ~self.is_string), ("strings", self.is_string)):
            if chosen.any():
                lengths, tensions = self.lengths[chosen], self.tensions[chosen]
                words = f"lengths {span(lengths, 'm')}, tensions {span(tensions, 'N')}"
                yield f"  {name}: {words}"
        yield self._masses_line()
        if self.slack.any():
            yield f"  slack: strings {listed(np.flatnonzero(self.slack))}"
        if self.buckled.any():
            yield f"  buckled: bars {listed(np.flatnonzero(self.buckled))}"

    def __repr__(self) -> str:
        count = len(self.cables)
        cables = f"{count} cable{'s' * (count > 1)}, " if count else ""
        return (
            f"Structure({self.nodes} nodes in {self.dim} dimensions, {self.bars} bars, "
            f"{self.strings} strings, {cables}{int(self.slack.sum())} of them slack)"
        )
