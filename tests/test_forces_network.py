"""Forces of one's own in networks and at walls: against SciPy, closed forms, and their own work."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tensegrity import (
    Chain,
    Damping,
    Drive,
    Force,
    Network,
    Potential,
    PowerLaw,
    StabilityError,
    TensegrityError,
    Wall,
    simulate,
)

U_X, U_Y, V_X, V_Y, V, SPEED = sp.symbols("u_x u_y v_x v_y v speed")
T, R, RATE, SLIP, C = sp.symbols("t r rate slip c")
PLACES = np.array([[0, 0], [1, 0], [0.5, 0.8], [1.6, 0.9]])
BONDS = [(0, 1), (1, 2), (0, 2), (2, 3), (1, 3)]
STRUTS = [0, 2, 3]
MASS = np.array([1, 1.3, 0.7, 1.1])
DRAG = np.array([0.1, 0.2, 0.3, 0.4])
NORMAL = np.array([0.1, 1.0]) / math.hypot(0.1, 1.0)
SPRING = Potential(R**2 / 2 + R**3 / 10, R)
END = 6.0


def network(**more):
    """Four masses with nonlinear forces on sites, in bonds and at a wall; the last one is held."""
    on_sites = Force(
        (-C * SPEED * V_X + sp.sin(T) * U_Y / 10, -C * SPEED * V_Y + U_X * V_Y / 7),
        parameters={"c": DRAG},
    )
    in_bonds = Force(
        (C * RATE * (1 + R**2) + R**3 / 5, -SLIP * (1 + R) / 3), "bonds", STRUTS, {"c": 0.2}
    )
    at_walls = Force((-RATE / 10 - R / 3, -SLIP / (5 * sp.sqrt(SLIP**2 + C))), "walls", None,
                     {"c": 0.1})  # fmt: skip
    given = {
        "walls": [Wall([0, -0.2], NORMAL)],
        "wall_contacts": [[0, 0], [1, 0]],
        "wall_spring": Potential(R**2, R),
        "radius": 0.2,
        "held": [3],
        "damping": Damping(bond=0.05, ground=0.02),
        "drive": {2: Drive(force=(sp.sin(2 * T) / 10, None))},
    }
    forces = (on_sites, in_bonds, at_walls)
    return Network(PLACES, BONDS, SPRING, mass=MASS, forces=forces, **given | more)


def rates(t, y):
    """The equations of motion of `network`, written out."""
    u, v = y.reshape(2, 4, 2)
    force = np.zeros((4, 2))
    for number, (i, j) in enumerate(BONDS):
        apart = PLACES[j] - PLACES[i] + u[j] - u[i]
        along = apart / np.linalg.norm(apart)
        r = np.linalg.norm(apart) - np.linalg.norm(PLACES[j] - PLACES[i])
        rate = along @ (v[j] - v[i])
        pull = (r + 0.3 * r**2 + 0.05 * rate) * along
        if number in STRUTS:
            pull += (0.2 * rate * (1 + r**2) + r**3 / 5) * along
            pull += (1 + r) / 3 * (v[j] - v[i] - rate * along)
        force[i] += pull
        force[j] -= pull
    for i in (0, 1):
        gap = NORMAL @ (PLACES[i] - [0, -0.2] + u[i]) - 0.2
        rate = NORMAL @ v[i]
        across = v[i] - rate * NORMAL
        force[i] += (-2 * gap - rate / 10 - gap / 3) * NORMAL
        force[i] -= across / (5 * np.sqrt(across @ across + 0.1))
    speed = np.linalg.norm(v, axis=1)
    force -= (DRAG * speed + 0.02)[:, None] * v
    force[:, 0] += np.sin(t) * u[:, 1] / 10
    force[:, 1] += u[:, 0] * v[:, 1] / 7
    force[2, 0] += np.sin(2 * t) / 10
    force[3] = 0
    return np.concatenate([v.ravel(), (force / MASS[:, None]).ravel()])


def start(scene):
    return scene.at_rest({0: [0.3, 0.1], 2: [-0.1, 0.2]})


@pytest.fixture(scope="module")
def reference():
    state = start(network())
    y = np.concatenate([state.u.ravel(), state.v.ravel()])
    found = solve_ivp(rates, (0, END), y, method="DOP853", rtol=1e-13, atol=1e-15)
    return found.y[:, -1].reshape(2, 4, 2)


def errors(run, reference):
    wrong = np.abs([run.final.u - reference[0], run.final.v - reference[1]]).max()
    energy = run.energy - run.energy[0] - (run.work - run.work[0]) + (run.loss - run.loss[0])
    return wrong, np.abs(energy).max()


@pytest.mark.parametrize(
    "tol", [1e-3, 1e-9, *(pytest.param(x, marks=pytest.mark.slow) for x in (1e-6, 1e-11))]
)
def test_all_forces_together_meet_a_tolerance(reference, tol):
    scene = network()
    run = simulate(scene, start(scene), END, tol=tol)
    wrong, energy = errors(run, reference)
    assert run.method == "rk8"
    assert wrong <= tol * 0.2
    assert energy <= tol * run.energy[0]
    assert run.loss[-1] > 0.5 * run.energy[0]


def test_the_order_is_that_of_the_method(reference):
    counts, found = [40, 50, 60, 70], []
    for count in counts:
        scene = network()
        run = simulate(scene, start(scene), END, dt=END / count, method="rk8")
        found.append(errors(run, reference)[0])
    assert -np.polyfit(np.log(counts), np.log(found), 1)[0] > 7.3


def test_a_network_on_a_line_is_the_chain():
    mass, of_chain = [1.0, 1.5, 2.0], Force(-C * abs(V) * V, parameters={"c": 0.4})
    of_net = Force((-C * SPEED * V_X,), parameters={"c": 0.4})
    strut = Force(RATE / 5, "bonds")
    chain = Chain(SPRING, 3, mass, forces=(of_chain, strut))
    line = {"mass": mass, "forces": (of_net, strut)}
    loaded = Network(
        [[0.0], [1.0], [2.0]], [(0, 1), (1, 2)], SPRING, loads=np.zeros((3, 1)), **line
    )
    backwards = Network([[2.0], [1.0], [0.0]], [(2, 1), (0, 1)], SPRING, mass=mass[::-1],
                        forces=line["forces"])  # fmt: skip
    one = simulate(chain, chain.at_rest({0: 0.3}), 5.0, tol=1e-11).final
    two = simulate(loaded, loaded.at_rest({0: [0.3]}), 5.0, tol=1e-11).final
    three = simulate(backwards, backwards.at_rest({2: [0.3]}), 5.0, tol=1e-11).final
    np.testing.assert_allclose(two.u[:, 0], one.u, rtol=0, atol=1e-11)
    np.testing.assert_allclose(three.u[::-1, 0], one.u, rtol=0, atol=1e-11)


@pytest.mark.parametrize("dim", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_forces_in_bonds_keep_momentum(dim):
    places = np.eye(4, dim) * 1.3
    bonds = [(0, 1), (1, 2), (2, 0), (3, 0), (3, 1)]
    force = Force((C * RATE, -SLIP), "bonds", parameters={"c": 0.3})
    net = Network(places, bonds, SPRING, lengths=1.0, forces=(force,))
    state = net.at_rest({0: [0.2, -0.1, 0.3][:dim], 3: [0.0, 0.1, -0.2][:dim]})
    run = simulate(net, state, 10.0, tol=1e-8)
    np.testing.assert_allclose(net.momentum(run.final), net.momentum(state), rtol=0, atol=1e-15)
    assert run.loss[-1] > 0.1 * run.energy[0]


def test_a_block_slides_to_rest_by_friction():
    """v' = -mu g v/s, s^2 = v^2 + v0^2, keeps s - v0 artanh(v0/s) + mu g t."""
    mu, gravity, v0, stiffness = 0.3, 9.81, 0.05, 1e3
    press = sp.Max(-R, 0) * stiffness
    friction = Force((sp.Integer(0), -mu * press * SLIP / sp.sqrt(SLIP**2 + v0**2)), "walls")
    block = Network(
        [[0.0, 0.1 - gravity / stiffness]], np.zeros((0, 2), int), (), walls=[Wall([0, 0], [0, 1])],
        wall_contacts=[[0, 0]], wall_spring=PowerLaw(stiffness, 1.0), radius=0.1,
        loads=[[0.0, -gravity]], forces=(friction,),
    )  # fmt: skip
    run = simulate(block, block.at_rest({0: [1.0, 0.0]}), 0.5, tol=1e-9)

    def left(v, t):
        s, first = math.hypot(v, v0), math.hypot(1.0, v0)
        return s - v0 * math.atanh(v0 / s) - first + v0 * math.atanh(v0 / first) + mu * gravity * t

    for t, v in zip(run.t[1:], run.v[1:, 0, 0], strict=True):
        assert v == pytest.approx(brentq(left, 1e-6, 1.0, args=(t,), xtol=1e-15), abs=1e-8)
    assert run.loss[-1] == pytest.approx(0.5 * (1 - run.v[-1, 0, 0] ** 2), rel=1e-8)


def test_a_step_beyond_the_decay_by_friction_is_refused():
    rough = Force((sp.Integer(0), -100 * SLIP / sp.sqrt(SLIP**2 + C)), "walls", None, {"c": 1e-8})
    scene = Network(
        PLACES, BONDS, SPRING, mass=MASS, walls=[Wall([0, -0.2], NORMAL)], radius=0.2,
        wall_contacts=[[0, 0], [1, 0]], wall_spring=Potential(R**2, R), forces=(rough,),
    )  # fmt: skip
    with pytest.raises(StabilityError, match="rate at which forces change velocities"):
        simulate(scene, scene.at_rest({2: [0.1, 0.0]}), 1.0, dt=1e-3)
    run = simulate(scene, scene.at_rest({2: [0.1, 0.0]}), 1e-4, dt=1e-7)
    assert run.loss[-1] >= 0


@pytest.mark.parametrize(
    ("words", "make"),
    [
        ("3 expressions of a force on bonds", lambda: Force((R, R, R), "bonds")),
        ("contains slip", lambda: Force(SLIP, "bonds")),
        ("contains v_z", lambda: Force((V_X, sp.Symbol("v_z")))),
        ("1 expressions of a force on sites", lambda: network_of(Force(-V))),
        ("3 expressions of a force on sites", lambda: network_of(Force((V_X, V_Y, V_X)))),
        ("on walls", lambda: Chain(SPRING, 3, forces=[Force((R, SLIP), "walls")])),
        ("number 3 of the walls, there are 0", lambda: network_of(Force(R, "walls", [3]))),
        ("0 where they are open", lambda: network_of(Force(RATE, "bonds"), follow=True)),
        ("give one", lambda: Force((R, SLIP), "bonds").values(0.1, 0.1)),
    ],
)
def test_wrong_forces_are_refused(words, make):
    with pytest.raises(TensegrityError, match=words):
        make()


def network_of(force, follow=False):
    more = {"contacts": "follow", "law": PowerLaw(1.0, 1.5), "radius": 0.1} if follow else {}
    return Network(PLACES, BONDS, SPRING, forces=(force,), **more)
