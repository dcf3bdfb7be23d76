"""One engine: what chains can, networks can, with parameters shared, own, or own to a lane."""

import numpy as np
import pytest
from networks import patch, pushed
from oracle import stepped
from scenes import plain_forces, prism_chain, smooth_blow

from tensegrity import (
    Chain,
    Ensemble,
    LockingError,
    Network,
    PowerLaw,
    Prism,
    Record,
    State,
    TensegrityError,
    Wall,
    simulate,
)
from tensegrity.engine.bonds import SHORT
from tensegrity.engine.kernel import bind
from tensegrity.engine.methods import METHODS
from tensegrity.scenes.dynamics import dynamics

RANDOM = np.random.default_rng(3)


def tapered(sites=150):
    """All contacts different, each with its own precompression."""
    factor = np.linspace(1, 2, sites - 1)
    springs = [PowerLaw(2 * k, 1.5, preload=0.1 / k) for k in factor]
    return Chain(springs, sites, mass=np.linspace(1, 3, sites), ends=("free", "fixed"))


def graded(sites=150):
    """Prisms of different prestrain, power laws in their middle, and a long uniform part."""
    prisms = [Prism(1.0, 0.8, p, 1.0).potential() for p in np.linspace(0.02, 0.1, 40)]
    rest = [PowerLaw(2.0, 1.5, preload=0.1)] * 5 + [prisms[0]] * (sites - 46)
    return Chain(prisms + rest, sites)


def alternating(sites=60):
    hard, soft = PowerLaw(2.0, 1.5, preload=0.1), PowerLaw(1.0, 1.5, preload=0.1)
    return Chain([hard, soft] * ((sites - 1) // 2) + [hard], sites)


SCENES = [tapered, graded, alternating]


@pytest.mark.parametrize("scene", SCENES)
def test_bonds_with_parameters_of_their_own_pull_as_each_alone(scene):
    chain = scene()
    state, bonds, dt, steps = smooth_blow(chain), dynamics(chain).loop_bonds, 0.05, 60
    u, v = state.u.copy(), state.v.copy()
    bound = bind(u, v, bonds, METHODS["verlet"], dt)
    bound.advance(steps)
    x, y, r = state.u.copy(), state.v.copy(), []
    for _ in range(steps):
        y += dt / 2 * plain_forces(chain, x) * dynamics(chain).inverse_mass
        r.append(np.diff(x))
        x += dt * y
        y += dt / 2 * plain_forces(chain, x) * dynamics(chain).inverse_mass
    r.append(np.diff(x))
    np.testing.assert_allclose(u, x, rtol=0, atol=1e-15)
    np.testing.assert_allclose(v, y, rtol=0, atol=1e-15)
    for spring, (low, high) in enumerate(bound.range):
        mine = np.array(r)[:, dynamics(chain).springs.group == spring]
        assert (low, high) == pytest.approx((mine.min(), mine.max()), abs=1e-15)


@pytest.mark.parametrize("bonds", [1, 63, 64, 65, 200])
def test_ranges_of_many_equal_bonds_are_those_of_all(bonds):
    """Kicks of verlet fall on its steps: there is nothing else to be met."""
    chain = prism_chain(bonds + 1)
    start = chain.at_rest({0: 0.02, bonds // 2 + 1: -0.01})
    run = simulate(chain, start, 20.0, dt=0.25, record=Record(every=1))
    r = np.diff(run.u)
    np.testing.assert_array_equal(run.met, [[min(r.min(), 0), max(r.max(), 0)]])


@pytest.mark.parametrize("method", ["verlet", "rkn6", "rk4"])
@pytest.mark.parametrize("scene", [*SCENES, patch])
def test_loop_is_that_of_numpy_whoever_owns_the_parameters(scene, method):
    scene, method = scene(), METHODS[method]
    state = smooth_blow(scene) if isinstance(scene, Chain) else pushed(scene)
    u, v = dynamics(scene).arrays(state)
    bound = bind(u, v, dynamics(scene).loop_bonds, method, 0.1)
    bound.advance(53)
    bound.advance(60)
    plain, sites = stepped(scene, state, method, 0.1, 113), slice(scene.sites)
    for one, two in ((u[sites], plain.u), (v[sites], plain.v), (bound.range, plain.met)):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-13 * np.abs(two).max())


def test_few_short_runs_keep_common_parameters_and_many_get_their_own():
    few, many = (dynamics(scene()).loop_bonds.runs for scene in (graded, alternating))
    assert few.own.tolist() == [1, 0, 0]
    assert np.diff(few.first).tolist() == [40, 5, 104]
    assert many.own.tolist() == [1]
    assert SHORT > 5  # the five power laws stand alone all the same
    names = Prism(1.0, 0.8, 0.02, 1.0).potential().parameters
    own = dynamics(graded()).loop_bonds.own[0]
    assert 0 < len(own) < len(names) / 2  # most do not depend on the prestrain


@pytest.mark.parametrize("method", ["verlet", "rkn6", "midpoint"])
def test_lanes_have_masses_and_springs_of_their_own(method):
    def chain(k):
        springs = [PowerLaw(k * (1 + j / 41.7), 1.5, preload=0.2) for j in range(19)]
        return Chain(springs, 20, mass=k + np.arange(20) / 20, ends=("free", "fixed"))

    chains = [chain(k) for k in np.linspace(1, 3, 11)]  # and 5 idle ones
    several = Ensemble(chains)
    start = several.at_rest({0: np.linspace(0.01, 0.03, 11)})
    options = {"dt": 0.05, "method": method}
    run = simulate(several, start, 2.0, **options)
    alone = [simulate(one, several.lane(start, k), 2.0, **options) for k, one in enumerate(chains)]
    for k, one in enumerate(alone):
        np.testing.assert_allclose(run.u[..., k], one.u, rtol=0, atol=1e-15)
        np.testing.assert_allclose(run.v[..., k], one.v, rtol=0, atol=1e-15)
        mine = run.met[dynamics(several).springs.group[:, k]]
        np.testing.assert_allclose(mine, one.met[dynamics(one.scene).springs.group], atol=1e-14)
    each = np.stack([one.energy for one in alone], axis=-1)
    np.testing.assert_allclose(run.energy, each, rtol=1e-13)


def test_lanes_of_one_spring_each_have_their_own():
    chains = [Chain(PowerLaw(k, 1.5, preload=0.2), 20) for k in np.linspace(1, 3, 11)]
    several = Ensemble(chains)
    start = several.at_rest({0: 0.02})
    run = simulate(several, start, 5.0, dt=0.05, method="rkn6")
    for k, one in enumerate(chains):
        alone = simulate(one, several.lane(start, k), 5.0, dt=0.05, method="rkn6")
        np.testing.assert_allclose(run.u[..., k], alone.u, rtol=0, atol=1e-15)


def test_a_lane_of_its_own_that_locks_is_named():
    chains = [Chain(Prism(1.0, 0.7, p, 1.0).potential(), 12) for p in np.linspace(0.01, 0.08, 8)]
    several = Ensemble(chains)
    start = several.at_rest({0: np.where(np.arange(8) == 5, 0.9, 0.01)})
    with pytest.raises(LockingError, match="sites 0 and 1 of lane 5 got there at t"):
        simulate(several, start, 5.0, tol=1e-4)


def test_networks_run_in_lanes():
    several = Ensemble([patch(4), patch(4, spring=PowerLaw(2.0, 1.5, preload=0.3, length=1.0))])
    states = [pushed(scene) for scene in several.scenes]
    start = State(*(np.stack(x, -1) for x in zip(*((s.u, s.v) for s in states), strict=True)))
    run = simulate(several, start, 4.0, dt=0.02)
    for k, scene in enumerate(several.scenes):
        one = simulate(scene, states[k], 4.0, dt=0.02)
        assert run.u[..., k].tobytes() == one.u.tobytes()
    assert run.energy_error < 1e-3


def test_lanes_of_other_shape_are_refused():
    for other in (prism_chain(11), patch(4)):
        with pytest.raises(TensegrityError, match=r"scene 1, .* differs in shape"):
            Ensemble([prism_chain(10), other])
    with pytest.raises(TensegrityError, match="give a scene and lanes"):
        Ensemble(prism_chain(10))
    with pytest.raises(TensegrityError, match="empty"):
        Ensemble([])


# --- on a line -------------------------------------------------------------------------------


def as_network(chain, **options):
    """The same masses and springs as a network of one dimension."""
    bonds = [(j, j + 1) for j in range(chain.sites - 1)]
    places = np.arange(chain.sites, dtype=float)[:, None]
    return Network(places, bonds, chain.springs, mass=chain.mass, held=chain.held, **options)


@pytest.mark.parametrize("scene", [prism_chain, tapered])
@pytest.mark.parametrize("method", ["verlet", "rkn6", "rk4"])
def test_a_chain_written_as_a_network_is_the_same_loop(scene, method):
    chain = scene()
    network, state = as_network(chain), smooth_blow(chain)
    assert dynamics(network).loop_bonds.contacts is None
    start = State(state.u[:, None], state.v[:, None])
    one = simulate(chain, state, 10.0, dt=0.05, method=method)
    two = simulate(network, start, 10.0, dt=0.05, method=method)
    assert two.final.u[:, 0].tobytes() == one.final.u.tobytes()
    np.testing.assert_allclose(two.energy, one.energy, rtol=1e-13)


@pytest.mark.parametrize("method", ["verlet", "rkn6", "rk4", "midpoint"])
def test_bonds_in_any_order_on_a_line_pull_as_in_a_chain(method):
    """The bonds backwards, every other one from right to left: the general loop."""
    chain = tapered(30)
    order = np.arange(29)[::-1]
    bonds = [(j, j + 1) if j % 2 else (j + 1, j) for j in order]
    places = np.arange(30, dtype=float)[:, None]
    springs = [chain.springs[j] for j in order]
    network = Network(places, bonds, springs, mass=chain.mass, held=chain.held)
    assert dynamics(network).loop_bonds.contacts is not None
    state = smooth_blow(chain)
    start = State(state.u[:, None], state.v[:, None])
    one = simulate(chain, state, 5.0, dt=0.05, method=method)
    two = simulate(network, start, 5.0, dt=0.05, method=method)
    np.testing.assert_allclose(two.final.u[:, 0], one.final.u, rtol=0, atol=1e-14)
    np.testing.assert_allclose(two.energy, one.energy, rtol=1e-13)


def test_a_line_has_walls_and_loads():
    """A bead that falls on a wall and a bead: momentum, and energy with the load's."""
    walls = [Wall([0.0], [1.0])]
    network = Network(
        [[1.0], [3.0]], [(0, 1)], PowerLaw(5.0, 1.5), mass=[1.0, 2.0], walls=walls,
        wall_contacts=[(0, 0)], wall_spring=PowerLaw(9.0, 1.5), radius=1.0,
        loads=[[-0.1], [-0.2]],
    )  # fmt: skip
    run = simulate(network, network.at_rest({1: [-0.3]}), 6.0, tol=1e-8)
    assert run.energy_error < 1e-7
    momentum = (run.v[:, :, 0] @ [1.0, 2.0]) + 0.3 * run.t + 0.6
    np.testing.assert_allclose(run.impulse[:, 0, 0], -momentum, atol=1e-7)
    assert np.abs(run.impulse[-1]) > 0.5


# --- forces and stiffness --------------------------------------------------------------------


def scenes_with_a_state():
    beads = patch(4, dim=3)
    yield tapered(12), 0.01 * RANDOM.standard_normal(12)
    yield Chain(Prism(1.0, 0.7, 0.05, 1.0, 10.0, 100.0).potential(0.01), 9), 0.01 * np.arange(9)
    yield beads, 0.01 * RANDOM.standard_normal(beads.shape)
    walled = Network(
        [[0.0, 0.9], [1.5, 0.9]], [(0, 1)], PowerLaw(3.0, 2.0), mass=[1.0, 2.0],
        lengths=1.6, walls=[Wall((0, 0), (0, 1))], wall_contacts=[(0, 0), (1, 0)],
        wall_spring=PowerLaw(2.0, 1.5), radius=1.0, loads=[[0, -1], [0.5, 0]], held=[1],
        wall_gaps=[-0.1, -0.1],
    )  # fmt: skip
    yield walled, np.array([[0.02, -0.05], [0.0, 0.0]])


@pytest.mark.parametrize("number", range(4))
def test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces(number):
    scene, u = list(scenes_with_a_state())[number]
    if isinstance(scene, Chain):
        u[list(scene.held)] = 0
    at_rest, free = np.zeros(scene.shape), np.ones(scene.shape, dtype=bool)
    free[list(scene.held)] = False
    h = 1e-5
    forces, stiffness = scene.forces(u), scene.stiffness(u).toarray()
    assert np.abs(stiffness).max() > 0.1
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-13)
    for k in np.flatnonzero(free.ravel()):
        step = np.zeros(u.size)
        step[k] = h
        one, two = u + step.reshape(u.shape), u - step.reshape(u.shape)
        slope = (scene.energy(State(one, at_rest)) - scene.energy(State(two, at_rest))) / (2 * h)
        assert forces.ravel()[k] == pytest.approx(-slope, abs=1e-9)
        change = (scene.forces(one) - scene.forces(two)).ravel() / (2 * h)
        np.testing.assert_allclose(stiffness[:, k], -change * free.ravel(), atol=2e-8)
    assert not forces[list(scene.held)].any()
    assert not stiffness[~free.ravel()].any()


def test_stiffness_of_a_prism_of_bars_and_strings_is_the_18_coordinate_tangent():
    import casadi as ca

    from derivations import member
    from tensegrity.engine.law import to_casadi

    prism = Prism(1.0, 0.8, 0.1, 1.0, 5.0, 50.0)
    cross, base, bar = prism.natural_lengths()
    lower = [np.array([np.cos(a), np.sin(a), 0]) / np.sqrt(3) for a in 2 * np.pi / 3 * np.arange(3)]
    turn = 5 * np.pi / 6
    turned = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    places = np.array(lower + [turned @ x + [0, 0, prism.height] for x in lower])
    x, c = ca.SX.sym("x", 18), ca.SX.sym("c", 6)
    energy = to_casadi(member.prism_energy(), (*member.POSITIONS, *member.CONSTANTS))(
        *ca.vertsplit(x), *ca.vertsplit(c)
    )
    hessian = ca.Function("h", [x, c], ca.hessian(energy, x))
    values = {"k_1": prism.k_cross, "k_2": prism.k_base, "k_3": prism.k_bar}
    values |= {"s_N": cross, "l_N": base, "b_N": bar}
    constants = [values[str(name)] for name in member.CONSTANTS]
    wanted, gradient = (np.array(part) for part in hessian(places.ravel(), constants))
    assert np.abs(gradient).max() < 1e-14  # the self-stressed state
    ring = [(0, 1), (1, 2), (2, 0)]
    bonds = ring + [(i + 3, j + 3) for i, j in ring]  # bases
    bonds += [((j + 1) % 3, j + 3) for j in range(3)] + [(j, j + 3) for j in range(3)]
    springs = [linear(k) for k in [prism.k_base] * 6 + [prism.k_cross] * 3 + [prism.k_bar] * 3]
    lengths = [base] * 6 + [cross] * 3 + [bar] * 3
    network = Network(places, bonds, springs, lengths=lengths)
    found = network.stiffness(np.zeros((6, 3))).toarray()
    np.testing.assert_allclose(found, wanted, atol=1e-12 * np.abs(wanted).max())
    assert np.abs(network.forces(np.zeros((6, 3)))).max() < 1e-14


def linear(k):
    import sympy as sp

    from tensegrity import Potential

    r, stiffness = sp.symbols("r k")
    return Potential(stiffness * r**2 / 2, r, {stiffness: k})


# --- methods and fitted forces in networks -----------------------------------------------------


def braced(rows=4):
    """A patch of linear springs and a few prisms: smooth, no contacts."""
    spring = Prism(1.0, 1.0, 0.2, 1.0, 10.0, 100.0).potential()
    return patch(rows, spring=spring)


@pytest.mark.parametrize("method", ["verlet", "rkn6", "midpoint", "rk4"])
def test_every_method_keeps_its_order_in_a_network(method):
    network = patch(3)
    state, t_end = pushed(network), 2.0
    exact = simulate(network, state, t_end, method="rkn6", dt=0.002).final
    steps = {"verlet": (40, 80, 160), "rk4": (20, 40, 80)}
    steps["midpoint"] = steps["verlet"]
    errors, counts = [], steps.get(method, (5, 8, 12))
    for count in counts:
        final = simulate(network, state, t_end, method=method, dt=t_end / count).final
        errors.append(np.max(np.abs(final.v - exact.v)))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == pytest.approx(METHODS[method].order, abs=0.35)


def test_a_tolerance_takes_fitted_forces_in_a_network_too(monkeypatch):
    from tensegrity.runs import tolerance

    monkeypatch.setattr(tolerance, "WORTH", -1.0)
    network = braced(3)
    state = pushed(network, 0.02)
    run = simulate(network, state, 3.0, tol=1e-6)
    assert "polynomial" in run.force
    exact = simulate(network, state, 3.0, method="rkn6", dt=0.01)
    assert np.max(np.abs(run.final.v - exact.final.v)) < 1e-6 * np.abs(exact.v).max()
