"""Solitary waves of pair laws with a coordinate that is not free, and their tails."""

import math
from functools import cache

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    PairLaw,
    TensegrityError,
    dispersion,
    floquet,
    simulate,
    solitary_wave,
    transition_wave,
)

TILT, INERTIA = 0.35, 1 / (4 * 1.815**2)
u, a, v, U, A, V = sp.symbols("u a v U A V")


def turning(tilt=TILT, ks=0.01851, kt=3.835e-5, length=1):
    """Rigid units on hinges in a row: energies of a bond and of a site."""
    arm = length / (2 * sp.cos(tilt))
    along = U - u + arm * (2 * sp.cos(tilt) - sp.cos(tilt + a) - sp.cos(tilt + A))
    across = arm * (sp.sin(tilt + A) - sp.sin(tilt + a))
    kt = kt * length**2
    return along**2 / 2 + ks * across**2 / 2 + kt * (a + A) ** 2 / 2, 2 * kt * a**2


BOND, SITE = turning()
PAIR = PairLaw(BOND, (u, a), (U, A), site=SITE)


def row(pair=PAIR, sites=8, mass=(1.0, INERTIA)):
    return Chain(pair, sites, mass=mass)


@cache
def wave(**speed):
    return solitary_wave(row(), **speed)


@pytest.mark.parametrize(
    ("ratio", "difference", "turn", "energy"),
    [
        (0.8, -0.0856833486729, 0.187849809054, 0.00016717968108),
        (0.7, -0.171668818761, 0.330006137439, 0.00039921722574),
    ],
)
def test_waves_slower_than_sound_are_those_of_another_computation(ratio, difference, turn, energy):
    """In units.json, from a collocation of their own grid."""
    found = wave(speed_ratio=ratio)
    assert found.sound_speed == pytest.approx(0.047929345739371, rel=1e-12)
    assert found.elongation(0.0) == pytest.approx((difference, turn), rel=1e-11)
    assert found.energy == pytest.approx(energy, rel=1e-10)
    assert (found.family, found.tail) == ("compression", None)
    assert found.residual < 1e-11  # forces that cancel: round-off
    assert found.speed_ratio == pytest.approx(ratio, rel=1e-14)


def test_a_wave_is_unchanged_after_thirty_units():
    found, chain = wave(speed_ratio=0.7), row(sites=470)
    start = found.launch(chain, 217.0)
    assert chain.energy(start) == pytest.approx(found.energy, rel=1e-11)
    assert chain.momentum(start) == pytest.approx([found.momentum], rel=1e-11)
    run = simulate(chain, start, 30 / found.speed, method="rkn6", dt=0.1)
    there = found.launch(chain, 247.0)
    assert np.abs(run.final.u - there.u).max() < 3e-12
    assert np.abs(run.final.v - there.v).max() < 3e-12
    back = found.launch(chain, 217.0, direction=-1)
    assert back.u[:, 1] == pytest.approx(start.u[:, 1], abs=1e-15)
    assert back.v[:, 1] == pytest.approx(-start.v[:, 1], abs=1e-15)


def unbalanced(found, chain, x, h=0.02):
    """Inertial forces minus forces of sites at x but the first and last, over the largest of each
    coordinate: the rate by differences of order 8, at places that are on no grid."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    slope = sum(w * (found.rate(x + k * h) - found.rate(x - k * h)) for k, w in weights.items()) / h
    forces = chain.forces(found.displacement(x))
    wrong = (found.speed**2 * slope * chain.mass - forces)[1:-1]
    return np.abs(wrong).max(axis=0), np.abs(forces[1:-1]).max(axis=0)


@pytest.mark.parametrize("speed", [{"speed_ratio": 0.8}, {"speed_ratio": 0.7}, {"speed": 0.5}])
def test_accelerations_between_the_points_of_the_grid_are_those_of_the_forces(speed):
    wrong, forces = unbalanced(wave(**speed), row(sites=12), np.arange(12) - 5.37)
    assert wrong.max() < 3e-13
    assert forces.max() > 5e-6


@pytest.mark.parametrize(("length", "k"), [(1e-6, 1e7), (100.0, 1.0)])
def test_waves_are_those_in_other_units(length, k):
    """A coordinate of length beside an angle, and angles of units that slide in other ones."""
    bond, site = turning(length=length)
    chain = row(PairLaw(k * bond, (u, a), (U, A), site=k * site), mass=(1.0, INERTIA * length**2))
    found, exact = solitary_wave(chain, speed_ratio=0.8), wave(speed_ratio=0.8)
    assert found.amplitude / [length, 1] == pytest.approx(exact.amplitude, rel=1e-10)
    assert found.energy == pytest.approx(exact.energy * k * length**2, rel=1e-9)
    assert found.width() == pytest.approx(exact.width(), rel=1e-8)
    arc = {a: a / length, A: A / length}  # the angle in metres of its arc
    law = PairLaw(k * bond.subs(arc), (u, a), (U, A), site=k * site.subs(arc))
    found = solitary_wave(row(law, mass=(1.0, INERTIA)), speed=0.5 * math.sqrt(k))
    assert found.amplitude[1] / length == pytest.approx(-0.6365, abs=2e-3)
    assert 5e-4 < found.tail.amplitude / length < 2e-3


@pytest.mark.parametrize("excess", [-1e-3, -1e-4])
def test_waves_near_sound_have_the_profile_of_korteweg_and_de_vries(excess):
    """Their peaks over the excess have a limit, with corrections of the order of the excess; forces
    of second differences as small as these cancel."""
    found, twice = wave(excess=excess), wave(excess=2 * excess)
    assert found.speed_ratio - 1 == pytest.approx(excess, rel=1e-9)
    assert found.amplitude[1] / excess == pytest.approx(-0.7317458, rel=3 * abs(excess))
    rise = twice.amplitude / found.amplitude / 2 - 1
    assert np.all((rise > 0) & (rise < 3 * abs(excess)))
    half = found.width(0.5) / 2
    kappa = 2 * math.acosh(math.sqrt(2)) / half
    x = half * np.array([0.5, 2.0])
    shape = found.elongation(x)[:, 1] / found.amplitude[1]
    assert shape == pytest.approx(1 / np.cosh(kappa * x / 2) ** 2, rel=5 * abs(excess))
    assert found.residual < 1e-9


def test_several_coordinates_may_not_be_free():
    """Hinges that also bend across, coupled to the angle."""
    bond = BOND + (V + v) ** 2 / 8000 + (V + v) * (A + a) / 20000 + (v + V) * (a**2 + A**2) / 9000
    pair = PairLaw(bond, (u, a, v), (U, A, V), site=SITE + v**2 / 8000)
    chain = row(pair, sites=12, mass=(1.0, INERTIA, 0.3))
    found = solitary_wave(chain, speed_ratio=0.9)
    assert np.all(np.abs(found.amplitude) > 1e-4)
    assert found.amplitude == pytest.approx(found.elongation(0.0), rel=1e-12)
    wrong, forces = unbalanced(found, chain, np.arange(12) - 5.37)
    assert np.all(wrong < 1e-7 * forces + 3e-13)
    assert np.all(forces > 1e-8)


def test_faster_waves_have_tails_and_are_never_small():
    """The gap in amplitude: long waves have their peak near -2 (tan b - S)."""
    found = wave(speed=0.5)
    assert found.elongation(0.0)[1] == pytest.approx(-0.636, abs=2e-3)
    assert 5e-4 < found.tail.amplitude < 2e-3
    assert found.tail.change > 1e-4  # with the period
    upper = dispersion(PAIR, (1.0, INERTIA), [found.tail.wavenumber])[0, 1]
    assert upper == pytest.approx(0.5 * found.tail.wavenumber, rel=1e-12)
    far = found.elongation(np.linspace(0.8, 1.0, 300) * found.x[-1])[:, 1]
    assert np.abs(far).max() == pytest.approx(found.tail.amplitude, rel=0.05)
    assert "tail" in str(found)
    assert 1e-2 < wave(speed=0.8).tail.amplitude < 6e-2


def test_the_tail_of_a_wave_slower_than_sound_has_a_wavenumber_of_the_second_zone():
    bond, site = turning(math.radians(25), 0.0185, 1.5e-4)
    chain = row(PairLaw(bond, (u, a), (U, A), site=site), mass=(1.0, 1 / 12.96))
    found = solitary_wave(chain, speed_ratio=0.8)
    assert found.elongation(0.0)[1] == pytest.approx(0.24559346, abs=2e-9)
    assert 3e-10 < found.tail.amplitude < 7e-9
    k = found.tail.wavenumber
    assert math.pi < k < 2 * math.pi
    lower = dispersion(chain.springs[3], (1.0, 1 / 12.96), [k])[0, 0]
    assert lower == pytest.approx(found.speed * k, rel=1e-12)


def test_waves_near_sound_are_as_small_as_one_likes():
    """S - tan b, from the equations of long waves."""
    t, c2 = math.tan(TILT), (0.9 * 0.047929345739371) ** 2
    small = 2 * (math.sqrt(8 * 3.835e-5 * (1 - c2) / c2) - t)
    assert wave(excess=-0.1).elongation(0.0)[1] == pytest.approx(small, rel=0.05)


def test_coordinates_may_have_any_order_and_others_may_be_at_rest():
    turned = PairLaw(BOND, (a, u), (A, U), site=SITE)
    found = solitary_wave(row(turned, mass=(INERTIA, 1.0)), speed_ratio=0.7)
    exact = wave(speed_ratio=0.7)
    x = np.linspace(-9, 9, 7)
    for name in ("elongation", "rate", "displacement"):
        both = (getattr(one, name)(x) for one in (found, exact))
        np.testing.assert_allclose(next(both)[:, ::-1], next(both), atol=1e-12)
    assert found.family == "rarefaction"  # its first coordinate is the angle
    assert found.shift == pytest.approx([0.0, exact.shift[0]])
    three = PairLaw(BOND + (V - v) ** 2 / 2000, (u, v, a), (U, V, A), site=SITE)
    found = solitary_wave(row(three, mass=(1.0, 1.0, INERTIA)), speed=exact.speed)
    assert found.elongation(0.0) == pytest.approx(np.insert(exact.elongation(0.0), 1, 0), rel=4e-11)


def refused():
    yield "1.1 of sound: the equations of long waves have none", row(), {"speed_ratio": 1.1}
    yield "no solitary wave of rarefaction", row(), {"speed_ratio": 0.8, "family": "rarefaction"}
    yield "must be 'compression' or", row(), {"speed_ratio": 0.8, "family": "fast"}
    yield "speed_ratio 0 must be above 0", row(), {"speed_ratio": 0.0}
    yield "excess -1 must be above -1", row(), {"excess": -1.0}
    yield "speed_ratio nan", row(), {"speed_ratio": math.nan}
    yield "no solitary wave", row(), {"speed": 1e300}
    yield "no solitary wave|not resolved", row(), {"speed": 1e-300}
    yield "amplitude given", row(), {"amplitude": 0.1}
    yield "energy given", row(), {"energy": 0.1}
    yield "alone", row(), {"speed_ratio": 0.8, "mass": 2.0}
    yield "mass given", row(), {"speed_ratio": 0.999, "mass": 3.0}
    skew = PairLaw(BOND + (A - a) * (U - u) / 100 + (A - a) ** 2, (u, a), (U, A), site=SITE)
    yield "ends are exchanged", row(skew), {"speed_ratio": 0.8}
    alone = PairLaw((A + a) ** 2 + (A - a) ** 4, a, A)
    yield "another one must be", row(alone, mass=(1.0,)), {"speed": 0.8}
    two = PairLaw((U - u) ** 2 + (A + a) ** 2 + (V + v) ** 2, (u, a, v), (U, A, V))
    yield "no curvature", row(two, mass=(1.0,) * 3), {"speed": 0.8}
    loose = PairLaw(BOND - (a + A) ** 2, (u, a), (U, A))
    yield "not stable at rest", row(loose), {"speed": 0.5}
    masses = np.ones((8, 2))
    masses[3] = 2
    yield "masses of a column", row(mass=masses), {"speed_ratio": 0.8}
    yield (
        "springs of a column",
        row([PAIR] * 6 + [PairLaw(BOND, (u, a), (U, A), site=SITE * 2)]),
        {"speed_ratio": 0.8},
    )


@pytest.mark.parametrize("number", range(len(list(refused()))))
def test_what_has_no_such_wave_is_refused(number):
    words, chain, given = list(refused())[number]
    with pytest.raises(TensegrityError, match=words):
        solitary_wave(chain, **given)


def test_what_is_not_computed_of_pair_laws_is_refused_by_name():
    with pytest.raises(TensegrityError, match="needs its inertias"):
        solitary_wave(PAIR, speed_ratio=0.8)
    with pytest.raises(TensegrityError, match="fronts of a pair law"):
        transition_wave(PAIR, ahead=0.0, behind=1.0)
    with pytest.raises(TensegrityError, match="several components"):
        floquet(wave(speed_ratio=0.8))
