"""Steps of driven runs: what is quick, narrow or has corners in time is seen, not stepped over."""

import numpy as np
import pytest
import sympy as sp
from springs import series

from tensegrity import Chain, Damping, Drive, TensegrityError, simulate

T = sp.Symbol("t")
LINEAR = series()


def pushed(force, sites=3):
    """A row of equal masses, its second pushed: the momentum is the integral of the force."""
    return Chain(LINEAR, sites, drive={1: Drive(force=force)})


def off(scene, impulse, t_end, **how):
    """By how much the mean velocity is off at the end, over the largest velocity in the run."""
    run = simulate(scene, scene.at_rest(), t_end, **how)
    return abs(scene.momentum(run.final) - impulse) / scene.sites / abs(run.v).max()


@pytest.mark.parametrize("corner", [1.234, 3.3, 7.77])
@pytest.mark.parametrize("tol", [1e-5, 1e-7, 1e-9])
def test_tolerances_hold_where_a_drive_has_a_corner(corner, tol):
    scene = pushed(sp.Abs(T - corner))
    assert off(scene, corner**2 / 2 + (10 - corner) ** 2 / 2, 10.0, tol=tol) < tol


@pytest.mark.parametrize("samples", [200, 2000])
def test_tolerances_hold_where_a_drive_is_sampled(samples):
    from scipy.interpolate import CubicSpline

    t = np.linspace(0, 10, samples)
    noise = 0.1 * np.random.default_rng(1).standard_normal(samples)
    impulse = float(CubicSpline(t, noise).integrate(0, 10))
    for tol in (1e-4, 1e-6, 1e-8):
        assert off(pushed((t, noise)), impulse, 10.0, tol=tol) < tol


@pytest.mark.parametrize("how", [{}, {"tol": 1e-6}])
@pytest.mark.parametrize("width", [0.3, 0.03])
def test_a_narrow_pulse_in_a_long_run_is_not_stepped_over(width, how):
    scene = pushed(sp.exp(-(((T - 500.123) / width) ** 2)) / width)
    assert off(scene, np.sqrt(np.pi), 600.0, **how) < 1e-6


def test_a_pulse_between_two_looks_is_no_jump():
    scene = pushed(sp.exp(-(((T - 5.00123) / 3e-4) ** 2)) / 3e-4)
    assert off(scene, np.sqrt(np.pi), 6.0) < 1e-6
    with pytest.raises(TensegrityError, match=r"jumps by .* at t = 4\.9 s"):
        simulate(pushed(sp.Heaviside(T - 4.9)), pushed(0.0).at_rest(), 6.0)


@pytest.mark.parametrize("how", [{}, {"tol": 1e-6}])
def test_steps_follow_a_drive_far_quicker_than_the_springs(how):
    rate = 3000.0
    scene = pushed(rate * sp.sin(rate * T))
    assert off(scene, 1 - np.cos(10 * rate), 10.0, **how) < 1e-6


def test_what_a_scene_says_of_its_functions_of_time_makes_another():
    given = {"drive": {0: Drive(displacement=sp.sin(T) / 9)}}
    one = Chain(LINEAR, 4, **given)
    other = Chain(LINEAR, 4, drive=one.drive, damping=one.damping)
    first, second = (simulate(x, x.at_rest(), 5.0, tol=1e-6) for x in (one, other))
    assert np.array_equal(first.u, second.u)


@pytest.mark.parametrize("rate", [2.0, 1e3, 1e5])
@pytest.mark.parametrize("how", [{}, {"tol": 1e-8}])
def test_steps_follow_dashpots_far_stiffer_than_the_springs(rate, how):
    scene = Chain(LINEAR, 2, damping=Damping(bond=rate))
    run = simulate(scene, scene.at_rest({0: 1.0}), 2.0, **how)
    root = np.sqrt(rate**2 - 2)  # r'' + 2 rate r' + 2 r = 0, r' = -1 at first
    slow, fast = -2 / (rate + root), -rate - root
    exact = -(np.exp(slow * run.t) - np.exp(fast * run.t)) / (slow - fast)
    assert abs(run.u[:, 1] - run.u[:, 0] - exact).max() < 1e-8 * abs(run.u).max()
