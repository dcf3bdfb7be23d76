"""The loop of a chain against the same steps in plain Python and NumPy."""

import platform

import numpy as np
import pytest
from oracle import stepped
from scenes import plain_forces, prism_chain, smooth_blow

from tensegrity import Chain, PowerLaw, Prism, Record, simulate
from tensegrity.engine.compiled import evaluated
from tensegrity.engine.kernel import bind
from tensegrity.engine.law import evaluate
from tensegrity.engine.methods import METHODS
from tensegrity.scenes.dynamics import dynamics

EXPLICIT = [method for method in METHODS.values() if method.explicit]


def mixed_chain():
    prism = Prism(1.0, 0.8, 0.05, 1.0)
    springs = [prism.potential()] * 70 + [PowerLaw(2.0, 1.5, preload=0.1)] * 50
    return Chain(springs + [prism.potential(0.05)] * 9, 130, ends=("free", "fixed"))


def advanced(chain, state, method, dt, steps):
    u, v = state.u.copy(), state.v.copy()
    bound = bind(u, v, dynamics(chain).loop_bonds, method, dt)
    bound.advance(steps)
    return u, v, bound.range.copy()


def plain_verlet(chain, state, dt, steps):
    u, v = state.u.copy(), state.v.copy()
    for _ in range(steps):
        v += dt / 2 * plain_forces(chain, u) * dynamics(chain).inverse_mass
        u += dt * v
        v += dt / 2 * plain_forces(chain, u) * dynamics(chain).inverse_mass
    return u, v


def test_loop_against_plain_python():
    chain = mixed_chain()
    state = smooth_blow(chain)
    u, v, _ = advanced(chain, state, METHODS["verlet"], 0.05, 60)
    plain_u, plain_v = plain_verlet(chain, state, 0.05, 60)
    np.testing.assert_allclose(u, plain_u, rtol=0, atol=1e-15)
    np.testing.assert_allclose(v, plain_v, rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", EXPLICIT, ids=lambda method: method.name)
@pytest.mark.parametrize("chain", [prism_chain(100), mixed_chain()], ids=["uniform", "mixed"])
def test_loop_is_that_of_numpy_to_the_growth_of_round_off(chain, method):
    """Two orders of summation differ by eps a step, which grows no faster than the steps do."""
    state, steps = smooth_blow(chain), 173
    u, v, met = advanced(chain, state, method, 0.1, steps)
    plain = stepped(chain, state, getattr(method, "base", method), 0.1, steps)
    eps = np.finfo(float).eps
    assert np.max(np.abs(u - plain.u)) < steps * eps * np.max(np.abs(u))
    assert np.max(np.abs(v - plain.v)) < steps * eps * np.max(np.abs(v))
    np.testing.assert_allclose(met, plain.met, rtol=0, atol=1e-14)


@pytest.mark.parametrize("order", range(4))
def test_a_compiled_law_has_the_values_of_casadi_s_machine(order):
    spring = Prism(1.0, 0.8, 0.05, 1.0).potential(0.1)
    r = np.linspace(0.9 * spring.domain[0], 0.4, 77)
    compiled, plain = (f(spring.law, order, spring.values, r) for f in (evaluated, evaluate))
    np.testing.assert_allclose(compiled, plain, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("exponent", [3.0, 1.5])  # without roots and with
@pytest.mark.parametrize("sites", [2, 3, 64, 65, 66, 129, 1000])
def test_blocks_of_any_length(sites, exponent):
    """Against the same steps in plain NumPy, around the loop's block length."""
    chain = Chain(PowerLaw(1.0, exponent, preload=0.2), sites)
    state = chain.at_rest({0: 0.1, sites - 1: -0.05})
    u, v, met = advanced(chain, state, METHODS["verlet"], 0.1, 5)
    x, y, low = state.u.copy(), state.v.copy(), np.inf
    spring = chain.springs[0]
    for k in range(6):
        r = np.diff(x)
        low = min(low, r.min())
        f = np.concatenate([[0], spring.tension(r), [0]])
        y += (0.05 if k in (0, 5) else 0.1) * np.diff(f)
        x += (0.1 if k < 5 else 0) * y
    np.testing.assert_allclose(u, x, rtol=0, atol=1e-15)
    np.testing.assert_allclose(v, y, rtol=0, atol=1e-15)
    assert met[0, 0] == pytest.approx(low, abs=1e-15)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64", "aarch64"), reason="no such mode")
def test_numbers_below_the_smallest_normal_one_are_none_in_a_loop_and_some_outside():
    """Ahead of a front they would be many, and slow."""
    chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 200)
    run = simulate(chain, chain.at_rest({0: 0.02}), 20.0, dt=0.05, record=Record(every=1))
    sizes = np.abs(np.concatenate([run.u, run.v]))
    assert (sizes == 0).any()
    assert not ((sizes > 0) & (sizes < np.finfo(float).tiny)).any()
    assert np.array([1e-310]) * 0.5 > 0
