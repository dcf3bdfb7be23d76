"""The pack of the talk: beads, scenes, runs and measured quantities."""

from granular import Bead, Striker, chain, fcc_pack, hertz, materials, simulate, wall_force
from granular.contact_network import wall_sites
from tensegrity import Record

D = 9.53e-3  # m, of all beads
STEEL, GLASS = (Bead(D, materials[name]) for name in ("steel", "glass"))
FAST = 1.65  # m/s, of the striker
FINE, COARSE = 2e-7, 1e-7  # s: steps of rkn6 and of verlet
ROW = 4e-7  # s between rows


def cube(layers=17, bead=STEEL, sides="ptfe", by=1.0):
    """The pack, 7 x 7 beads in a layer, on steel; `sides` None: without walls."""
    striker = bead if isinstance(bead, Bead) else STEEL
    return fcc_pack(
        layers, 7, bead=bead, floor=STEEL.material, sides=sides and materials[sides],
        striker=Striker(striker, by * FAST),
    )  # fmt: skip


def column(beads, speed):
    """The same materials one below the other on a steel floor, struck by a steel bead."""
    return chain(beads, striker=Striker(STEEL, speed), end=STEEL.material)


def exact(scene, t_end, record):
    """A run by rkn6: peaks to 1e-7."""
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=FINE, record=record)


def floor_of(scene, t_end, name="floor"):
    """Instants and the force on the floor [N] of a run by verlet: peaks to 5e-6 of themselves."""
    record = Record(interval=ROW, sites=wall_sites(scene, name))
    run = simulate(scene, scene.start(), t_end, method="verlet", dt=COARSE, record=record)
    return run.t, wall_force(run, name)


def direct(bead, speed):
    """Largest force of that bead straight on a steel wall [N], in closed form."""
    alpha = hertz(bead, STEEL.material).constant
    return alpha * (5 * bead.mass * speed**2 / (4 * alpha)) ** 0.6


def rows(figure, found):
    """Lines of the table of the group, from {quantity: here, or (here, reference)}."""
    pairs = {name: x if isinstance(x, tuple) else (x, "") for name, x in found.items()}
    return [{"figure": figure, "quantity": name, "reference": reference, "here": here}
            for name, (here, reference) in pairs.items()]  # fmt: skip
