"""Springs that change while a chain moves: against other integrators, balances, errors."""

import math

import numpy as np
import pytest
import sympy as sp
from scenes import smooth_blow
from scipy.integrate import solve_ivp
from springs import series

from figures import _scenes
from tensegrity import (
    Chain,
    LockingError,
    Prism,
    Record,
    ResolutionError,
    StabilityError,
    State,
    TensegrityError,
    resume,
    simulate,
)

ALL, T = Record(every=1), sp.Symbol("t")


def stiffening(t):
    """A spring of k = 1 + sin(t)^2/2 with a cubic part."""
    return series(0, 1 / 4, k=1 + math.sin(t) ** 2 / 2, length=1.0)


def drawn_in(t):
    """Prestrain from 0.02 to 0.05 about t = 5."""
    return _scenes.rigid(0.8, 0.02 + 0.015 * (1 + math.tanh((t - 5) / 1.5)))


def simulate_tuned(chain, state, t_end, spring_at, *, dt, method="rkn6", record=None):
    """A run of the chain with springs that are a function of time."""
    chain = Chain(chain.springs, chain.sites, chain.mass, chain.ends, tune=spring_at)
    return simulate(chain, state, t_end, method=method, dt=dt, record=record)


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


@pytest.mark.parametrize("tune", [stiffening, {"k": 1 + sp.sin(T) ** 2 / 2}])
@pytest.mark.parametrize(("method", "order"), [("verlet", 2), ("rkn6", 6)])
def test_methods_keep_their_order(changing, tune, method, order):
    chain, state = changing
    u, v, work = reference(chain, state, 3.0)
    steps, scene = np.array([12, 16, 24, 32]), Chain(chain.springs, 8, tune=tune)
    runs = [simulate(scene, state, 3.0, dt=3 / n, method=method) for n in steps]
    for errors in (
        [max(np.abs(run.final.u - u).max(), np.abs(run.final.v - v).max()) for run in runs],
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


def test_bad_input_says_what_and_why():
    chain = Chain(drawn_in(0.0), 6)
    state = smooth_blow(chain)

    def refused(error, text, spring_at=drawn_in, dt=0.05, **how):
        with pytest.raises(error, match=text):
            simulate_tuned(chain, state, 10.0, spring_at, dt=dt, **how)

    refused(TensegrityError, "tune begins with", lambda t: drawn_in(t + 5))
    refused(
        TensegrityError,
        "all have the same law",
        lambda t: drawn_in(0.0) if t < 5 else stiffening(t),
    )
    refused(TensegrityError, "not a Potential", lambda t: drawn_in(0.0) if t < 5 else t)
    taller = Prism(1.0, 0.9, 0.02, 1.0).potential()
    refused(ResolutionError, "too abruptly", lambda t: drawn_in(0.0) if t < 5 else taller)
    jump = _scenes.rigid(0.8, 0.05)
    refused(ResolutionError, "too abruptly", lambda t: drawn_in(0.0) if t < 5 else jump)
    refused(StabilityError, "beyond", dt=5.0)
    refused(TensegrityError, "not a splitting", method="rk4")
    refused(TensegrityError, "tune 'x' must be a dict .* or a function", spring_at="x")
    longer = Chain(series(length=1.0), 6)
    with pytest.raises(TensegrityError, match=r"length 1\..* refer to another shape"):
        simulate_tuned(longer, state, 10.0, lambda t: series(length=1.0 + 0.01 * t), dt=0.05)


@pytest.mark.parametrize("stiff", [(), (10.0, 100.0)], ids=["rigid", "elastic"])
def test_a_function_of_time_and_an_expression_of_it_give_the_same_run(stiff):
    def at(t):
        return Prism(1.0, 0.7, 0.02 + 0.01 * math.sin(t / 3) ** 2, 1.0, *stiff).potential()

    tunes = {"prestrain": 0.02 + 0.01 * sp.sin(T / 3) ** 2}, at
    chains = [Chain(at(0.0), 8, tune=tune) for tune in tunes]
    one, other = (simulate(c, c.at_rest({0: 0.05}), 8.0, tol=1e-8) for c in chains)
    np.testing.assert_allclose(other.u, one.u, atol=1e-12 * np.abs(one.u).max())
    np.testing.assert_allclose(other.work, one.work, atol=1e-12 * one.energy[0])
    assert other.energy_error < 1e-9


def test_a_run_goes_on_from_its_file_with_the_same_function(tmp_path):
    """No file holds a function: the scene is handed in again, and its name is what tells it."""
    chain = Chain(drawn_in(0.0), 6, tune=drawn_in)
    record = Record(every=1, path=tmp_path / "rows.npy", checkpoint=0)
    run = simulate(chain, smooth_blow(chain), 5.0, dt=0.1, record=record)
    with pytest.raises(TensegrityError, match="give it as `scene`"):
        resume(record.path)
    again = resume(record.path, chain)
    np.testing.assert_array_equal(again.u, run.u)
    with pytest.raises(TensegrityError, match="is not that of"):
        resume(record.path, Chain(drawn_in(0.0), 6, tune=lambda t: drawn_in(t)))


def test_locking_says_which_spring_and_when():
    """Met within a step, where the tension is already no number."""
    chain = Chain(drawn_in(0.0), 6)
    with pytest.raises(
        LockingError,
        match=r"^elongation -0\.\d+ m is at or below .* where the bars meet .*: the spring between "
        r"sites 2 and 3 got there at t = 0\.\d+ s$",
    ):
        simulate_tuned(chain, chain.at_rest({2: 1.0}), 10.0, drawn_in, dt=0.01)


def test_a_spring_may_use_the_stroke_that_it_has_at_that_instant():
    """The end comes nearer while the spring springs back from it."""

    def closing(t):
        return series(length=1.0, domain=(-0.2 + 0.1 * t, 1.0))

    chain = Chain(closing(0.0), 2)
    state = State(np.array([0.0, -0.14]), np.zeros(2))
    run = simulate_tuned(chain, state, 1.0, closing, dt=0.1)
    assert np.diff(run.final.u) == pytest.approx(-0.14 * math.cos(math.sqrt(2)), rel=1e-5)
    with pytest.raises(
        LockingError, match=r"below -0\.13\d* m.*sites 0 and 1 got there at t = 0.2"
    ):
        simulate_tuned(chain, state, 0.5, lambda t: closing(3 * t), dt=0.01)


def test_motion_that_is_not_finite_is_unstable():
    soft = series(0, -1, k=0.0)  # runs away in finite time
    chain = Chain(soft, 2)
    with (
        pytest.raises(StabilityError, match=r"no longer finite at t = \d"),
        np.errstate(all="ignore"),
    ):
        simulate_tuned(chain, chain.at_rest({0: 1.0}), 50.0, lambda t: soft, dt=0.05)


def test_the_stability_limit_is_watched_at_every_step():
    """The stiffest moment lies between the recorded instants, and what is recorded is no matter."""

    def squeezed(t):
        return series(k=1 + 30 * math.exp(-((t - 5) ** 2)), length=1.0)

    chain = Chain(squeezed(0.0), 6)
    texts = []
    for record in (None, Record(every=1000)):
        with pytest.raises(StabilityError, match="beyond") as caught:
            simulate_tuned(chain, smooth_blow(chain), 10.0, squeezed, dt=0.4, record=record)
        texts.append(str(caught.value))
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_a_short_change_between_the_nodes_of_a_series_is_not_lost():
    def pulse(width):
        def spring_at(t):
            stiffness = 1 + 0.5 * math.exp(-(((t - 20.93 * width) / width) ** 2))
            return series(k=stiffness, length=1.0)

        return spring_at

    chain = Chain(pulse(1.0)(0.0), 2)
    state = chain.at_rest({0: 1.0})
    run = simulate_tuned(chain, state, 40.0, pulse(1.0), dt=0.05)
    assert abs(run.work[-1]) > 1e-4
    with pytest.raises(ResolutionError, match="too abruptly"):
        simulate_tuned(chain, state, 400.0, lambda t: pulse(1.0)(t - 188.37), dt=0.05)


def test_energy_error_is_no_less_than_zero_for_a_negative_energy():

    def hanging(t):
        return series(0, 1 / 2, k=-2 - math.sin(t), length=1.0)

    chain = Chain(hanging(0.0), 2)
    state = State(np.array([0.0, 0.9]), np.zeros(2))
    run = simulate_tuned(chain, state, 5.0, hanging, dt=0.1, method="verlet")
    assert run.energy[0] < 0
    gap = np.abs(run.energy - run.work - run.energy[0]).max()
    size = max(np.abs(run.energy).max(), np.abs(run.work).max())
    assert run.energy_error == pytest.approx(gap / size)
    assert gap > 0


def at_height(prism, preload, height):
    """Axial load of a prism at a height, on the potential's own terms."""
    spring = prism.potential(preload)
    return preload - float(spring.tension(height - spring.length))


@pytest.mark.parametrize("rigid", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_preload_and_prestrain_move_the_equilibrium_that_elongations_count_from(rigid):
    """Slow change: the spring follows the height that carries the load of each instant."""
    stiff = () if rigid else (10.0, 100.0)
    first = Prism(1.0, 0.7, 0.02, 1.0, *stiff)
    tune = {"prestrain": 0.02 + 0.01 * sp.sin(T / 3) ** 2, "preload": 0.002 + 0.001 * T / 6}
    if not rigid:
        tune = {"prestrain": tune["prestrain"]}
    preload = 0.002 if rigid else 0.001
    chain = Chain(first.potential(preload), 2, 1.0, tune=tune)
    run = simulate(chain, chain.at_rest(), 6.0, dt=0.05, method="rkn6", record=Record(every=1))
    assert run.energy_error < 1e-9
    height = chain.springs[0].length + np.diff(run.u)[:, 0]
    acceleration = np.gradient(np.gradient(np.diff(run.u)[:, 0], 0.05), 0.05)
    for k in (20, 60, 100):
        values = {n: float(x.subs(T, run.t[k])) for n, x in tune.items()}
        now = Prism(1.0, 0.7, values["prestrain"], 1.0, *stiff)
        load = values.get("preload", preload)
        pulled = load - at_height(now, load, height[k])
        assert acceleration[k] == pytest.approx(-2 * pulled, abs=3e-5)
    assert np.abs(acceleration).max() > 1e-4


def test_a_prestrain_driven_out_of_its_domain_ends_the_run_there():
    spring = Prism(1.0, 0.7, 0.02, 1.0).potential()
    chain = Chain(spring, 4, tune={"prestrain": 0.02 - 0.01 * T})
    with pytest.raises(LockingError, match=r"prestrain .*driven there at t = 2") as one:
        simulate(chain, chain.at_rest({0: 0.001}), 5.0, dt=0.1, method="rkn6")
    run = one.value.run
    assert not run.complete
    assert run.t[-1] == pytest.approx(1.9, abs=0.11)
    assert run.energy_error < 1e-8


def test_what_cannot_be_tuned_is_refused():
    spring = Prism(1.0, 0.7, 0.02, 1.0).potential()

    def refused(text, tune, springs=spring):
        with pytest.raises(TensegrityError, match=text):
            Chain(springs, 4, tune=tune)

    refused("'colour' is not an argument", {"colour": T})
    refused("tune begins at prestrain 0.03, the spring has 0.02", {"prestrain": 0.03 + T})
    refused("depends on x", {"prestrain": sp.Symbol("x")})
    refused("tune .* must be a dict", [("prestrain", T)])
    refused("one spring for all bonds, there are 2", {"prestrain": 0.02 + T},
            [spring, spring, drawn_in(0.0)])  # fmt: skip
