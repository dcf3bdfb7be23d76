"""No answer depends on the units: each scene is run in metres, kilograms and seconds and in others.

All inputs are converted by their dimensions, all outputs converted back.  Micrometres, grams and
milliseconds differ by powers of ten, so the last digits of the inputs do; powers of two change
no digit at all.
"""

from dataclasses import dataclass

import numpy as np
import pytest
import sympy as sp

from granular import Bead, Material, Striker, chain, y_guide
from tensegrity import (
    Chain,
    Network,
    Potential,
    PowerLaw,
    Prism,
    State,
    equilibrium_path,
    simulate,
    solitary_wave,
)
from tensegrity.prisms.stability import first_loss
from tensegrity.waves.curve import largest_speed


@dataclass(frozen=True)
class Units:
    """What one metre, kilogram and second measure."""

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0

    def __call__(self, value, length=0, mass=0, time=0):
        return value * self.metre**length * self.kilogram**mass * self.second**time


LENGTH, MASS, TIME, SPEED = (1,), (0, 1), (0, 0, 1), (1, 0, -1)
FORCE, ENERGY, STIFFNESS, RATE = (1, 1, -2), (2, 1, -2), (0, 1, -2), (0, 0, -1)
MOMENTUM, PRESSURE, DENSITY, NUMBER = (1, 1, -1), (-1, 1, -2), (-3, 1), ()

SI = Units()
SMALL = Units(1e6, 1e3, 1e3)  # micrometre, gram, millisecond
BINARY = Units(2.0**20, 2.0**-30, 2.0**10)
HUGE = Units(2.0**-60, 2.0**40, 2.0**-35)


def prism(u, k_base=np.inf, k_bar=np.inf):
    stiff = (k if np.isinf(k) else u(k, *STIFFNESS) for k in (k_base, k_bar))
    return Prism(u(0.02, *LENGTH), u(0.014, *LENGTH), 0.03, u(300.0, *STIFFNESS), *stiff)


def of_potential(u, spring, unit):
    r = u(unit, *LENGTH) * np.array([-0.05, -1e-3, -1e-9, 1e-12, 1e-4, 0.03])
    return {
        "energy": (spring.energy(r), ENERGY),
        "tension": (spring.tension(r), FORCE),
        "stiffness": (spring.stiffness(r), STIFFNESS),
        "sound": (spring.sound_speed(u(0.02, *MASS)), RATE),
        "ends": (np.nan_to_num(spring.domain, posinf=0, neginf=0), LENGTH),
    }


def of_wave(u, spring, **given):
    wave = solitary_wave(spring, u(0.02, *MASS), **given)
    return {
        "peak": (wave.amplitude, LENGTH),
        "profile": (wave.elongation(np.linspace(-3, 3, 31)), LENGTH),
        "speed": (wave.speed, RATE),
        "energy": (wave.energy, ENERGY),
        "momentum": (wave.momentum, MOMENTUM),
        "width": (wave.width(), NUMBER),
    }


def of_run(u, run, scene):
    return {
        "t": (run.t, TIME),
        "u": (run.final.u, LENGTH),
        "v": (run.final.v, SPEED),
        "energy": (scene.energy(run.final), ENERGY),
        "dt": (run.dt, TIME),
    }


def rigid(u):
    spring = prism(u).potential(u(0.02, *FORCE))
    top = {"largest": (largest_speed(prism(u).potential(), u(0.02, *MASS)), RATE)}
    return of_potential(u, spring, 0.01) | of_wave(u, spring, speed_ratio=1.3) | top


def rarefaction(u):
    return of_wave(u, prism(u).potential(), speed_ratio=1.5, family="rarefaction")


def elastic(u):
    spring = prism(u, 4000.0, 40000.0).potential(u(0.02, *FORCE))
    return of_potential(u, spring, 0.01) | of_wave(u, spring, speed_ratio=1.05)


def path(u, *stiffness):
    found = equilibrium_path(prism(u, *stiffness), max_load=u(5.0, *FORCE))
    return {"load": (found.load, FORCE), "height": (found.height, LENGTH)}


def limit(u):
    """A prism so thick that it snaps: loaded to next to its limit load, and where it turns."""
    thick = Prism(u(0.02, *LENGTH), u(0.004, *LENGTH), 0.03, u(300.0, *STIFFNESS))
    largest = float(np.max([event.load for event in equilibrium_path(thick).events]))
    loaded = thick.potential(preload=largest * (1 - 1e-9))
    return {"largest": (largest, FORCE), "length": (loaded.length, LENGTH)}


def stability(u):
    stiff = (u(k, *STIFFNESS) for k in (300.0, 3000.0, 30000.0))
    found = first_loss(Prism(u(0.02, *LENGTH), u(0.03, *LENGTH), 0.02, *stiff), "tilting")
    return {"height": (found.height, LENGTH), "load": (found.load, FORCE)}


def lennard_jones_spring(u):
    r, depth, size = sp.symbols("r depth size")
    values = {depth: u(1e-3, *ENERGY), size: u(2e-4, *LENGTH)}
    energy = depth * ((1 + r / size) ** -12 - 2 * (1 + r / size) ** -6 + 1)
    return Potential(energy, r, values, domain=(-values[size], np.inf))


def lennard_jones(u):
    return of_wave(u, lennard_jones_spring(u), speed_ratio=1.01)


def torn(u):
    """Energy enough to tear every bond: no elongation is out of reach."""
    row = Chain(lennard_jones_spring(u), 8, u(0.02, *MASS))
    state = State(np.zeros(8), u(np.eye(8)[3] * 0.5, *SPEED))
    return of_run(u, simulate(row, state, u(5e-4, *TIME)), row)


def vacuum(u):
    spring = PowerLaw(u(3e8, 1 - 1.5, 1, -2), 1.5)
    return of_wave(u, spring, amplitude=u(-1e-6, *LENGTH))


def preloaded(u):
    spring = PowerLaw(u(1e4, 1 - 1.5, 1, -2), 1.5, u(100.0, *FORCE))
    wave = of_wave(u, spring, energy=u(1.0, *ENERGY))
    return of_potential(u, spring, 1e-3) | wave


def chain_run(u, **given):
    springs = [prism(u).potential(), prism(u, 4000.0, 40000.0).potential()]
    spring = springs[given.pop("elastic", 0)]
    row = Chain(spring, 8, u(0.02, *MASS))
    state = State(np.zeros(8), u(np.eye(8)[0] * 0.05, *SPEED))
    given = {key: u(x, *TIME) if key == "dt" else x for key, x in given.items()}
    return of_run(u, simulate(row, state, u(0.05, *TIME), **given), row)


def network_run(u, **given):
    cells = np.array([[0, 0], [1, 0], [0.5, 0.75**0.5], [1.5, 0.75**0.5]])
    spring = PowerLaw(u(1e6, 1 - 1.5, 1, -2), 1.5, u(2.0, *FORCE))
    bonds = [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)]
    net = Network(u(0.01 * cells, *LENGTH), bonds, spring, mass=u(0.004, *MASS))
    velocity = u(np.array([[0.02, 0.01], [0, 0], [0, -0.01], [0, 0]]), *SPEED)
    run = simulate(net, State(np.zeros((4, 2)), velocity), u(0.005, *TIME), **given)
    return of_run(u, run, net)


def steel(u):
    return Material("steel", u(193e9, *PRESSURE), 0.3, u(8000.0, *DENSITY))


def soft(u):
    return Material("soft", u(1.46e9, *PRESSURE), 0.46, u(2200.0, *DENSITY))


def beads(u, **given):
    bead = Bead(u(0.00476, *LENGTH), steel(u))
    row = chain([bead] * 6, striker=Striker(bead, u(0.3, *SPEED)), end=soft(u))
    run = simulate(row, row.start(), u(1e-4, *TIME), **given)
    return of_run(u, run, row) | {"force": (row.contact_forces(run.final.u), FORCE)}


def guide(u):
    bead = Bead(u(0.00476, *LENGTH), steel(u))
    made = y_guide(4, 3, bead=bead, wall=soft(u), striker=Striker(bead, u(0.3, *SPEED)))
    run = simulate(made, made.start(), u(6e-5, *TIME))
    return of_run(u, run, made)


SCENES = {
    "rigid prism": rigid,
    "rarefaction": rarefaction,
    "elastic prism": elastic,
    "rigid path": path,
    "elastic path": lambda u: path(u, 4000.0, 40000.0),
    "limit load": limit,
    "loss of stability": stability,
    "Lennard-Jones": lennard_jones,
    "chain that tears": torn,
    "sonic vacuum": vacuum,
    "preloaded contact": preloaded,
    "chain, default step": chain_run,
    "chain, tol": lambda u: chain_run(u, tol=1e-10),
    "chain, dt": lambda u: chain_run(u, dt=1e-4, method="rkn6"),
    "elastic chain": lambda u: chain_run(u, elastic=1),
    "network, default step": network_run,
    "network, tol": lambda u: network_run(u, tol=1e-9),
    "beads, default step": beads,
    "beads, tol": lambda u: beads(u, tol=1e-8),
    "guide": guide,
}
DIGITS = {SMALL: 1e-9, BINARY: 1e-10, HUGE: 1e-10}


@pytest.mark.parametrize("units", DIGITS, ids=["micrometres", "binary", "huge"])
@pytest.mark.parametrize("name", SCENES)
def test_no_answer_depends_on_the_units(name, units):
    here, there = SCENES[name](SI), SCENES[name](units)
    for quantity, (value, dimension) in here.items():
        other = np.asarray(there[quantity][0]) / units(1.0, *dimension)
        assert np.shape(other) == np.shape(value), quantity
        size = np.max(np.abs(value))
        assert np.max(np.abs(other - value)) <= DIGITS[units] * size, quantity
