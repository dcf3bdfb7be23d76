"""Granular crystals on the engine of `tensegrity`: contact laws, chains and guides."""

from granular.beads import Bead, Striker, bead_of_mass, coated
from granular.chain import BeadChain, chain
from granular.contact import Contact, hertz, power
from granular.materials import Material, materials
from tensegrity import simulate

__all__ = [
    "Bead",
    "BeadChain",
    "Contact",
    "Material",
    "Striker",
    "bead_of_mass",
    "chain",
    "coated",
    "hertz",
    "materials",
    "power",
    "simulate",
]
