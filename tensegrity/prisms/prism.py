"""The regular tensegrity prism: its description, and the quantities known in closed form.

A prism consists of two regular polygons of strings with n sides, joined by n bars and n cross
strings; n is 3 by default, and members have no thickness.  The reference is the self-stressed
state at twist pi/2 + pi/n, which is 5 pi/6 for triangles.  Source: the talk, part III; the forms
for any n are those of `derivations.polygon`.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import NoLocking, TensegrityError
from tensegrity.printing import Lines, Printed, call, filled
from tensegrity.prisms.closed import assembled, exact, rigid_potential
from tensegrity.springs.potential import Potential
from tensegrity.structures.structure import Structure
from tensegrity.typing import (
    Distance,
    Length,
    NotNegative,
    Preload,
    Sides,
    Stiffness,
    StiffnessOrInf,
)
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from tensegrity.lattices.bloch import PeriodicBonds
    from tensegrity.lattices.lattice import Lattice
    from tensegrity.prisms.problem import PrismProblem
    from tensegrity.scenes.network import Network

DRAWN = 0.95  # fraction of the compressive domain that a notebook's picture shows
STIFF = 100.0  # spring constant over k_cross by which rigid members are drawn


class NaturalLengths(NamedTuple):
    """Unstressed lengths [m]."""

    cross: float
    base: float
    bar: float

    def __str__(self) -> str:
        return f"cross {self.cross:.6g} m, base {self.base:.6g} m, bar {self.bar:.6g} m"


@checked
@dataclass(frozen=True)
class Prism(Printed):
    """A regular tensegrity prism, triangular by default.

    Parameters
    ----------
    base : float
        Side of the polygons in the self-stressed state [m].
    height : float
        Height of the self-stressed state [m].
    prestrain : float
        Strain (s0 - sN)/sN of the cross strings in the self-stressed state, >= 0; s0 is their
        length there and sN their natural length.
    k_cross : float
        Spring constant of a cross string [N/m].
    k_base, k_bar : float, optional
        Spring constants of a base string and of a bar [N/m]; inf (the default) is rigid.
    sides : int, optional
        Sides of the polygons, at least 3.

    Raises
    ------
    TensegrityError
        If a value is outside its bounds, or the bases are so soft that their natural length
        would not be positive (k_base <= k_cross p0/((1 + p0) 2 sin(pi/n)), p0 the prestrain).

    Examples
    --------
    >>> from tensegrity import Prism
    >>> prism = Prism(base=1.0, height=0.7, prestrain=0.1, k_cross=1.0)
    >>> prism
    Prism(base=1, height=0.7, prestrain=0.1, k_cross=1)
    >>> round(prism.natural_lengths().cross, 6), round(prism.locking_height(), 6)
    (0.691935, 0.632996)
    >>> round(prism.axial_stiffness(), 6)
    2.77758
    """

    base: Length
    height: Length
    prestrain: NotNegative
    k_cross: Stiffness
    k_base: StiffnessOrInf = math.inf
    k_bar: StiffnessOrInf = math.inf
    sides: Sides = 3

    def __post_init__(self) -> None:
        if self.natural_lengths().base <= 0:
            (least,) = map(float, exact("least k_base", self))
            raise TensegrityError(
                f"k_base {self.k_base:g} N/m must be above {least:g} N/m, "
                "below which the natural length of the base strings is not positive"
            )

    @classmethod
    @checked
    def from_members(
        cls,
        cross: Length,
        base: Length,
        bar: Length,
        k_cross: Stiffness,
        k_base: StiffnessOrInf = math.inf,
        k_bar: StiffnessOrInf = math.inf,
        sides: Sides = 3,
    ) -> Prism:
        """The self-stressed prism assembled from members of given natural lengths.

        Parameters
        ----------
        cross, base, bar : float
            Natural lengths of cross strings, base strings and bars [m].
        k_cross, k_base, k_bar : float
            Spring constants, EA over natural length [N/m]; see `member_stiffness`.  Infinite
            `k_base` or `k_bar` (the default) is rigid.
        sides : int, optional
            Sides of the polygons, at least 3.

        Returns
        -------
        Prism

        Raises
        ------
        TensegrityError
            If a value is outside its bounds.
        EquilibriumError
            If the bars are too short to stress the strings, or the cross strings too short for
            the base, so that the self-stressed height would not be positive.
        """
        stiff = k_cross, k_base, k_bar
        base, height, prestrain = assembled([cross, base, bar], stiff, sides)
        return cls(base, height, prestrain, *stiff, sides)

    def structure(self, mass: ArrayLike = 1.0) -> Structure:
        """The prism as a structure, with all coordinates of its nodes free.

        Parameters
        ----------
        mass : float or array_like, (2 sides,), optional
            Mass of each node [kg].

        Returns
        -------
        Structure
            In the self-stressed state.  The lower nodes 0 to n - 1 lie in the plane z = 0, node 0
            on the x axis; bar j joins lower node j to upper node n + j.  The strings are the n
            cross strings, then the n of the lower base, then the n of the upper one.

        Raises
        ------
        TensegrityError
            If bases or bars are rigid.
        """
        return self.column(1).at_mass(mass)

    @overload
    def column(
        self, count: int | None = None, chirality: str = "alternate", plates: bool = False,
        periodic: Literal[False] = False,
    ) -> Structure: ...  # fmt: skip

    @overload
    def column(
        self, count: int | None = None, chirality: str = "alternate", plates: bool = False, *,
        periodic: Literal[True],
    ) -> Lattice: ...  # fmt: skip

    @overload
    def column(
        self, count: int | None = None, chirality: str = "alternate", plates: bool = False,
        periodic: bool = False,
    ) -> Structure | Lattice: ...  # fmt: skip

    @overload
    def column(
        self, count: int | None = None, chirality: str = "alternate", *,
        plates: tuple[float, float], periodic: Literal[False] = False,
    ) -> Network: ...  # fmt: skip

    @overload
    def column(
        self, count: int | None = None, chirality: str = "alternate", *,
        plates: tuple[float, float], periodic: Literal[True],
    ) -> PeriodicBonds: ...  # fmt: skip

    def column(
        self,
        count: int | None = None,
        chirality: str = "alternate",
        plates: bool | tuple[float, float] = False,
        periodic: bool = False,
    ) -> Structure | Lattice | Network | PeriodicBonds:
        """A column of prisms equal to this one, one above the other along the z axis.

        Parameters
        ----------
        count : int, optional
            Number of units; by default 5, or in a periodic column the smallest number after which
            units repeat: 2 if they alternate, 4/gcd(4, sides + 2) if all have the same handedness,
            1 between heavy plates.
        chirality : {"alternate", "same"}, optional
            Whether neighbouring units twist in opposite senses or in the same one.
        plates : bool or (float, float), optional
            If true, a rigid smooth plate, guided along the column, lies between neighbouring units,
            each of which has its own polygon on it.  If false (the default), neighbours have one
            polygon in common, whose strings are twice as stiff.  Two numbers are the mass [kg] and
            the radius of gyration [m] of heavy plates, which a unit turns as it is compressed: the
            nodes of both neighbours slide without mass along spokes of the plate.
        periodic : bool, optional
            If true, the units form the cell of an infinite column.

        Returns
        -------
        Structure or Lattice, or Network or PeriodicBonds between heavy plates
            In equilibrium without load.  Nodes are numbered polygon by polygon from below; members
            are the bars unit by unit, then the cross strings unit by unit, then the base strings
            polygon by polygon.  Plates have two coordinates, u[:, 0] along the axis and u[:, 1],
            their rotation times the radius of gyration [m].

        Raises
        ------
        TensegrityError
            If bases or bars are rigid, between heavy plates the bars, or another argument is
            outside its bounds.

        Notes
        -----
        The chain of condensed prisms, `Chain(prism.potential(), ...)`, is the limit of long waves
        of an alternating column, with an error of 1 % at 41 units per wavelength.  It is not that
        of a column of one handedness, in which axial and torsional waves are coupled.  With heavy
        plates, of the mass of the nodes and their circumradius as radius of gyration, long waves
        are exact for either handedness.
        `simulate`, `gradient` and `modes` take the network, with drives and held plates as other
        arguments of `Network(column.positions, column.bonds, column.springs[0], mass=...)`;
        `bands` takes the periodic column.  Its springs are smooth: strings carry compression, and
        members pass through each other.

        Examples
        --------
        >>> from tensegrity import Prism
        >>> prism = Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0)
        >>> prism.column(count=2)
        Structure(9 nodes in 3 dimensions, 6 bars, 15 strings, 0 of them slack)
        >>> prism.column(periodic=True)
        Lattice(6 nodes, 1 vector in 3 dimensions, 6 bars, 12 strings)
        >>> prism.column(count=2, plates=(3.0, 0.5))
        Network(3 sites of 2 coordinates, 2 bonds, 0 walls with 0 contacts)
        """
        from tensegrity.prisms.stack import stacked

        return stacked(self, count, chirality, plates, periodic)

    def __repr__(self) -> str:
        given = {name: value for name, value in asdict(self).items() if value != math.inf}
        if self.sides == 3:
            del given["sides"]
        return call("Prism", **given)

    def __str__(self) -> str:
        given = [("base", "m"), ("height", "m"), ("prestrain", ""), ("k_cross", "N/m")]
        given += [(k, "N/m") for k in ("k_base", "k_bar") if getattr(self, k) != math.inf]
        numbers = (f"{name} {getattr(self, name):.6g} {unit}".rstrip() for name, unit in given)
        return filled(f"prism of {self.sides} sides: {', '.join(numbers)}")

    def _lines(self) -> Lines:
        yield str(self)
        yield f"natural lengths: {self.natural_lengths()}"
        yield f"axial stiffness: {self.axial_stiffness():.6g} N/m"
        with contextlib.suppress(NoLocking):
            yield f"locking height: {self.locking_height():.6g} m"

    _size = (6.4, 2.8)

    def _draw(self, figure: Any) -> None:
        """Draw the prism at rest, and its load against shortening."""
        shape = figure.add_subplot(1, 2, 1, projection="3d")
        curve = figure.add_subplot(1, 2, 2)
        rigid = [name for name in ("k_base", "k_bar") if math.isinf(getattr(self, name))]
        finite: dict[str, Any] = dict.fromkeys(rigid, STIFF * self.k_cross)
        # the shape at rest does not depend on the spring constants
        replace(self, **finite).structure().plot(shape)
        potential = self.potential()
        low, high = potential.computable_domain
        r = np.linspace(DRAWN * low, min(high, -low) / 2, 200)
        curve.plot(-r, -potential.tension(r))
        curve.set(xlabel=in_units("shortening [m]"), ylabel=in_units("axial load [N]"))

    @property
    def is_rigid(self) -> bool:
        """Whether bases and bars are rigid, so that the prism has one degree of freedom."""
        return math.isinf(self.k_base) and math.isinf(self.k_bar)

    @property
    def reference_twist(self) -> float:
        """Twist of the self-stressed state, pi/2 + pi/n [rad]."""
        return 5 * math.pi / 6 if self.sides == 3 else math.pi / 2 + math.pi / self.sides

    @property
    def circumradius(self) -> float:
        """Circumradius of the polygons in the self-stressed state [m]."""
        return self.base / (2 * math.sin(math.pi / self.sides))

    def natural_lengths(self) -> NaturalLengths:
        """Unstressed lengths of cross strings, base strings and bars [m], as a named tuple."""
        return NaturalLengths(*(float(x) for x in exact("natural lengths", self)))

    def locking_height(self) -> float:
        """Height at which the bars of the rigid prism meet (twist pi) [m].

        Raises
        ------
        NoLocking
            If the prism is so thick that it is flat (height 0) before the bars meet.
        """
        (squared,) = exact("locking height squared", self)
        if squared <= 0:
            raise NoLocking(
                f"height {self.height:g} m of this prism is not above "
                f"{float((self.height**2 - squared) ** 0.5):g} m: its bars never meet, it "
                "collapses flat"
            )
        return float(squared**0.5)

    def axial_stiffness(self) -> float:
        """Axial stiffness K_h0 of the whole prism at the reference state [N/m], >= 0.

        It vanishes with the prestrain, where the reference becomes a sonic vacuum.  The closed
        form contains the compliances of the members, which are zero for rigid ones (the talk,
        part III, "Axial stiffness").
        """
        (stiffness,) = exact("axial stiffness", self)
        return float(stiffness)

    @checked
    def problem(
        self,
        *,
        min_height: Distance = 0.0,
        max_load: Annotated[float, "> 0", "or inf", "N"] = math.inf,
        max_height: float | None = None,
        past_contact: bool = False,
    ) -> PrismProblem:
        """The problem whose path `equilibrium_path` follows, with the same arguments.

        Parameters
        ----------
        min_height, max_load, max_height, past_contact : optional
            See `tensegrity.equilibrium_path`.

        Returns
        -------
        PrismProblem
            Its `events` and `columns` are expressions of its `unknowns`.

        Raises
        ------
        TensegrityError
            If an argument is outside its bounds.
        """
        from tensegrity.prisms.problem import PrismProblem

        if min_height >= self.height:
            raise TensegrityError(
                f"min_height {min_height:g} m must be below the height {self.height:g} m of the "
                "prism"
            )
        if self.is_rigid and past_contact:
            raise TensegrityError(
                "past_contact=True needs elastic bases or bars: rigid ones lock where the bars meet"
            )
        above = None
        if max_height is not None:
            most_height = check.number("max_height", max_height, above=self.height, unit="m")
            above = PrismProblem(self, 1, {"height": most_height}, past_contact)
        until = {"load": max_load} | ({"height": min_height} if min_height else {})
        return PrismProblem(self, -1, until, past_contact, above)

    @checked
    def potential(self, preload: Preload = 0.0) -> Potential:
        """Axial potential of the prism, for use as a spring of a chain.

        Parameters
        ----------
        preload : float, optional
            Axial load F0 at rest [N], compression > 0, >= 0.

        Returns
        -------
        Potential
            V(r) = U(h1 + r) - U(h1) + F0 r about the loaded height h1, which is its `length`.
            The domain ends in compression where the bars meet (twist pi) or the prism is flat
            (height 0), and in extension at twist 0; for elastic members see `ElasticPotential`.
            The method and its results may be used from several threads at once.

        Raises
        ------
        EquilibriumError
            If no equilibrium on the branch of the reference state carries the preload.

        Examples
        --------
        >>> from tensegrity import Prism
        >>> spring = Prism(1.0, 0.7, 0.1, 1.0).potential()
        >>> [round(end, 6) for end in spring.domain]
        [-0.067004, 0.616821]
        >>> round(float(spring.tension(-0.01)), 6)
        -0.030852
        """
        if not self.is_rigid:
            from tensegrity.prisms.condensed import ElasticPotential

            return ElasticPotential(self, preload)
        return rigid_potential(self, preload)
