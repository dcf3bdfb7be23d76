"""Where no orbit is, or another one than was sought: what is said, and what is found."""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    Damping,
    Drive,
    Network,
    PowerLaw,
    ResolutionError,
    State,
    TensegrityError,
    floquet,
    orbit_path,
    periodic_orbit,
)
from tests.test_driven_orbits import PRISM, shaken
from tests.test_orbits import EDGE, HERTZ, breather, gap_breather

STIFFNESS = float(PRISM.stiffness(0.0))
HEAVY, LIGHT, TOP = 0.02884, 0.00975, 9371.402789  # kg, of steel and aluminium; of the bands [Hz]


def diatomic(heavy, sites=81):
    """Prisms between masses 1 and `heavy`, the middle one light, and edges of the bands [Hz]."""
    light = (np.arange(sites) - sites // 2) % 2 == 0
    squares = 2 * STIFFNESS * np.array([1 / heavy, 1.0, 1 + 1 / heavy])
    return Chain(PRISM, sites, np.where(light, 1.0, heavy)), np.sqrt(squares) / (2 * math.pi)


def test_an_end_bead_of_aluminium_has_a_mode_of_its_own_in_the_gap():
    """Its frequency is f_3/sqrt 2, and it decays by the ratio of the masses."""
    light = np.arange(80) % 2 == 1
    row = Chain(PowerLaw(HERTZ, 1.5, preload=20.0), 80, np.where(light, LIGHT, HEAVY))
    frequency, back = TOP / math.sqrt(2), np.arange(80)[::-1]
    decay = (-LIGHT / HEAVY) ** ((back + 1) // 2)
    orbit = periodic_orbit(row, State(2e-7 * decay, 0.0 * decay), period=1 / (0.9995 * frequency))
    u = orbit.state.u - orbit.state.u[:40].mean()
    assert np.abs(u[:50]).max() < 1e-6 * np.abs(u).max()
    assert u[-5:-1] / u[-1] == pytest.approx(decay[-5:-1], abs=1e-2)
    weak = periodic_orbit(row, orbit, energy=1e-4 * orbit.energy)
    assert weak.period * frequency == pytest.approx(1, abs=1e-6)
    assert frequency < EDGE


@pytest.mark.parametrize("size", [0.01, 0.03, 0.06])
def test_a_second_harmonic_in_the_optic_band_is_named(size):
    chain, (_, low, top) = diatomic(6.0)
    frequency, x = (low + top) / 4, np.arange(81) - 40
    assert frequency < low
    u = size * np.where(x % 2, np.sin(np.pi * x / 2), 0.0) / np.cosh(0.3 * x)
    with pytest.raises(TensegrityError, match=rf"harmonic 2 of the period, {2 * frequency:.4g}"):
        periodic_orbit(chain, State(u, 0 * u), period=1 / frequency)


@pytest.mark.parametrize("mass", [1.0, 2.0])
def test_masses_that_are_not_light_hold_no_mode(mass):
    x = np.arange(41) - 20
    chain = Chain(PRISM, 41, np.where(x == 0, mass, 1.0))
    u = 0.0091 * (-1.0 / 3) ** np.abs(x)
    frequency = math.sqrt(4 * STIFFNESS / 0.75) / (2 * math.pi)  # of a mass 0.5
    with pytest.raises(TensegrityError, match="converges to the state at rest"):
        periodic_orbit(chain, State(u, 0 * u), period=1 / frequency)


def test_at_a_fold_the_other_response_is_found_or_none():
    fold, state = 1.72627260149807, State([0, 0.0024274], [0, 0.0490216])
    before = shaken(PRISM, 0.001, 0.02, fold - 1e-6)
    near = periodic_orbit(before, state)
    assert floquet(near).multipliers[0].real == pytest.approx(0.9991, abs=1e-4)
    for frequency in (fold, fold + 1e-6):
        scene = shaken(PRISM, 0.001, 0.02, frequency)
        with pytest.raises(TensegrityError, match="no periodic orbit found: the last Newton step"):
            periodic_orbit(scene, state)
        other = periodic_orbit(scene, scene.at_rest())
        assert abs(other.state.v[1]) < 0.01
        assert floquet(other).stable


def test_an_energy_below_the_least_of_a_family_is_refused():
    least = gap_breather(False, 7800)
    assert least.energy == pytest.approx(1.0078e-4, rel=1e-4)
    with pytest.raises(TensegrityError, match="no periodic orbit found"):
        periodic_orbit(least.scene, least, energy=0.9e-4)


def test_a_breather_does_not_change_with_the_number_of_sites():
    near, far = (breather(sites, 1.2) for sites in (20, 40))
    assert near.energy == pytest.approx(far.energy, rel=5e-9)
    assert np.ptp(near.state.u) == pytest.approx(np.ptp(far.state.u), rel=1e-7)


def test_a_scene_in_which_nothing_is_free_is_named():
    row = Network([(0, 0), (1, 0)], [(0, 1)], [PRISM], held=[0, 1])
    with pytest.raises(TensegrityError, match="all 2 sites are held or moved, none is free"):
        periodic_orbit(row, row.at_rest(), period=1.0)


@pytest.mark.parametrize(
    ("until", "words"),
    [
        (0, "no period on the way to W 0: its angular frequency, 0 rad/s there, becomes 0"),
        (-1.0, "no period on the way to W -1"),
        (1e-5, "must take at most 4096"),
        ({}, "until {} names no column at which the path ends"),
    ],
)
def test_a_path_that_has_no_end_or_no_period_there_is_refused(until, words):
    t, w = sp.symbols("t W")
    shaker = Drive(force=0.001 * sp.cos(w * t), parameters={"W": 1.65})
    ends, damping = ("fixed", "free"), Damping(ground=0.02)
    chain = Chain(PRISM, 2, ends=ends, damping=damping, drive={1: shaker})
    with pytest.raises(TensegrityError, match=words):
        orbit_path(periodic_orbit(chain, chain.at_rest()), by="W", until=until)


def test_multipliers_of_a_state_that_does_not_return_are_refused():
    orbit = breather(20, 1.05)
    assert floquet(orbit).neutral.size
    off = replace(orbit, state=State(1.01 * orbit.state.u, orbit.state.v))
    with pytest.raises(ResolutionError, match=r"neutral multipliers .* from 1 with \d+ steps"):
        floquet(off)
