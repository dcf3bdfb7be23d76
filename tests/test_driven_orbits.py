"""Periodic responses of driven and damped chains, and their continuation.

Folds and torus points are those of independent codes: shooting with a Runge-Kutta method of order 8
in twice the steps, harmonic balance with 20 harmonics, and pyHarm 1.2.2 for Duffing's oscillator.
"""

import math
from concurrent.futures import ProcessPoolExecutor
from functools import cache

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    Force,
    Potential,
    PowerLaw,
    Prism,
    State,
    TensegrityError,
    floquet,
    orbit_path,
    periodic_orbit,
    simulate,
    sweep,
)
from tensegrity.orbits.flow import DrivenFlow

T, W, U, V, R, RATE = sp.symbols("t W u v r rate")
PRISM = Prism(1.0, 0.7, 0.1, 1.0).potential()
DUFFING = Potential(R**2 / 2 + R**4 / 4, R)
LINEAR = Potential(R**2 / 2, R)


def shaken(spring, force, ground, frequency, **more):
    """A mass on a held base."""
    drive = Drive(force=force * sp.cos(W * T), parameters={"W": frequency})
    forcing = {"damping": Damping(ground=ground), "drive": {1: drive}} | more
    return Chain(spring, 2, ends=("fixed", "free"), **forcing)


def response(scene, until):
    """Of a scene that starts from rest far from resonance."""
    return orbit_path(periodic_orbit(scene, scene.at_rest()), by="W", until=until)


@cache
def prism_orbit():
    return periodic_orbit(scene := shaken(PRISM, 0.001, 0.02, 1.68), scene.at_rest())


@cache
def prism_response():
    """Over a resonance, with two folds."""
    return orbit_path(prism_orbit(), by="W", until=1.74)


def beads():
    """Ten beads, the second one light, between a moving wall and a fixed one."""
    mass = np.ones(12)
    mass[2] = 0.5
    wall = Drive(displacement=0.02 * sp.cos(W * T), parameters={"W": 2.83})
    forcing = {"damping": Damping(ground=0.005), "drive": {0: wall}}
    return Chain(PowerLaw(1.0, 1.5, preload=1.0), 12, mass, ("free", "fixed"), **forcing)


def values(path, kind):
    return np.array([event.value for event in path.events if event.kind == kind])


@pytest.mark.parametrize(
    ("scene", "until", "folds"),
    [
        (None, 1.74, [1.72627260149807, 1.69896188992076]),
        (shaken(DUFFING, 0.05, 0.05, 1.08), 1.26, [1.22699410451938, 1.10587678963098]),
        (shaken(PRISM, 0.002, 0.05, 1.66), 1.76, []),
    ],
    ids=["prism", "Duffing", "damped prism"],
)
def test_folds_of_a_response_are_those_of_harmonic_balance(scene, until, folds):
    path = response(scene, until) if scene else prism_response()
    assert [event.kind for event in path.events] == ["fold"] * len(folds)
    assert np.allclose(values(path, "fold"), folds, rtol=0, atol=1e-10)
    assert path.columns["W"][-1] == pytest.approx(until, abs=1e-12)
    assert path.stable[[0, -1]].all()
    between = path.stable[slice(*[event.row + 1 for event in path.events])] if folds else []
    assert not np.any(between)
    for event in path.events:
        assert event.multiplier == pytest.approx(1, abs=1e-9)


@pytest.mark.slow
def test_ten_beads_with_a_light_one_have_folds_and_torus_points():
    path = response(beads(), 2.75)
    assert np.allclose(values(path, "fold"), [2.754734771536, 2.79844666645761], rtol=0, atol=1e-10)
    torus = values(path, "torus")
    assert np.abs(torus - 2.814324508447).min() < 1e-10
    assert np.abs(torus - 2.758314250225).min() < 1e-10
    assert not any(orbit.opens for orbit in path.orbits)
    assert path.stable.any()
    assert not path.stable.all()


PULLS = (
    Force(-0.1 * V**3 - 0.2 * U**3 * sp.cos(1.3 * T) ** 2),
    Force(0.3 * RATE * R**2, "bonds", at=[1, 3]),
)


@pytest.mark.parametrize("forces", [(), PULLS])
def test_tangents_are_the_derivatives_of_the_flow(forces):
    n, time = 6, 3.7
    drive = {
        0: Drive(displacement=0.02 * sp.cos(W * T), parameters={"W": 1.7}),
        2: Drive(force=0.01 * sp.sin(2 * W * T), parameters={"W": 1.7}),
    }
    chain = Chain(PRISM, n, np.linspace(1, 2, n), ("free", "fixed"), drive=drive, forces=forces,
                  damping=Damping(bond=0.05, ground=0.02))  # fmt: skip
    flow, free = DrivenFlow(chain, 30, time), [1, 2, 3, 4, 7, 8, 9, 10]
    u, v = chain.at_rest().u, chain.at_rest().v
    u[1:-1] += 0.03 * np.random.default_rng(0).normal(size=n - 2)

    def difference(end):
        h = 4e-5
        return (8 * (end(h) - end(-h)) - end(2 * h) + end(-2 * h)) / (12 * h)

    tangent, column = flow.tangents(u, v, time, by="W")[2:]
    columns = [
        difference(lambda s, d=d: np.concatenate(flow.end(u + s * d[0], v + s * d[1], time)))
        for d in np.eye(2 * n).reshape(2 * n, 2, n)
    ]
    by = difference(lambda s: np.concatenate(flow.end(u, v, time, {"W": 1.7 + s})))
    assert np.abs(np.transpose(columns) - tangent)[np.ix_(free, free)].max() < 2e-11
    assert np.abs(by - column)[free].max() < 2e-11 < np.abs(column[free]).max()
    run = simulate(chain, State(u, v), time, tol=1e-11)
    assert np.abs(run.final.u - flow.end(u, v, time)[0]).max() < 1e-9


@pytest.mark.parametrize("damping", [Damping(bond=0.1), Damping(bond=0.07, ground=0.03)])
def test_the_product_of_the_multipliers_is_that_of_the_decay(damping):
    mass = np.array([1.0, 2.0, 0.7, 1.3, 1.0])
    drive = {4: Drive(force=0.002 * sp.sin(1.1 * T))}
    chain = Chain(PRISM, 5, mass, ("fixed", "free"), damping=damping, drive=drive)
    orbit = periodic_orbit(chain, chain.at_rest())
    ends = np.array([2.0, 2.0, 2.0, 1.0])  # bonds of each free site
    trace = np.sum((ends * damping.bond + damping.ground) / mass[1:])
    found = np.prod(floquet(orbit).multipliers)
    assert found == pytest.approx(math.exp(-trace * orbit.period), rel=1e-11)
    assert orbit.period == pytest.approx(2 * math.pi / 1.1, rel=1e-15)


def test_multipliers_and_state_of_a_linear_response_are_the_closed_form():
    frequency, ground = 1.3, 0.2
    orbit = periodic_orbit(scene := shaken(LINEAR, 0.1, ground, frequency), scene.at_rest())
    wave = 0.1 / (1 - frequency**2 + 1j * ground * frequency)
    assert orbit.state.u[1] == pytest.approx(wave.real, abs=1e-12)
    assert orbit.state.v[1] == pytest.approx((1j * frequency * wave).real, abs=1e-12)
    energy = (orbit.state.u[1] ** 2 + orbit.state.v[1] ** 2) / 2
    assert orbit.energy == pytest.approx(energy, rel=1e-14)
    decay = -ground / 2 + 1j * math.sqrt(1 - ground**2 / 4)
    found = floquet(orbit)
    exact = np.exp(decay * orbit.period)
    assert np.abs(found.multipliers - exact).min() < 1e-11
    assert found.neutral.size == 0
    assert found.stable


def test_a_response_returns_in_a_run():
    scene = shaken(PRISM, 0.001, 0.02, 1.71)
    scene = Chain(PRISM, 4, ends=("fixed", "free"), damping=scene.damping,
                  drive={3: scene.drive[1]}, forces=(Force(-0.1 * V**3),))  # fmt: skip
    orbit = periodic_orbit(scene, scene.at_rest())
    run = orbit.run(1e-11)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-12
    assert np.abs(run.final.v - orbit.state.v).max() < 1e-12
    assert orbit.energy == pytest.approx(run.energy[0], rel=1e-12)
    assert np.ptp(orbit.state.u) > 1e-4


def test_a_dashpot_is_a_force_of_velocity():
    by_damping = shaken(PRISM, 0.001, 0.02, 1.75)
    by_force = shaken(PRISM, 0.001, 0.0, 1.75, forces=(Force(-0.02 * V, at=[1]),))
    first, second = (periodic_orbit(one, one.at_rest()).state for one in (by_damping, by_force))
    assert np.allclose(first.u, second.u, rtol=0, atol=1e-15)
    assert np.allclose(first.v, second.v, rtol=0, atol=1e-15)


def test_a_free_chain_is_found_where_the_guess_lies():
    drive = {0: Drive(force=0.001 * sp.sin(2 * T))}
    chain = Chain(PRISM, 4, damping=Damping(bond=0.1), drive=drive)
    guess = State(np.full(4, 0.25), np.zeros(4))
    orbit = periodic_orbit(chain, guess)
    run = orbit.run(1e-11)
    assert np.mean(orbit.state.u) == pytest.approx(0.25, abs=1e-12)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-11
    assert np.sum(np.abs(floquet(orbit).multipliers - 1) < 1e-5) == 2  # shift and boost


def test_a_doubled_orbit_exists_beyond_a_doubling():
    path = response(shaken(PRISM, 0.1, 0.05, 3.7), 3.3)
    assert [event.kind for event in path.events] == ["doubling"]
    assert path.stable[0]
    assert not path.stable[-1]
    before, after = (path.orbits[row] for row in (0, -1))
    assert path.events[0].multiplier == pytest.approx(1, abs=1e-9)
    last = floquet(after).multipliers
    assert last[0].real == pytest.approx(-np.abs(last[0]), rel=1e-12)
    moved = State(after.state.u + np.array([0, 1e-3]), after.state.v)
    late = simulate(after.scene, moved, 200 * after.period, tol=1e-9).final
    doubled = periodic_orbit(after.scene, late, period=2 * after.period)
    assert doubled.period == pytest.approx(2 * after.period, rel=1e-14)
    assert np.abs(doubled.state.u - after.state.u).max() > 1e-3
    assert floquet(doubled).stable
    same = periodic_orbit(before.scene, before, period=2 * before.period)
    assert np.allclose(same.state.u, before.state.u, rtol=0, atol=1e-12)
    squares = floquet(before).multipliers ** 2
    found = np.sort_complex(floquet(same).multipliers)
    assert np.allclose(found, np.sort_complex(squares), rtol=0, atol=1e-9)


def test_two_equal_masses_part_where_the_stability_changes():
    drive = Drive(force=sp.cos(W * T), parameters={"W": 2.1})
    forcing = {"damping": Damping(ground=0.02), "drive": {1: drive, 2: drive}}
    path = response(Chain(DUFFING, 4, ends=("fixed", "fixed"), **forcing), 1.85)
    assert [event.kind for event in path.events] == ["stability"]
    assert path.stable[[0, -1]].tolist() == [True, False]
    inside = path.orbits[int(np.argmax(path.multiplier))]
    assert inside.state.u[1] == pytest.approx(inside.state.u[2], abs=1e-12)
    moved = State(inside.state.u + np.array([0, 1e-3, 0, 0]), inside.state.v)
    late = simulate(inside.scene, moved, 300 * inside.period, tol=1e-9).final
    assert abs(late.u[1] - late.u[2]) > 1e-2


def test_an_undriven_orbit_is_followed_in_period_and_in_energy():
    chain = Chain(PRISM, 2, ends=("fixed", "free"))
    slow = 2 * math.pi / math.sqrt(float(PRISM.stiffness(0.0)))
    guess = State(np.array([0, 0.02]), np.zeros(2))
    first = periodic_orbit(chain, guess, period=0.995 * slow)
    path = orbit_path(first, by="period", until=0.9 * slow)
    alone = periodic_orbit(chain, path.orbits[-2], period=0.9 * slow)
    assert path.energy[-1] == pytest.approx(alone.energy, rel=1e-8)
    back = orbit_path(path.orbits[-1], by="energy", until=first.energy)
    assert back.period[-1] == pytest.approx(first.period, rel=1e-9)
    assert path.events == back.events == ()
    assert path.stable.all()
    assert list(path.columns)[:2] == ["period", "amplitude"]
    assert list(back.columns)[:2] == ["energy", "amplitude"]


def test_a_path_is_written_and_drawn(tmp_path):
    import matplotlib.pyplot as plt

    path = prism_response()
    path.to_csv(tmp_path / "path.csv")
    lines = (tmp_path / "path.csv").read_text().splitlines()
    assert lines[0] == "W,amplitude [m],period [s],energy [J],multiplier,stable"
    assert len(lines) == len(path) + 1
    axes = path.plot()
    assert [line.get_linestyle() for line in axes.lines][:2] == ["-", "--"]
    drawn = np.isfinite(axes.lines[0].get_ydata())
    assert np.array_equal(drawn, path.stable)
    plt.close(axes.figure)
    top = np.ptp(path.orbits[int(np.argmax(path.amplitude))].run(1e-10).u[:, 1]) / 2
    assert path.amplitude.max() == pytest.approx(top, rel=0.05)


def test_after_ctrl_c_a_path_has_the_orbits_so_far(monkeypatch):
    first, whole = prism_orbit(), prism_response()
    calls, stacked = [], np.column_stack

    def ctrl_c(arrays):
        calls.append(0)
        if len(calls) == 60:
            raise KeyboardInterrupt
        return stacked(arrays)

    monkeypatch.setattr(np, "column_stack", ctrl_c)
    path = orbit_path(first, by="W", until=1.74)
    assert [path.end, whole.end] == ["interrupted", "W 1.74"]
    assert 4 < len(path) == len(path.orbits) < len(whole)
    np.testing.assert_allclose(path.amplitude, whole.amplitude[: len(path)], rtol=1e-9)
    calls[:] = [0] * 59  # before there is a first row
    with pytest.raises(KeyboardInterrupt):
        orbit_path(first, by="W", until=1.74)


WRONG = [
    (Chain(PRISM, 2, damping=Damping(ground=0.1)), {}, "no periodic drive"),
    (shaken(PRISM, 0.1, 0.1, 2.0), {"energy": 1.0}, "energy of a driven orbit"),
    (shaken(PRISM, 0.1, 0.1, 2.0), {"period": 1.5 * math.pi}, "must be a whole multiple"),
    (shaken(PRISM, 0.1, 0.1, 2.0, drive={1: Drive(force=T)}), {}, "has no period"),
    (shaken(PRISM, 0.1, 0.1, 2.0, drive={1: Drive(force=sp.exp(-T))}), {}, "has no period"),
    (shaken(PRISM, 0.1, 0.1, 2.0, drive={1: Drive(force=([0.0, 9], [0.0, 1]))}), {}, "no period"),
    (
        shaken(PRISM, 0.1, 0.1, 2.0, drive={1: Drive(force=sp.sin(T) + sp.sin(sp.sqrt(2) * T))}),
        {},
        "periods of the drives do not fit",
    ),
    (shaken(PRISM, 0.1, 0.1, 2.0, forces=(Force(-U * T),)), {}, "has no period"),
    (shaken(PRISM, 0.1, 0.1, 0.0), {}, "frequency is 0"),
    (
        shaken(PRISM, 0.1, 1e5, 2.0),
        {},
        r"must take at most 4096: .* rates are 12 times too",
    ),
]


@pytest.mark.parametrize(("scene", "given", "words"), WRONG)
def test_what_no_drive_repeats_is_refused(scene, given, words):
    with pytest.raises(TensegrityError, match=words):
        periodic_orbit(scene, scene.at_rest(), **given)


@pytest.mark.parametrize(
    ("force", "period"),
    [
        (sp.sin(3 * T) ** 2, math.pi / 3),
        (sp.sin(3 * T) * sp.cos(3 * T) + 1, math.pi / 3),
        (sp.sin(2 * T) + sp.cos(sp.Rational(5, 3) * T), 6 * math.pi),
        (sp.exp(sp.sin(sp.pi * T)), 2.0),
        (sp.cos(0.7 * T + sp.sin(1.4 * T)), 2 * math.pi / 0.7),
    ],
)
def test_the_period_of_a_drive_is_its_shortest(force, period):
    scene = shaken(PRISM, 0.1, 0.5, 2.0, drive={1: Drive(force=1e-3 * force)})
    found = periodic_orbit(scene, scene.at_rest())
    assert found.period == pytest.approx(period, rel=1e-14)


def test_paths_of_what_is_no_parameter_are_refused():
    scene = shaken(PRISM, 0.001, 0.02, 1.6)
    orbit = periodic_orbit(scene, scene.at_rest())
    for given, words in (
        ({"by": "period", "until": 2.0}, "by 'period' is not one of W"),
        ({"by": 3, "until": 2.0}, "by 3 is not one of W"),
        ({"by": "W", "until": 1.6}, "the path begins at W 1.6"),
        ({"by": "W", "until": 1.6 * (1 + 1e-15)}, "the path begins at W 1.6"),
        ({"by": "W", "until": math.nan}, "until"),
    ):
        with pytest.raises(TensegrityError, match=words):
            orbit_path(orbit, **given)
    with pytest.raises(TensegrityError, match="orbit"):
        orbit_path(scene, by="W", until=2.0)


@pytest.mark.parametrize("ground", [5.0, 50.0, 500.0])
def test_a_strongly_damped_response_has_its_closed_form(ground):
    scene = shaken(LINEAR, 0.1, ground, 1.0)
    found = periodic_orbit(scene, scene.at_rest()).state
    wave = 0.1 / (1j * ground)  # k - m W^2 = 0
    assert found.u[1] == pytest.approx(wave.real, abs=1e-12 * abs(wave))
    assert found.v[1] == pytest.approx((1j * wave).real, rel=1e-12)


def test_a_parameter_that_parts_the_periods_of_drives_is_refused():
    """Also from that of a force whose parameter has the same name, and keeps its value."""
    drive = Drive(force=0.001 * (sp.sin(W * T) + sp.sin(2 * T)), parameters={"W": 1.0})
    also = Force(0.001 * sp.cos(W * T), parameters={"W": 1.0})
    for more in ({"drive": {1: drive}}, {"forces": (also,)}):
        scene = shaken(PRISM, 0.001, 0.1, 1.0, **more)
        orbit = periodic_orbit(scene, scene.at_rest())
        with pytest.raises(TensegrityError, match="changes the ratio of the periods"):
            orbit_path(orbit, by="W", until=1.1)


def test_a_force_is_followed_as_well_as_a_frequency():
    force = sp.Symbol("F")
    drive = Drive(force=force * sp.cos(1.3 * T), parameters={"F": 0.01})
    scene = shaken(LINEAR, 0.1, 0.2, 1.0, drive={1: drive})
    path = orbit_path(periodic_orbit(scene, scene.at_rest()), by="F", until=0.05)
    gain = abs(1 / (1 - 1.3**2 + 0.26j))
    assert np.allclose(path.amplitude / path.columns["F"], gain, rtol=1e-5, atol=0)
    assert np.allclose(path.period, 2 * math.pi / 1.3, rtol=1e-14, atol=0)
    assert path.orbits[-1].scene.drive[1].parameters == {"F": pytest.approx(0.05, rel=1e-12)}


def motion_of_beads(frequency):
    """The last displacements of the beads with the wall at another frequency, for `sweep`."""
    of = beads()
    drive = {0: of.drive[0].varied({"W": frequency})}
    scene = Chain(of.springs, 12, of.mass, of.ends, damping=of.damping, drive=drive)
    return scene, simulate(scene, scene.at_rest(), 30.0, tol=1e-10).final.u


def test_parameters_of_drives_are_swept():
    frequencies = [2.5, 2.83, 3.0]
    scenes, alone = zip(*map(motion_of_beads, frequencies), strict=True)
    batch = Ensemble(scenes)
    together = simulate(batch, batch.at_rest(), 30.0, tol=1e-10).final.u
    with ProcessPoolExecutor(1) as pool:
        swept = sweep(motion_of_beads, frequencies, executor=pool)
    assert np.ptp(alone, axis=0)[1:-1].min() > 1e-4  # the frequency counts
    for k in range(3):
        assert np.abs(together[:, k] - alone[k]).max() < 1e-10
        assert np.array_equal(swept[k][1], alone[k])
        assert swept[k][0] == scenes[k]
    for values, words in (({"Q": 1.0}, "does not contain Q"), (3, "must be a dict")):
        with pytest.raises(TensegrityError, match=words):
            scenes[0].drive[0].varied(values)


def test_a_response_on_springs_to_the_ground_returns():
    """The ground's tangent too: Newton's method converges, and the closed form of a linear one."""
    drive = {3: Drive(force=0.05 * sp.cos(0.9 * T))}
    given = {"drive": drive, "damping": Damping(ground=0.1)}
    scene = Chain(PRISM, 4, ground=DUFFING, **given)
    orbit = periodic_orbit(scene, scene.at_rest())
    run = orbit.run(1e-11)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-11
    assert orbit.energy == pytest.approx(run.energy[0], rel=1e-12)
    flow, time = DrivenFlow(scene, 40, 2.1), 2.1
    u, v = np.array([0.02, 0.01, -0.01, 0.03]), np.zeros(4)
    tangent, h = flow.tangents(u, v, time)[2], 2e-6
    for k in range(4):
        step = h * np.eye(4)[k]
        ends = [np.concatenate(flow.end(u + s * step, v, time)) for s in (1, -1)]
        assert np.abs((ends[0] - ends[1]) / (2 * h) - tangent[:, k]).max() < 1e-8
    drive = {1: Drive(force=0.1 * sp.cos(1.3 * T))}
    given = {"drive": drive, "damping": Damping(ground=0.2), "ground": LINEAR}
    alone = Chain(LINEAR, 2, ends=("fixed", "free"), **given)
    found = periodic_orbit(alone, alone.at_rest()).state.u[1]
    assert found == pytest.approx((0.1 / (2 - 1.69 + 0.26j)).real, abs=1e-12)
