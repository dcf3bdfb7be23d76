"""Interfaces of two chains of prisms, from acoustically hard to soft: reflected and transmitted
waves.

`FOUND` were found by searches over their parameters for both waves of the talk's claim.  An exact
rarefaction wave travels along the near chain and meets the far one.  `tensegrity.transmission`
finds the pulses at one instant, and the exact waves that they agree with.
"""

import math
from typing import NamedTuple

import numpy as np

from tensegrity import (
    Polynomial,
    Potential,
    Prism,
    Record,
    SolitaryWave,
    interface,
    simulate,
    solitary_wave,
    transmission,
)

CUT = 1e-10  # of the peak, at which the launched wave is truncated
ROWS = 200  # recorded instants
TRAVEL = 100  # bonds that sound travels in the far chain
LEAST_TRAVEL = 200  # ... and in the near one
AFTER = 400  # bonds of the far chain
COUNTED = 0.15  # of the largest elongation of a chain: from there a peak is a pulse
VISITED = (-1.5, 1.3)  # elongations of the near chain, over the incident peak
ERROR = 1e-11  # of the polynomial there, for its potential: runs take an eighth of the time
KINDS = ("reflected rarefactions", "reflected compressions", "transmitted rarefactions",
         "transmitted compressions")  # fmt: skip
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


class Interface(NamedTuple):
    """Two chains and the wave incident along the first one; the site between has the mass of the
    far one."""

    near: Potential
    far: Potential
    masses: tuple[float, float]  # kg
    incident: SolitaryWave

    @property
    def sounds(self):
        """Sound speeds of both chains [sites/s]."""
        return self.near.sound_speed(self.masses[0]), self.far.sound_speed(self.masses[1])


def made(values):
    """The interface of prisms of values of `NAMES`."""
    one = dict(zip(NAMES, values, strict=True))
    k = one["k_cross far"]
    load = one["preload"] * min(1.0, k * one["base far"])
    springs = []
    for side, base, stiff in (("near", 1.0, 1.0), ("far", one["base far"], k)):
        prism = Prism(
            base, one[f"height {side}"] * base, one[f"prestrain {side}"], stiff,
            k_base=one[f"k_base {side}"] * stiff, k_bar=one[f"k_bar {side}"] * stiff,
        )  # fmt: skip
        springs.append(prism.potential(load))
    peak = one["peak"] * springs[0].domain[1]
    near = Polynomial(springs[0], *(x * peak for x in VISITED), ERROR)
    return Interface(near, springs[1], (1.0, one["mass far"]), solitary_wave(near, amplitude=peak))


def followed(real):
    """Runs of one incidence with a step and with half of it.

    Returns
    -------
    coarse, fine : (Run, Transmission)
    """
    (near, far), wave = real.sounds, real.incident
    time = max(TRAVEL / far, LEAST_TRAVEL / near)
    before = math.ceil(1.02 * wave.speed * time + 2 * wave.reach(CUT)) + 20
    away = wave.reach(CUT) + 2
    chain = interface(real.near, real.far, (before, AFTER + 1), real.masses)
    state, t_end = wave.launch(chain, before - away, tail=CUT), away / wave.speed + time
    record = Record(times=t_end * np.arange(ROWS + 1) / ROWS)
    coarse = simulate(chain, state, t_end, method="rkn6", record=record)
    fine = simulate(chain, state, t_end, method="rkn6", dt=coarse.dt / 2, record=record)
    return [(run, transmission(run, fraction=COUNTED)) for run in (coarse, fine)]


def solitary(found):
    """The pulses of a `Transmission` that are exact waves, the first to leave the interface first.

    Returns
    -------
    list of dict
        kind, one of `KINDS`; place [sites from the interface]; peak [m]; ratio, speed over sound;
        energy, over the incident one; delay after the incident peak arrives [s].
    """
    rows = []
    for way in ("reflected", "transmitted"):
        pairs = zip(getattr(found, way), getattr(found, f"{way}_delays"), strict=True)
        for pulse, delay in sorted(pairs, key=lambda pair: pair[1]):
            if pulse.wave:
                rows.append({
                    "kind": f"{way} {'rarefactions' if pulse.amplitude > 0 else 'compressions'}",
                    "place": pulse.place - found.site, "peak": pulse.amplitude,
                    "ratio": pulse.wave.speed_ratio, "delay": delay,
                    "energy": pulse.energy / found.incident.energy,
                })  # fmt: skip
    return rows
