"""Instruments on exact waves, alone and two far apart, where the right answer is known."""

import math

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
    width,
)
from tensegrity.measure.observables import passage
from tensegrity.root import root

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


def test_a_passage_is_exact_where_the_rate_is_a_polynomial_of_ninth_degree():
    """At unequal instants, one of which may be the passage itself."""
    t = np.array([0.0, 0.3, 0.5, 0.9, 1.2, 1.4, 1.9, 2.1, 2.4, 2.5])
    for peak in (1.27, 1.4):
        integral = np.polynomial.Polynomial.fromroots([peak] + [-1.0] * 8).integ()
        instant = passage(t, integral(t) - integral(5.0), integral.deriv()(t))
        assert instant == pytest.approx(peak, abs=1e-14)


def test_a_passage_is_found_to_tenth_order_in_the_recording_interval():
    """The peak of x/2 - cosh x, elongation of a pulse that is steeper behind."""
    peak, errors = math.asinh(0.5), []
    for interval in (0.4, 0.2):
        t = peak + interval * (np.arange(-12, 13) + 0.37)
        errors.append(abs(passage(t, t / 2 - np.cosh(t) + 40, 0.5 - np.sinh(t)) - peak))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(10, abs=0.3)


def test_width_from_a_duration_is_that_of_the_exact_wave(waves, passing):
    for level in (0.05, 0.5):
        measured = duration(passing, 510, level) * waves[0].speed
        assert measured == pytest.approx(waves[0].width(level), rel=1e-6)


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
        tail_front(chain, chain.at_rest())
    alone = waves[0].launch(chain, at=150.5)
    with pytest.raises(TensegrityError, match="follows"):
        tail_front(chain, alone)


def test_a_width_needs_increasing_positions():
    x = np.linspace(-3, 3, 61)
    with pytest.raises(TensegrityError, match=r"x must increase, not by -0\.1"):
        width(x[::-1], np.exp(-(x**2)))


def test_signs_are_told_apart_where_their_product_overflows_or_vanishes():
    for size in (1e-200, 1e200):
        assert root(lambda x, size=size: size * (x - 0.25), 0.0, 1.0) == 0.25
        with pytest.raises(ValueError, match="no change of sign"):
            root(lambda x, size=size: size * (x + 1), 0.0, 1.0)
