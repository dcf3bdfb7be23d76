"""Networks that several tests share."""

import numpy as np
from springs import series

from tensegrity import Network, PowerLaw, Wall

SPACING = 1.0
SPRING = PowerLaw(1.0, 1.5, preload=0.3, length=SPACING)


def patch(rows=5, dim=2, spring=SPRING):
    """A triangular patch of precompressed contacts: each inner site has six neighbours."""
    shift = np.array([[1, 0, 0], [0.5, np.sqrt(0.75), 0]])
    cells = np.array([(a, b) for b in range(rows) for a in range(rows)])
    positions = (cells @ shift)[:, :dim] * SPACING
    far = np.linalg.norm(positions[:, None] - positions, axis=-1)
    bonds = np.argwhere(np.triu(np.abs(far - SPACING) < 1e-9))
    return Network(positions, bonds, spring)


def pushed(network, speed=0.05):
    """The patch with a blow at a corner and a turn of it all."""
    velocity = np.zeros(network.shape)
    velocity[0] = speed * np.array([1.0, 0.6, 0.3])[: network.dim]
    velocity[1, 1] = -speed / 2
    return network.at_rest(dict(enumerate(velocity)))


def plate(**given):
    """A square lattice of 3 x 3 of a cubic spring."""
    places = np.array([(x, y) for y in range(3) for x in range(3)], dtype=float)
    bonds = [(i, j) for i in range(9) for j in range(i) if np.sum((places[i] - places[j]) ** 2) < 3]
    law = series(0, 1 / 4, length=1.0)
    return Network(places, bonds, **{"spring": law, "mass": 0.5, "held": [0, 2]} | given)


def triangles():
    """The patch, and its blow."""
    return patch(), pushed(patch())


def fork(stem=6, branch=5, wall_contacts=True):
    """Touching beads along a stem and two branches at 30 degrees, walls along the branches."""
    d, radius = 4.76e-3, 2.38e-3
    along = np.arange(1, branch + 1)[:, None] * d
    up = along * np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    line = np.stack([np.arange(1 - stem, 1) * d, np.zeros(stem)], axis=1)
    positions = np.concatenate([line, up, up * [1, -1]])
    first, second = stem, stem + branch
    bonds = [(k, k + 1) for k in range(stem - 1)]
    for start in (first, second):
        bonds += [(stem - 1, start), *((start + k, start + k + 1) for k in range(branch - 1))]
    bonds.append((first, second))
    walls, contacts = [], []
    for number, (sign, start) in enumerate(((1, first), (-1, second))):
        axis = np.array([np.cos(np.pi / 6), sign * np.sin(np.pi / 6)])
        outside = sign * radius * np.array([-axis[1], axis[0]])
        ends = (outside + axis * s for s in (radius * np.tan(np.pi / 12), (branch + 1) * d))
        walls.append(Wall.between(*ends, axis * d))
        contacts += [(start + k, number) for k in range(branch)]
    return Network(
        positions,
        bonds,
        PowerLaw(5e9, 1.5),
        mass=4.5e-4,
        walls=walls,
        wall_contacts=contacts if wall_contacts else (),
        wall_spring=PowerLaw(1.5e8, 1.5),
        wall_gaps=np.zeros(len(contacts)) if wall_contacts else None,
        radius=radius,
    )
