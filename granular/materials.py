"""Elastic constants and densities of the beads and walls.

Source: the talk, part II, "Analyzed systems and materials" (six materials); the paper, Table I
(three materials; its values for steel and PTFE agree with those of the talk).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import filled


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
