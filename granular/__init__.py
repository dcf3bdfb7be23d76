"""Granular crystals on the engine of `tensegrity`: contact laws, chains and guides."""

from granular.beads import Bead, Striker, bead_of_mass, coated
from granular.chain import BeadChain, chain
from granular.contact import Contact, hertz, power
from granular.guide import Guide, diamond_guide, y_guide
from granular.kept import keep_scenes
from granular.materials import Material, materials
from granular.observables import sensor_force
from tensegrity import simulate

keep_scenes()

__all__ = [
    "Bead",
    "BeadChain",
    "Contact",
    "Guide",
    "Material",
    "Striker",
    "bead_of_mass",
    "chain",
    "coated",
    "diamond_guide",
    "hertz",
    "materials",
    "power",
    "sensor_force",
    "simulate",
    "y_guide",
]
