"""The composite claim: what interfaces of prisms reflect and transmit."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from figures import _composite, _stored, composite
from figures._composite import KINDS
from tensegrity import Prism, Record, budget, interface, simulate, solitary_wave

FIRST, SECOND = _composite.FOUND
RESULTS, _ = _stored.read(_stored.DATA / "composite_data.npz")
BACK, PRESSED, _, TRAIN = KINDS


@pytest.mark.parametrize("seed", range(4))
def test_what_the_far_chain_holds_is_what_the_incident_wave_brought_less_what_stays(seed):
    """Momentum, on random interfaces: of the sites, and as the impulse of the bond between."""
    rng = np.random.default_rng(seed)
    near, far = (
        Prism(1.0, *rng.uniform((0.6, 0.02), (1.0, 0.2)), rng.uniform(0.2, 1)).potential()
        for _ in range(2)
    )
    masses = tuple(rng.uniform(0.5, 2, 2))
    peak = -0.3 * rng.uniform() * near.domain[1] - 0.02
    wave = solitary_wave(near, masses[0], amplitude=max(peak, 0.3 * near.domain[0]))
    chain, away = interface(near, far, (60, 61), masses), wave.reach(1e-10) + 2
    sound = max(near.sound_speed(masses[0]), far.sound_speed(masses[1]), wave.speed)
    state, t_end = wave.launch(chain, 60 - away, tail=1e-10), away / wave.speed + 20 / sound
    run = simulate(chain, state, t_end, method="rkn6", tol=None, record=Record(every=1))
    momentum = chain.mass * run.v
    near_part, far_part = momentum[:, :60].sum(axis=1), momentum[:, 60:].sum(axis=1)
    assert np.abs((near_part + far_part) / wave.momentum - 1).max() < 1e-9
    passed = budget(run, 59)
    assert abs(far_part[-1]) > 0.05 * abs(wave.momentum)
    assert passed.impulse[-1] == pytest.approx(far_part[-1] - far_part[0], rel=1e-5)


@pytest.mark.parametrize("name", [FIRST, SECOND])
def test_interfaces_are_from_acoustically_hard_to_soft(name):
    real = _composite.made(_composite.FOUND[name])
    near, far = real.sounds
    assert far < near
    assert real.masses[1] * far < real.masses[0] * near


def test_the_polynomial_of_the_near_chain_is_the_prism():
    real = _composite.made(_composite.FOUND[FIRST])
    one = dict(zip(_composite.NAMES, _composite.FOUND[FIRST], strict=True))
    load = one["preload"] * one["k_cross far"] * one["base far"]
    prism = Prism(1.0, one["height near"], one["prestrain near"], 1.0,
                  k_base=one["k_base near"], k_bar=one["k_bar near"]).potential(load)  # fmt: skip
    r = np.linspace(*real.near.domain, 101)[1:-1]
    exact = prism.tension(r)
    np.testing.assert_allclose(real.near.tension(r), exact, atol=1e-10 * np.abs(exact).max())


def test_both_interfaces_reflect_and_transmit_what_the_page_says():
    """As stored; the compressions leave late and one after the other."""
    tables = RESULTS
    (back,) = composite.solitary(tables, FIRST, BACK)
    assert back["energy"] == pytest.approx(0.290, abs=0.001)
    first, second = composite.solitary(tables, FIRST, TRAIN)
    assert first["energy"] == pytest.approx(0.0292, abs=5e-4)
    assert 100 < first["delay"] < second["delay"] - 50
    (pressed,) = composite.solitary(tables, SECOND, PRESSED)
    assert pressed["energy"] == pytest.approx(0.646, abs=0.002)
    for name in _composite.FOUND:
        assert tables[name]["momentum error"] < 1e-9
        assert tables[name]["largest change of a peak at half the step"] < 1e-3
    for shown in composite.SHOWN:
        one = tables[shown]
        exact = np.interp(one["bond"], one["x"], one["exact"])
        np.testing.assert_allclose(one["elongation"], exact, atol=0.05 * np.abs(exact).max())


def test_words_and_pictures_are_made_of_what_was_computed():
    figure = plt.figure(layout="constrained")
    composite.draw(figure, RESULTS)
    plt.close(figure)
    for row in composite.table(RESULTS):
        assert all(row.values())
