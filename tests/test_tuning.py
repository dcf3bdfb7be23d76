"""Springs that change while a chain moves: against other integrators, balances, errors."""

import math

import numpy as np
import pytest
import sympy as sp
from scenes import smooth_blow
from scipy.integrate import solve_ivp

from figures import _scenes
from tensegrity import (
    Chain,
    LockingError,
    Potential,
    Prism,
    Record,
    ResolutionError,
    StabilityError,
    TensegrityError,
    simulate,
)
from tensegrity.tuning import simulate_tuned

ALL = Record(every=1)


def stiffening(t):
    """A spring of k = 1 + sin(t)^2/2 with a cubic part."""
    r, k = sp.symbols("r k")
    return Potential(k * r**2 / 2 + r**4 / 4, r, {k: 1 + math.sin(t) ** 2 / 2}, length=1.0)


def drawn_in(t):
    """Prestrain from 0.02 to 0.05 about t = 5."""
    return _scenes.rigid(0.8, 0.02 + 0.015 * (1 + math.tanh((t - 5) / 1.5)))


def reference(chain, state, t_end):
    """u, v and work by an explicit method of order 8, the rate of V typed by hand."""

    def rates(t, y):
        u, v = y[: chain.sites], y[chain.sites : -1]
        r, k = np.diff(u), 1 + math.sin(t) ** 2 / 2
        pull = np.diff(k * r + r**3, prepend=0.0, append=0.0)
        power = np.sum(math.sin(t) * math.cos(t) * r**2 / 2)
        return [*v, *(pull / chain.mass), power]

    y = solve_ivp(rates, (0, t_end), [*state.u, *state.v, 0.0], "DOP853", rtol=1e-12, atol=1e-14)
    end = y.y[:, -1]
    return end[: chain.sites], end[chain.sites : -1], end[-1]


@pytest.fixture(scope="module")
def changing():
    chain = Chain(stiffening(0.0), 8)
    return chain, chain.at_rest({0: 0.5, 5: -0.3})


def test_motion_and_work_agree_with_another_integrator(changing):
    chain, state = changing
    run = simulate_tuned(chain, state, 6.0, stiffening, dt=0.01)
    u, v, work = reference(chain, state, 6.0)
    np.testing.assert_allclose(run.final.u, u, atol=1e-10)
    np.testing.assert_allclose(run.final.v, v, atol=1e-10)
    assert run.work[-1] == pytest.approx(work, abs=1e-10)
    assert abs(work) > 1e-3
    assert run.energy_error < 1e-10


@pytest.mark.parametrize(("method", "order"), [("verlet", 2), ("rkn6", 6)])
def test_methods_keep_their_order(changing, method, order):
    chain, state = changing
    u, _, work = reference(chain, state, 3.0)
    steps = np.array([12, 16, 24, 32])
    runs = [simulate_tuned(chain, state, 3.0, stiffening, dt=3 / n, method=method) for n in steps]
    for errors in (
        [np.abs(run.final.u - u).max() for run in runs],
        [abs(run.work[-1] - work) for run in runs],
    ):
        assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.7)


def test_springs_that_stay_give_the_run_of_simulate():
    chain = Chain(drawn_in(0.0), 12)
    state = smooth_blow(chain)
    tuned = simulate_tuned(chain, state, 5.0, lambda t: drawn_in(0.0), dt=0.05, record=ALL)
    plain = simulate(chain, state, 5.0, method="rkn6", dt=0.05, record=ALL)
    np.testing.assert_allclose(tuned.u, plain.u, atol=1e-14)
    np.testing.assert_array_equal(tuned.t, plain.t)
    assert not tuned.work.any()


def test_chain_at_rest_stays_so_while_its_springs_change():
    chain = Chain(drawn_in(0.0), 5)
    run = simulate_tuned(chain, chain.at_rest(), 10.0, drawn_in, dt=0.1)
    assert not run.u.any()
    assert run.energy_error == 0


def test_prestrain_drawn_in_does_work_that_the_energy_keeps():
    chain = Chain(drawn_in(0.0), 30)
    run = simulate_tuned(chain, smooth_blow(chain), 10.0, drawn_in, dt=0.05)
    assert run.work[-1] > 0.1 * run.energy[0]
    assert run.energy_error < 1e-9
    assert run.scene.springs[0] == drawn_in(10.0)


def test_bad_input_says_what_and_why():
    chain = Chain(drawn_in(0.0), 6)
    state = smooth_blow(chain)

    def refused(error, text, spring_at=drawn_in, dt=0.05, **how):
        with pytest.raises(error, match=text):
            simulate_tuned(chain, state, 10.0, spring_at, dt=dt, **how)

    refused(TensegrityError, "differ from spring_at", lambda t: drawn_in(t + 5))
    refused(TensegrityError, "another law", lambda t: drawn_in(0.0) if t < 5 else stiffening(t))
    taller = Prism(1.0, 0.9, 0.02, 1.0).potential()
    refused(TensegrityError, "has length 0.9 m", lambda t: drawn_in(0.0) if t < 5 else taller)
    refused(TensegrityError, "not a Potential", lambda t: drawn_in(0.0) if t < 5 else t)
    jump = _scenes.rigid(0.8, 0.05)
    refused(ResolutionError, "too abruptly", lambda t: drawn_in(0.0) if t < 5 else jump)
    refused(StabilityError, "beyond", dt=5.0)
    refused(TensegrityError, "not a splitting", method="rk4")
    with pytest.raises(LockingError, match="bars meet"):
        simulate_tuned(chain, chain.at_rest({0: 1.0}), 10.0, drawn_in, dt=0.01)
