"""Bonds with two wells hold back a blow: the wall feels no more than the torque that switches one.

Twenty squares with strings of both hands join 21 discs, the last of which is held; the first is
struck.  In one well the blow runs through the chain to the wall.  With two, the bonds near the blow
switch to their upper wells and keep part of its energy there, and the wall feels at most the torque
at which a well ends, as long as there are bonds to switch (S. Shan et al., Adv. Mater. 27, 4296
(2015), for compression).  The prestrain, the same of all bonds, is optimised over its range; then
that of each bond by gradients of the peak.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from figures.transition_units import natural
from tensegrity import Chain, Record, State, catalogue, gradient, simulate
from tensegrity import objective as o

NAME = "transition_trap"
GROUP = "waves"

BONDS, BLOW, TORQUE = 20, 0.2, 3e-3  # discs of 1 kg m^2; rad/s of the first; N m on each bond
END, DT = 400.0, 0.1  # s
ONE_WELL = np.linspace(0.1, 0.24, 8)  # prestrains
TWO_WELLS = np.linspace(0.2525, 0.3125, 25)
STEPS, FIRST, LEAST = 24, 4e-3, 1e-4  # of the descent, and changes of prestrain
RANGE = 0.2525, 0.32
SPLITS = 0.25  # prestrain


@cache
def bond(prestrain):
    """The spring between two discs, by their relative twist."""
    rest = natural(prestrain)
    return unit().varied({"N": rest, "N_2": rest, "M": TORQUE})


@cache
def unit():
    return catalogue.twin_strings(sides=4)


@cache
def well(prestrain, side=1):
    """The lower (side = 1) or the upper well [rad], and how it changes with the prestrain."""
    from scipy.optimize import brentq

    one = bond(prestrain)
    twists = side * np.linspace(0.0 if side > 0 else 0.02, 0.78, 2001)
    outward = np.flatnonzero(side * one.tension(twists[1:]) >= 0)
    inward = np.flatnonzero(side * one.tension(twists[:-1]) < 0)
    k = outward[outward >= inward[0]][0]
    place = brentq(lambda x: float(one.tension(x)), *sorted(twists[k : k + 2]), xtol=1e-15)
    h = 1e-6
    rest = natural(prestrain)
    ends = (one.varied({"N": rest + s, "N_2": rest + s}) for s in (h, -h))
    slope = np.subtract(*(float(end.tension(place)) for end in ends)) / (2 * h)
    return place, -slope / float(one.stiffness(place)) * by_prestrain(prestrain)


def by_prestrain(prestrain):
    """Derivative of the natural length [m]."""
    return -natural(prestrain) / (1 + prestrain)


def fold(prestrain):
    """Torque at which the lower well ends [N m]."""
    return -float(bond(prestrain).tension(np.linspace(0.0, well(prestrain)[0], 4001)).min())


def struck(prestrains):
    """The chain of bonds with these prestrains, and its state after the blow."""
    places = np.array([well(p)[0] for p in prestrains])
    u = np.append(-np.cumsum(places[::-1])[::-1], 0.0)
    v = np.zeros(BONDS + 1)
    v[0] = BLOW
    return Chain([bond(p) for p in prestrains], BONDS + 1, ends=("free", "fixed")), State(u, v)


def run(prestrains):
    """Times, torque on the wall, and elongations [s], [N m], [rad]."""
    chain, state = struck(prestrains)
    one = simulate(chain, state, END, dt=DT, record=Record(times=np.linspace(0, END, 2001)))
    twist = np.diff(one.u)
    return one.t, -chain.springs[-1].tension(twist[:, -1]), twist


def stored(prestrain, twist):
    """Least number of bonds in the upper well over the last quarter, and the part of the blow's
    energy in them."""
    try:
        upper = well(prestrain, -1)[0]
    except IndexError:
        return 0, 0.0
    least = int(np.sum(twist[3 * len(twist) // 4 :] < 0, axis=1).min())
    one = bond(prestrain)
    lifted = float(one.energy(upper) - one.energy(well(prestrain)[0]))
    return least, least * lifted / (BLOW**2 / 2)


def peak(prestrains):
    """Largest torque on the wall [N m], and its derivatives by the prestrains."""
    chain, state = struck(prestrains)
    wall = o.peak(o.load(bond=BONDS - 1))
    found = gradient(wall, chain, state, END, dt=DT, wanted=("N", "N_2"))
    lengths = found.by("N") + found.by("N_2")
    moved = -np.cumsum(found.u)[:-1]  # by the well of each bond, which moves the discs before it
    slopes = lengths * [by_prestrain(p) for p in prestrains]
    return found.value, slopes + moved * [well(p)[1] for p in prestrains]


def descended(start):
    """Peaks along a descent by gradients, and the prestrains at its end."""
    x, reach = np.array(start), FIRST
    (height, slopes), way = peak(x), []
    for _ in range(STEPS):
        way.append(height)
        trial = np.clip(x - reach * slopes / np.abs(slopes).max(), *RANGE)
        there = peak(trial)
        if there[0] < height:
            x, (height, slopes), reach = trial, there, 1.5 * reach
        else:
            reach /= 3
        if reach < LEAST:
            break
    return [*way, height], x


def uniform():
    """The prestrain, the same of all bonds, of the lowest peak: a scan, and a search beside its
    best."""
    from scipy.optimize import minimize_scalar

    heights = [run([p] * BONDS)[1].max() for p in TWO_WELLS]
    k = int(np.argmin(heights))
    near = TWO_WELLS[max(k - 1, 0)], TWO_WELLS[k + 1]
    found = minimize_scalar(lambda p: run([p] * BONDS)[1].max(), bounds=near, method="bounded",
                            options={"xatol": 1e-5, "maxiter": 12})  # fmt: skip
    return found.x if found.fun < heights[k] else TWO_WELLS[k]
