"""The hexagonal pack that is optimised, and what it is compared with."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from functools import cache

import numpy as np

from granular import Bead, Striker, hexagonal_pack, materials
from granular.design import Choice, Order, objective, search
from granular.design.objective import wall_peak
from tensegrity import sweep

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
FINE = (
    0.5
    * objective.SHARE
    * float(objective.Designs.of([[HARD, SOFT]]).unit(STEEL, STRIKER.speed)[0])
)  # s


def peak(beads):
    """Largest force on the floor [N], and when [s]."""
    return wall_peak(build, beads, T_END, FINE)


@cache
def peaks():
    """{design: (force [N], time [s])} of what is compared, and of all random orders."""
    space = SPACES["order of half steel, half PTFE"]
    drawn = [space.beads(row) for row in space.random(np.random.default_rng(0), DRAWN)]
    with ProcessPoolExecutor() as pool:
        found = sweep(peak, [*COMPARED.values(), *drawn], pool)
    return dict(zip(COMPARED, found, strict=False)), np.array(
        [f for f, _ in found[len(COMPARED) :]]
    )


@cache
def best(name):
    """The result of the search of one of the spaces."""
    with ProcessPoolExecutor() as pool:
        return search(
            SPACES[name], striker=STRIKER, wall=STEEL, t_end=T_END, build=build, budget=BUDGET,
            executor=pool,
        )  # fmt: skip
