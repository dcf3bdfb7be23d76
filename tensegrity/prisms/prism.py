"""The regular tensegrity prism a user describes, and what follows from it in closed form.

Two regular polygons of strings, as many bars and cross strings, three by default; members without
thickness.  The reference is the self-stressed state at twist pi/2 + pi/n, 5 pi/6 for triangles.
Source: seeds/000, part III; the forms for any n are those of `derivations.polygon`.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import NoLocking, TensegrityError
from tensegrity.notebook import page, wires
from tensegrity.prisms.closed import assembled, exact, rigid_potential
from tensegrity.springs.potential import Potential, call
from tensegrity.structures.structure import Structure

DRAWN = 0.95  # of the way to the end of the domain in a notebook's picture
STIFF = 100.0  # constants over k_cross for the drawing of rigid members


class NaturalLengths(NamedTuple):
    """Unstressed lengths [m]."""

    cross: float
    base: float
    bar: float


@dataclass(frozen=True)
class Prism:
    """A regular tensegrity prism, triangular unless told otherwise.

    Parameters
    ----------
    base : float
        Side of the polygons in the self-stressed state [m].
    height : float
        Height of the self-stressed state [m].
    prestrain : float
        (s0 - sN)/sN of the cross strings, >= 0.
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
        would not be positive (k_base <= k_cross p0/((1 + p0) 2 sin(pi/n))).
    """

    base: float
    height: float
    prestrain: float
    k_cross: float
    k_base: float = math.inf
    k_bar: float = math.inf
    sides: int = 3

    def __post_init__(self) -> None:
        object.__setattr__(self, "sides", check.whole("sides", self.sides, least=3))
        for name, unit in (("base", "m"), ("height", "m"), ("k_cross", "N/m")):
            self._check(name, above=0, unit=unit)
        self._check("prestrain", least=0)
        for name in ("k_base", "k_bar"):
            self._check(name, above=0, finite=False, unit="N/m")
        if self.natural_lengths().base <= 0:
            (least,) = map(float, exact("least k_base", self))
            raise TensegrityError(
                f"k_base {self.k_base:g} N/m must be above {least:g} N/m, "
                "below which the natural length of the base strings is not positive"
            )

    @classmethod
    def from_members(
        cls,
        cross: float,
        base: float,
        bar: float,
        k_cross: float,
        k_base: float = math.inf,
        k_bar: float = math.inf,
        sides: int = 3,
    ) -> Prism:
        """The prism that members of given natural lengths make.

        Parameters
        ----------
        cross, base, bar : float
            Natural lengths of cross strings, base strings and bars [m].
        k_cross, k_base, k_bar : float
            EA over natural length [N/m], see `member_stiffness`; inf is rigid.
        sides : int, optional

        Returns
        -------
        Prism

        Raises
        ------
        EquilibriumError
            If the bars are too short to stress the strings, or so short in comparison with the
            base that there is no height.
        """
        given = {"cross": cross, "base": base, "bar": bar}
        lengths = [check.number(name, x, above=0, unit="m") for name, x in given.items()]
        k_cross = check.number("k_cross", k_cross, above=0, unit="N/m")
        stiff = [
            check.number(name, k, above=0, finite=False, unit="N/m")
            for name, k in (("k_base", k_base), ("k_bar", k_bar))
        ]
        sides = check.whole("sides", sides, least=3)
        found = assembled(lengths, [k_cross, *stiff], sides)
        return cls(found[0], found[1], found[2], k_cross, stiff[0], stiff[1], sides)

    def structure(self, mass: ArrayLike = 1.0) -> Structure:
        """The prism in all coordinates of its nodes.

        Parameters
        ----------
        mass : float or array_like, (2 sides,), optional
            Of each node [kg].

        Returns
        -------
        Structure
            Lower nodes 0 to n - 1 on the plane z = 0, node 0 on the x axis; upper node n + j is
            joined to lower node j by bar j.  Strings: n cross ones, n of the lower base, n of the
            upper.

        Raises
        ------
        TensegrityError
            If bases or bars are rigid.
        """
        from tensegrity.prisms.stack import stacked

        return stacked(self, 1, "same", False).at_mass(mass)

    def _check(self, name: str, **bounds: Any) -> None:
        object.__setattr__(self, name, check.number(name, getattr(self, name), **bounds))

    def __repr__(self) -> str:
        given = {name: value for name, value in asdict(self).items() if value != math.inf}
        if self.sides == 3:
            del given["sides"]
        return call("Prism", **given)

    def _repr_html_(self) -> str:
        lengths = self.natural_lengths()
        rows = {
            "base, height": f"{self.base:g} m, {self.height:g} m",
            "prestrain": f"{self.prestrain:g} of the cross strings",
            "k_cross, k_base, k_bar": f"{self.k_cross:g}, {self.k_base:g}, {self.k_bar:g} N/m",
            "natural lengths": f"cross {lengths.cross:.6g}, base {lengths.base:.6g}, "
            f"bar {lengths.bar:.6g} m",
            "axial stiffness": f"{self.axial_stiffness():.6g} N/m",
        }
        with contextlib.suppress(NoLocking):
            rows["locking height"] = f"{self.locking_height():.6g} m"
        title = f"Prism of {self.sides} sides"
        return page(title, rows, self._draw, size=(6.4, 2.8))

    def _draw(self, figure: Any) -> None:
        """The prism at rest, and its load against shortening."""
        shape, curve = figure.subplots(1, 2, width_ratios=(1, 1.4))
        rigid = [name for name in ("k_base", "k_bar") if math.isinf(getattr(self, name))]
        finite: dict[str, Any] = dict.fromkeys(rigid, STIFF * self.k_cross)
        # the shape at rest is that of any constants
        structure = replace(self, **finite).structure()
        wires(shape, structure.positions, structure.ends, structure.bars)
        potential = self.potential()
        low, high = potential.reach
        r = np.linspace(DRAWN * low, min(high, -low) / 2, 200)
        curve.plot(-r, -potential.tension(r))
        curve.set(xlabel="shortening [m]", ylabel="axial load [N]")

    @property
    def is_rigid(self) -> bool:
        """Whether bases and bars are rigid, so that the height alone describes the prism."""
        return math.isinf(self.k_base) and math.isinf(self.k_bar)

    @property
    def reference_twist(self) -> float:
        """Twist of the self-stressed state, pi/2 + pi/n [rad]."""
        return 5 * math.pi / 6 if self.sides == 3 else math.pi / 2 + math.pi / self.sides

    @property
    def circumradius(self) -> float:
        """Of the polygons in the self-stressed state [m]."""
        return self.base / (2 * math.sin(math.pi / self.sides))

    def natural_lengths(self) -> NaturalLengths:
        """Unstressed lengths of cross strings, base strings and bars [m], as a named tuple."""
        return NaturalLengths(*(float(x) for x in exact("natural lengths", self)))

    def locking_height(self) -> float:
        """Height at which the bars of the rigid prism meet (twist pi) [m].

        Raises
        ------
        NoLocking
            If the prism is so thick that it collapses flat (height 0) before that.
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
        """Stiffness K_h0 of the total axial force at the reference state [N/m], > 0.

        Zero where the prestrain is zero: the reference is then a sonic vacuum.  Closed form,
        with rigid members as those of no compliance (seeds/000, part III, "Axial stiffness").
        """
        (stiffness,) = exact("axial stiffness", self)
        return float(stiffness)

    def potential(self, preload: float = 0.0) -> Potential:
        """Potential of the prism as a spring of a chain.

        Parameters
        ----------
        preload : float, optional
            Axial load F0 at rest [N], compression > 0, >= 0.

        Returns
        -------
        Potential
            V(r) = U(h1 + r) - U(h1) + F0 r about the loaded height h1, which is its `length`.
            Its domain ends where the bars meet (twist pi) or the prism is flat (height 0), and
            where it is stretched to twist 0; with elastic members see `ElasticPotential`.
            Threads may ask for potentials, and of them, at once.

        Raises
        ------
        EquilibriumError
            If no equilibrium on the branch of the reference state carries the preload.
        """
        preload = check.number("preload", preload, least=0, unit="N")
        if not self.is_rigid:
            from tensegrity.prisms.condensed import ElasticPotential

            return ElasticPotential(self, preload)
        return rigid_potential(self, preload)


def column(
    prism: Prism, count: int = 5, chirality: str = "alternate", plates: bool = False
) -> Structure:
    """Prisms on one another, along the last axis.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    count : int, optional
        Number of units.
    chirality : {"alternate", "same"}, optional
        Whether neighbours turn against one another or alike.
    plates : bool, optional
        Between units a rigid plate, smooth and guided along the column, on which both have their
        own polygons; else they share the polygon, its strings twice as stiff.

    Returns
    -------
    Structure
        Polygon after polygon from below; bars unit by unit, then cross strings unit by unit, then
        base strings polygon by polygon.  Without load it is in equilibrium.
    """
    from tensegrity.prisms.stack import stacked

    check.kind("prism", prism, Prism)
    return stacked(prism, count, chirality, plates)
