"""Interfaces of two chains, and a detector of solitary waves that says no.

An exact rarefaction wave comes along the near chain and meets the far one.  What leads back and
what goes on is judged at one instant: a pulse counts as solitary where

* the exact wave of its crest exists, and elongations and velocities over the width of that wave
  (where it is above 5 % of its crest) differ from it by at most `MISFIT` of their largest;
* its crest is ahead of the acoustic front, which left the interface as the incident crest met it;
* it carries at least `LEAST` of the incident energy.

Velocities tell speed and direction.  What a run shows counts where neither end was reached.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from tensegrity import Chain, Potential, Record, State, TensegrityError, simulate, solitary_wave
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.springs.polynomial import Polynomial
from tensegrity.waves.asymptotics import sound_speed

MISFIT = 0.05  # of the crest
LEAST = 1e-4  # of the incident energy, that a pulse carries
TRAIN = 2  # compression pulses that make one
CUT = 1e-10  # of the crest, cut off where the wave is launched
QUIET = 1e-8  # of the incident crest: less has not reached an end

ENDS = 5  # bonds that are an end
COVERED, FIT = (0.95, 0.8, 0.65, 0.5), 1e-9  # parts of a domain for a polynomial, and its error
ROWS = 200  # recorded instants
LEVEL = 0.05  # of a crest, between which a wave has its width
ROUNDS, SAME = 4, 1e-3  # in which crest and place of a pulse are found, and when they are


@dataclass(frozen=True)
class Interface:
    """Two chains and the wave that comes along the first one.

    Attributes
    ----------
    near, far : Potential
    masses : (float, float)
        Of the sites of the near and of the far chain [kg]; the site between has the far one's.
    crest : float
        Elongation of the incident wave [m], > 0: rarefaction.
    """

    near: Potential
    far: Potential
    masses: tuple[float, float]
    crest: float

    @property
    def sounds(self):
        """Speeds of sound [sites/s]."""
        return sound_speed(self.near, self.masses[0]), sound_speed(self.far, self.masses[1])

    @property
    def impedances(self):
        """Of small waves [kg/s]."""
        near, far = self.sounds
        return self.masses[0] * near, self.masses[1] * far

    def wave(self):
        """The incident wave."""
        return solitary_wave(self.near, self.masses[0], amplitude=self.crest)

    def chain(self, before, after):
        """So many bonds of the near and of the far chain."""
        mass = np.repeat(self.masses, (before, after + 1))
        return Chain([self.near] * before + [self.far] * after, before + after + 1, mass)


class Start(NamedTuple):
    """A wave on its way to the interface, at site `before`.

    `met` is when its crest is there [s].
    """

    chain: Chain
    state: State
    before: int
    met: float


def start(interface, wave, before, after):
    """The wave as close to the interface as its tail lets it be."""
    away = wave.reach(CUT) + 2
    chain = interface.chain(before, after)
    return Start(chain, wave.launch(chain, before - away, tail=CUT), before, away / wave.speed)


class Found(NamedTuple):
    """A pulse and the exact wave of its crest.

    Attributes
    ----------
    place : float
        Of the crest, in bonds from the interface.
    crest : float
        [m].
    misfit : float
        Of elongations and velocities, the larger one; inf where there is no exact wave.
    ahead : float
        Sites ahead of the acoustic front.
    ratio, width, energy, momentum : float
        Of the exact wave: speed over sound, sites at 5 %, [J], and of its motion [kg m/s].
    """

    place: float
    crest: float
    misfit: float
    ahead: float
    ratio: float = math.nan
    width: float = math.nan
    energy: float = 0.0
    momentum: float = 0.0

    def is_solitary(self, incident):
        """By the definition of the module; `incident` is an energy [J]."""
        return self.misfit <= MISFIT and self.ahead > 0 and self.energy >= LEAST * incident


def crests(r, sign, least, limit):
    """Bonds with the `limit` largest maxima of sign * r above `least`, the largest first."""
    size = sign * r
    inner = size[1:-1]
    peak = (inner >= size[:-2]) & (inner > size[2:]) & (inner >= least)
    found = np.flatnonzero(peak) + 1
    return found[np.argsort(-size[found], kind="stable")[:limit]]


def matched(r, v, bond, exact):
    """The exact wave towards higher sites that a pulse is nearest to.

    Parameters
    ----------
    r : ndarray, (bonds,)
    v : ndarray, (bonds + 1,)
    bond : int
        Of its crest.
    exact : callable
        exact(crest) is the exact wave of a crest [m].

    Returns
    -------
    wave : SolitaryWave
        Of the crest found.
    place : float
        [bonds].
    misfit : float

    Raises
    ------
    TensegrityError
        If there is no wave of that crest.
    """
    crest, place = _top(r, bond)
    for _ in range(ROUNDS):
        wave = exact(crest)
        place, share = _placed(r, wave, place, bond)
        if abs(share - 1) < SAME:
            break
        crest *= share
    return wave, place, misfit(r, v, wave, place)


def _top(r, bond):
    """Crest and place by the parabola through three bonds."""
    left, top, right = r[bond - 1 : bond + 2]
    shift = (left - right) / (2 * (left - 2 * top + right))
    return float(top - (left - right) * shift / 4), bond + float(shift)


def _placed(r, wave, place, bond):
    """Place of the crest and share of the wave's amplitude, by least squares over its width."""
    from scipy.optimize import least_squares

    half = wave.width(LEVEL) / 2
    low, high = max(math.ceil(place - half), 0), min(math.floor(place + half), len(r) - 1)
    x = np.arange(low, high + 1)

    def gap(unknown):
        return (unknown[1] * wave.elongation(x - unknown[0]) - r[x]) / wave.amplitude

    bounds = [bond - 1, 0.5], [bond + 1, 2.0]
    guess = np.clip([place, 1.0], *bounds)
    return least_squares(gap, guess, bounds=bounds, xtol=1e-10, ftol=1e-10, gtol=1e-10).x


def misfit(r, v, wave, place):
    """Largest difference from a wave, over its width, over its largest values; inf at an edge."""
    half = wave.width(LEVEL) / 2
    bonds = np.arange(math.ceil(place - half), math.floor(place + half) + 1)
    if bonds[0] < 0 or bonds[-1] >= len(r):
        return math.inf
    sites = np.append(bonds, bonds[-1] + 1)  # site j is half a site before bond j
    exact = -wave.speed * wave.rate(sites - place - 0.5)
    fastest = wave.speed * abs(float(wave.rate(0.0)))
    return float(
        max(
            np.abs(r[bonds] - wave.elongation(bonds - place)).max() / abs(wave.amplitude),
            np.abs(v[sites] - exact).max() / fastest,
        )
    )


def pulses(r, v, sign, exact, front, least, limit=4):
    """Pulses of one sign that move towards higher bonds, ahead of a place.

    Parameters
    ----------
    r, v : ndarray, (bonds,), (bonds + 1,)
        Of a part that begins at the interface.
    sign : int
        1 rarefaction, -1 compression.
    exact : callable
        exact(crest) is the exact wave of a crest [m].
    front : float
        [bonds].
    least : float
        Elongation from which a crest counts [m], > 0.
    limit : int, optional
        How many are looked at, the largest ones.

    Returns
    -------
    list of Found
        The largest first.
    """
    found = []
    begin = max(math.floor(front), 0)
    for bond in crests(r[begin:], sign, least, limit) + begin:
        try:
            wave, place, gap = matched(r, v, int(bond), exact)
        except TensegrityError:
            found.append(Found(float(bond), float(r[bond]), math.inf, bond - front))
            continue
        found.append(
            Found(
                place, wave.amplitude, gap, place - front, wave.speed_ratio, wave.width(LEVEL),
                wave.energy, wave.momentum,
            )
        )  # fmt: skip
    return found


def parts(r, v, before):
    """Elongations and velocities of both parts, each from the interface on.

    The near part is seen in a mirror: its velocities change sign.
    """
    return (r[:before][::-1], -v[: before + 1][::-1]), (r[before:], v[before:])


class Answer(NamedTuple):
    """What one instant of a run shows.

    Attributes
    ----------
    back, leading, train : list of Found
        Rarefaction pulses in the near chain, rarefaction and compression pulses in the far one.
    ends : float
        Largest elongation at an end over the incident crest.
    """

    back: list
    leading: list
    train: list
    ends: float

    def verdict(self, incident):
        """Numbers of solitary waves: reflected rarefactions, transmitted compressions."""
        if self.ends > QUIET:
            return 0, 0
        return tuple(
            sum(one.is_solitary(incident) for one in each) for each in (self.back, self.train)
        )


def _exact(spring, mass, crest):
    return solitary_wave(spring, mass, amplitude=crest)


def answer(interface, run, row, before, met, least=0.01):
    """What is seen at a recorded instant; `least` is over the largest elongation of each part."""
    u, v, t = run.u[row], run.v[row], run.t[row] - met
    r = np.diff(u)
    sides = parts(r, v, before)
    found = []
    for (part, speeds), spring, mass, sound, signs in zip(
        sides, (interface.near, interface.far), interface.masses, interface.sounds,
        ((1,), (1, -1)), strict=True,
    ):  # fmt: skip
        for sign in signs:
            size = max(float((sign * part[max(math.floor(sound * t), 0) :]).max(initial=0.0)), 0.0)
            floor = max(least * np.abs(part).max(), 0.1 * size)
            exact = partial(_exact, spring, mass)
            found.append(pulses(part, speeds, sign, exact, sound * t, floor))
    ends = float(max(np.abs(r[:ENDS]).max(), np.abs(r[-ENDS:]).max()) / interface.crest)
    return Answer(*found, ends)


class Outcome(NamedTuple):
    """What becomes of one incidence, in chains whose ends nothing reaches.

    Attributes
    ----------
    run : Run
        The finer one.
    begun : Start
    incident : SolitaryWave
    coarse, fine : Answer
        At the last instant, with a step and with half of it.
    """

    run: object
    begun: Start
    incident: object
    coarse: Answer
    fine: Answer

    @property
    def verdict(self):
        """Solitary waves that both steps show: reflected rarefactions, transmitted compressions."""
        pairs = zip(
            *(x.verdict(self.incident.energy) for x in (self.coarse, self.fine)), strict=True
        )
        return tuple(min(pair) for pair in pairs)

    @property
    def does_both(self):
        """Whether a rarefaction is reflected and a train of compressions transmitted."""
        back, train = self.verdict
        return back >= 1 and train >= TRAIN

    @property
    def moved(self):
        """Largest relative change of a solitary wave's crest from one step to the other."""
        least = self.incident.energy
        several = [
            [x.crest for x in (*one.back, *one.train) if x.is_solitary(least)]
            for one in (self.coarse, self.fine)
        ]
        return max((abs(a / b - 1) for a, b in zip(*several, strict=False)), default=0.0)

    def momenta(self):
        """Shares of the incident momentum at last: what the near chain holds, what the far one
        does, and how much of that its solitary compressions carry."""
        mass, v = self.run.scene.mass, self.run.final.v
        near = float(np.sum((mass * v)[: self.begun.before])) / self.incident.momentum
        far = float(np.sum((mass * v)[self.begun.before :])) / self.incident.momentum
        pushed = sum(
            x.momentum for x in self.fine.train if x.is_solitary(self.incident.energy)
        )  # fmt: skip
        return near, far, pushed / self.incident.momentum


def outcome(interface, duration, after, dt=None, rows=ROWS):
    """An incidence followed for so long after crest and interface have met [s].

    Parameters
    ----------
    interface : Interface
    duration : float
        [s].
    after : int
        Bonds of the far chain, to begin with: doubled until nothing reaches its end.
    dt : float, optional
        The coarser step [s]; by default what `simulate` takes.
    rows : int, optional
        Recorded instants.

    Returns
    -------
    Outcome
    """
    wave = interface.wave()
    before = math.ceil(1.02 * wave.speed * duration + 2 * wave.reach(CUT)) + 20
    while True:
        begun = start(interface, wave, before, after)
        t_end = begun.met + duration
        record = Record(times=t_end * np.arange(rows + 1) / rows)
        coarse = simulate(*begun[:2], t_end, method="rkn6", dt=dt, record=record)
        first = answer(interface, coarse, -1, before, begun.met)
        if first.ends <= QUIET:
            break
        after *= 2
    fine = simulate(*begun[:2], t_end, method="rkn6", dt=coarse.dt / 2, record=record)
    second = answer(interface, fine, -1, before, begun.met)
    return Outcome(fine, begun, wave, first, second)


def fitted(interface):
    """The same with polynomials for elastic prisms: an order of magnitude cheaper to run."""
    return replace(interface, near=_fitted(interface.near), far=_fitted(interface.far))


def _fitted(spring):
    if not isinstance(spring, ElasticPotential):
        return spring
    for part in COVERED:
        with contextlib.suppress(TensegrityError):
            return Polynomial(spring, part * spring.domain[0], part * spring.domain[1], FIT)
    return spring
