"""Error against cost: the cheapest method is the cheapest, errors and stable steps are true."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp
from random_scenes import KINDS

import tensegrity as ts
from tensegrity import Chain, Potential, PowerLaw, State, TensegrityError, simulate, work_precision
from tensegrity.precision.peers import Entry, Peer

SITES, END = 12, 40.0
ERRORS = 1e-2, 1e-4, 1e-6, 1e-8
RK8_STAGES, DENSE = 12, 60
WORSE = 1.25  # evaluations of the method recommended, over the fewest


def linear():
    r = sp.Symbol("r")
    chain = Chain(Potential(r**2 / 2, r), SITES)
    return chain, State(np.zeros(SITES), np.random.default_rng(3).standard_normal(SITES))


def modes_of(state, t):
    """The state of the linear chain by its modes."""
    number = np.arange(SITES)
    omega = 2 * np.sin(np.pi * number / (2 * SITES))
    shapes = np.cos(np.pi * np.outer(number, number + 0.5) / SITES)
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    speeds = shapes @ state.v
    places = np.where(omega, np.sin(omega * t) / np.where(omega, omega, 1), t) * speeds
    return State(shapes.T @ places, shapes.T @ (np.cos(omega * t) * speeds))


@pytest.fixture(scope="module")
def harmonic():
    chain, state = linear()
    return work_precision(chain, state, END, peers=["dop853"])


def off(found, u, v):
    """Error of a last state, by the scales that errors of the result have."""
    return distance(found, State(u, v))


def test_own_reference_is_the_closed_form_within_its_error(harmonic):
    true = modes_of(linear()[1], END)
    assert off(harmonic, true.u, true.v) < 3 * harmonic.reference_error + 3e-14
    assert harmonic.reference_error < 1e-12


def test_errors_are_those_that_the_runs_have_against_the_closed_form(harmonic):
    chain, state = linear()
    given = work_precision(chain, state, END, reference=lambda t: modes_of(state, t))
    assert given.reference_error == 0
    for error in ERRORS:
        one, other = harmonic.best(error), given.best(error)
        assert (one.method, one.dt, one.evaluations) == (other.method, other.dt, other.evaluations)
        assert one.error == pytest.approx(other.error, rel=1e-2)
        run = simulate(chain, state, END, method=one.method, dt=one.dt)
        assert off(harmonic, run.final.u, run.final.v) == pytest.approx(one.error, rel=1e-2)


def test_long_double_is_a_reference_where_springs_are_smooth(harmonic):
    chain, state = linear()
    if np.finfo(np.longdouble).eps == np.finfo(float).eps:
        pytest.skip("long double is double here")
    found = work_precision(chain, state, END, ["rkn6"], reference="long double")
    true = modes_of(state, END)
    assert off(harmonic, found.final.u, found.final.v) < 1e-13
    assert np.abs(np.asarray(found.final.u, float) - true.u).max() < 3e-14
    open_contacts = Chain(PowerLaw(1.0, 1.5), 3)
    with pytest.raises(TensegrityError, match="chains of smooth springs"):
        work_precision(open_contacts, open_contacts.at_rest({0: 1.0}), 2.0, reference="long double")


def test_largest_stable_step_of_a_linear_chain_is_that_of_its_highest_mode(harmonic):
    highest = 2 * np.cos(np.pi / (2 * SITES))
    found = {one.method: one for one in harmonic.stability}
    assert found["verlet"].found == pytest.approx(2 / highest, rel=0.02)
    assert found["verlet"].predicted == pytest.approx(2 / highest, rel=0.02)
    assert found["verlet"].fails == "growth"
    assert not found["verlet"].reason
    for one in found.values():
        assert abs(one.found / one.predicted - 1) < 0.02 or one.reason


def test_a_loose_bound_of_the_frequency_is_the_reason_that_is_named():
    """Masses of a light and a heavy end: the bound counts each bond as if its other end moved."""
    r = sp.Symbol("r")
    chain = Chain(Potential(r**2 / 2, r), 3, mass=[1.0, 100.0, 100.0])
    state = chain.at_rest({0: 0.1})
    found = work_precision(chain, state, 200.0, ["rk4", "verlet"], seconds=4.0).stability
    limit = {one.method: one for one in found}["verlet"]
    scaled = np.array([[1, -0.1, 0], [-0.1, 0.02, -0.01], [0, -0.01, 0.01]])
    highest = np.sqrt(np.linalg.eigvalsh(scaled)[-1])
    assert limit.found == pytest.approx(2 / highest, rel=0.01)
    over = limit.found / limit.predicted - 1
    assert over > 0.1
    assert f"{over:.0%}"[:2] in limit.reason
    assert "bound of the" in limit.reason


def test_runge_kutta_methods_lose_energy_and_symplectic_ones_do_not(harmonic):
    drifts = {one.method: one for one in harmonic.energy}
    assert drifts["rk4"].drifts
    assert drifts["rk4"].drift < 0
    assert not drifts["verlet"].drifts
    assert not drifts["rkn6"].drifts
    assert drifts["verlet"].largest < 3 * drifts["verlet"].first


def scanned(found, state, error):
    """The fewest evaluations from which on an error is kept, in a dense scan of all methods.

    Down to half the cost of the method recommended: if an error is kept that far, that is enough.
    """
    fewest, top = math.inf, found.best(error).evaluations
    for name in found.methods:
        per_step = ts.METHODS[name].stages if name in ts.METHODS else RK8_STAGES
        counts = np.unique(np.linspace(top / 2, top, DENSE) // per_step).astype(int)
        counts = counts[counts > 0]
        errors = np.full(len(counts), np.inf)
        for k, n in enumerate(counts.tolist()):
            record = ts.Record(times=[found.t_end])
            try:
                end = simulate(found.scene, state, found.t_end, method=name, dt=found.t_end / n,
                               record=record).final  # fmt: skip
            except TensegrityError:
                continue
            errors[k] = distance(found, end)
        kept = np.flatnonzero(np.logical_and.accumulate(errors[::-1] <= error)[::-1])
        if kept.size:
            fewest = min(fewest, per_step * counts[kept[0]])
    return fewest


def distance(found, end):
    """Error of a last state, by the scales that errors of the result have."""
    return max(
        np.abs(a - b).max() / s
        for a, b, s in zip((end.u, end.v), (found.final.u, found.final.v), found.scale, strict=True)
    )


def assert_judges_well(kind, seed):
    scene, state, t_end = KINDS[kind](np.random.default_rng(seed))
    found = work_precision(scene, state, t_end, seconds=20.0)
    reached = 0
    for error in ERRORS:
        try:
            best = found.best(error)
        except TensegrityError:
            continue
        reached += 1
        run = simulate(scene, state, t_end, method=best.method, dt=best.dt)
        assert distance(found, run.final) + found.reference_error <= error
        assert best.evaluations <= WORSE * scanned(found, state, error), (kind, seed, error)
    assert reached >= 2, found
    for limit in found.stability:
        agrees = abs(limit.found / limit.predicted - 1) <= 0.02
        assert agrees or limit.reason, (kind, seed, str(limit))
    return found


@pytest.mark.parametrize("kind", ["preloaded", "pack"])
def test_best_is_the_cheapest_of_a_dense_scan(kind):
    assert_judges_well(kind, 3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_best_is_the_cheapest_of_a_dense_scan_on_random_scenes(seed):
    kind = list(KINDS)[seed % len(KINDS)]
    found = assert_judges_well(kind, seed)
    if kind in ("corners", "lanes"):
        return
    scene, state, t_end = KINDS[kind](np.random.default_rng(seed))
    end = simulate(scene, state, t_end, tol=1e-10, record=ts.Record(times=[t_end]))
    assert distance(found, end.final) < 3 * (1e-10 + found.reference_error)


def test_other_programs_run_beside_and_say_their_evaluations(harmonic):
    rows = harmonic.ladder("dop853")
    assert min(row.error for row in rows) < 1e-9
    assert rows[0].evaluations < rows[-1].evaluations
    pytest.importorskip("numba")
    chain, state = linear()
    found = work_precision(chain, state, END, ["verlet"], ["numba"])
    ours = found.cost("verlet", 1e-4, "evaluations")
    assert found.cost("numba", 1e-4, "evaluations") == pytest.approx(ours, rel=0.05)


def test_an_interrupt_returns_what_was_done():
    def interrupts(scene, state, t_end):
        raise KeyboardInterrupt
        yield Entry

    chain, state = linear()
    found = work_precision(chain, state, END, ["verlet", "rkn6"], [Peer("mine", interrupts)])
    assert found.ended == "interrupted"
    assert not found.stability
    assert found.best(1e-6).method == "rkn6"


def test_a_budget_ends_the_comparison_and_what_is_not_reached_is_said():
    chain, state = linear()
    found = work_precision(chain, state, END, seconds=1e-6)
    assert found.rows == ()
    assert "ended after" in found.ended
    with pytest.raises(TensegrityError, match="no run kept it"):
        found.best(1e-3)


def test_table_and_picture_have_each_run(harmonic):
    frame = harmonic.to_dataframe()
    assert len(frame) == len(harmonic.rows)
    assert frame.error.min() < 1e-11
    ax = harmonic.plot()
    names = {line.get_label() for line in ax.lines}
    assert {"verlet", "rkn6", "dop853", "simulate(tol=)"} <= names
    assert ax.get_xlim()[0] > ax.get_xlim()[1]  # better to the right
    with pytest.raises(TensegrityError, match="cost 'joules' must be one of evaluations, seconds"):
        harmonic.plot(cost="joules")
    plt.close("all")


def test_words_name_the_method_its_step_and_what_others_need(harmonic):
    best = harmonic.best(1e-6)
    assert best.why.startswith(f"{best.method}, dt {best.dt:.3g} s: {best.evaluations:,}")
    assert "verlet needs" in best.why
    assert "simulate(tol=" in best.why
    assert "1e-06" in str(harmonic)
    assert "left out: corrected6" in str(harmonic)


def test_time_at_an_error_lies_on_the_power_law_between_two_runs(harmonic):
    rows = harmonic.ladder("verlet")
    middle = math.sqrt(rows[0].error * rows[-1].error)
    cost = harmonic.cost("verlet", middle, "evaluations")
    below = next(row for row in rows if row.error <= middle)
    assert below.evaluations / 1.3 < cost <= below.evaluations
    assert math.isinf(harmonic.cost("verlet", 1e-20))


@pytest.mark.parametrize(
    ("given", "message"),
    [({"methods": ["euler"]}, "is not one of"), ({"peers": ["matlab"]}, "peer 'matlab'"),
     ({"methods": ["rk4"], "reference": "double"}, "'long double'"), ({"seconds": 0.0}, "seconds")],
)  # fmt: skip
def test_wrong_arguments_are_named(given, message):
    chain, state = linear()
    with pytest.raises(TensegrityError, match=message):
        work_precision(chain, state, END, **given)
