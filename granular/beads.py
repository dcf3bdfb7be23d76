"""Materials, and beads and strikers: spheres with a mass and a radius of contact.

Source of the elastic constants and densities: the talk, part II, "Analyzed systems and materials"
(six materials); the paper, Table I (three materials; its values for steel and PTFE agree with those
of the talk).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import filled
from tensegrity.typing import Distance, Length, Mass, Speed


@checked
@dataclass(frozen=True)
class Material:
    """A linear elastic material.

    Attributes
    ----------
    name : str
    modulus : float
        Young's modulus [Pa], > 0.
    poisson : float
        Poisson's ratio, above -1 and at most 0.5.
    density : float
        Mass density [kg/m^3], > 0.
    source : str
        Publication from which the constants are taken.
    """

    name: str
    modulus: Annotated[float, "> 0", "Pa"]
    poisson: Annotated[float, "> -1", "<= 0.5"]
    density: Annotated[float, "> 0", "kg/m^3"]
    source: str = ""
    _given_by = "; take one of granular.materials"

    def __str__(self) -> str:
        return filled(
            f"{self.name}: modulus {self.modulus:.6g} Pa, Poisson's ratio {self.poisson:.6g}, "
            f"density {self.density:.6g} kg/m^3"
        )

    def __post_init__(self) -> None:
        check.kind("name of a material", self.name, str)
        check.kind(f"source of {self.name}", self.source, str)


class _Catalogue(dict[str, Material]):
    """Materials by name; an unknown name raises a TensegrityError that lists the known ones."""

    def __str__(self) -> str:
        return filled(f"materials: {', '.join(self)}")

    def __getitem__(self, name: str) -> Material:
        return super().__getitem__(name) if isinstance(name, str) else self.__missing__(name)

    def __missing__(self, name: str) -> Material:
        raise TensegrityError(f"material {check.shown(name)} is not one of {', '.join(self)}")


TALK = "the talk Wave Dynamics of Innovative Nonlinear Lattices, part II"
PAPER = (
    "Highly nonlinear pulse splitting and recombination in a two-dimensional granular network "
    "(2010), Table I"
)
GPA = 1e9

materials = _Catalogue(
    {
        name: Material(name, modulus * GPA, poisson, density, source)
        for name, modulus, poisson, density, source in (
            ("steel", 193.0, 0.30, 8000.0, f"{TALK}; {PAPER}: stainless, 316"),
            ("ptfe", 1.46, 0.46, 2200.0, f"{TALK}; {PAPER}"),
            ("rubber", 0.30, 0.49, 2200.0, TALK),
            ("bronze", 76.0, 0.41, 8500.0, TALK),
            ("glass", 62.0, 0.20, 2425.0, TALK),
            ("nylon", 3.55, 0.40, 1085.0, TALK),
            ("parylene", 15.0, 0.38, 1289.0, f"{PAPER}: Parylene-C coating"),
        )
    }
)
"""The materials of both sources, by name."""


HUGE, FAST = 1.0, 100.0  # m, m/s: larger values probably stem from a wrong unit


@checked
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
    mass: float
    contact_radius: float

    def __init__(
        self,
        diameter: Length,
        material: Material,
        mass: Mass | None = None,
        contact_radius: Length | None = None,
    ) -> None:
        if diameter >= HUGE:
            _warn_once(
                f"a bead of diameter {diameter:g} m, {1e3 * diameter:g} mm: lengths are in metres, "
                f"{diameter:g} mm are {diameter / 1e3:g} m"
            )
        if mass is None:
            mass = check.number("mass", material.density * volume(diameter), above=0, unit="kg")
        radius = diameter / 2 if contact_radius is None else contact_radius
        object.__setattr__(self, "diameter", diameter)
        object.__setattr__(self, "material", material)
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "contact_radius", check.number("contact_radius", radius, above=0))

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
    @checked
    def of_mass(cls, mass: Mass, material: Material) -> Bead:
        """A bead of the given mass [kg], > 0, whose diameter follows from the density.

        The heavy striker of the paper is specified by its mass alone.
        """
        return cls((6 * mass / (math.pi * material.density)) ** (1 / 3), material, mass)

    @checked
    def coated(self, coating: Material, thickness: Distance) -> Bead:
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
        return Bead(self.diameter, coating, self.mass, self.contact_radius + thickness)


@checked
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

    def __init__(self, bead: Bead, speed: Speed) -> None:
        if speed >= FAST:
            _warn_once(
                f"a striker of {1e3 * bead.diameter:g} mm at {speed:g} m/s: speeds are in m/s, "
                f"and Hertzian contact without loss holds far below {FAST:g} m/s"
            )
        object.__setattr__(self, "bead", bead)
        object.__setattr__(self, "speed", speed)

    def __str__(self) -> str:
        return filled(f"striker at {self.speed:.6g} m/s, a {' '.join(str(self.bead).split())}")


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


@lru_cache(maxsize=256)
def _warn_once(words: str) -> None:
    """Warn whoever makes an object whose `__init__`, which is checked, calls this; once."""
    warnings.warn(words, UserWarning, stacklevel=4)
