"""The two engines: compiled and interpreted, against each other and against plain Python."""

import platform

import numpy as np
import pytest
from scenes import plain_forces, prism_chain, smooth_blow

from tensegrity import Chain, PowerLaw, Prism, Record, simulate
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.interpreted import Interpreted
from tensegrity.engine.kernel import bind
from tensegrity.engine.methods import METHODS
from tensegrity.engine.native import CompilerError


def mixed_chain():
    prism = Prism(1.0, 0.8, 0.05, 1.0)
    springs = [prism.potential()] * 70 + [PowerLaw(2.0, 1.5, preload=0.1)] * 50
    return Chain(springs + [prism.potential(0.05)] * 9, 130, ends=("free", "fixed"))


def advanced(engine, chain, state, method, dt, steps):
    method = METHODS[method]
    u, v = state.u.copy(), state.v.copy()
    bound = bind(u, v, chain.loop_bonds, method, dt, engine.of(chain.loop_bonds))
    bound.advance(steps)
    return u, v, bound.range.copy()


def plain_verlet(chain, state, dt, steps):
    u, v = state.u.copy(), state.v.copy()
    for _ in range(steps):
        v += dt / 2 * plain_forces(chain, u) * chain.inverse_mass
        u += dt * v
        v += dt / 2 * plain_forces(chain, u) * chain.inverse_mass
    return u, v


COMPILED = pytest.param(Compiled, marks=pytest.mark.needs_compiler)


@pytest.mark.parametrize("engine", [Interpreted, COMPILED])
def test_engine_against_plain_python(engine):
    chain = mixed_chain()
    state = smooth_blow(chain)
    u, v, _ = advanced(engine, chain, state, "verlet", 0.05, 60)
    plain_u, plain_v = plain_verlet(chain, state, 0.05, 60)
    np.testing.assert_allclose(u, plain_u, rtol=0, atol=1e-15)
    np.testing.assert_allclose(v, plain_v, rtol=0, atol=1e-15)


@pytest.mark.needs_compiler
@pytest.mark.parametrize("method", [m for m in METHODS if METHODS[m].explicit])
@pytest.mark.parametrize("chain", [prism_chain(100), mixed_chain()], ids=["uniform", "mixed"])
def test_engines_agree_to_the_growth_of_round_off(chain, method):
    """Two orders of summation differ by eps a step, which grows no faster than the steps do."""
    state, steps = smooth_blow(chain), 173
    u, v, met = advanced(Compiled, chain, state, method, 0.1, steps)
    other_u, other_v, other_met = advanced(Interpreted, chain, state, method, 0.1, steps)
    eps = np.finfo(float).eps
    assert np.max(np.abs(u - other_u)) < steps * eps * np.max(np.abs(u))
    assert np.max(np.abs(v - other_v)) < steps * eps * np.max(np.abs(v))
    np.testing.assert_allclose(met, other_met, rtol=0, atol=1e-14)


@pytest.mark.needs_compiler
@pytest.mark.parametrize("order", range(4))
def test_engines_evaluate_the_same(order):
    spring = Prism(1.0, 0.8, 0.05, 1.0).potential(0.1)
    r = np.linspace(0.9 * spring.domain[0], 0.4, 77)
    compiled, interpreted = (
        kind((spring.law,)).evaluate(0, order, spring.values, r) for kind in (Compiled, Interpreted)
    )
    np.testing.assert_allclose(compiled, interpreted, rtol=1e-13, atol=1e-14)


@pytest.mark.needs_compiler
@pytest.mark.parametrize("exponent", [3.0, 1.5])  # without roots and with
@pytest.mark.parametrize("sites", [2, 3, 64, 65, 66, 129, 1000])
def test_blocks_of_any_length(sites, exponent):
    """The compiled loop against the same steps in plain NumPy, around its block length."""
    chain = Chain(PowerLaw(1.0, exponent, preload=0.2), sites)
    state = chain.at_rest({0: 0.1, sites - 1: -0.05})
    u, v, met = advanced(Compiled, chain, state, "verlet", 0.1, 5)
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


@pytest.mark.needs_compiler
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64", "aarch64"), reason="no such mode")
def test_numbers_below_the_smallest_normal_one_are_none_in_a_loop_and_some_outside():
    """Ahead of a front they would be many, and slow."""
    chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 200)
    run = simulate(chain, chain.at_rest({0: 0.02}), 20.0, dt=0.05, record=Record(every=1))
    sizes = np.abs(np.concatenate([run.u, run.v]))
    assert (sizes == 0).any()
    assert not ((sizes > 0) & (sizes < np.finfo(float).tiny)).any()
    assert np.array([1e-310]) * 0.5 > 0


@pytest.mark.needs_compiler
def test_corrected_steps_that_cannot_be_compiled_are_interpreted(monkeypatch):
    """They are compiled when a law without corners is asked for them: the disk may be full then."""

    def run():
        chain = prism_chain(6)
        return simulate(chain, smooth_blow(chain), 4.0, method="corrected6", dt=0.1)

    def refused(self):
        raise CompilerError("no space for corrected steps")

    compiled = run()
    monkeypatch.setattr(Compiled, "openings", property(refused))
    with pytest.warns(RuntimeWarning, match="no space for corrected steps"):
        interpreted = run()
    np.testing.assert_allclose(interpreted.u, compiled.u, rtol=0, atol=1e-14)
