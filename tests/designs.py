"""Protectors that several tests use, and functions that worker processes can import."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import numpy as np

from granular import Bead, Striker, chain, materials
from granular.design import Choice, Order, Sizes, search

STEEL = materials["steel"]
BIG, SMALL = Bead(10e-3, STEEL), Bead(4e-3, STEEL)
SOFT = Bead(10e-3, materials["ptfe"])
STRIKER = Striker(BIG, speed=0.44)
BLOW = {"striker": STRIKER, "wall": STEEL}
ORDER = Order([BIG] * 4 + [SMALL] * 4)
SIZES = Sizes(6, (4e-3, 10e-3), 0.042, STEEL)
CHOICE = Choice(6, 10e-3, [materials[name] for name in ("steel", "ptfe", "nylon")])
LETTERS = {"S": "steel", "P": "ptfe", "R": "rubber", "B": "bronze", "G": "glass", "N": "nylon"}


def spelled(word, other=SMALL):
    """Beads of a word: A is large steel, b the other one, capitals else are materials."""
    kinds = {"A": BIG, "b": other}
    return [kinds[c] if c in kinds else Bead(10e-3, materials[LETTERS[c]]) for c in word]


def before_a_wall(beads):
    """A chain as a `build` gives it."""
    return chain(beads, striker=STRIKER, end=STEEL), "end"


def never_a_number(beads):
    """A scene that cannot be built."""
    raise ValueError("no such pack")


def squared(x):
    return x * x


def square_or_be_killed(x):
    """The square, but one case, of a number in the command, kills the process."""
    if x == int(sys.argv[3]):
        os.kill(os.getpid(), signal.SIGKILL)
    return x * x


def square_or_die(x):
    """The square, but a case below 0 takes its process along."""
    if x < 0:
        os._exit(1)
    return x * x


def square_or_die_once(case):
    """The square, but the first time at all the process dies."""
    x, flag = case
    if not Path(flag).exists():
        Path(flag).touch()
        os._exit(1)
    return x * x


def small_search(path=None, executor=None, budget=640, seed=3):
    """A search of some seconds."""
    return search(
        Choice(12, 10e-3, CHOICE.materials), t_end=3e-3, budget=budget, seed=seed,
        executor=executor, checkpoint=path, **BLOW,
    )  # fmt: skip


def die_after(count):
    """Let this process be killed when it is about to show another file, after so many."""
    left, replace = [count], os.replace

    def last(*names):
        left[0] -= 1
        if left[0] < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(*names)

    os.replace = last


if __name__ == "__main__":
    if sys.argv[1] == "search":
        die_after(int(sys.argv[3]))
        best = small_search(sys.argv[2])
        print(repr((best.peak_force, best.evaluations, np.array(best.history).tobytes().hex())))
    else:
        from tensegrity import sweep

        print(sweep(square_or_be_killed, range(40), checkpoint=sys.argv[2]))
