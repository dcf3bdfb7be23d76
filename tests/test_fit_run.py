"""Fits of a run to records: against SciPy's own fit, what is covered, what is not determined."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit

from granular import Bead, Striker, materials, sensor_force, y_guide
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Network,
    PowerLaw,
    Record,
    State,
    TensegrityError,
    TimeSeries,
    first_peak,
    fit_run,
    objective,
    simulate,
)

T = np.linspace(0.0, 3.0, 61)  # [s]


def beads(stiffness=2.0, preload=0.3, loss=0.1, mass=1.5):
    """Four beads, of which the third holds a sensor, with dashpots."""
    spring = PowerLaw(stiffness, 1.5, preload)
    chain = Chain(spring, 4, mass=[1.0, 1.0, mass, 1.0], damping=Damping(bond=loss))
    return chain, chain.at_rest({0: 0.6})


def loads(chain, start, t, bonds=(1, 2)):
    """Of bonds, by a run with a tolerance."""
    inside = np.clip(t, 0, None)
    run = simulate(
        chain, start, float(inside.max()), tol=1e-10, record=Record(times=np.unique(inside))
    )
    found = -chain.bond_tension(run.u)[:, list(bonds)]
    return np.array([np.interp(inside, run.t, row) for row in found.T])


TRUE = {"stiffness": 2.0, "preload": 0.3, "loss": 0.1, "mass": 1.5, "trigger": 0.2}
GUESS = {"stiffness": 2.3, "preload": 0.25, "loss": 0.15, "mass": 1.3, "trigger": 0.15}
NOISE = 0.005  # N


@pytest.fixture(scope="module")
def two():
    """Records of two contacts, of which time 0 is 0.2 s after the impact."""
    clean = loads(*beads(), T + 0.2)
    noisy = clean + NOISE * np.random.default_rng(3).normal(size=clean.shape)
    return {
        objective.load(k): TimeSeries(T, row, "N", NOISE)
        for k, row in zip((1, 2), noisy, strict=True)
    }


def test_contact_constants_loss_prestress_mass_and_trigger_as_scipy_fits_them(two):
    """`curve_fit` takes whole runs with a tolerance, and differences for derivatives."""
    found = fit_run(two, beads, GUESS, dt=0.02, method="rk8")
    measured = np.concatenate([record.values for record in two.values()])

    def model(_, stiffness, preload, loss, mass, trigger):
        return loads(*beads(stiffness, preload, loss, mass), T + trigger).ravel()

    x = np.arange(measured.size)
    best, covariance = curve_fit(model, x, measured, list(found.values.values()))
    errors = np.sqrt(np.diag(covariance))
    assert list(found.values.values()) == pytest.approx(best, abs=0.02 * errors.min(), rel=1e-4)
    assert list(found.errors.values()) == pytest.approx(errors, rel=0.02)
    assert found.correlation == pytest.approx(covariance / np.outer(errors, errors), abs=0.02)
    for name, (low, high) in found.intervals().items():
        assert low < found.values[name] < high
        assert high - low == pytest.approx(2 * 1.98 * found.errors[name], rel=0.1)
        assert abs(found.values[name] - TRUE[name]) < 4 * found.errors[name]
    assert found.factor == pytest.approx(1.0, rel=0.2)
    assert found.unidentified == ()
    assert [len(left) for left in found.residuals] == [61, 61]
    assert "122 samples of 2 records" in str(found)


def test_the_modulus_of_the_guide_of_fig_2_comes_back_from_three_sensors():
    steel = materials["steel"]

    def guide(modulus):
        bead = Bead(4.76e-3, replace(steel, modulus=modulus), mass=0.45e-3)
        return y_guide(bead=bead, striker=Striker(bead, 0.585))

    made, records, rng = guide(steel.modulus), {}, np.random.default_rng(7)
    run = simulate(made, made.start(), 420e-6, tol=1e-8, record=Record(interval=1e-6))
    for sensor in (("stem 1", 12), ("stem 1", 16), ("branch 1", 4)):
        force, site = sensor_force(run, *sensor), made.site(*sensor)
        noise = 0.02 * force.max()
        noisy = force + noise * rng.normal(size=force.size)
        both = tuple(objective.load(k) for k, ends in enumerate(made.bonds) if site in ends)
        records[both] = TimeSeries(run.t - 50e-6, noisy, "N")
    guess = {"modulus": 0.8 * steel.modulus, "trigger": 45e-6}
    found = fit_run(records, guide, guess, dt=0.4e-6, method="rkn6")
    assert found.values["modulus"] == pytest.approx(steel.modulus, rel=0.01)
    assert found.errors["modulus"] < 0.003 * steel.modulus
    assert found.values["trigger"] == pytest.approx(50e-6, abs=0.5e-6)
    assert found.factor == pytest.approx(1.0, rel=0.1)
    assert found.scene == guide(found.values["modulus"])


SHORT = np.linspace(0.0, 2.4, 41)
STIFF = {"stiffness": 2.0, "trigger": 0.1}


def three(stiffness):
    return Chain(PowerLaw(stiffness, 1.5), 3), State(np.zeros(3), np.array([1.0, 0.0, 0.0]))


def covered(draws, seed):
    """Shares of records whose 95 % intervals contain what made them."""
    clean = loads(*three(2.0), SHORT + 0.1, (1,))[0]
    rng, inside = np.random.default_rng(seed), []
    for _ in range(draws):
        noisy = TimeSeries(SHORT, clean + 0.02 * rng.normal(size=41), "N", 0.02)
        found = fit_run({objective.load(1): noisy}, three, STIFF, dt=0.05, method="rkn6")
        ends = found.intervals()
        inside.append([ends[name][0] < value < ends[name][1] for name, value in STIFF.items()])
    return np.mean(inside, axis=0)


def test_intervals_of_some_records_contain_the_truth():
    assert (covered(4, 2) >= 0.75).all()


@pytest.mark.slow
def test_95_in_100_intervals_contain_the_truth():
    shares = covered(3000, 1)
    assert (shares > 0.93).all()
    assert (shares < 0.97).all()


def test_what_the_records_do_not_determine_is_said():
    clean = loads(*three(2.0), SHORT, (1,))[0]
    record = {objective.load(1): TimeSeries(SHORT, clean, "N", 0.02)}

    def product(one, other):
        return three(one * other)

    found = fit_run(record, product, {"one": 1.1, "other": 2.0}, dt=0.05)
    assert any("one and other: correlation -1.0000" in words for words in found.unidentified)
    assert any("one: its standard error is" in words for words in found.unidentified)
    assert found.values["one"] * found.values["other"] == pytest.approx(2.0, rel=0.01)
    assert found.intervals()["one"] == (0.0, np.inf)

    def idle(stiffness, loss):
        return Chain(PowerLaw(stiffness, 1.5), 3, damping=Damping(bond=loss)), three(2.0)[1]

    noisy = TimeSeries(SHORT, clean + 0.02 * np.random.default_rng(4).normal(size=41), "N", 0.02)
    lossless = fit_run({objective.load(1): noisy}, idle, {"stiffness": 2.0, "loss": 0.02}, dt=0.05)
    assert "loss: its standard error is" in lossless.unidentified[0]


def test_a_drive_of_unknown_size_is_found():
    import sympy as sp

    def driven(size):
        push = Drive(force=sp.Symbol("a") * sp.sin(sp.Symbol("t")), parameters={"a": size})
        return Chain(PowerLaw(2.0, 1.0), 3, drive={0: push})

    chain = driven(0.5)
    run = simulate(chain, chain.at_rest(), 3.0, tol=1e-10, record=Record(times=T))
    record = {objective.displacement(2): TimeSeries(T, run.u[:, 2], "m", 1e-3)}
    found = fit_run(record, driven, {"size": 0.4}, dt=0.05)
    assert found.values["size"] == pytest.approx(0.5, rel=1e-4)


def test_a_parameter_that_gradients_do_not_follow_is_named():
    """The direction of a bond of a network depends on where its sites are."""

    def bent(height):
        net = Network([[0, 0], [1, height], [2, 0]], [(0, 1), (1, 2)], PowerLaw(2.0, 1.0), held=[0])
        return net, net.at_rest({2: (-0.3, 0.0)})

    net, start = bent(0.5)
    run = simulate(net, start, 3.0, tol=1e-8, record=Record(times=T))
    record = {objective.displacement(1, axis=1): TimeSeries(T, run.u[:, 1, 1], "m", 1e-3)}
    with pytest.raises(
        TensegrityError, match="height changes the scene in a way that gradients do"
    ):
        fit_run(record, bent, {"height": 0.4}, dt=0.05)


def test_records_without_noise_count_by_their_largest_values():
    clean = loads(*three(2.0), SHORT, (0, 1))
    records = {objective.load(k): TimeSeries(SHORT, row, "N", 0.0) for k, row in enumerate(clean)}
    found = fit_run(records, three, {"stiffness": 1.7}, dt=0.01, method="rkn6")
    assert found.values["stiffness"] == pytest.approx(2.0, rel=1e-5)
    assert found.factor < 1e-4


def test_a_fit_is_drawn_with_its_records(two):
    found = fit_run(
        two, lambda stiffness: beads(stiffness), {"stiffness": 2.0, "trigger": 0.2}, dt=0.02
    )
    ax = found.plot()
    assert [line.get_label() for line in ax.lines[1::2]] == ["load of bond 1", "load of bond 2"]
    assert (ax.lines[0].get_xdata()[0], ax.get_ylabel()) == (found.values["trigger"], "value [N]")
    top = first_peak(ax.lines[1].get_xdata(), ax.lines[1].get_ydata(), noise=0.0).height
    assert top == pytest.approx(two[objective.load(1)].values.max(), abs=4 * NOISE)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"records": {}}, "records {} must be a dict"),
        ({"records": {3: TimeSeries(SHORT, SHORT)}}, "sensor 3 is not a Trace"),
        ({"records": {objective.load(1): SHORT}}, "record of load of bond 1"),
        ({"records": {objective.load(1): TimeSeries(SHORT, 0 * SHORT)}}, "are 0"),
        ({"free": {}}, "free {} must be a dict"),
        ({"free": {"stiffness": 0.0}}, "guess of stiffness is 0"),
        ({"free": {"stiffness": np.nan}}, "guess of stiffness"),
        ({"free": {"stiffness": 1e9}}, "unstable|stab|step"),
        ({"scene": lambda stiffness: 3}, "gave 3, must give a scene"),
        (
            {"scene": lambda stiffness: Chain(PowerLaw(2.0, 1.5), 3 + int(stiffness > 2.0))},
            "number of",
        ),
        ({"records": {objective.load(7): TimeSeries(SHORT, SHORT)}}, "bond 7 must be below 2"),
    ],
)
def test_what_cannot_be_fitted_is_refused(change, words):
    given = {
        "records": {objective.load(1): TimeSeries(SHORT, np.sin(SHORT), "N")}, "scene": three,
        "free": {"stiffness": 2.0}, "dt": 0.05,
    } | change  # fmt: skip
    with pytest.raises(TensegrityError, match=words):
        fit_run(**given)
