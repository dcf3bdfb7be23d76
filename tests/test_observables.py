"""Instruments on exact waves, alone and two far apart, where the right answer is known."""

import numpy as np
import pytest

from tensegrity import (
    Chain,
    Prism,
    Record,
    TensegrityError,
    duration,
    simulate,
    solitary_wave,
    speed,
    tail_front,
)
from tensegrity.measure.observables import pulses

SPRING = Prism(1.0, 0.7, 0.01, 1.0).potential()


@pytest.fixture(scope="module")
def waves():
    return solitary_wave(SPRING, speed_ratio=1.5), solitary_wave(SPRING, speed_ratio=1.2)


@pytest.fixture(scope="module")
def passing(waves):
    """A run of the faster wave over 500 sites, bonds 20 and 520 and their neighbours recorded."""
    fast, _ = waves
    chain = Chain(SPRING, 560)
    sites = (60, 61, 510, 511)
    start = fast.launch(chain, at=30.2)
    record = Record(every=1, sites=sites)
    return simulate(chain, start, 500 / fast.speed, method="rkn6", dt=0.04, record=record)


def test_speed_from_arrivals_is_that_of_the_exact_wave(waves, passing):
    assert speed(passing, (60, 510)) == pytest.approx(waves[0].speed, rel=1e-10)


def test_width_from_a_duration_is_that_of_the_exact_wave(waves, passing):
    for level in (0.05, 0.5):
        measured = duration(passing, 510, level) * waves[0].speed
        assert measured == pytest.approx(waves[0].width(level), rel=1e-6)


def test_energy_and_momentum_of_two_waves_far_apart(waves):
    fast, slow = waves
    chain = Chain(SPRING, 300)
    state = slow.launch(chain, at=60.0) + fast.launch(chain, at=220.5)
    first, second = pulses(chain, state, fraction=0.1)
    for pulse, wave in ((first, fast), (second, slow)):
        assert pulse.energy == pytest.approx(wave.energy, rel=1e-10)
        assert pulse.momentum == pytest.approx(wave.momentum, rel=1e-10)
    assert first.place == pytest.approx(220.5, abs=1e-10)  # on a bond: the samples are even
    assert second.place == pytest.approx(60.0, abs=1e-10)  # on a mass: even again
    assert first.elongation == pytest.approx(fast.amplitude, rel=1e-12)


def test_opposite_momenta_of_waves_that_run_apart(waves):
    fast, slow = waves
    chain = Chain(SPRING, 300)
    state = slow.launch(chain, at=60.0, direction=-1) + fast.launch(chain, at=220.5)
    first, second = pulses(chain, state)
    assert first.momentum == pytest.approx(fast.momentum, rel=1e-10)
    assert second.momentum == pytest.approx(-slow.momentum, rel=1e-10)


def test_waves_that_overlap_are_cut_at_the_least_elongation_between_them(waves):
    """Each site counts once, what is at the cuts included."""
    fast, slow = waves
    chain = Chain(SPRING, 80)
    state = slow.launch(chain, at=40.5) + fast.launch(chain, at=44.5)
    r = np.abs(chain.elongation(state.u))
    first, second = pulses(chain, state)
    least = 40 + int(np.argmin(r[40:45]))
    assert r[least] > 0.01 * r.max()  # or the cut would not matter
    assert (second.last, first.first) == (least, least + 1)
    each = chain.site_energy(state.u, state.v)
    for pulse in (first, second):
        inside = slice(pulse.first, pulse.last + 1)
        assert pulse.energy == pytest.approx(each[inside].sum(), rel=1e-12)
        assert pulse.momentum == pytest.approx((chain.mass * state.v)[inside].sum(), rel=1e-12)
    assert first.energy + second.energy == pytest.approx(chain.energy(state), rel=1e-9)


def test_pulses_are_counted_above_the_stated_fraction(waves):
    fast, slow = waves
    chain = Chain(SPRING, 300)
    state = slow.launch(chain, at=60.5) + fast.launch(chain, at=220.5)
    part = slow.amplitude / fast.amplitude
    assert len(pulses(chain, state, 0.99 * part)) == 2
    assert len(pulses(chain, state, 1.01 * part)) == 1


def test_a_pulse_of_rarefaction_carries_momentum_backward():
    wave = solitary_wave(SPRING, amplitude=0.12)
    chain = Chain(SPRING, 200)
    (pulse,) = pulses(chain, wave.launch(chain, at=90.5))
    assert pulse.elongation == pytest.approx(0.12, rel=1e-12)
    assert pulse.momentum == pytest.approx(wave.momentum, rel=1e-10)
    assert wave.momentum < 0


def test_front_of_what_follows_a_wave(waves):
    fast, slow = waves
    chain = Chain(SPRING, 300)
    state = slow.launch(chain, at=60.5) + fast.launch(chain, at=220.5)
    for level in (0.05, 0.5):
        place = 60.5 + slow.width(level) / 2
        assert tail_front(chain, state, level) == pytest.approx(place, abs=0.1)


def test_nothing_to_measure_is_an_error(waves):
    chain = Chain(SPRING, 300)
    with pytest.raises(TensegrityError, match="undeformed"):
        pulses(chain, chain.at_rest())
    with pytest.raises(TensegrityError, match="fraction 0 "):
        pulses(chain, waves[0].launch(chain, at=150.0), fraction=0)
    alone = waves[0].launch(chain, at=150.5)
    with pytest.raises(TensegrityError, match="follows"):
        tail_front(chain, alone)
