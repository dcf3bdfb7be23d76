"""Chains: what they refuse, and their forces, energies and ends."""

import math

import numpy as np
import pytest
from scenes import plain_forces, prism_chain, smooth_blow
from springs import series

from tensegrity import Chain, PowerLaw, Prism, State, TensegrityError, simulate

SPRING = PowerLaw(1.0, 1.5, preload=0.1)


@pytest.mark.parametrize("sites", [0, 1, -3, 2.0, True, None])
def test_too_few_sites_are_refused(sites):
    with pytest.raises(TensegrityError, match="sites"):
        Chain(SPRING, sites)


def test_impossible_chains_are_refused():
    for mass in (0.0, -1.0, math.nan, [1.0, 2.0], [1, 0, 1], "heavy", 1j, [[1], [2, 3]]):
        with pytest.raises(TensegrityError, match="mass"):
            Chain(SPRING, 3, mass=mass)
    with pytest.raises(TensegrityError, match="springs"):
        Chain([SPRING] * 3, 3)
    with pytest.raises(TensegrityError, match="not a Potential"):
        Chain([SPRING, "spring"], 3)
    for spring in (None, 5.0):
        with pytest.raises(TensegrityError, match="not a Potential"):
            Chain(spring, 3)
    for ends in ("free", ("free", "loose"), ("free",), None):
        with pytest.raises(TensegrityError, match="ends"):
            Chain(SPRING, 3, ends=ends)


NUMBERS = np.array([0.0, 0.25, -0.5, 3.0])


@pytest.mark.parametrize(
    "given",
    [
        NUMBERS,
        NUMBERS.tolist(),
        tuple(NUMBERS),
        NUMBERS.astype(np.float32),
        NUMBERS.astype(np.longdouble),
        NUMBERS.astype(">f8"),
        np.repeat(NUMBERS, 2)[::2],
        np.stack([NUMBERS, NUMBERS], axis=1)[:, 1],
        [0, 0.25, np.float32(-0.5), np.int64(3)],
    ],
)
def test_states_convert_what_is_made_of_real_numbers(given):
    state = State(given, np.zeros(4, dtype=int))
    for made, expected in ((state.u, NUMBERS), (state.v, np.zeros(4))):
        assert made.dtype == np.float64
        assert made.flags.c_contiguous
        assert np.array_equal(made, expected)


def test_states_do_not_copy_what_is_right_already():
    u, v = np.zeros((2, 4))
    state = State(u, v)
    assert state.u is u
    assert state.v is v


@pytest.mark.parametrize(
    ("u", "why"),
    [
        (np.zeros(4, dtype=complex), "dtype complex128"),
        (np.zeros(4, dtype=bool), "dtype bool"),
        (np.zeros(4, dtype=object), "dtype object"),
        (np.array(["0"] * 4), "dtype <U1"),
        ([0, 1j, 0, 0], "not made of numbers"),
        ([0.0, True, 0.0, 0.0], "not made of numbers"),
        ([0, 10**400, 0, 0], "not made of numbers"),
        (["0", "1", "2", "3"], "not made of numbers"),
        ([[0.0], [0.0, 1.0]], "not made of numbers"),
        (None, "not made of numbers"),
        (np.array([0, math.nan, 0, 0]), "nan at index 1, must be finite"),
        ([0, 0, math.inf, 0], "inf at index 2, must be finite"),
        (np.full(4, np.longdouble(1e308) * 10), "inf at index 0, must be finite"),
    ],
)
def test_states_of_anything_else_are_refused(u, why):
    for name, pair in (("displacement", (u, np.zeros(4))), ("velocity", (np.zeros(4), u))):
        with pytest.raises(TensegrityError, match=f"{name} .*{why}"):
            State(*pair)


def test_states_have_one_to_three_axes_and_as_many_velocities():
    for u in (0.0, np.zeros((2, 2, 2, 2))):
        with pytest.raises(TensegrityError, match="dimensions, must have 1 to 3"):
            State(u, u)
    with pytest.raises(TensegrityError, match=r"velocity has shape \(3,\), must be \(4,\)"):
        State(np.zeros(4), np.zeros(3))


def test_states_of_another_chain_are_refused():
    chain = Chain(SPRING, 5, ends=("fixed", "free"))
    with pytest.raises(TensegrityError, match="sites"):
        simulate(chain, State(np.zeros(4), np.zeros(4)), 1.0)
    with pytest.raises(TensegrityError, match="not a State"):
        simulate(chain, np.zeros(5), 1.0)
    with pytest.raises(TensegrityError, match="fixed"):
        chain.at_rest({0: 1.0})
    for site in (5, -1, 1.5):
        with pytest.raises(TensegrityError, match="site"):
            chain.at_rest({site: 1.0})
    for bad in ({1: math.nan}, [0.3], 0.3):
        with pytest.raises(TensegrityError, match="velocity"):
            chain.at_rest(bad)
    with pytest.raises(TensegrityError, match="not a scene"):
        simulate(None, chain.at_rest(), 1.0)


def test_a_state_out_of_the_domain_is_refused():
    chain = prism_chain(3)
    with pytest.raises(TensegrityError, match="bars meet"):
        simulate(chain, State(np.array([0, -0.1, 0.0]), np.zeros(3)), 1.0)


def test_held_sites_stay_exactly_where_they_are_in_long_implicit_steps():
    """Solved for with all others they would pick up round-off, and their state be refused."""
    chain = Chain(series(), 20, np.geomspace(1, 1e-2, 20), ("fixed", "fixed"))
    start = chain.at_rest({1: 0.03, 18: -0.03})
    run = simulate(chain, start, 30.0, dt=3.0, method="midpoint")
    assert np.abs(run.u[-1, 1:-1]).min() > 0
    assert np.all(run.u[:, [0, -1]] == 0)
    assert np.all(run.v[:, [0, -1]] == 0)
    assert simulate(chain, run.final, 3.0, dt=3.0, method="midpoint").complete


@pytest.mark.parametrize("ends", [("free", "free"), ("fixed", "free"), ("fixed", "fixed")])
def test_mixed_chain_follows_newton(ends, rng):
    """Acceleration of a chain of five laws and random masses against bond-by-bond forces."""
    prism = Prism(1.0, 0.8, 0.05, 1.0)
    kinds = [SPRING, prism.potential(), prism.potential(0.1), PowerLaw(2.0, 2.0, preload=0.3)]
    springs = [kinds[k] for k in rng.integers(0, 4, 120)] + [kinds[0]] * 40 + [kinds[1]] * 39
    chain = Chain(springs, 200, mass=rng.uniform(0.5, 2, 200), ends=ends)
    u = rng.uniform(-0.01, 0.01, 200)
    u[chain.held] = 0
    dt = 1e-3
    run = simulate(chain, State(u, np.zeros(200)), dt, dt=dt, method="verlet")
    mobility = np.where(np.isin(np.arange(200), chain.held), 0, 1 / chain.mass)
    acceleration = mobility * plain_forces(chain, u)
    np.testing.assert_allclose(run.final.u, u + dt**2 / 2 * acceleration, rtol=0, atol=1e-17)
    later = mobility * plain_forces(chain, run.final.u)
    np.testing.assert_allclose(run.final.v, dt / 2 * (acceleration + later), rtol=0, atol=1e-17)
    assert np.all(run.final.u[chain.held] == 0)


def test_energy_of_the_chain_is_that_of_its_sites():
    chain = prism_chain(30)
    run = simulate(chain, smooth_blow(chain), 20.0)
    sites = chain.site_energy(run)
    np.testing.assert_allclose(sites.sum(axis=1), run.energy, rtol=1e-13)
    assert math.isclose(chain.energy(run.final), run.energy[-1], rel_tol=1e-14)
