"""Polynomials in place of a tension: their errors, as estimated, and runs that choose them."""

import doctest
import subprocess
import sys
from functools import cache
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from extended import extended
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import stepped

from derivations import prism as derived_prism
from derivations import rigid_elastic as derived
from tensegrity import (
    Chain,
    LockingError,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    RangeError,
    Record,
    ResolutionError,
    State,
    TensegrityError,
    simulate,
)
from tensegrity.springs import polynomial

RIGID = Prism(1.0, 0.8, 0.02, 1.0).potential()
SOFT = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(0.05)
R = sp.Symbol("r")
TODA = Potential(sp.exp(-R) + R - 1, R)


def true_error(fit, spring):
    """Largest error of the tension over the largest tension, on a dense sample."""
    r = np.linspace(*fit.domain, 3001)[1:-1]
    exact = spring.tension(r)
    return np.abs(fit.tension(r) - exact).max() / np.abs(exact).max()


# --- the fit ---------------------------------------------------------------------------------


CASES = {
    "narrow": (RIGID, -0.012, 0.012),
    "wide": (RIGID, -0.04, 0.02),
    "most of the stroke": (RIGID, 0.9 * RIGID.domain[0], 0.01),
    "Toda": (TODA, -1.0, 0.5),
    "elastic": (SOFT, -0.1, 0.05),
    "elastic, to the end": (SOFT, *SOFT.domain),
    "contact that stays closed": (PowerLaw(1.0, 1.5, preload=1.0), -0.3, 0.3),
}


@pytest.mark.parametrize("error", [1e-5, 1e-7, 1e-10])
@pytest.mark.parametrize("name", CASES)
def test_error_estimate_is_right_within_a_hundredth(name, error):
    spring, low, high = CASES[name]
    if name == "most of the stroke":
        error = max(error, 1e-7)
    fit = Polynomial(spring, low, high, error)
    assert type(fit.error_estimate) is float
    assert fit.error_estimate <= error
    actual = true_error(fit, spring)
    assert actual <= fit.error_estimate / np.cos(np.pi / 20) + 1e-14
    assert fit.error_estimate <= 10 * actual


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.33, 1.5), st.floats(-3, -1), st.floats(0.02, 0.85), st.floats(0.01, 0.2),
    st.floats(-11, -4),
)  # fmt: skip
def test_error_estimate_holds_for_any_rigid_prism_and_range(height, prestrain, low, high, digits):
    spring = Prism(1.0, height, 10**prestrain, 1.0).potential()
    low, high = low * spring.domain[0], high * min(spring.domain[1], height / 5)
    try:
        fit = Polynomial(spring, low, high, 10**digits)
    except ResolutionError:
        assert high - low > 0.3 * -spring.domain[0]  # never for a small range
        return
    assert fit.error_estimate <= 10**digits
    assert true_error(fit, spring) <= fit.error_estimate + 1e-14


def exact_tension(fields):
    """Tension of a rigid prism at 50 digits, from V(h) as it is derived."""
    bar = sp.sqrt(derived_prism.at_reference(derived_prism.bar_length_squared()))
    form = derived.force(1).subs(
        {
            derived.bar: bar,
            derived.circumradius: derived_prism.CIRCUMRADIUS,
            derived.natural_cross: derived_prism.natural_lengths()[0],
            derived.k_cross: fields[3],
        }
    )
    arguments = (
        derived.height, derived_prism.base, derived_prism.reference_height, derived_prism.prestrain,
    )  # fmt: skip
    force, (base, height, prestrain) = sp.lambdify(arguments, form, "mpmath"), fields[:3]
    return lambda r: force(mpmath.mpf(height) + mpmath.mpf(r), base, height, prestrain)


@pytest.mark.parametrize("error", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize(("low", "high"), [(-0.012, 0.012), (-0.04, 0.02)])
def test_error_estimate_holds_where_the_error_is_worst(low, high, error):
    """At the peaks of the error, at rest and at both ends, against 50 digits."""
    fit = Polynomial(RIGID, low, high, error)
    r = np.linspace(low, high, 20_001)[1:-1]
    gap = np.abs(fit.tension(r) - RIGID.tension(r))
    peaks = r[np.argsort(gap)[-30:]]
    tiny = np.array([-1e-9, -1e-300, 1e-300, 1e-9])
    ends = np.nextafter([low, high], 0)
    worst, peak = 0.0, np.abs(RIGID.tension(ends)).max()
    with mpmath.workdps(50):
        exact = exact_tension((1.0, 0.8, 0.02, 1.0))
        for x in np.concatenate([peaks, tiny, ends]).tolist():
            worst = max(worst, float(abs(mpmath.mpf(float(fit.tension(x))) - exact(x))))
    assert worst <= fit.error_estimate / np.cos(np.pi / 20) * peak + 1e-15 * peak


def test_an_error_that_no_node_sees_is_estimated():
    """A ripple that vanishes at all nodes."""
    ripple, angle = 1e-3, sp.acos(R)
    n = polynomial.NODES
    waves = sp.cos((n + 1) * angle) / (n + 1) - sp.cos((n - 1) * angle) / (n - 1)
    spring = Potential(R**2 / 2 + ripple / 2 * waves, R, domain=(-1, 1))
    fit = Polynomial(spring, -1, 1, 0.01)
    assert fit.degree == 7
    assert fit.error_estimate == pytest.approx(1.05 * true_error(fit, spring), rel=0.02)
    assert fit.error_estimate > ripple
    with pytest.raises(ResolutionError):
        Polynomial(spring, -1, 1, 1e-4)


@pytest.mark.parametrize("spring", [RIGID, SOFT, TODA])
def test_energy_is_the_exact_antiderivative(spring):
    """Gauss' rule of 30 points is exact up to degree 59."""
    fit = Polynomial(spring, -0.04, 0.02, 1e-9)
    x, w = np.polynomial.legendre.leggauss(30)
    for r in (-0.0399, -0.01, 1e-7, 0.0199):
        integral = np.sum(w * fit.tension(r / 2 * (1 + x))) * r / 2
        assert float(fit.energy(r)) == pytest.approx(integral, rel=1e-12)
    r = np.linspace(-0.039, 0.019, 9)
    step = 1e-5
    for lower, upper in (("tension", "stiffness"), ("stiffness", "stiffness_slope")):
        slope = (getattr(fit, lower)(r + step) - getattr(fit, lower)(r - step)) / (2 * step)
        np.testing.assert_allclose(slope, getattr(fit, upper)(r), rtol=1e-4, atol=1e-4)


def test_what_is_at_rest_stays_at_rest():
    assert float(Polynomial(RIGID, -0.04, 0.01, 1e-4).tension(0.0)) == 0
    loose = Potential(R**2 / 2 + 0.3 * R + R**4, R)  # no equilibrium at 0
    assert float(Polynomial(loose, -0.5, 0.4).tension(0.0)) == float(loose.tension(0.0))


def test_equal_degrees_share_a_law():
    one, other = Polynomial(RIGID, -0.012, 0.012, 1e-9), Polynomial(SOFT, -0.1, 0.05, 1e-11)
    assert one.degree == other.degree
    assert one.law == other.law
    assert Polynomial(RIGID, -0.012, 0.012, 1e-9) == one != other


def test_a_wider_range_takes_a_higher_degree_until_none_will_do():
    degrees = [Polynomial(RIGID, part * RIGID.domain[0], 0.01, 1e-8).degree
               for part in (0.1, 0.3, 0.5, 0.7)]  # fmt: skip
    assert degrees == sorted(degrees)
    assert degrees[-1] > degrees[0] + 4
    with pytest.raises(ResolutionError, match=r"error 1e-08 .* must be at least"):
        Polynomial(RIGID, 0.97 * RIGID.domain[0], 0.01, 1e-8)


@pytest.mark.parametrize(
    ("spring", "low", "high", "kind", "words"),
    [
        (RIGID, 0.0, 0.01, TensegrityError, "must contain 0"),
        (RIGID, -0.01, -0.02, TensegrityError, "must contain 0"),
        (RIGID, -0.06, 0.01, LockingError, "bars meet"),
        (SOFT, -0.1, 0.4, LockingError, "unloaded"),
        (PowerLaw(1.0, 1.5), -0.1, 0.1, ResolutionError, "must be at least"),
        (RIGID, -1e-310, 1e-310, TensegrityError, "width of the range .* must be at least"),
    ],
)
def test_impossible_fits_are_refused(spring, low, high, kind, words):
    with pytest.raises(kind, match=words):
        Polynomial(spring, low, high, 1e-12)
    with pytest.raises(TensegrityError, match="error"):
        Polynomial(RIGID, -0.01, 0.01, 0.0)


def test_a_prism_that_softens_to_its_limit_point_is_fitted_over_it():
    """Where the stiffness is zero, and past it; the fold is where the exact one is."""
    r = np.linspace(*SOFT.domain, 4001)
    fold = r[np.flatnonzero(np.diff(np.sign(SOFT.stiffness(r))))[-1]]
    assert SOFT.domain[0] < fold < 0
    ends_there, beyond = (Polynomial(SOFT, low, 0.1, 1e-11) for low in (fold, 1.2 * fold))
    for fit in (ends_there, beyond):
        inner = np.linspace(fold, 0.1, 99)[1:-1]
        np.testing.assert_allclose(fit.stiffness(inner), SOFT.stiffness(inner), atol=1e-8)


def test_docstring_example_prints_what_it_says():
    assert doctest.testmod(polynomial) == (0, 5)


# --- runs ------------------------------------------------------------------------------------


def test_a_rough_polynomial_keeps_its_own_energy():
    spring = Polynomial(SOFT, -0.15, 0.15, 1e-3)
    chain = Chain(spring, 40)
    run = simulate(chain, chain.at_rest({0: 0.1}), 40.0, method="rkn6", dt=0.01)
    assert run.energy_error < 2e-13
    assert run.force_model.startswith("polynomial of degree 7 on [-0.15")


def test_the_loop_takes_polynomials():
    spring = Polynomial(RIGID, -0.02, 0.02, 1e-10)
    chain = Chain([spring] * 70 + [Polynomial(SOFT, -0.1, 0.1, 1e-10)] * 60, 131)
    state = State(0.009 * np.sin(np.arange(131.0) ** 2), np.zeros(131))
    v = simulate(chain, state, 0.1, dt=0.1, method="verlet").final.v
    plain = stepped(chain, state, "verlet", 0.1, 1)
    np.testing.assert_allclose(v, plain.v, rtol=0, atol=1e-15)


def test_leaving_the_range_ends_the_run_with_numbers_and_keeps_what_was_done():
    chain = Chain(Polynomial(RIGID, -0.01, 0.01), 64)
    words = r"at or below -0.01 m, where the range of the polynomial ends.*sites 0 and 1.*t = "
    with pytest.raises(RangeError, match=words) as caught:
        simulate(chain, chain.at_rest({0: 0.1}), 60.0, dt=0.01)
    run = caught.value.run
    assert np.isfinite(run.u).all()
    assert chain.elongation(run.u).min() > -0.01


def soft_blow(sites=600):
    chain = Chain(SOFT, sites, ends=("fixed", "free"))
    return chain, chain.at_rest({1: 0.15})


def error_of(run, u, v):
    return max(
        float(np.max(np.abs(run.final.u - u)) / np.max(np.abs(run.u))),
        float(np.max(np.abs(run.final.v - v)) / np.max(np.abs(run.v))),
    )


def fitted_degree(run):
    """Of the polynomial that took part in it."""
    assert "polynomial of degree" in str(run)
    return int(run.force_model.removeprefix("polynomial of degree ").split()[0])


@cache
def reference(t_end):
    """The last u and v by the exact law in extended precision."""
    return extended(*soft_blow(), "rkn6", 1 / 30, round(30 * t_end))


@pytest.mark.needs_extended
def test_a_tolerance_is_kept_with_polynomials_that_get_better_with_it():
    """Against the exact law in extended precision; fitted to more than all that was met."""
    (chain, state), degrees = soft_blow(), []
    for tol in (1e-5, 1e-7, 1e-10):  # at 1e-4 the exact law is as cheap
        run = simulate(chain, state, 15.0, tol=tol)
        degrees.append(fitted_degree(run))
        assert error_of(run, *reference(15.0)) < tol
        assert run.error_estimate < tol
        assert np.isclose(run.energy[-1], chain.energy(run.final), rtol=1e-15)  # the exact one
        low, high = (float(x) for x in run.force_model.split("[")[1].split("]")[0].split(", "))
        assert low < run.elongation_range[0, 0] < 0 < run.elongation_range[0, 1] < high
    assert degrees == sorted(set(degrees))


def test_a_fit_whose_error_shows_in_the_motion_is_refined(monkeypatch):
    chain, state = soft_blow()
    usual = simulate(chain, state, 40.0, tol=1e-9)
    monkeypatch.setattr("tensegrity.runs.tolerance.FIRST_ERROR", 1e5)
    run = simulate(chain, state, 40.0, tol=1e-9)
    low, high = run.elongation_range[0]
    rough = Polynomial(chain.springs[0], low, high, 1e-4).degree
    assert rough < fitted_degree(run) <= fitted_degree(usual)
    assert error_of(run, usual.final.u, usual.final.v) < 1e-9


def test_a_range_left_is_widened(monkeypatch):
    """With all energy in one spring too little, runs leave the narrower ranges, which come first
    where a high degree is not wanted."""
    chain, state = soft_blow()
    usual = simulate(chain, state, 40.0, tol=1e-7)
    monkeypatch.setattr("tensegrity.runs.tolerance.MODEST", 7)
    run = simulate(chain, state, 40.0, tol=1e-7)
    assert run.force_model == usual.force_model
    assert np.array_equal(run.final.u, usual.final.u)
    low, high = (float(x) for x in run.force_model.split("[")[1].split("]")[0].split(", "))
    assert low < run.elongation_range[0, 0]
    assert run.elongation_range[0, 1] < high
    monkeypatch.setattr("tensegrity.runs.tolerance.RANGES", 0)
    assert simulate(chain, state, 40.0, tol=1e-7).force_model == "exact"


def test_fits_of_earlier_runs_change_no_bit():
    """What a process ran before, also with the same springs, leaves no trace."""
    code = """
from test_polynomial import SOFT
from tensegrity import Chain, simulate
for velocity, tol in (*BEFORE, (0.1, 1e-7)):
    chain = Chain(SOFT, 300)
    run = simulate(chain, chain.at_rest({0: velocity}), 40.0, tol=tol)
print(run.force_model, run.error_estimate.hex(), run.final.u.tobytes().hex())
"""
    found = {
        subprocess.run(
            [sys.executable, "-c", code.replace("BEFORE", repr(before))],
            cwd=Path(__file__).parent, capture_output=True, text=True, check=True,
        ).stdout
        for before in ((), ((0.103, 2e-7), (0.05, 1e-5), (0.1, 1e-7), (0.2, 1e-9)))
    }  # fmt: skip
    assert len(found) == 1
    assert "polynomial" in found.pop()


def test_contacts_that_open_stay_exact():
    """No polynomial comes near a stiffness that has a kink."""
    chain = Chain(PowerLaw(1.0, 1.5), 2000)
    assert simulate(chain, chain.at_rest({0: 1.0}), 10.0, tol=1e-5).force_model == "exact"


def test_runs_without_a_tolerance_and_short_ones_are_exact():
    chain, state = soft_blow(10)
    for options in ({"tol": 1e-4}, {"dt": 0.1}, {}):
        assert simulate(chain, state, 2.0, **options).force_model == "exact"


def test_a_state_that_is_kept_says_what_the_forces_are(tmp_path):
    """So that a run with polynomials is not kept."""
    record = Record(path=tmp_path / "run.npy", checkpoint=1e9)
    assert simulate(*soft_blow(), 40.0, tol=1e-7, record=record).force_model == "exact"


def test_polynomial_and_exact_waves_agree_within_the_tolerance():
    """The rarefaction wave ahead of a compressive blow, all of its profile."""
    chain, state = soft_blow()
    run = simulate(chain, state, 90.0, tol=1e-8)
    assert fitted_degree(run) > 5
    exact = simulate(chain, state, 90.0, dt=run.dt, method=run.method)
    assert exact.force_model == "exact"
    assert error_of(run, exact.final.u, exact.final.v) < 1e-8
    front = [np.argmax(chain.elongation(one.final.u)) for one in (run, exact)]
    assert front[0] == front[1] > 80
