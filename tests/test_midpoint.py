"""The implicit midpoint rule: its equations, what it keeps, and steps that nothing else allows."""

import itertools

import numpy as np
import pytest
import sympy as sp
from networks import fork, patch
from oracle import LIMITS
from scenes import prism_chain, smooth_blow
from springs import series

from tensegrity import (
    Chain,
    Network,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    Record,
    StabilityError,
    State,
    Wall,
    simulate,
)

R = sp.Symbol("r")


def walled(dim):
    """Two rows of beads of different masses above a wall, one held, pulled down and aside."""
    at = np.array([(x, y, 0.1 * x * y)[:dim] for y in (0.45, 1.75) for x in (0.0, 1.2, 2.5)])
    bonds = [(0, 1), (1, 2), (3, 4), (5, 4), (3, 0), (1, 4), (2, 5), (1, 3)]
    normal = np.eye(dim)[1]
    return Network(
        at, bonds, [PowerLaw(k, 1.5, preload=0.1) for k in np.linspace(3, 4, 8)],
        mass=np.linspace(1, 2, 6), walls=[Wall(0 * normal, normal)],
        wall_contacts=[(0, 0), (1, 0), (2, 0)], wall_spring=PowerLaw(2.0, 1.5), radius=0.5,
        loads=np.linspace(-0.02, 0.01, 6 * dim).reshape(6, dim), held=[4], wall_gaps=[-0.05] * 3,
    )  # fmt: skip


def held_ends():
    springs = [Prism(1.0, 0.7, 0.05, 1.0, 10.0, 100.0).potential(0.01), PowerLaw(2.0, 2.0, 0.1)]
    return Chain(springs * 8, 17, mass=np.linspace(1, 3, 17), ends=("fixed", "fixed"))


SCENES = {
    "chain": lambda: prism_chain(24),
    "held, two laws": held_ends,
    "plane": lambda: patch(4),
    "space": lambda: patch(4, dim=3),
    "walls in the plane": lambda: walled(2),
    "walls in space": lambda: walled(3),
    "touching beads along walls": fork,
}


def blow(scene, speed=0.02):
    v = speed * np.random.default_rng(4).standard_normal(scene.shape)
    v[list(scene.held)] = 0
    return State(np.zeros(scene.shape), v)


@pytest.mark.parametrize(
    ("name", "share"), [("chain", 0.1), ("walls in space", 0.1), *((name, 3.0) for name in SCENES)]
)
def test_steps_solve_the_equations_of_the_rule(name, share):
    """(u' - u)/dt is the mean velocity, m (v' - v)/dt the force in the middle, walls' too."""
    scene = SCENES[name]()
    state = blow(scene)
    dt = share / (3e5 if scene.mass[0] < 1e-3 else 2.5)
    run = simulate(scene, state, 8 * dt, dt=dt, method="midpoint", record=Record(every=1))
    middle, mean = (run.u[1:] + run.u[:-1]) / 2, (run.v[1:] + run.v[:-1]) / 2
    size = np.abs(run.u).max() + dt * np.abs(run.v).max()
    np.testing.assert_allclose(np.diff(run.u, axis=0), dt * mean, rtol=0, atol=1e-14 * size)
    mass = np.reshape(scene.mass, (-1, *[1] * (len(scene.shape) - 1)))
    forces = np.array([scene.forces(u) for u in middle])
    change = mass * np.diff(run.v, axis=0)
    np.testing.assert_allclose(change[:, list(scene.held)], 0, rtol=0, atol=0)
    free = np.setdiff1d(np.arange(scene.sites), scene.held)
    slack = 1e-13 * np.abs(mass).max() * size / dt
    np.testing.assert_allclose(change[:, free], dt * forces[:, free], rtol=0, atol=slack)
    if run.impulse is not None:
        pulls = np.array([bonds_alone(scene, u) for u in middle])
        on_sites = (forces - pulls - scene.loads)[:, free].sum(axis=1)
        given = np.diff(run.impulse, axis=0).sum(axis=1)
        np.testing.assert_allclose(given, -dt * on_sites, rtol=0, atol=1e-12 * np.abs(given).max())
        assert np.abs(given).max() > 0
    seen = np.array([scene.elongation(u) for u in (*middle, *run.u)])
    if seen.shape[1] == len(scene.springs):  # no walls
        lowest, highest = min(seen.min(), 0), max(seen.max(), 0)
        assert run.elongation_range.min() == pytest.approx(lowest, abs=1e-14 * size)
        assert run.elongation_range.max() == pytest.approx(highest, abs=1e-14 * size)


def bonds_alone(scene, u):
    """Forces of a network's bonds on its sites."""
    found, pairs = np.zeros(scene.shape), np.asarray(scene.bonds)
    apart = np.diff((scene.positions + u)[pairs], axis=1)[:, 0]
    apart /= np.linalg.norm(apart, axis=1, keepdims=True)
    pull = scene.bond_tension(u)[: len(pairs), None] * apart
    np.add.at(found, pairs[:, 0], pull)
    np.subtract.at(found, pairs[:, 1], pull)
    return found


@pytest.mark.parametrize("name", ["chain", "held, two laws", "plane", "walls in space"])
def test_small_steps_extrapolated_agree_with_rkn6(name):
    scene = SCENES[name]()
    state, t_end = blow(scene), 3.0
    exact = simulate(scene, state, t_end, method="rkn6", dt=1e-3).final
    one, two = (
        simulate(scene, state, t_end, method="midpoint", dt=dt).final for dt in (0.02, 0.01)
    )
    for a, b, x in ((one.u, two.u, exact.u), (one.v, two.v, exact.v)):
        assert 3.8 < np.abs(a - x).max() / np.abs(b - x).max() < 4.2
        assert np.abs((4 * b - a) / 3 - x).max() < 2e-3 * np.abs(b - x).max()


def test_a_polynomial_whose_stiffness_is_not_compiled_otherwise_is_followed():
    spring = Polynomial(Prism(1.0, 0.7, 0.05, 1.0).potential(), -0.05, 0.05)
    assert "stiffness" not in spring.law.compiled
    chain = Chain(spring, 12)
    state = smooth_blow(chain)
    exact = simulate(chain, state, 5.0, method="rkn6", dt=0.01).final.u
    errors = [
        np.abs(simulate(chain, state, 5.0, method="midpoint", dt=dt).final.u - exact).max()
        for dt in (0.1, 0.05)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)


def test_energy_of_linear_springs_is_kept_at_any_step():
    chain = Chain(Potential(R**2 / 2, R), 20)
    for dt in (0.1, 3.0, 100.0):
        run = simulate(chain, blow(chain), 300 * dt, dt=dt, method="midpoint")
        assert run.energy_error < 1e-12


def test_energy_of_springs_that_stiffen_does_not_drift():
    chain = prism_chain(24)
    record = Record(every=10)
    run = simulate(chain, smooth_blow(chain), 4000.0, dt=0.2, method="midpoint", record=record)
    off = np.abs(run.energy / run.energy[0] - 1)
    half = len(off) // 2
    assert 1e-6 < off[half:].max() < 1.5 * off[:half].max() < 1e-2


@pytest.mark.parametrize("name", ["chain", "plane", "walls in the plane"])
def test_a_run_turned_back_comes_home(name):
    scene = SCENES[name]()
    state = blow(scene)
    there = simulate(scene, state, 9.0, dt=0.3, method="midpoint").final
    back = simulate(scene, State(there.u, -there.v), 9.0, dt=0.3, method="midpoint").final
    np.testing.assert_allclose(back.u, state.u, rtol=0, atol=1e-11)
    np.testing.assert_allclose(back.v, -state.v, rtol=0, atol=1e-11)


def stiff_chain():
    """Two bonds of 13 a million times stiffer: their vibrations are not excited."""
    soft, stiff = (series(0, k / 4, k=k) for k in (1.0, 1e6))
    chain = Chain([soft] * 4 + [stiff] + [soft] * 3 + [stiff] + [soft] * 4, 14)
    return chain, chain.at_rest({0: 0.4})


def stiff_ladder():
    """A braced ladder in the plane, its two first rungs a million times stiffer."""
    at = np.array([(x, y) for x in range(6) for y in range(2)], dtype=float)
    rungs = [(k, k + 1) for k in range(0, 12, 2)]
    others = [b for k in range(0, 10, 2) for b in ((k, k + 2), (k + 1, k + 3), (k, k + 3))]
    stiff, soft = (Potential(k * R**2 / 2, R) for k in (1e6, 1.0))
    network = Network(at, rungs + others, [stiff] * 2 + [soft] * (len(rungs + others) - 2))
    return network, network.at_rest({10: (0.2, 0.0), 11: (0.2, 0.1)})


@pytest.mark.parametrize("scene", [stiff_chain, stiff_ladder])
def test_steps_go_far_beyond_the_limit_of_every_explicit_method(scene):
    """The soft bonds are followed to the order of the method; for the stiff ones the step is tens
    of what any explicit method here allows."""
    scene, state = scene()
    fastest = np.sqrt(2e6)  # of two masses on a stiff bond
    exact = simulate(scene, state, 6.0, method="rkn6", dt=0.001).final.u
    errors = []
    for dt in (0.2, 0.1, 0.05):
        run = simulate(scene, state, 6.0, method="midpoint", dt=dt)
        errors.append(np.abs(run.final.u - exact).max() / np.abs(exact).max())
    assert 0.1 * fastest > 20 * max(LIMITS.values())
    assert errors[-1] < 2e-3
    for one, other in itertools.pairwise(errors):
        assert np.log2(one / other) == pytest.approx(2, abs=0.1)
    with pytest.raises(StabilityError):
        simulate(scene, state, 6.0, method="rkn6", dt=0.05)


@pytest.mark.parametrize("every", [1, 10**6])
def test_a_step_that_cannot_be_solved_ends_the_run(every):
    """An exponential force is met by Newton's method in steps of one length each."""
    chain = Chain(Potential(sp.exp(-R) + R - 1, R), 8)
    state, record = chain.at_rest({0: 1.0}), Record(every=every)
    assert simulate(chain, state, 40.0, method="midpoint", dt=10.0, record=record).complete
    match = r"dt 100 s is too large for midpoint: its equations were not solved in 60 iterations"
    with pytest.raises(StabilityError, match=match) as caught:
        simulate(chain, state, 400.0, method="midpoint", dt=100.0, record=record)
    run = caught.value.run
    assert not run.complete
    np.testing.assert_array_equal(run.final.u, state.u)
