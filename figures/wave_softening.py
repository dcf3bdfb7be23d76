"""A compressive blow on a softening chain: a leading rarefaction wave, or none."""

from __future__ import annotations

import numpy as np

from figures import _measure, _scenes
from tensegrity import TensegrityError, simulate, solitary_wave
from tensegrity.asymptotics import sound_speed
from tensegrity.observables import arrival, passage

NAME = "wave_softening"
GROUP = "waves"

PRELOAD = 0.05  # N
SITES, DURATION = 600, 450.0  # s: sound goes 540 sites
SENSORS = (300, 500)  # bonds
NOISE = 1e-3  # of the crest: the oscillations behind begin there
SUPERSONIC = 1e-3  # least excess over sound, and closeness to the exact wave's, of a soliton
HARD = 0.15  # m/s, the blow that is shown
SPEEDS = (0.05, 0.1, 0.15, 0.2)  # m/s

BLOWS = {  # velocities of the sites per speed of the blow, held first site or not, its mass
    "held end, next mass pushed": ({1: 1.0}, "fixed", 1.0),
    "held end, next mass pulled": ({1: -1.0}, "fixed", 1.0),
    "free end pulled": ({0: -1.0}, "free", 1.0),
    "free end pushed": ({0: 1.0}, "free", 1.0),
    "free end, light striker (mass 0.2)": ({0: 1.0}, "free", 0.2),
    "free end, heavy striker (mass 5)": ({0: 1.0}, "free", 5.0),
    "free end, five masses pushed": (dict.fromkeys(range(5), 1.0), "free", 1.0),
}


def struck(blow, speed, sites=SITES, duration=DURATION):
    """The scene of one blow."""
    velocities, end, first = BLOWS[blow]
    mass = np.ones(sites)
    mass[0] = first
    speeds = {site: speed * v for site, v in velocities.items()}
    return _scenes.impact(_scenes.softening(PRELOAD), sites, speeds, duration, (end, "free"), mass)


def leading(run, sensors=SENSORS):
    """Speed, crest and energy of the first pulse, and the speed of the tail behind it.

    The tail's front is its first large extremum of the other sign.
    """
    near, far = sensors
    numbers, behind = {}, []
    for bond in sensors:
        left = run.sites.index(bond)
        r, rate = np.diff(run.u[:, left : left + 2])[:, 0], np.diff(run.v[:, left : left + 2])[:, 0]
        crest = passage(run.t, r, rate)
        first = int(np.searchsorted(run.t, crest))
        numbers["crest"] = float(np.interp(crest, run.t, r))
        other = first + int(np.argmax(r[first:] * numbers["crest"] < 0))
        turned = np.minimum(r[other:] * np.sign(numbers["crest"]), 0)
        behind.append(passage(run.t[other:], turned, rate[other:]))
    sound = sound_speed(run.scene.springs[-1], run.scene.mass[-1])
    numbers["speed"] = (far - near) / (arrival(run, far) - arrival(run, near)) / sound
    numbers["tail"] = (far - near) / (behind[1] - behind[0]) / sound
    return numbers


def is_soliton(numbers, exact_ratio):
    """Whether the first pulse is a rarefaction wave that runs as the exact wave of its crest."""
    return (
        numbers["crest"] > 0
        and numbers["speed"] > 1 + SUPERSONIC
        and abs(numbers["speed"] - exact_ratio) < SUPERSONIC
    )
