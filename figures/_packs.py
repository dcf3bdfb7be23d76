"""The packs of the talk: beads, scenes, runs and measured quantities."""

from __future__ import annotations

from granular import (
    Bead,
    Striker,
    chain,
    fcc_pack,
    hertz,
    hexagonal_pack,
    materials,
    simulate,
    wall_force,
)
from granular.contact_network import wall_sites
from tensegrity import Record

D = 9.53e-3  # m, of all beads
STEEL, PTFE, GLASS = (Bead(D, materials[name]) for name in ("steel", "ptfe", "glass"))
FAST, SLOW = 1.65, 1.0  # m/s: strikers in space and in the plane
FINE, COARSE = 2e-7, 1e-7  # s: steps of rkn6 and of verlet
ROW = 4e-7  # s between rows


def cube(layers=17, bead=STEEL, sides="ptfe"):
    """The pack in space, 7 x 7 beads in a layer, on steel; `sides` None: without walls."""
    striker = bead if isinstance(bead, Bead) else STEEL
    return fcc_pack(
        layers, 7, bead=bead, floor=STEEL.material, sides=sides and materials[sides],
        striker=Striker(striker, FAST),
    )  # fmt: skip


def plane(bead=STEEL, **options):
    """The pack in the plane, 12 rows of 21 and 20 beads, the striker steel."""
    striker = Striker(STEEL, SLOW)
    return hexagonal_pack(
        12, 21, bead=bead, floor=STEEL.material, sides=PTFE.material, striker=striker, **options
    )


def column(beads, speed):
    """The same materials one below the other on a steel floor, struck by a steel bead."""
    return chain(beads, striker=Striker(STEEL, speed), end=STEEL.material)


def quick(scene, t_end, record):
    """A run by verlet: peaks to 5e-6 of themselves."""
    return simulate(scene, scene.start(), t_end, method="verlet", dt=COARSE, record=record)


def exact(scene, t_end, record):
    """A run by rkn6: peaks to 1e-7."""
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=FINE, record=record)


def floor_of(scene, t_end, name="floor"):
    """Instants and the force on the floor [N] of a quick run."""
    run = quick(scene, t_end, Record(interval=ROW, sites=wall_sites(scene, name)))
    return run.t, wall_force(run, name)


def direct(bead, speed):
    """Largest force of that bead straight on a steel wall [N], in closed form."""
    alpha = hertz(bead, STEEL.material).constant
    return alpha * (5 * bead.mass * speed**2 / (4 * alpha)) ** 0.6


def lines(scene, u):
    """Ends of all contacts of two beads that carry, and their forces; (n, 2, dim), (n,)."""
    force = -scene.bond_tension(u)
    carry = force > 0
    return scene.positions[scene.bonds[carry]], force[carry]


def row(figure, quantity, here, reference=""):
    """One line of the table of the group."""
    return {"figure": figure, "quantity": quantity, "reference": reference, "here": here}
