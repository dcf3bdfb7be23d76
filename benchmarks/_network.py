"""A pack of beads of the revision on the path; as a program, a process that advances it on request.

`python _network.py side layers steps` answers each line it reads by the CPU seconds of so many
steps.
"""

import sys
import time
from importlib import import_module

import numpy as np

from granular import Bead, hertz, materials
from tensegrity import Network, PowerLaw, State, Wall
from tensegrity.scenes.dynamics import dynamics

try:
    METHODS = import_module("tensegrity.methods").METHODS  # before the package had rooms
except ImportError:
    METHODS = import_module("tensegrity.engine.methods").METHODS

STEEL = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
DT, SPEED = 1e-9, 0.02  # s, m/s: all contacts stay closed
OVERLAP = 1e-4  # of the diameter
WORK = 300_000  # contact-steps of one call


def pack(side, layers):
    """Layers of side x side beads in a box without lid, every other one shifted; all overlap."""
    from scipy.spatial import cKDTree

    d = STEEL.diameter * (1 - OVERLAP)
    layer, y, x = np.indices((layers, side, side)).reshape(3, -1)
    shift = np.where(layer % 2, 1.0, 0.5)
    places = d * np.stack([shift + x, shift + y, 0.5 + layer / np.sqrt(2)], axis=1)
    pairs = np.sort(cKDTree(places).query_pairs(1.01 * d, output_type="ndarray"), axis=1)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    width = (side + 0.5) * d
    walls = [
        Wall((0, 0, 0), (0, 0, 1)), Wall((0, 0, 0), (1, 0, 0)), Wall((width, 0, 0), (-1, 0, 0)),
        Wall((0, 0, 0), (0, 1, 0)), Wall((0, width, 0), (0, -1, 0)),
    ]  # fmt: skip
    near = [(places - w.point) @ w.normal < 0.501 * d for w in walls]
    touching = [(s, k) for k, here in enumerate(near) for s in np.flatnonzero(here).tolist()]
    return Network(
        places, pairs, PowerLaw(hertz(STEEL, STEEL).constant, 1.5), lengths=STEEL.diameter,
        mass=STEEL.mass, walls=walls, wall_contacts=touching,
        wall_spring=PowerLaw(hertz(STEEL, materials["ptfe"]).constant, 1.5), radius=STEEL.radius,
    )  # fmt: skip


def main(side, layers, steps):
    network = pack(side, layers)
    velocity = SPEED * np.random.default_rng(0).standard_normal(network.shape)
    bound = dynamics(network).bind(
        *dynamics(network).arrays(State(0 * velocity, velocity)), METHODS["verlet"], DT
    )
    for _ in sys.stdin:
        began = time.process_time()
        bound.advance(steps)
        print(time.process_time() - began, flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
