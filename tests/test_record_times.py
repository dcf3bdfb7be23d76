"""Rows at instants of the user's choice, whatever the step, as accurate as the run."""

import numpy as np
import pytest
from networks import triangles
from oracle import ORDERS
from scenes import blow, lanes, prism_chain
from springs import series

from granular import Bead, Striker, materials, y_guide
from tensegrity import (
    Chain,
    LockingError,
    PowerLaw,
    Record,
    State,
    TensegrityError,
    simulate,
)

TIMES = (0.0, 0.137, 0.31, 1.2345, 1.2346, 3.3, 4.0)
ALL = ["verlet", "rkn6", "rk4", "midpoint"]


SCENES = {"chain": blow, "lanes": lanes, "network": triangles}
CASES = [(s, m) for s in SCENES for m in ALL]


@pytest.mark.parametrize(("name", "method"), CASES)
def test_values_between_steps_have_the_order_and_the_accuracy_of_the_run(name, method):
    scene, state = SCENES[name]()
    record = Record(times=TIMES)

    def rows(steps, method=method):
        run = simulate(scene, state, TIMES[-1], dt=4.0 / steps, method=method, record=record)
        assert run.t.tolist() == list(TIMES)
        assert run.steps == steps
        return np.stack([run.u, run.v])

    exact, counts = rows(400, "rkn6"), np.array([18, 27, 40])
    errors = [np.abs(rows(n) - exact).max(axis=(0, *range(2, exact.ndim))) for n in counts]
    between, ends = np.array(errors)[:, 3:-1].max(axis=1), np.array(errors)[:, -1]
    fitted = -np.polyfit(np.log(counts), np.log(between), 1)[0]
    order = ORDERS[method]
    assert order - 0.4 < fitted < order + 2, errors
    assert np.all(between < 3 * ends)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.3])
@pytest.mark.parametrize("tol", [1e-5, 1e-9])
def test_values_between_steps_keep_a_tolerance_where_contacts_open(exponent, tol):
    """Just before an opening, and just behind a closing: the last kicks of a step do not tell."""
    chain = Chain(PowerLaw(1.0, exponent), 2)
    state, end, count = State([0.0, 0.2], [1.0, 0.0]), 5.0, 2000
    run = simulate(chain, state, end, tol=tol, record=Record(interval=end / count))
    dense = Record(every=8)
    exact = simulate(chain, state, end, dt=end / (8 * count), method="corrected6", record=dense)
    np.testing.assert_allclose(run.t, exact.t, rtol=1e-12)
    for found, wanted in ((run.u, exact.u), (run.v, exact.v)):
        assert np.abs(found - wanted).max() < tol * np.abs(wanted).max()


@pytest.mark.parametrize("method", [*ALL, "corrected6"])
def test_what_is_recorded_changes_no_bit_of_the_run(method):
    chain, state = blow()
    if method == "corrected6":
        chain = Chain(PowerLaw(1.0, 1.5), 24)
    options = {"dt": 0.1, "method": method}
    plain = simulate(chain, state, 8.0, **options)
    for record in (Record(every=1), Record(every=7), Record(interval=0.33), Record(times=TIMES)):
        run = simulate(chain, state, 8.0, **options, record=record)
        for name in ("u", "v"):
            assert np.array_equal(getattr(run.final, name), getattr(plain.final, name)), record
        same = np.isin(run.t, plain.t)
        assert np.array_equal(run.u[same], plain.u[np.isin(plain.t, run.t)])


def test_what_is_recorded_changes_no_bit_where_contacts_open_and_walls_are():
    steel = Bead(4.76e-3, materials["steel"])
    guide = y_guide(5, 4, bead=steel, striker=Striker(steel, 0.5))
    plain = simulate(guide, guide.start(), 1e-4)
    run = simulate(guide, guide.start(), 1e-4, record=Record(interval=1.7e-6))
    assert run.dt == plain.dt
    assert np.array_equal(run.final.v, plain.final.v)
    assert np.array_equal(run.impulse[-1], plain.impulse[-1])
    assert np.array_equal(run.elongation_range, plain.elongation_range)
    expected = np.interp(run.t, plain.t, plain.impulse[:, 0, 1])
    np.testing.assert_allclose(run.impulse[:, 0, 1], expected, rtol=0, atol=1e-2 * expected[-1])


def test_lanes_and_a_network_too():
    for scene, state in (lanes(), triangles()):
        plain = simulate(scene, state, 4.0, dt=0.1)
        run = simulate(scene, state, 4.0, dt=0.1, record=Record(times=TIMES))
        assert np.array_equal(run.final.u, plain.final.u)
        assert np.array_equal(run.final.v, plain.final.v)


def test_an_interval_goes_from_the_start_to_the_end():
    chain, state = blow()
    run = simulate(chain, state, 1.0, record=Record(interval=0.3))
    assert run.t == pytest.approx([0, 0.3, 0.6, 0.9, 1.0], abs=1e-15)
    even = simulate(chain, state, 1.0, record=Record(interval=0.1))
    assert len(even.t) == 11
    assert even.t[-1] == 1.0
    assert simulate(chain, state, 0.0, record=Record(interval=0.1)).t.tolist() == [0.0]
    assert simulate(chain, state, 1.0, record=Record(interval=5.0)).t.tolist() == [0.0, 1.0]


def test_instants_do_not_depend_on_the_step_that_a_tolerance_takes(tmp_path):
    chain, state = blow()
    path = tmp_path / "run.npy"
    run = simulate(chain, state, 4.0, tol=1e-10, record=Record(times=TIMES, path=path, sites=[3]))
    assert np.load(path)["t"].tolist() == run.t.tolist() == list(TIMES)
    assert run.u.shape == (len(TIMES), 1)
    exact = simulate(chain, state, 4.0, dt=0.01, method="rkn6", record=Record(times=TIMES))
    largest = np.abs(exact.u).max()
    assert np.abs(run.u[:, 0] - exact.u[:, 3]).max() < 1e-10 * largest


def test_a_run_that_locks_between_instants_ends_with_its_final_state():
    chain = prism_chain()
    with pytest.raises(LockingError) as caught:
        simulate(chain, chain.at_rest({0: 0.3}), 9.0, dt=0.001, record=Record(interval=0.0717))
    run = caught.value.run
    assert run.t[:-1] == pytest.approx(0.0717 * np.arange(len(run.t) - 1), rel=1e-14)
    assert run.t[-1] == run.steps * run.dt
    assert np.array_equal(run.u[-1], run.final.u)


def test_a_shorter_step_that_fails_ends_the_run_with_what_it_had():
    """A whole step of verlet ends inside the domain where half of it does not."""
    chain = Chain(series(k=0.25, domain=(-0.2, 0.11)), 2)
    state, how = State([0, 0.09], [0, 0.05]), {"dt": 1.9, "method": "verlet"}
    assert simulate(chain, state, 1.9, **how).complete
    with pytest.raises(LockingError) as caught:
        simulate(chain, state, 1.9, **how, record=Record(times=[0.0, 0.95, 1.9]))
    run = caught.value.run
    assert run.t[0] == 0
    assert np.array_equal(run.u[-1], run.final.u)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"every": 2, "times": [1.0]}, "every and times exclude"),
        ({"interval": 0.1, "times": [1.0]}, "times and interval exclude"),
        ({"times": []}, "times is empty"),
        ({"times": "12"}, "sequence of instants"),
        ({"times": 1.0}, "sequence of instants"),
        ({"times": [0.0, -1.0]}, "-1 s must be at least 0"),
        ({"times": [0.0, 0.5, 0.5]}, "time 0.5 s to record follows 0.5 s"),
        ({"times": [0.0, float("nan")]}, "not finite"),
        ({"times": [0.1, "x"]}, "'x' is not a number"),
        ({"checkpoint": 1.0}, "needs a path"),
    ],
)
def test_records_that_mean_nothing_are_refused(options, words):
    with pytest.raises(TensegrityError, match=words):
        Record(**options)


def test_instants_that_a_run_does_not_reach_are_refused():
    chain, state = blow()
    with pytest.raises(TensegrityError, match=r"time 1\.5 s to record is after the end, 1 s"):
        simulate(chain, state, 1.0, record=Record(times=[0.0, 1.5, 2.0]))
    with pytest.raises(TensegrityError, match="GB of memory"):
        simulate(chain, state, 1.0, record=Record(interval=1e-13))
