"""The hexagonal pack that is optimised, and reference packs."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from figures import _searches
from figures._stored import stored
from granular import Bead, Striker, hexagonal_pack, materials, simulate, wall_force
from granular.contact_network import wall_sites
from granular.design import Choice, Order, search
from tensegrity import Record, largest_peak, sweep

GROUP = "protectors"
STEEL, PTFE = materials["steel"], materials["ptfe"]
DIAMETER = 9.53e-3  # m
HARD, SOFT = Bead(DIAMETER, STEEL), Bead(DIAMETER, PTFE)
STRIKER = Striker(HARD, speed=1.0)
ROWS, COLUMNS = 12, 21
LENGTHS = [COLUMNS - k % 2 for k in range(ROWS)]  # beads of each row, from the top
COUNT = sum(LENGTHS)
T_END = 2e-3  # s
DRAWN = 100  # random orders, seed 0
BUDGET = 1280
NAMES = ("steel", "ptfe", "rubber", "bronze", "glass", "nylon")


def build(beads):
    """The pack on its steel floor between PTFE walls, struck in the middle of the top row."""
    pack = hexagonal_pack(ROWS, COLUMNS, bead=list(beads), floor=STEEL, sides=PTFE, striker=STRIKER)
    return pack, "floor"


def by_row(kinds):
    """Beads of which each row is of one kind."""
    return [kind for kind, length in zip(kinds, LENGTHS, strict=True) for _ in range(length)]


COMPARED = {
    "uniform steel": [HARD] * COUNT,
    "uniform PTFE": [SOFT] * COUNT,
    "alternating rows, steel on top": by_row([HARD, SOFT] * (ROWS // 2)),
    "steel over PTFE": by_row([HARD] * (ROWS // 2) + [SOFT] * (ROWS // 2)),
    "PTFE over steel": by_row([SOFT] * (ROWS // 2) + [HARD] * (ROWS // 2)),
}
SPACES = {
    "order of half steel, half PTFE": Order([HARD, SOFT] * (COUNT // 2)),
    "any of six materials": Choice(COUNT, DIAMETER, [materials[name] for name in NAMES]),
}
FINE = 1.16e-6  # s, half a step of the search


def peak(beads, dt=FINE):
    """Largest force on the floor [N], and when [s]."""
    scene, name = build(beads)
    record = Record(every=2, sites=wall_sites(scene, name))
    run = simulate(scene, scene.start(), T_END, method="rkn6", dt=dt, record=record)
    instant, force = largest_peak(run.t, wall_force(run, name))
    return force, instant


@stored(GROUP)
def searches():
    """The search of each of the spaces, as columns."""
    with ProcessPoolExecutor() as pool:
        return {
            name: _searches.columns(search(
                space, striker=STRIKER, wall=STEEL, t_end=T_END, build=build, budget=BUDGET,
                executor=pool,
            )) for name, space in SPACES.items()
        }  # fmt: skip


def best(name):
    """The result of the search of one of the spaces."""
    return _searches.found(searches()[name])


@stored(GROUP)
def peaks():
    """Force on the floor [N] and its time [s] of what is compared, and of all random orders."""
    space = SPACES["order of half steel, half PTFE"]
    drawn = [space.beads(row) for row in space.random(np.random.default_rng(0), DRAWN)]
    with ProcessPoolExecutor() as pool:
        found = np.array(sweep(peak, [*COMPARED.values(), *drawn], pool))
    compared, drawn = found[: len(COMPARED)].T, found[len(COMPARED) :].T
    return {
        "compared": {"design": list(COMPARED), "force [N]": compared[0], "time [s]": compared[1]},
        "drawn": {"force [N]": drawn[0], "time [s]": drawn[1]},
    }
