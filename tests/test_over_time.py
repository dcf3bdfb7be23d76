"""Springs that change while a chain moves: against other integrators, balances, errors."""

import math
import pickle

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
    dispersion,
    resume,
    simulate,
    solitary_wave,
)

ALL, T = Record(every=1), sp.Symbol("t")
CUBIC = series(0, 1 / 4, length=1.0)
DRAWN_IN = 0.02 + 0.015 * (1 + sp.tanh((T - 5) / 1.5))  # prestrain from 0.02 to 0.05 about t = 5
PRISM = _scenes.rigid(0.8, 0.02).over_time(prestrain=DRAWN_IN)
HOW = {"method": "rkn6", "dt": 0.05}
SAME, WAVE = np.zeros(7), 2 * math.pi / 3 * (np.arange(7) % 3)  # phases of the bonds


def reference(phases, state, t_end):
    """u, v and work by an explicit method of order 8, the rate of V typed by hand."""
    sites = len(phases) + 1

    def rates(t, y):
        u, v = y[:sites], y[sites:-1]
        r, k = np.diff(u), 1 + np.sin(t - phases) ** 2 / 2
        pull = np.diff(k * r + r**3, prepend=0.0, append=0.0)
        power = np.sum(np.sin(t - phases) * np.cos(t - phases) * r**2 / 2)
        return [*v, *pull, power]

    y = solve_ivp(rates, (0, t_end), [*state.u, *state.v, 0.0], "DOP853", rtol=1e-12, atol=1e-14)
    end = y.y[:, -1]
    return end[:sites], end[sites:-1], end[-1]


@pytest.fixture(scope="module", params=[SAME, WAVE], ids=["one spring", "phases"])
def changing(request):
    """A chain of springs of k = 1 + sin(t - phase)^2/2 with a cubic part."""
    each = [CUBIC.over_time(k=1 + sp.sin(T - x) ** 2 / 2) for x in request.param.tolist()]
    chain = Chain(each, 8)
    return chain, chain.at_rest({0: 0.5, 5: -0.3}), request.param


def test_motion_and_work_agree_with_another_integrator(changing):
    chain, state, phases = changing
    run = simulate(chain, state, 6.0, method="rkn6", dt=0.01)
    u, v, work = reference(phases, state, 6.0)
    np.testing.assert_allclose(run.final.u, u, atol=1e-10)
    np.testing.assert_allclose(run.final.v, v, atol=1e-10)
    assert run.work[-1] == pytest.approx(work, abs=1e-10)
    assert abs(work) > 1e-3
    assert run.energy_error < 1e-10


@pytest.mark.parametrize(("method", "order"), [("verlet", 2), ("rkn6", 6)])
def test_methods_keep_their_order(changing, method, order):
    chain, state, phases = changing
    u, v, work = reference(phases, state, 3.0)
    steps = np.array([12, 16, 24, 32])
    runs = [simulate(chain, state, 3.0, dt=3 / n, method=method) for n in steps]
    for errors in (
        [max(np.abs(run.final.u - u).max(), np.abs(run.final.v - v).max()) for run in runs],
        [abs(run.work[-1] - work) for run in runs],
    ):
        assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.7)


def test_springs_that_stay_give_the_run_of_simulate():
    chain = Chain(PRISM.at(0.0), 12)
    stays = Chain(PRISM.at(0.0).over_time(prestrain=DRAWN_IN.subs(T, 0)), 12)
    state = smooth_blow(chain)
    run, plain = (simulate(x, state, 5.0, **HOW, record=ALL) for x in (stays, chain))
    np.testing.assert_allclose(run.u, plain.u, atol=1e-14)
    np.testing.assert_array_equal(run.t, plain.t)
    assert not run.work.any()


def test_chain_at_rest_stays_so_while_its_springs_change():
    chain = Chain(PRISM, 5)
    run = simulate(chain, chain.at_rest(), 10.0, method="rkn6", dt=0.1)
    assert not run.u.any()
    assert run.energy_error == 0


def test_prestrain_drawn_in_does_work_that_the_energy_keeps():
    chain = Chain(PRISM, 30)
    run = simulate(chain, smooth_blow(chain), 10.0, **HOW)
    assert run.work[-1] > 0.1 * run.energy[0]
    assert run.energy_error < 1e-9


def test_a_spring_over_time_is_what_its_arguments_are_at_an_instant():
    for t in (0, 7):
        r, then = np.array([-0.02, 0.01]), _scenes.rigid(0.8, float(DRAWN_IN.subs(T, t)))
        np.testing.assert_allclose(PRISM.at(t).tension(r), then.tension(r), rtol=1e-14)
    assert CUBIC.at(3.0) is CUBIC
    assert _scenes.rigid(0.8, 0.3).over_time(prestrain=DRAWN_IN) == PRISM
    assert PRISM.at(0.0) != PRISM
    assert {PRISM: 1}[pickle.loads(pickle.dumps(PRISM))] == 1
    assert "over_time(prestrain=0.015*tanh" in repr(PRISM)
    assert PRISM.length == 0.8
    analyses = [
        lambda: PRISM.energy(0.0),
        PRISM.sound_speed,
        lambda: solitary_wave(PRISM, speed_ratio=1.1),
        lambda: dispersion(PRISM, 1.0, [0.1]),
    ]
    for analysis in analyses:
        with pytest.raises(TensegrityError, match=r"at an instant only: take it `\.at\(t\)`"):
            analysis()


def test_a_wave_is_launched_among_springs_that_will_change():
    wave = solitary_wave(PRISM.at(0.0), speed_ratio=1.2)
    one, other = (Chain(x, 60) for x in (PRISM, PRISM.at(0.0)))
    np.testing.assert_array_equal(wave.launch(one, at=30).v, wave.launch(other, at=30).v)


def test_bad_input_says_what_and_why():
    state = smooth_blow(Chain(PRISM, 6))

    def refused(error, text, spring=PRISM, dt=0.05, **how):
        with pytest.raises(error, match=text):
            simulate(Chain(spring, 6), state, 10.0, **{"method": "rkn6", "dt": dt} | how)

    far = Prism(1.0, 0.7, 0.02, 1.0, 10.0, 100.0).potential().over_time(k_bar=100 * sp.exp(2 * T))
    refused(ResolutionError, "too abruptly with k_bar", far)
    refused(StabilityError, "beyond", dt=5.0)
    refused(TensegrityError, "not a splitting", method="rk4")
    with pytest.raises(TensegrityError, match=r"tune is no argument: give springs `\.over_time"):
        Chain(PRISM, 6, tune={"prestrain": DRAWN_IN})


@pytest.mark.parametrize("stiff", [
    pytest.param((), id="rigid"),
    pytest.param((10.0, 100.0), id="elastic", marks=pytest.mark.slow),
])  # fmt: skip
def test_bonds_of_a_chain_change_as_each_does_alone(stiff):
    """Pairs in three phases, between springs too soft to be felt."""
    spring = Prism(1.0, 0.7, 0.02, 1.0, *stiff).potential()
    each = [spring.over_time(prestrain=0.02 + 0.01 * sp.sin(T - k) ** 2) for k in range(3)]
    between = series(k=1e-15)
    together = Chain([each[0], between, each[1], between, each[2]], 6)
    run = simulate(together, State(np.tile([0.02, 0.0], 3), np.zeros(6)), 8.0, **HOW)
    for k, one in enumerate(each):
        pair = Chain(one, 2)
        alone = simulate(pair, State(np.array([0.02, 0.0]), np.zeros(2)), 8.0, **HOW)
        np.testing.assert_allclose(run.u[:, 2 * k : 2 * k + 2], alone.u, atol=1e-12)
        of_pair = run.elongation_range[[0, 2, 3][k]]
        np.testing.assert_allclose(of_pair, alone.elongation_range[0], atol=1e-12)
    assert np.ptp(run.u[-1, ::2]) > 1e-4
    assert run.energy_error < 1e-9


def test_a_run_goes_on_from_its_file(tmp_path):
    chain = Chain([PRISM, PRISM.at(0.0)] * 3, 7)
    record = Record(every=1, path=tmp_path / "rows.npy", checkpoint=0)
    run = simulate(chain, chain.at_rest({0: 0.02}), 5.0, method="rkn6", dt=0.1, record=record)
    with pytest.raises(TensegrityError, match="give it as `scene`"):
        resume(record.path)
    again = resume(record.path, pickle.loads(pickle.dumps(chain)))
    np.testing.assert_array_equal(again.u, run.u)
    with pytest.raises(TensegrityError, match="is not that of"):
        resume(record.path, Chain(PRISM, 7))


def test_locking_says_which_spring_and_when():
    """Met within a step, where the tension is already no number."""
    chain = Chain(PRISM, 6)
    with pytest.raises(
        LockingError,
        match=r"^elongation -0\.\d+ m is at or below .* where the bars meet .*: the spring between "
        r"sites 2 and 3 got there at t = 0\.\d+ s$",
    ):
        simulate(chain, chain.at_rest({2: 1.0}), 10.0, method="rkn6", dt=0.01)


def test_each_spring_may_use_the_stroke_that_it_has():
    """A mass between two, nearer to the end of one spring than to that of the other."""
    short, long = (series(length=1.0, domain=(-end, 1.0)) for end in (0.1, 0.3))
    for springs, where, speed in (
        ((short, long), "0 and 1", -1.0),
        ((long, short), "1 and 2", 1.0),
    ):
        chain = Chain([x.over_time(k=2 + sp.sin(T)) for x in springs], 3, [1e6, 1.0, 1e6])
        text = f"elongation -0.10.* at or below -0.1 m.*sites {where} got there at t = 0.1"
        with pytest.raises(LockingError, match=text):
            simulate(chain, chain.at_rest({1: speed}), 10.0, method="rkn6", dt=1e-3)
        run = simulate(chain, chain.at_rest({1: -speed / 10}), 10.0, method="rkn6", dt=1e-2)
        assert run.complete


def test_motion_that_is_not_finite_is_unstable():
    soft = series(0, -1, k=0.0).over_time(k=1e-9 * T)  # runs away in finite time
    chain = Chain(soft, 2)
    with (
        pytest.raises(StabilityError, match=r"no longer finite at t = \d"),
        np.errstate(all="ignore"),
    ):
        simulate(chain, chain.at_rest({0: 1.0}), 50.0, **HOW)


def test_the_stability_limit_is_watched_at_every_step():
    """The stiffest moment lies between the recorded instants, and what is recorded is no matter."""
    squeezed = series(length=1.0).over_time(k=1 + 30 * sp.exp(-((T - 5) ** 2)))
    chain, texts = Chain([CUBIC, *[squeezed] * 4], 6), []
    for record in (None, Record(every=1000)):
        with pytest.raises(StabilityError, match="beyond") as caught:
            simulate(chain, smooth_blow(chain), 10.0, method="rkn6", dt=0.4, record=record)
        texts.append(str(caught.value))
    assert texts[0] == texts[1]


def test_energy_error_is_no_less_than_zero_for_a_negative_energy():
    chain = Chain(series(0, 1 / 2, length=1.0).over_time(k=-2 - sp.sin(T)), 2)
    state = State(np.array([0.0, 0.9]), np.zeros(2))
    run = simulate(chain, state, 5.0, dt=0.1, method="verlet")
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
    given = {"prestrain": 0.02 + 0.01 * sp.sin(T / 3) ** 2, "preload": 0.002 + 0.001 * T / 6}
    if not rigid:
        given = {"prestrain": given["prestrain"]}
    preload = 0.002 if rigid else 0.001
    chain = Chain(first.potential(preload).over_time(**given), 2, 1.0)
    run = simulate(chain, chain.at_rest(), 6.0, dt=0.05, method="rkn6", record=Record(every=1))
    assert run.energy_error < 1e-9
    height = chain.springs[0].length + np.diff(run.u)[:, 0]
    acceleration = np.gradient(np.gradient(np.diff(run.u)[:, 0], 0.05), 0.05)
    for k in (20, 60, 100):
        values = {n: float(x.subs(T, run.t[k])) for n, x in given.items()}
        now = Prism(1.0, 0.7, values["prestrain"], 1.0, *stiff)
        load = values.get("preload", preload)
        pulled = load - at_height(now, load, height[k])
        assert acceleration[k] == pytest.approx(-2 * pulled, abs=3e-5)
    assert np.abs(acceleration).max() > 1e-4


def test_a_prestrain_driven_out_of_its_domain_ends_the_run_there():
    spring = Prism(1.0, 0.7, 0.02, 1.0).potential()
    chain = Chain([spring, spring.over_time(prestrain=0.02 - 0.01 * T), spring], 4)
    with pytest.raises(LockingError, match=r"prestrain .*driven there at t = 2") as one:
        simulate(chain, chain.at_rest({0: 0.001}), 5.0, dt=0.1, method="rkn6")
    run = one.value.run
    assert not run.complete
    assert run.t[-1] == pytest.approx(1.9, abs=0.11)
    assert run.energy_error < 1e-8


def test_what_cannot_change_is_refused():
    spring = Prism(1.0, 0.7, 0.02, 1.0).potential()

    def refused(text, **given):
        with pytest.raises(TensegrityError, match=text):
            spring.over_time(**given)

    refused("'colour' is not an argument", colour=T)
    refused("needs an argument that changes")
    refused("depends on x", prestrain=sp.Symbol("x"))
    refused("prestrain 'x'", prestrain="x")
    refused("prestrain -0.1", prestrain=T - 0.1)
