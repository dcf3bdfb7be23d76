"""Exact solitary waves: closed forms, identities, chains that carry them, and what has none."""

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    Potential,
    Prism,
    simulate,
    solitary_wave,
)

R = sp.Symbol("r")
TODA = Potential(sp.exp(-R) + R - 1, R, length=1.0)
PRISM = Prism(1.0, 0.7, 0.01, 1.0).potential()


def toda_elongation(kappa, x):
    """M. Toda (1967): exp(-r) - 1 = sinh^2 kappa sech^2(kappa x), c = sinh(kappa)/kappa."""
    return -np.log1p((np.sinh(kappa) / np.cosh(kappa * x)) ** 2)


@pytest.mark.parametrize("kappa", [0.1, 0.8, 2.0])
def test_toda_soliton_by_speed_is_the_closed_form(kappa):
    wave = solitary_wave(TODA, speed=np.sinh(kappa) / kappa)
    x = np.linspace(-30 / kappa, 30 / kappa, 1001)
    error = np.abs(wave.elongation(x) - toda_elongation(kappa, x)).max()
    assert error < 1e-12 * abs(wave.amplitude)
    assert wave.residual < 1e-12


def test_toda_soliton_by_amplitude_has_its_closed_speed_momentum_and_energy():
    kappa = 1.3
    wave = solitary_wave(TODA, mass=1.0, amplitude=float(toda_elongation(kappa, 0.0)))
    assert wave.speed == pytest.approx(np.sinh(kappa) / kappa, rel=1e-12)
    # u behind the soliton: log cosh(y - kappa) - log cosh(y) from one end to the other
    assert wave.shift == pytest.approx(2 * kappa, rel=1e-12)
    assert wave.momentum == pytest.approx(2 * np.sinh(kappa), rel=1e-12)
    assert wave.energy == pytest.approx(np.sinh(2 * kappa) - 2 * kappa, rel=1e-12)


@pytest.mark.parametrize("ratio", [1.001, 1.01, 1.05, 1.3, 2.0, 5.0])
@pytest.mark.parametrize("shape", [(0.7, 0.01), (0.6, 0.001), (0.8, 0.02)])
def test_residual_off_the_grid_is_round_off_up_to_0_97_of_the_stroke(shape, ratio):
    spring = Prism(1.0, *shape, 1.0).potential()
    last = solitary_wave(spring, amplitude=0.97 * spring.domain[0])
    if ratio < last.speed_ratio:
        wave = solitary_wave(spring, speed_ratio=ratio)
        assert wave.residual <= 1e-12
        assert wave.speed_ratio == pytest.approx(ratio, rel=1e-14)
    assert last.residual <= 1e-12


def test_wave_launched_on_a_chain_keeps_its_shape_over_500_sites():
    wave = solitary_wave(PRISM, speed_ratio=1.3)
    chain = Chain(PRISM, 600)
    start = wave.launch(chain, at=40.3)
    assert chain.energy(start) == pytest.approx(wave.energy, rel=1e-12)
    run = simulate(chain, start, 500 / wave.speed, method="rkn6", dt=0.05)
    there = wave.launch(chain, at=540.3)
    r = chain.elongation(run.final.u) - chain.elongation(there.u)
    assert np.max(np.abs(r)) < 1e-9 * abs(wave.amplitude)
    assert np.max(np.abs(run.final.v - there.v)) < 1e-9 * np.max(np.abs(there.v))
