"""Beads and strikers: spheres with a mass and a radius of contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from granular.materials import Material
from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import filled

if TYPE_CHECKING:
    from collections.abc import Iterable


HUGE, FAST = 1.0, 100.0  # m, m/s: larger values probably stem from a wrong unit


@dataclass(frozen=True)
class Bead:
    """A sphere.

    Parameters
    ----------
    diameter : float
        [m], > 0: sets the geometry, the distance between the centres of two equal touching beads.
    material : Material
        Elastic constants of the contact; its density gives the mass if none is given.
    mass : float, optional
        [kg], > 0; by default density times volume.
    contact_radius : float, optional
        Radius [m] in the contact law, > 0; by default half the diameter.

    Raises
    ------
    TensegrityError
        A number that is not finite and above 0, or the name of a material instead of a Material.

    Examples
    --------
    >>> from granular import Bead, materials
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> print(f"{1e3 * bead.mass:.3f} g")
    4.189 g
    """

    diameter: float
    material: Material
    mass: float = None  # type: ignore[assignment]
    contact_radius: float = None  # type: ignore[assignment]

    if TYPE_CHECKING:  # omitted values follow from the others

        def __init__(
            self,
            diameter: float,
            material: Material,
            mass: float | None = None,
            contact_radius: float | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        diameter = check.number("diameter", self.diameter, above=0, unit="m")
        _require("material", self.material, Material)
        if diameter >= HUGE:
            check.warn_once(
                f"a bead of diameter {diameter:g} m, {1e3 * diameter:g} mm: lengths are in metres, "
                f"{diameter:g} mm are {diameter / 1e3:g} m"
            )
        mass = self.material.density * volume(diameter) if self.mass is None else self.mass
        radius = diameter / 2 if self.contact_radius is None else self.contact_radius
        object.__setattr__(self, "diameter", diameter)
        object.__setattr__(self, "mass", check.number("mass", mass, above=0, unit="kg"))
        radius = check.number("contact radius", radius, above=0, unit="m")
        object.__setattr__(self, "contact_radius", radius)

    def __str__(self) -> str:
        return filled(
            f"bead of {self.material.name}: diameter {self.diameter:.6g} m, mass {self.mass:.6g} "
            f"kg, contact radius {self.contact_radius:.6g} m"
        )

    @property
    def radius(self) -> float:
        """Half the diameter [m]."""
        return self.diameter / 2

    @classmethod
    def of_mass(cls, mass: float, material: Material) -> Bead:
        """A bead of the given mass [kg], > 0, whose diameter follows from the density.

        The heavy striker of the paper is specified by its mass alone.
        """
        mass = check.number("mass", mass, above=0, unit="kg")
        _require("material", material, Material)
        return cls((6 * mass / (math.pi * material.density)) ** (1 / 3), material, mass)

    def coated(self, coating: Material, thickness: float) -> Bead:
        """This bead with a soft coating, modelled, as in the paper, as a homogeneous sphere.

        Mass and lattice spacing remain those of the core; the contact takes the elastic constants
        of the coating and the outer radius.  The model neglects the dynamics of the layer and
        holds while the overlap is below the thickness.

        Parameters
        ----------
        coating : Material
        thickness : float
            Thickness of the coating [m], >= 0.

        Returns
        -------
        Bead
            With the diameter and the mass of the core.
        """
        _require("coating", coating, Material)
        thickness = check.number("thickness", thickness, least=0, unit="m")
        return Bead(self.diameter, coating, self.mass, self.contact_radius + thickness)


@dataclass(frozen=True)
class Striker:
    """A bead that strikes the first bead of a scene.

    Parameters
    ----------
    bead : Bead
    speed : float
        Impact speed [m/s], > 0: towards the chain.

    Raises
    ------
    TensegrityError
        A striker at rest or moving away.

    Examples
    --------
    >>> from granular import Bead, Striker, materials
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> print(Striker(bead, speed=0.5))
    striker at 0.5 m/s, a bead of steel: diameter 0.01 m, mass 0.00418879 kg,
        contact radius 0.005 m
    """

    bead: Bead
    speed: float

    def __str__(self) -> str:
        return filled(f"striker at {self.speed:.6g} m/s, a {' '.join(str(self.bead).split())}")

    def __post_init__(self) -> None:
        _require("striker", self.bead, Bead)
        speed = check.number(
            "speed of the striker, towards the chain", self.speed, above=0, unit="m/s"
        )
        if speed >= FAST:
            check.warn_once(
                f"a striker of {1e3 * self.bead.diameter:g} mm at {speed:g} m/s: speeds are in "
                f"m/s, and Hertzian contact without loss holds far below {FAST:g} m/s"
            )
        object.__setattr__(self, "speed", speed)


def beads_of(given: Iterable[object], where: str = "") -> tuple[Bead, ...]:
    """The beads as a tuple, each checked to be a Bead; `where` names the design in the error."""
    beads = check.sequence(f"beads{where}", given, "Beads")
    for number, bead in enumerate(beads):
        if not isinstance(bead, Bead):
            raise TensegrityError(f"bead {number}{where} is {check.shown(bead)}, not a Bead")
    return beads


def volume(diameter: float) -> float:
    """Volume of a sphere [m^3]."""
    return math.pi / 6 * diameter * diameter * diameter  # inf where it has no number, no error


def _require(name: str, value: object, kind: type) -> None:
    known = "; take one of granular.materials" if kind is Material else ""
    check.kind(name, value, kind, known)
