"""Runs: orders, invariants, recording, and where the methods fail."""

import math

import numpy as np
import pytest
import sympy as sp
from extended import extended
from networks import SPRING
from oracle import LIMITS, ORDERS
from scenes import blow, ctrl_c, many_steps, prism_chain, smooth_blow
from springs import series

from tensegrity import (
    Chain,
    ContactError,
    Damping,
    LockingError,
    Network,
    PowerLaw,
    Prism,
    Record,
    StabilityError,
    State,
    TensegrityError,
    simulate,
)

DURATION = 24.0
REFINEMENTS = [("verlet", (400, 800, 1600)), ("rkn6", (60, 90, 135)),
               ("rk4", (900, 1300, 1800)),
               ("midpoint", (400, 800, 1600))]  # fmt: skip


def fitted_order(errors, dts):
    return np.polyfit(np.log(dts), np.log(errors), 1)[0]


@pytest.mark.needs_extended
@pytest.mark.parametrize(("name", "counts"), REFINEMENTS)
def test_order_against_extended_precision(name, counts):
    chain = prism_chain()
    state = smooth_blow(chain)
    exact, _ = extended(chain, state, "rkn6", DURATION / 3000, 3000)
    errors = []
    for n in counts:
        run = simulate(chain, state, DURATION, method=name, dt=DURATION / n)
        errors.append(float(np.max(np.abs(run.final.u - exact))))
    order = fitted_order(errors, [DURATION / n for n in counts])
    assert abs(order - ORDERS[name]) < 0.2


@pytest.mark.needs_extended
@pytest.mark.parametrize("name", ["verlet", "rkn6", "midpoint"])
def test_steps_are_symplectic(name):
    """J^T Omega J = Omega, J by differences in extended precision."""
    chain = prism_chain(6)
    n, h = chain.sites, np.longdouble(1e-4)
    start = smooth_blow(chain)
    start.v[5] = -0.02

    def flow(x):
        state = type("", (), {"u": x[:n], "v": x[n:]})
        return np.concatenate(extended(chain, state, name, 0.3, 7))

    x = np.concatenate([start.u, start.v]).astype(np.longdouble)
    columns = []
    for i in range(2 * n):
        e = np.zeros(2 * n, dtype=np.longdouble)
        e[i] = h
        one, two = flow(x + e) - flow(x - e), flow(x + 2 * e) - flow(x - 2 * e)
        three = flow(x + 3 * e) - flow(x - 3 * e)
        columns.append((45 * one - 9 * two + three) / (60 * h))
    jacobian = np.stack(columns, axis=1)
    zero, unit = np.zeros((n, n)), np.eye(n)
    omega = np.block([[zero, unit], [-unit, zero]])
    assert np.max(np.abs(jacobian.T @ omega @ jacobian - omega)) < 1e-12


@pytest.mark.parametrize("name", ["verlet", "rkn6", "midpoint"])
def test_time_reversal_returns_to_the_start(name):
    chain = prism_chain()
    start = smooth_blow(chain)
    dt = 0.4 if name == "midpoint" else 0.05
    there = simulate(chain, start, 30.0, method=name, dt=dt)
    back = simulate(chain, there.final.reversed(), 30.0, method=name, dt=dt)
    np.testing.assert_allclose(back.final.u, start.u, rtol=0, atol=1e-13)
    np.testing.assert_allclose(back.final.v, -start.v, rtol=0, atol=1e-13)


def test_each_recorded_row_is_where_a_run_that_ends_there_ends():
    """And the first is what was given."""
    chain = prism_chain(20)
    start = smooth_blow(chain)
    options = {"method": "rkn6", "dt": 0.25}
    run = simulate(chain, start, 4.0, record=Record(every=4), **options)
    assert np.array_equal(run.u[0], start.u)
    assert np.array_equal(run.v[0], start.v)
    for row, t in enumerate(run.t[1:], 1):
        ended = simulate(chain, start, t, record=Record(every=99), **options)
        np.testing.assert_allclose(run.u[row], ended.final.u, rtol=0, atol=1e-15)
        np.testing.assert_allclose(run.v[row], ended.final.v, rtol=0, atol=1e-15)
        assert run.energy[row] == pytest.approx(run.energy[0], rel=1e-6)


def test_locking_is_told_of_the_spring_that_locks():
    """Bond 0 closes in this step; bond 2 is the shortest one before it."""
    chain = prism_chain(4)
    end = chain.springs[0].domain[0]
    state = State(np.array([0.0, 0.0, 0.0, 0.9 * end]), np.array([1.0, 0.0, 0.0, 0.0]))
    with pytest.raises(LockingError, match="between sites 0 and 1 "):
        simulate(chain, state, 1.0, dt=0.05, method="verlet")


def test_a_run_ends_inside_the_domain_whatever_the_method():
    """The last place of a step of rk4 is none of those where it looks at the forces."""
    chain = Chain(series(domain=(-0.1, math.inf)), 2)
    end = 0.3476190476
    with pytest.raises(LockingError, match="at t =") as caught:
        simulate(chain, chain.at_rest({0: 0.3}), end, dt=0.3, method="rk4")
    assert chain.elongation(caught.value.run.final.u).min() > -0.1


@pytest.mark.parametrize("name", [*ORDERS, "corrected6"])
def test_no_time_is_no_motion(name):
    chain = prism_chain(4)
    run = simulate(chain, chain.at_rest({0: 0.01}), 0.0, method=name)
    assert run.steps == 0
    assert len(run.t) == 1


def test_a_step_longer_than_the_run_is_the_run():
    chain = prism_chain(4)
    run = simulate(chain, chain.at_rest({0: 0.01}), 0.1, dt=100.0)
    assert run.steps == 1
    assert run.dt == 0.1


def pulled(spring, energy):
    """Two masses that fly apart with that energy [J]."""
    chain = Chain(spring, 2)
    return chain, chain.at_rest({0: -math.sqrt(energy), 1: math.sqrt(energy)})


R = sp.Symbol("r")
RIGID = Prism(1.0, 0.8, 0.02, 1.0).potential()
PLAIN = series(domain=(-0.1, 0.1))  # a law that goes on beyond its domain


@pytest.mark.parametrize("method", ["verlet", "rkn6", "rk4"])
@pytest.mark.parametrize("spring", [RIGID, PLAIN], ids=["to twist 0", "a bounded domain"])
def test_a_spring_pulled_to_the_upper_end_of_its_domain_ends_the_run_there(spring, method):
    """In the very step that passes it; with a little less energy it comes back."""
    high = spring.domain[1]
    barrier = float(spring.energy(high * (1 - 1e-12)))
    chain, state = pulled(spring, 1.05 * barrier)
    with pytest.raises(LockingError, match="twist 0" if spring is RIGID else "0.1 m") as caught:
        simulate(chain, state, 2.0, dt=1e-3, method=method, record=Record(every=10))
    run = caught.value.run
    (reached,) = chain.elongation(run.final.u)
    (rate,) = np.diff(run.final.v)
    assert max(reached, run.elongation_range[0, 1]) < high < reached + 1.5e-3 * rate
    chain, state = pulled(spring, 0.95 * barrier)
    quarter = 0.4 if spring is RIGID else 2.0
    run = simulate(chain, state, quarter, dt=1e-3, method=method)
    assert 0.9 * high < run.elongation_range[0, 1] < high


def test_momentum_is_kept_to_round_off():
    chain = prism_chain()
    start = smooth_blow(chain)
    run = simulate(chain, start, 100.0, method="verlet", dt=0.02)
    assert abs(chain.momentum(run.final) - chain.momentum(start)) < 1e-14


def test_energy_error_has_no_trend_over_a_million_steps():
    chain = prism_chain(16)
    steps, dt = 1_000_000, 0.1
    run = simulate(chain, smooth_blow(chain), steps * dt, dt=dt, record=Record(every=1000))
    deviation = run.energy / run.energy[0] - 1
    trend, _ = np.polyfit(np.linspace(0, 1, len(deviation)), deviation, 1)
    assert run.steps == steps
    assert abs(trend) < 0.05 * np.ptp(deviation)  # over the whole run, of its oscillation
    assert np.ptp(deviation) < 5e-3


def test_recorded_rows_are_the_asked_steps_and_sites():
    chain = prism_chain(20)
    every = simulate(chain, smooth_blow(chain), 1.0, dt=0.1, record=Record(every=1))
    some = simulate(chain, smooth_blow(chain), 1.0, dt=0.1, record=Record(every=4, sites=[7, 0]))
    np.testing.assert_allclose(some.t, [0, 0.4, 0.8, 1.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(some.u, every.u[[0, 4, 8, 10]][:, [7, 0]], rtol=1e-14)
    np.testing.assert_allclose(some.v, every.v[[0, 4, 8, 10]][:, [7, 0]], rtol=1e-14)
    np.testing.assert_allclose(some.energy, every.energy[[0, 4, 8, 10]], rtol=1e-14)
    assert some.sites == (7, 0)
    assert some.dt == pytest.approx(0.1)


def test_no_time_gives_the_initial_row():
    chain = prism_chain(5)
    for options in ({}, {"dt": 0.1}, {"tol": 1e-6}):
        run = simulate(chain, smooth_blow(chain), 0.0, **options)
        assert run.t.tolist() == [0.0]
        assert np.array_equal(run.final.v, smooth_blow(chain).v)


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"t_end": -1.0}, "t_end"),
        ({"t_end": math.nan}, "t_end"),
        ({"dt": 0.0}, "dt"),
        ({"dt": -0.1}, "dt"),
        ({"dt": math.nan}, "dt"),
        ({"tol": 0.0}, "tol"),
        ({"dt": 0.1, "tol": 1e-3}, "exclude"),
        ({"method": "euler"}, "method"),
        ({"method": ""}, "method"),
        ({"record": "run.npy"}, "not a Record"),
        ({"record": Record(sites=[0, 99])}, "site 99"),
    ],
)
def test_impossible_runs_are_refused(options, name):
    chain = prism_chain(5)
    with pytest.raises(TensegrityError, match=name):
        simulate(chain, smooth_blow(chain), **{"t_end": 1.0, **options})


BAD_RECORDS = [
    *({"every": bad} for bad in (0, 1.5)),
    *({"sites": bad} for bad in ([], [-1], [1.7], 3, "ab", ["a"])),
    {"path": 5},
]


@pytest.mark.parametrize("bad", BAD_RECORDS)
def test_impossible_records_are_refused(bad):
    with pytest.raises(TensegrityError):
        Record(**bad)


def fastest_mode(sites=200):
    """A linear chain with fixed ends in its fastest mode, and that mode's frequency."""
    chain = Chain(series(), sites, ends=("fixed", "fixed"))
    numbers = np.arange(sites)
    state = chain.at_rest()
    state.u[1:-1] = (1e-3 * (-1.0) ** numbers * np.sin(np.pi * numbers / (sites - 1)))[1:-1]
    return chain, state, 2 * np.cos(np.pi / (2 * (sites - 1)))


@pytest.mark.parametrize("name", LIMITS)
def test_stability_limit_on_both_sides(name):
    chain, state, omega = fastest_mode()
    limit = LIMITS[name] / omega
    run = simulate(chain, state, 3000 * limit, method=name, dt=0.998 * limit)
    assert np.max(np.abs(run.final.u)) < 0.1
    with pytest.raises(StabilityError, match=r"dt .* is beyond .* s, the stability limit"):
        simulate(chain, state, 10 * limit, method=name, dt=1.001 * limit)


def test_a_step_that_becomes_too_coarse_is_noticed_with_time_and_site():
    """At rest V'' = 0 and every step seems fine; the blow itself makes the contact stiff."""
    chain = Chain(PowerLaw(1.0, 3.0), 10)
    with pytest.raises(StabilityError, match=r"t = .* s between sites 0 and 1") as caught:
        simulate(chain, chain.at_rest({0: 4.0}), 20.0, dt=0.4)
    run = caught.value.run
    assert not run.complete
    assert np.isfinite(run.u).all()


def test_a_blow_that_locks_ends_the_run_and_keeps_what_was_recorded():
    chain = prism_chain()
    with pytest.raises(LockingError, match=r"bars meet.*between sites 0 and 1.*t = 0.2") as caught:
        simulate(chain, chain.at_rest({0: 0.3}), 60.0, dt=0.001, record=Record(every=10))
    run = caught.value.run
    assert 0.19 < run.t[-1] < 0.21
    assert len(run.t) > 15
    assert np.isfinite(run.u).all()
    assert np.isfinite(run.energy).all()


def test_a_pull_that_straightens_the_bars_ends_the_run():
    chain = prism_chain(3)
    with pytest.raises(LockingError, match="twist 0"):
        simulate(chain, chain.at_rest({0: -3.0}), 3.0)


def test_a_step_over_the_end_is_not_called_locking_where_the_energy_cannot_reach_it():
    chain = prism_chain()
    with pytest.raises(StabilityError, match="too coarse"):
        simulate(chain, chain.at_rest({0: 0.15}), 60.0, dt=0.9)


@pytest.mark.parametrize("speed", [1e-6, 0.03, 0.12])
def test_the_default_step_keeps_the_energy(speed):
    chain = prism_chain()
    run = simulate(chain, chain.at_rest({0: speed}), 50.0)
    assert run.method == "rkn6"
    assert run.energy_error < 1e-6


@pytest.mark.parametrize("part", [0.5, 0.7, 0.9])
def test_the_default_step_is_refined_where_bonds_stiffen_beyond_what_was_expected(part):
    """Three masses have more energy together than locks a bond: how much one gets is not known."""
    spring = Prism(1.0, 0.9, 0.01, 1.0).potential()
    v = np.zeros(12)
    v[[0, 4, 8]] = np.sqrt(2 * part * float(spring.energy(spring.domain[0])))
    chain, duration = Chain(spring, 12), 5 / np.sqrt(float(spring.stiffness(0.0)))
    run = simulate(chain, State(np.zeros(12), v), duration)
    stiffest = max(spring.stiffness(x) for x in run.elongation_range[0])
    assert run.dt * 2 * np.sqrt(stiffest) < 2 * 0.15 * LIMITS["rkn6"]
    assert run.energy_error < 1e-9


def test_a_chain_at_rest_in_a_vacuum_stays_at_rest():
    chain = Chain(PowerLaw(1.0, 1.5), 10)
    run = simulate(chain, chain.at_rest(), 5.0)
    assert not run.u.any()
    run = simulate(chain, chain.at_rest({0: 1.0}), 30.0)
    assert run.energy_error < 1e-4


@pytest.mark.parametrize("tol", [1e-2, 1e-4, 1e-7, 1e-10])
def test_tolerance_is_kept(tol):
    chain = prism_chain()
    state = smooth_blow(chain)
    exact = simulate(
        chain, state, DURATION, method="rkn6", dt=DURATION / 4000, record=Record(every=500)
    )
    run = simulate(chain, state, DURATION, tol=tol)
    error = max(
        np.max(np.abs(run.final.u - exact.final.u)) / np.max(np.abs(exact.u)),
        np.max(np.abs(run.final.v - exact.final.v)) / np.max(np.abs(exact.v)),
    )
    assert error < tol
    assert run.error_estimate < tol
    assert run.method == "rkn6"


@pytest.mark.parametrize("periods", [3, 8, 16])
def test_tolerance_where_all_checkpoints_could_fall_on_zeros(periods):
    """A two-mass oscillator is at u = 0 at every quarter of a whole number of periods."""
    chain = Chain(series(), 2)
    t_end = periods * 2 * np.pi / np.sqrt(2)
    run = simulate(chain, chain.at_rest({0: 1.0, 1: -1.0}), t_end, tol=1e-6, record=Record(10**9))
    np.testing.assert_allclose(run.final.v, [1, -1], rtol=0, atol=1e-6)


def test_tolerance_below_round_off_is_refused():
    chain = prism_chain(5)
    with pytest.raises(TensegrityError, match=r"tol 1e-16 must be at least"):
        simulate(chain, smooth_blow(chain), 1.0, tol=1e-16)
    with pytest.raises(TensegrityError, match=r"tol 3e-14 is below"):
        simulate(prism_chain(16), smooth_blow(prism_chain(16)), 300.0, tol=3e-14)


def test_a_stiffness_without_bound_is_no_licence_for_any_step():
    """n < 1: at the opening of the contact the stiffness is infinite."""
    chain = Chain(PowerLaw(1.0, 0.5, preload=1.0), 20)
    opened = simulate(chain, chain.at_rest({0: -3.0}), 400.0)
    assert opened.energy_error < 0.01
    closed = simulate(chain, chain.at_rest({0: 0.1}), 40.0)
    assert closed.energy_error < 1e-6


def test_numbers_that_overflow_are_refused():
    chain = prism_chain(5)
    loose = Chain(PowerLaw(1.0, 3.0), 5)
    with pytest.raises(TensegrityError, match="energy"):
        simulate(loose, loose.at_rest({0: 1e200}), 1.0)
    with pytest.raises(TensegrityError, match="mass"):
        Chain(PowerLaw(1.0, 3.0), 5, mass=1e-310)
    for options in ({"dt": 1e-320}, {"dt": 1e-13}):
        with pytest.raises(StabilityError, match="steps"):
            simulate(chain, smooth_blow(chain), 1.0, **options)
    with pytest.raises(TensegrityError, match="GB"):
        simulate(chain, smooth_blow(chain), 1.0, dt=2e-12, record=Record(every=1))


@pytest.mark.parametrize("at", [0.0, 0.3, 0.7, 0.8])
def test_an_interrupt_returns_what_was_done(at):
    chain, start = blow()
    how = {"dt": 8.0 / many_steps(23), "method": "verlet", "record": Record(interval=0.07)}
    whole = simulate(chain, start, 8.0, **how)
    run = simulate(chain, start, 8.0, **how, observe=ctrl_c(8 * at))
    assert not run.complete
    assert "incomplete" in str(run)
    assert at * whole.steps <= run.steps < whole.steps  # nothing was begun after it
    assert run.t[-1] == pytest.approx(run.steps * run.dt)
    rows = int(np.searchsorted(whole.t, run.t[-1], side="right"))
    for name in ("t", "u", "v", "energy"):
        assert np.array_equal(getattr(run, name)[:rows], getattr(whole, name)[:rows])
    assert np.array_equal(run.u[-1], run.final.u)


def test_a_run_says_what_it_is():
    chain = prism_chain()
    text = str(simulate(chain, smooth_blow(chain), 5.0, tol=1e-6))
    for word in ("rkn6", "dt =", "steps", "energy", "estimated", "wall time"):
        assert word in text


def test_runs_are_reproducible_bit_for_bit():
    chain = prism_chain(100)
    one, two = (simulate(chain, smooth_blow(chain), 40.0) for _ in range(2))
    assert one.u.tobytes() == two.u.tobytes()


LOCKED = prism_chain(), {0: 0.3}, 0.001, LockingError
STIFFENED = Chain(series(0, 50), 6), {0: 1.5}, 0.8, StabilityError
GRAZED = Network([[0, 0], [1, 0], [0, 9], [3, 9.2]], [(0, 1)], SPRING, radius=0.5)
GRAZED = GRAZED, {0: (0.1, 0.0), 2: (1.0, 0.0)}, 0.1, ContactError


@pytest.mark.parametrize("scene", [LOCKED, STIFFENED, GRAZED])
def test_what_goes_wrong_is_found_in_its_step_however_the_run_was_divided(scene):
    """The same error at the same time and place, however long the run was to be."""
    scene, velocity, dt, kind = scene
    runs, texts = [], []
    how = {"dt": dt, "method": "verlet", "record": Record(every=10)}
    for steps in (9_000, 900_000):
        with pytest.raises(kind) as caught:
            simulate(scene, scene.at_rest(velocity), steps * dt, **how)
        runs.append(caught.value.run)
        texts.append(str(caught.value))
    assert texts[0] == texts[1]
    for name in ("t", "u", "v"):
        assert np.array_equal(*(getattr(run, name) for run in runs))
    alone = simulate(scene, scene.at_rest(velocity), runs[0].t[-1], dt=dt, method="verlet")
    assert np.array_equal(alone.final.u, runs[0].final.u)  # in one go, where nothing went wrong


@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")
def test_a_run_that_overflows_ends():
    """Two bodies that never meet go out of what a number can say; no elongation shows it."""
    state = State([0.0, 1.0], [1e150, 1e150])
    with pytest.raises(StabilityError) as caught:
        simulate(Chain(PowerLaw(1.0, 1.5), 2), state, 1e200, dt=1e199)
    assert np.isfinite(caught.value.run.u).all()


@pytest.mark.parametrize(("given", "used"), [(50.0, "10"), (7.0, "5")])
@pytest.mark.parametrize("drive", [{}, {"damping": Damping(0.1)}])
def test_a_step_that_is_refused_is_the_one_given(given, used, drive):
    """Also where the one used is smaller, so as to divide the time evenly."""
    one = Chain(prism_chain().springs[0], 5, **drive)
    words = rf"dt {given:g} s, that is steps of {used} s, is beyond"
    with pytest.raises(StabilityError, match=words):
        simulate(one, one.at_rest({0: 0.01}), 10.0, dt=given)
