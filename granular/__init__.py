"""Granular crystals on the engine of `tensegrity`: contact laws, chains, guides and packs.

"The talk" and "the paper" in docstrings are the two sources that `help(tensegrity)` names.
"""

from granular.bead_chain import BeadChain, chain
from granular.beads import Bead, Material, Striker, materials
from granular.contact import Contact, hertz, power
from granular.damped_contact import (
    carretero_gonzalez,
    dmt,
    hunt_crossley,
    kuwabara_kono,
    tsuji,
    viscous,
)
from granular.guide import Guide, diamond_guide, y_guide
from granular.lattices import fcc_pack, hexagonal_pack
from granular.observables import energies, overlaps, sensor_force, wall_force
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
    "carretero_gonzalez",
    "chain",
    "diamond_guide",
    "dmt",
    "energies",
    "fcc_pack",
    "hertz",
    "hexagonal_pack",
    "hunt_crossley",
    "kuwabara_kono",
    "materials",
    "overlaps",
    "pack",
    "power",
    "sensor_force",
    "simulate",
    "tsuji",
    "viscous",
    "wall_force",
    "y_guide",
]
