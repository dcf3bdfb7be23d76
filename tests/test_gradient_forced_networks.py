"""Gradients of networks with drives, dashpots and forces of velocity, and by parameters of drives:
against complex steps of the scheme written out, closed forms, and the chain."""

import numpy as np
import pytest
import sympy as sp
from complex_steps import derivative

from granular import Bead, Striker, kuwabara_kono, materials, y_guide
from tensegrity import (
    METHODS,
    Chain,
    Damping,
    Drive,
    Force,
    Network,
    Potential,
    PowerLaw,
    State,
    TensegrityError,
    Wall,
    gradient,
    objective,
    simulate,
)

T, R, RATE, SLIP, SPEED = sp.symbols("t r rate slip speed")
C, K, B, Q, A, W, G = sp.symbols("c k b q a w g")
VS, US = sp.symbols("v_x v_y v_z"), sp.symbols("u_x u_y u_z")
BONDS = [(0, 1), (1, 2), (0, 2), (2, 3), (1, 3)]
STRUTS = [0, 2, 3]
SPRING = Potential(K * R**2 / 2 + R**3 / 10, R, {"k": 1.2})
DT, STEPS = 0.1, 8
GIVEN = {
    "mass": np.array([1, 1.3, 0.7, 1.1]),
    "c": np.array([0.1, 0.2, 0.3, 0.4]),
    "k": np.full(5, 1.2),
    "b": np.array([0.2, 0.3, 0.1]),
    "q": np.array([0.3]),
    "ground": np.full(4, 0.02),
    "bond": np.full(5, 0.05),
    "a": np.array([0.1]),
    "w": np.array([2.0]),
    "g": np.array([0.15]),
}


def places(dim):
    return np.array([[0, 0, 0], [1, 0, 0.2], [0.5, 0.8, 0], [1.6, 0.9, 0.3]])[:, :dim]


def normal(dim):
    return np.array([0.1, 1.0, 0.0])[:dim] / np.hypot(0.1, 1.0)


def network(dim):
    """A wall, slip and drag; one coordinate of site 3 is prescribed, one of site 2 is pulled."""
    drag = Force([-C * SPEED * VS[i] + sp.sin(T) * US[(i - 1) % dim] / 10 for i in range(dim)],
                 parameters={"c": GIVEN["c"]})  # fmt: skip
    strut = Force((B * RATE * (1 + R**2) + R**3 / 5, -SLIP * (1 + R) / 3), "bonds", STRUTS,
                  {"b": GIVEN["b"]})  # fmt: skip
    wall = Force((-RATE / 10 - R / 3, -Q * SLIP / sp.sqrt(SLIP**2 + sp.Rational(1, 9))), "walls",
                 parameters={"q": GIVEN["q"][0]})  # fmt: skip
    none, numbers = [None] * (dim - 1), {name: GIVEN[name][0] for name in "aw"}
    drive = {
        3: Drive(displacement=(A * sp.sin(W * T), *none), parameters=numbers),
        2: Drive(force=(*none, G * sp.cos(T)), parameters={"g": GIVEN["g"][0]}),
    }
    return Network(
        places(dim), BONDS, SPRING, mass=GIVEN["mass"],
        walls=[Wall([0, -0.2, 0][:dim], normal(dim))], wall_contacts=[[0, 0], [1, 0]],
        wall_spring=Potential(R**2, R), radius=0.2, forces=(drag, strut, wall), drive=drive,
        damping=Damping(bond=0.05, ground=0.02),
    )  # fmt: skip


def length(x):
    return np.sqrt(np.sum(x * x))


def forces(dim, t, u, v, given):
    """All forces of `network`, written out, for complex numbers."""
    force = -given["ground"][:, None] * v
    for number, (i, j) in enumerate(BONDS):
        apart = places(dim)[j] - places(dim)[i] + u[j] - u[i]
        along = apart / length(apart)
        r = length(apart) - length(places(dim)[j] - places(dim)[i])
        rate = np.sum(along * (v[j] - v[i]))
        pull = (given["k"][number] * r + 0.3 * r**2 + given["bond"][number] * rate) * along
        if number in STRUTS:
            b = given["b"][STRUTS.index(number)]
            pull = pull + (b * rate * (1 + r**2) + r**3 / 5) * along
            pull = pull + (1 + r) / 3 * (v[j] - v[i] - rate * along)
        force[i] += pull
        force[j] -= pull
    for i in (0, 1):
        gap = np.sum(normal(dim) * (places(dim)[i] - [0, -0.2, 0][:dim] + u[i])) - 0.2
        rate = np.sum(normal(dim) * v[i])
        across = v[i] - rate * normal(dim)
        force[i] += (-2 * gap - rate / 10 - gap / 3) * normal(dim)
        force[i] -= given["q"][0] * across / np.sqrt(np.sum(across * across) + 1 / 9)
    for i in range(4):
        force[i] -= given["c"][i] * length(v[i]) * v[i]
        force[i] += np.sin(t) * np.roll(u[i], 1) / 10
    force[2, -1] += given["g"][0] * np.cos(t)
    return force


def moved(t, u, v, given):
    """Prescribe the first coordinate of site 3."""
    a, w = given["a"][0], given["w"][0]
    u[3, 0], v[3, 0] = a * np.sin(w * t), a * w * np.cos(w * t)


def run(dim, u, v, given):
    """States after all steps, (steps + 1, 2, 4, dim)."""
    of, found = METHODS["rk4"], []
    names = ("nodes", "matrix", "rates", "positions", "velocities")
    nodes, matrix, rows, positions, velocities = (np.array(getattr(of, x)) for x in names)
    u, v = u.astype(complex), v.astype(complex)
    for k in range(STEPS + 1):
        moved(k * DT, u, v, given)
        found.append([u.copy(), v.copy()])
        slopes = np.zeros((len(nodes), 4, dim), complex)
        for s, node in enumerate(nodes):
            here = u + DT * node * v + DT**2 * np.tensordot(matrix[s, :s], slopes[:s], 1)
            speed = v + DT * np.tensordot(rows[s, :s], slopes[:s], 1)
            t = (k + node) * DT
            moved(t, here, speed, given)
            slopes[s] = forces(dim, t, here, speed, given) / given["mass"][:, None]
        u = u + DT * v + DT**2 * np.tensordot(positions, slopes, 1)
        v = v + DT * np.tensordot(velocities, slopes, 1)
    return np.array(found)


def start(dim):
    draw = np.random.default_rng(dim)
    u, v = 0.05 * draw.standard_normal((4, dim)), 0.3 * draw.standard_normal((4, dim))
    moved(0.0, u, v, GIVEN)
    return u, v


@pytest.mark.parametrize("dim", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_gradients_are_those_of_complex_steps_of_the_scheme(dim):
    scene, (u, v) = network(dim), start(dim)
    weights = np.random.default_rng(5).standard_normal((4, STEPS + 1))
    traces = [objective.displacement(0, 1), objective.velocity(1, dim - 1),
              objective.displacement(3, 0), objective.velocity(3, 0)]  # fmt: skip
    asked = objective.of(traces, lambda t, y: (float(np.sum(weights * y)), weights))
    found = gradient(asked, scene, State(u, v), STEPS * DT, dt=DT, method="rk4")

    def value(u=u, v=v, **changed):
        rows = run(dim, u, v, GIVEN | changed)
        read = [rows[:, 0, 0, 1], rows[:, 1, 1, dim - 1], rows[:, 0, 3, 0], rows[:, 1, 3, 0]]
        return np.sum(weights * read)

    assert found.value == pytest.approx(value().real, rel=1e-12)
    where = {"c": range(4), "b": STRUTS, "q": [5, 6], "a": [3], "w": [3], "g": [2],
             "k": range(5), "bond": range(5), "ground": range(4), "mass": range(4)}  # fmt: skip
    for name, at in where.items():
        ours = found.mass if name == "mass" else found.by(name)
        exact = [derivative(lambda x, n=name: value(**{n: x}), GIVEN[name], i)
                 for i in range(len(GIVEN[name]))]  # fmt: skip
        mine = [ours[list(at)].sum()] if name == "q" else ours[list(at)]
        assert np.abs(mine - np.array(exact)).max() < 1e-11 * np.abs(exact).max(), name
        assert not np.delete(ours, list(at)).any()
    for name, array in (("u", u), ("v", v)):
        exact = [derivative(lambda x, n=name: value(**{n: x}), array, at)
                 for at in np.ndindex(4, dim)]  # fmt: skip
        assert np.abs(getattr(found, name).ravel() - exact).max() < 1e-11 * np.abs(exact).max()
    assert found.u[3, 0] == found.v[3, 0] == 0


def test_a_damped_oscillator_has_the_derivatives_of_its_closed_form():
    """m u'' + c u' + k u = F sin(W t), from rest: by all five, and by the start."""
    m, c, k, size, w, t = sp.symbols("m c k F W t", positive=True)
    first, second = sp.symbols("first second")
    given = {m: 1.3, c: 0.2, k: 2.0, size: 0.7, w: 1.1, first: 0.3, second: -0.2}
    decay = c / (2 * m)
    omega = sp.sqrt(k / m - decay**2)
    real, imaginary = k - m * w**2, c * w
    square = real**2 + imaginary**2
    steady = size * (real * sp.sin(w * t) - imaginary * sp.cos(w * t)) / square
    free = first - steady.subs(t, 0)
    rate = (second - sp.diff(steady, t).subs(t, 0) + decay * free) / omega
    exact = steady + sp.exp(-decay * t) * (free * sp.cos(omega * t) + rate * sp.sin(omega * t))
    equation = m * sp.diff(exact, t, 2) + c * sp.diff(exact, t) + k * exact - size * sp.sin(w * t)
    assert abs(equation.subs(given).subs(t, 0.4).evalf()) < 1e-12
    end = 5.0
    spring = Potential(K * R**2 / 2, R, {"k": 2.0})
    drive = Drive(
        force=sp.Symbol("F") * sp.sin(sp.Symbol("W") * T), parameters={"F": 0.7, "W": 1.1}
    )
    chain = Chain(spring, 2, 1.3, ends=("fixed", "free"), drive={1: drive},
                  damping=Damping(ground=0.2))  # fmt: skip
    state = State(np.array([0.0, 0.3]), np.array([0.0, -0.2]))
    found = gradient(objective.displacement(1), chain, state, end, dt=0.02, method="rk8")
    ours = {
        w: found.by("W")[1], size: found.by("F")[1], c: found.by("ground")[1], k: found.by("k")[0],
        m: found.mass[1], first: found.u[1], second: found.v[1],
    }  # fmt: skip
    at = {**given, t: end}
    assert found.value == pytest.approx(float(exact.subs(at)), rel=1e-12)
    for symbol, value in ours.items():
        assert value == pytest.approx(float(sp.diff(exact, symbol).subs(at)), rel=1e-11)


def test_a_prescribed_end_has_derivatives_by_its_amplitude_and_frequency():
    """Richardson's differences of whole runs of a chain of beads that stay in contact."""

    def value(a, w):
        drive = Drive(displacement=A * (1 - sp.cos(W * T)), parameters={"a": a, "w": w})
        chain = Chain(
            PowerLaw(1.0, 1.5, preload=1.0), 6, drive={0: drive}, damping=Damping(bond=0.1)
        )
        return gradient(objective.p_norm(objective.displacement(4), 4), chain, chain.at_rest(), 8.0,
                        dt=0.02, method="rk8")  # fmt: skip

    found = value(0.1, 1.3)
    for name, h in (("a", (1e-3, 0)), ("w", (0, 1e-3))):
        slopes = []
        for size in (1, 2):
            ends = [value(0.1 + s * size * h[0], 1.3 + s * size * h[1]).value for s in (-1, 1)]
            slopes.append((ends[1] - ends[0]) / (2 * size * 1e-3))
        expected = (4 * slopes[0] - slopes[1]) / 3
        assert found.by(name)[0] == pytest.approx(expected, rel=1e-8)


def test_a_network_on_a_line_has_the_gradient_of_the_chain():
    mass = [1.0, 1.5, 2.0]
    of_chain = Force(-C * abs(sp.Symbol("v")) * sp.Symbol("v"), parameters={"c": 0.4})
    of_net = Force((-C * SPEED * VS[0],), parameters={"c": 0.4})
    strut = Force(B * RATE, "bonds", parameters={"b": 0.2})
    chain = Chain(SPRING, 3, mass, forces=(of_chain, strut))
    net = Network(
        [[0.0], [1.0], [2.0]], [(0, 1), (1, 2)], SPRING, mass=mass, forces=(of_net, strut),
        walls=[Wall([-9.0], [1.0])],
    )  # fmt: skip
    state = chain.at_rest({0: 0.3})
    flat = State(state.u[:, None], state.v[:, None])
    one, two = (
        gradient(objective.velocity(2), *x, 3.0, dt=0.05) for x in ((chain, state), (net, flat))
    )
    for name in ("c", "b", "k"):
        np.testing.assert_allclose(two.by(name), one.by(name), rtol=1e-11)
    np.testing.assert_allclose(two.mass, one.mass, rtol=1e-11)
    np.testing.assert_allclose(two.v[:, 0], one.v, rtol=1e-11)


def test_a_guide_that_dissipates_and_rubs():
    """By the constants of loss, friction and stiffness, and by diameters with their gaps."""
    steel = materials["steel"]
    bead = Bead(4.76e-3, steel)
    end, dt = 60e-6, 2e-7

    def scene(constant=5e-7, friction=0.2):
        return y_guide(stem=2, branch=2, bead=bead, wall=steel, striker=Striker(bead, 0.5),
                       law=kuwabara_kono(constant), friction=(friction, 0.05))  # fmt: skip

    one = scene()
    site = one.site("branch 1", 1)
    goal = objective.displacement(site, 1)
    found = gradient(goal, one, one.start(), end, dt=dt, method="rk8")

    def value(**changed):
        return simulate(scene(**changed), one.start(), end, dt=dt, method="rk8").final.u[site, 1]

    for name, size, by in (("constant", 5e-7, "constant"), ("friction", 0.2, "friction")):
        slopes = []
        for h in (1e-3, 2e-3):
            ends = [value(**{name: size * (1 + s * h)}) for s in (-1, 1)]
            slopes.append((ends[1] - ends[0]) / (2 * h * size))
        expected = (4 * slopes[0] - slopes[1]) / 3
        assert found.by(by).sum() == pytest.approx(expected, rel=1e-5)
    assert np.abs(found.by("diameter")).max() > 0


def test_what_has_no_gradient_is_refused():
    scene, twice = network(2), {"parameters": {"c": 1.0}}
    state = State(*start(2))
    with pytest.raises(TensegrityError, match="in which a further force acts"):
        gradient(objective.load(wall=0), scene, state, 0.2, dt=DT)
    with pytest.raises(TensegrityError, match="in which a further force acts"):
        gradient(objective.load(bond=2), scene, state, 0.2, dt=DT)
    assert gradient(objective.load(bond=4), Network(
        places(2), BONDS, SPRING, forces=(Force(RATE, "bonds", [0]),)), State(*start(2)), 0.2,
        dt=DT).by("k").any()  # fmt: skip
    clash = Chain(SPRING, 3, drive={0: Drive(force=C * T, **twice)},
                  forces=(Force(-C * sp.Symbol("v"), **twice),))  # fmt: skip
    with pytest.raises(TensegrityError, match="different things"):
        gradient(objective.displacement(0), clash, clash.at_rest(), 0.2, dt=DT)
