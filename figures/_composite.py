"""Interfaces of two chains of prisms, from acoustically hard to soft: reflected and transmitted
waves.

`FOUND` were found by searches over their parameters for both waves of the talk's claim.  An exact
rarefaction wave travels along the near chain and meets the far one.  Reflected and
transmitted pulses are classified at one instant by `figures._solitons`; the acoustic front leaves
the interface when the incident peak arrives.  A result counts if the wave reached neither end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from figures._solitons import pulses
from tensegrity import (
    Chain,
    Potential,
    Prism,
    Record,
    State,
    interface,
    simulate,
    solitary_wave,
)

TRAIN = 2  # compression pulses that make one
CUT = 1e-10  # of the peak, at which the launched wave is truncated
QUIET = 1e-8  # of the incident peak: an end with less has not been reached

ENDS = 5  # bonds that form an end
ROWS = 200  # recorded instants
TRAVEL = 100  # bonds that sound travels in the far chain
LEAST_TRAVEL = 200  # ... and in the near one
LONGEST = 3000  # ... at most
NAMES = ("height near", "prestrain near", "k_base near", "k_bar near", "height far",
         "prestrain far", "k_base far", "k_bar far", "base far", "k_cross far", "mass far",
         "preload", "peak")  # fmt: skip
FOUND = {
    "elastic to rigid": (
        0.47456824582383805, 0.016577957054138934, 1.0340417195892941, 60.582948679419545,
        1.3919507539947564, 0.00014868513594702555, math.inf, math.inf,
        1.9944701225524497, 0.04587078257940549, 4.56675770890025, 0.0019909121614583914,
        0.37854154198244355,
    ),
    "elastic to elastic": (
        0.6820464273000877, 0.028330057283244083, 4.780765598779244, 3.523275045782708,
        0.5957498807625385, 0.0002525710141244606, 7.73918692893198, 15.689812153792698,
        1.875150846054776, 0.07245722643494576, 0.14609272552253896, 0.01015897934786399,
        0.7197853315254595,
    ),
}  # fmt: skip
"""Values of `NAMES`.  Base 1 m, k_cross 1 N/m and mass 1 kg of the near chain; heights over the
base, k_base and k_bar over the k_cross of their prism; the preload over the smaller k_cross times
base; the peak over the largest elongation of the near prism."""


@dataclass(frozen=True)
class Interface:
    """Two chains and the wave incident along the first one.

    Attributes
    ----------
    near, far : Potential
    masses : (float, float)
        Of the sites of the near and of the far chain [kg]; the site between has the far one's.
    peak : float
        Elongation of the incident wave [m], > 0: rarefaction.
    """

    near: Potential
    far: Potential
    masses: tuple[float, float]
    peak: float

    @property
    def sounds(self):
        """Sound speeds of both chains [sites/s]."""
        return self.near.sound_speed(self.masses[0]), self.far.sound_speed(self.masses[1])

    @property
    def impedances(self):
        """Acoustic impedances of both chains [kg/s]."""
        near, far = self.sounds
        return self.masses[0] * near, self.masses[1] * far

    def wave(self):
        """The incident wave."""
        return solitary_wave(self.near, self.masses[0], amplitude=self.peak)

    def chain(self, before, after):
        """The chain with `before` near and `after` far bonds."""
        return interface(self.near, self.far, (before, after + 1), self.masses)


def made(one):
    """The interface of prisms of `NAMES` and their values."""
    k = one["k_cross far"]
    load = one["preload"] * min(1.0, k * one["base far"])
    springs = []
    for side, base, stiff in (("near", 1.0, 1.0), ("far", one["base far"], k)):
        prism = Prism(
            base, one[f"height {side}"] * base, one[f"prestrain {side}"], stiff,
            k_base=one[f"k_base {side}"] * stiff, k_bar=one[f"k_bar {side}"] * stiff,
        )  # fmt: skip
        springs.append(prism.potential(load))
    return Interface(*springs, (1.0, one["mass far"]), one["peak"] * springs[0].domain[1])


def duration(real):
    """Duration over which an interface is simulated [s]."""
    near, far = real.sounds
    return min(max(TRAVEL / far, LEAST_TRAVEL / near), LONGEST / near)


class Start(NamedTuple):
    """A wave on its way to the interface, at site `before`.

    `arrival` is the time at which its peak arrives there [s].
    """

    chain: Chain
    state: State
    before: int
    arrival: float


def start(interface, wave, before, after):
    """The wave launched as close to the interface as its tail permits."""
    away = wave.reach(CUT) + 2
    chain = interface.chain(before, after)
    return Start(chain, wave.launch(chain, before - away, tail=CUT), before, away / wave.speed)


def parts(r, v, before):
    """Elongations and velocities of both parts, each counted from the interface.

    The near part is mirrored, so that its velocities change sign.
    """
    return (r[:before][::-1], -v[: before + 1][::-1]), (r[before:], v[before:])


class Answer(NamedTuple):
    """The pulses at one instant of a run.

    Attributes
    ----------
    back, leading, train : list of Found
        Rarefaction pulses in the near chain, rarefaction and compression pulses in the far one.
    ends : float
        Largest elongation at an end over the incident peak.
    pressed : list of Found
        Compression pulses in the near chain.
    """

    back: list
    leading: list
    train: list
    ends: float
    pressed: tuple | list = ()

    def verdict(self, incident):
        """Numbers of solitary waves: reflected rarefactions, transmitted compressions."""
        if self.ends > QUIET:
            return 0, 0
        return tuple(
            sum(one.is_solitary(incident) for one in each) for each in (self.back, self.train)
        )


def _exact(spring, mass, peak):
    return solitary_wave(spring, mass, amplitude=peak)


def answer(interface, run, row, before, arrival, least=0.01):
    """The pulses at a recorded instant; `least` is relative to the largest elongation of a part."""
    u, v, t = run.u[row], run.v[row], run.t[row] - arrival
    r = np.diff(u)
    sides = parts(r, v, before)
    found = []
    for (part, speeds), spring, mass, sound in zip(
        sides, (interface.near, interface.far), interface.masses, interface.sounds,
        strict=True,
    ):  # fmt: skip
        for sign in (1, -1):
            size = max(float((sign * part[max(math.floor(sound * t), 0) :]).max(initial=0.0)), 0.0)
            floor = max(least * np.abs(part).max(), 0.1 * size)
            exact = partial(_exact, spring, mass)
            found.append(pulses(part, speeds, sign, exact, sound * t, floor))
    ends = float(max(np.abs(r[:ENDS]).max(), np.abs(r[-ENDS:]).max()) / interface.peak)
    back, pressed, leading, train = found
    return Answer(back, leading, train, ends, pressed)


class Outcome(NamedTuple):
    """The outcome of one incidence, in chains whose ends no wave reaches.

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
        each = (x.verdict(self.incident.energy) for x in (self.coarse, self.fine))
        return tuple(min(pair) for pair in zip(*each, strict=True))

    @property
    def does_both(self):
        """Whether a rarefaction is reflected and a train of compressions transmitted."""
        back, train = self.verdict
        return back >= 1 and train >= TRAIN

    @property
    def moved(self):
        """Largest relative change of the peak of a solitary wave from one step to the other."""
        least = self.incident.energy
        several = [
            [x.peak for x in (*one.back, *one.train) if x.is_solitary(least)]
            for one in (self.coarse, self.fine)
        ]
        return max((abs(a / b - 1) for a, b in zip(*several, strict=False)), default=0.0)

    def momenta(self):
        """Final momenta over the incident one: of the near chain, of the far chain, and of the
        solitary compression waves in the far chain."""
        mass, v = self.run.scene.mass, self.run.final.v
        near = float(np.sum((mass * v)[: self.begun.before])) / self.incident.momentum
        far = float(np.sum((mass * v)[self.begun.before :])) / self.incident.momentum
        pushed = sum(x.momentum for x in self.fine.train if x.is_solitary(self.incident.energy))
        return near, far, pushed / self.incident.momentum


def outcome(interface, time, after=2 * TRAVEL, dt=None, rows=ROWS):
    """Simulate one incidence for some time after the peak arrives at the interface.

    Parameters
    ----------
    interface : Interface
    time : float
        Time after the arrival of the peak [s].
    after : int, optional
        Initial number of bonds of the far chain, doubled until nothing reaches its end.
    dt : float, optional
        The coarser step [s]; by default what `simulate` takes.
    rows : int, optional
        Recorded instants.

    Returns
    -------
    Outcome
    """
    wave = interface.wave()
    before = math.ceil(1.02 * wave.speed * time + 2 * wave.reach(CUT)) + 20
    while True:
        begun = start(interface, wave, before, after)
        t_end = begun.arrival + time
        record = Record(times=t_end * np.arange(rows + 1) / rows)
        coarse = simulate(*begun[:2], t_end, method="rkn6", dt=dt, record=record)
        first = answer(interface, coarse, -1, before, begun.arrival)
        if first.ends <= QUIET:
            break
        after *= 2
    fine = simulate(*begun[:2], t_end, method="rkn6", dt=coarse.dt / 2, record=record)
    second = answer(interface, fine, -1, before, begun.arrival)
    return Outcome(fine, begun, wave, first, second)
