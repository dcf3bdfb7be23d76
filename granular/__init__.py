"""Granular crystals on the engine of `tensegrity`: contact laws, chains, guides and packs."""

from granular.bead_chain import BeadChain, chain
from granular.beads import Bead, Striker, bead_of_mass, coated
from granular.contact import Contact, hertz, power
from granular.guide import Guide, diamond_guide, y_guide
from granular.lattices import fcc_pack, hexagonal_pack
from granular.materials import Material, materials
from granular.observables import sensor_force, wall_force
from granular.packing import Pack, pack
from granular.stored import register_scenes
from tensegrity import simulate

register_scenes()

__all__ = [
    "Bead",
    "BeadChain",
    "Contact",
    "Guide",
    "Material",
    "Pack",
    "Striker",
    "bead_of_mass",
    "chain",
    "coated",
    "diamond_guide",
    "fcc_pack",
    "hertz",
    "hexagonal_pack",
    "materials",
    "pack",
    "power",
    "sensor_force",
    "simulate",
    "wall_force",
    "y_guide",
]
