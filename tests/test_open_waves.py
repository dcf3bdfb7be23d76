"""Solitary waves whose peak is beyond a corner of the force, solved in pieces."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad
from scipy.optimize import brentq

from tensegrity import (
    Chain,
    Potential,
    PowerLaw,
    TensegrityError,
    predict,
    simulate,
    solitary_wave,
)

R = sp.Symbol("r")
OPENS = PowerLaw(1.0, 0.5, preload=1.0)  # at r = 1; 2V/r^2 is largest at 4/3


of_energy = cache(lambda energy: solitary_wave(OPENS, energy=energy))
of_peak = cache(lambda peak: solitary_wave(OPENS, amplitude=peak))


@pytest.mark.parametrize(
    "peak",
    [0.999, 1.0, 1.2, *(pytest.param(x, marks=pytest.mark.slow) for x in (1.01, 1.33, 1.3333))],
)
def test_waves_whose_contacts_open_are_found_up_to_the_predicted_peak(peak):
    wave = of_peak(peak)
    assert wave.amplitude == pytest.approx(peak, rel=1e-14)
    assert wave.residual <= 1e-12
    low, high = predict(OPENS)["rarefaction"].speeds
    assert low < wave.speed < high * (1 + 1e-13)


@pytest.mark.slow
def test_a_wave_whose_contacts_open_obeys_its_equation():
    """By SciPy's quadrature of the convolution, between the places where it is not smooth."""
    wave = of_peak(1.2)
    opens = brentq(lambda x: float(wave.elongation(x)) - 1, 0.1, 1.0, xtol=1e-15)
    places = [sign * (opens + j) for sign in (-1, 1) for j in (-2, -1, 0, 1, 2)]
    for x in (0.0, 0.2, opens, 0.6, 1.1, 2.5, -1.3):
        edges = sorted({x - 1, x, x + 1, *(p for p in places if x - 1 < p < x + 1)})

        def mean(y, x=x):
            return (1 - abs(y - x)) * float(OPENS.tension(wave.elongation(y)))

        whole = sum(quad(mean, *part, epsabs=1e-13, limit=200)[0] for part in pairwise(edges))
        assert wave.speed**2 * wave.elongation(x) == pytest.approx(whole, abs=1e-12)


@pytest.mark.parametrize(
    ("energy", "peak"),
    [
        pytest.param(1.4882955912582, 1.2, marks=pytest.mark.slow),
        (3.0, 4 / 3),
        (5.0, 4 / 3),
    ],
)
def test_waves_of_open_contacts_widen_with_their_energy_at_the_last_peak(energy, peak):
    """Their width grows by the energy over that of a site of the flat top, twice V there."""
    wave = of_energy(energy)
    assert wave.energy == pytest.approx(energy, rel=1e-13)
    assert wave.amplitude == pytest.approx(peak, rel=1e-11)
    if energy == 5.0:
        narrow = of_energy(3.0)
        site = 4 / 3 * 1 / 2 + float(OPENS.energy(4 / 3))  # r T/2 + V
        assert wave.width() - narrow.width() == pytest.approx(2.0 / site, rel=1e-9)


@pytest.mark.parametrize("spring", ["opens", "stiffens"])
def test_a_wave_beyond_a_corner_of_the_force_runs_unchanged(spring):
    bends = Potential(sp.Piecewise((R**2 / 2, R > -1), (R**2 / 2 + (R + 1) ** 2, True)), R)
    wave = of_peak(1.2) if spring == "opens" else solitary_wave(bends, amplitude=-2.5)
    spring, chain = wave.potential, Chain(wave.potential, 80)
    start, wanted = wave.launch(chain, at=32), wave.launch(chain, at=42)
    stored = float(spring.energy(np.diff(start.u)).sum()) + 0.5 * float(start.v @ start.v)
    assert stored == pytest.approx(wave.energy, rel=1e-9)
    assert start.v.sum() == pytest.approx(wave.momentum, rel=1e-9)
    run = simulate(chain, start, 10 / wave.speed, tol=1e-7)
    assert np.abs(run.v[-1] - wanted.v).max() < 1e-6 * np.abs(wanted.v).max()
    assert np.ptp(run.u[-1] - wanted.u) < 1e-6 * abs(wave.shift)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"amplitude": 1.4}, r"peak 1\.4 m must be below 1\.33333 m in size, where 2V/r\^2 is"),
        ({"speed": 0.87}, r"speed 0\.87 sites/s must be below speed 0\.866025 sites/s"),
        (
            {"speed": 0.5**0.5},
            r"must be above 0\.707107 sites/s, the sound speed: slower waves have",
        ),
    ],
)
def test_what_lies_beyond_a_plateau_of_the_force_is_refused_with_its_bound(asked, words):
    with pytest.raises(TensegrityError, match=words):
        solitary_wave(OPENS, **asked)


@pytest.mark.slow
@pytest.mark.parametrize("exponent", [0.2, 0.3, 0.7, 0.8, 0.9, 0.95])
@pytest.mark.parametrize("part", [0.1, 0.5, 0.95])
def test_preloaded_power_laws_below_1_have_the_waves_that_are_predicted(exponent, part):
    spring = PowerLaw(2.0, exponent, preload=0.7)
    (family,) = predict(spring).families
    opens = spring.kinks[0][0]
    wave = solitary_wave(spring, amplitude=opens + part * (family.crests[1] - opens))
    assert wave.residual <= 1e-12
    assert family.speeds[0] < wave.speed < family.speeds[1] * (1 + 1e-11)
    near = solitary_wave(spring, amplitude=0.999 * opens)
    assert near.speed < wave.speed


@pytest.mark.parametrize("peak", [0.6, 0.8, 0.97])
def test_waves_whose_peak_is_before_the_corner_are_found_by_energy_too(peak):
    """The search along the family meets peaks beyond it, which are not resolved."""
    spring = PowerLaw(1.0, 0.79, preload=1.0)
    wave = solitary_wave(spring, amplitude=peak)
    assert solitary_wave(spring, energy=wave.energy).amplitude == pytest.approx(peak, rel=1e-13)
