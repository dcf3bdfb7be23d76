"""Gradients of chains with drives, dashpots and forces of velocity, against 50 digits."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from granular import Bead, chain, kuwabara_kono, materials
from tensegrity import (
    METHODS,
    Chain,
    Damping,
    Drive,
    Ensemble,
    Force,
    Potential,
    State,
    TensegrityError,
    gradient,
    objective,
    simulate,
)

T, R, RATE, U, V, C, K, B = sp.symbols("t r rate u v c k b")
SPRING = Potential(K * R**2 / 2 + R**3 / 3 + R**4 / 4, R, {"k": 1.3})
DRAG = Force(-C * abs(V) * V, at=[1, 2, 4], parameters={"c": [0.2, 0.3, 0.1]})
STRUT = Force(B * RATE * (1 + R**2) + sp.sin(T) * R / 5, "bonds", [0, 2], {"b": 0.4})
MASS, SITES, DT, STEPS = (1.0, 1.5, 0.8, 1.2, 1.1), 5, 0.04, 50
DRIVES = {0: Drive(displacement=sp.sin(T) / 10), 3: Drive(force=sp.cos(2 * T) / 8)}
START = {2: 0.4, 4: -0.2}


def scene(mass=MASS, drag=DRAG, strut=STRUT, spring=SPRING, **more):
    given = {"drive": DRIVES, "damping": Damping(bond=0.05, ground=0.02)} | more
    return Chain(spring, SITES, mass, forces=(drag, strut), **given)


def reference(moved=(), step=0):
    """u and v of the scheme at the end with 50 digits; `moved` names a number that is changed."""
    with mp.workdps(50):
        numbers = {("c", j): mp.mpf(x) for j, x in zip(DRAG.at, DRAG.parameters["c"], strict=True)}
        numbers |= {("b", j): mp.mpf(0.4) for j in STRUT.at}
        numbers |= {("k", j): mp.mpf(1.3) for j in range(SITES - 1)}
        numbers |= {("mass", j): mp.mpf(m) for j, m in enumerate(MASS)}
        numbers |= {(x, j): mp.mpf(0) for j in range(SITES) for x in "uv"}
        for site, speed in START.items():
            numbers["v", site] = mp.mpf(speed)
        if moved:
            numbers[moved] += step
        method, h = METHODS["rk4"], mp.mpf(DT)
        u, v = (np.array([numbers[x, j] for j in range(SITES)]) for x in "uv")

        def rates(t, u, v):
            u, v = u.copy(), v.copy()
            u[0], v[0] = mp.sin(t) / 10, mp.cos(t) / 10
            f = -mp.mpf(0.02) * v
            for j in range(SITES - 1):
                r, rate = u[j + 1] - u[j], v[j + 1] - v[j]
                pull = numbers["k", j] * r + r**2 + r**3 + mp.mpf(0.05) * rate
                if ("b", j) in numbers:
                    pull += numbers["b", j] * rate * (1 + r**2) + mp.sin(t) * r / 5
                f[j] += pull
                f[j + 1] -= pull
            for j in DRAG.at:
                f[j] -= numbers["c", j] * abs(v[j]) * v[j]
            f[3] += mp.cos(2 * t) / 8
            f[0] = mp.mpf(0)
            return f / np.array([numbers["mass", j] for j in range(SITES)])

        names = ("nodes", "matrix", "rates", "positions", "velocities")
        nodes, matrix, rows, positions, velocities = (
            np.vectorize(mp.mpf, otypes=[object])(getattr(method, name)) for name in names
        )
        for k in range(STEPS):
            a = np.zeros((0, SITES), dtype=object)
            for s, node in enumerate(nodes):
                place = u + h * node * v + h**2 * matrix[s, :s] @ a
                slope = rates((k + node) * h, place, v + h * rows[s, :s] @ a)
                a = np.append(a, slope[None], axis=0)
            u, v = u + h * v + h**2 * positions @ a, v + h * velocities @ a
            u[0], v[0] = mp.sin((k + 1) * h) / 10, mp.mpf(0)
        return u, v


def values(u, v):
    """The objectives: a displacement, a velocity, and an energy of a site."""
    return u[4], v[2]


OBJECTIVES = objective.displacement(4), objective.velocity(2)


@pytest.fixture(scope="module")
def found():
    one = scene()
    return gradient(list(OBJECTIVES), one, one.at_rest(START), STEPS * DT, method="rk4", dt=DT)


def test_values_are_those_of_the_scheme(found):
    for one, value in zip(found, values(*reference()), strict=True):
        assert one.value == pytest.approx(float(value), rel=1e-13)
        assert one.run.method == "rk4"
        assert one.reversal < 1e-14


@pytest.mark.parametrize(
    "name", [("c", 1), ("c", 4), ("b", 0), ("b", 2), ("k", 1), ("k", 3), ("mass", 1), ("mass", 3),
             ("mass", 4), ("u", 1), ("v", 3), ("v", 4)],
)  # fmt: skip
def test_derivatives_have_the_digits_of_a_double(found, name):
    step, (what, place) = mp.mpf(10) ** -25, name
    with mp.workdps(50):
        ends = [values(*reference(name, sign * step)) for sign in (-1, 1)]
        exact = [float((b - a) / (2 * step)) for a, b in zip(*ends, strict=True)]
    for one, expected in zip(found, exact, strict=True):
        derivatives = getattr(one, what) if what in ("u", "v", "mass") else one.by(what)
        assert derivatives[place] == pytest.approx(expected, rel=1e-11, abs=1e-14)


def test_what_is_prescribed_has_no_derivative(found):
    for one in found:
        assert one.u[0] == one.v[0] == one.mass[0] == 0
        assert np.flatnonzero(one.by("c")).tolist() == [1, 2, 4]
        assert np.flatnonzero(one.by("b")).tolist() == [0, 2]


def test_a_gradient_without_losses_is_that_of_the_splitting():
    """A force of 0: rk8 and rkn6 converge to the same derivatives of the motion."""
    plain = Chain(SPRING, SITES, MASS)
    idle = Chain(SPRING, SITES, MASS, forces=(Force(0 * V + C * U, parameters={"c": 0.0}),))
    peak = objective.peak(objective.displacement(3))
    one, two = (
        gradient(peak, x, x.at_rest(START), 4.0, dt=0.01, method=m)
        for x, m in ((plain, "rkn6"), (idle, "rk8"))
    )
    for name in ("u", "v", "mass"):
        np.testing.assert_allclose(getattr(two, name), getattr(one, name), rtol=0, atol=1e-10)
    np.testing.assert_allclose(two.by("k"), one.by("k"), rtol=0, atol=1e-10)


def test_springs_to_the_ground_are_forces():
    """The same derivatives by the stiffness of on-site springs as by that of forces written out."""
    goal = objective.p_norm(objective.load(bond=1), 4)
    held = Chain(SPRING, SITES, MASS, ground=Potential(B * U**4 / 4, U, {"b": 0.7}))
    pulled = Chain(SPRING, SITES, MASS, forces=(Force(-C * U**3, parameters={"c": 0.7}),))
    one, two = (gradient(goal, x, x.at_rest(START), 3.0, dt=DT) for x in (held, pulled))
    np.testing.assert_allclose(one.by("b"), two.by("c"), rtol=1e-12)
    np.testing.assert_allclose(one.mass, two.mass, rtol=1e-11, atol=1e-15)
    assert np.abs(one.by("b")).min() > 1e-8


def test_the_energy_of_sites_of_a_driven_chain():
    """Richardson's differences of whole runs; |v| v has a corner in its slope."""
    goal = objective.p_norm(objective.energy(sites=[2, 3]), p=2)

    def value(c, k):
        drag = Force(DRAG.expression, at=[1, 2, 4], parameters={"c": c})
        one = scene(drag=drag, spring=SPRING.varied({"k": k}))
        return gradient(goal, one, one.at_rest(START), 2.0, dt=DT, method="rk8")

    c, k = np.array([0.2, 0.3, 0.1]), 1.3
    exact = value(c, k)
    for place, name in ((1, "c"), (2, "c"), (0, "k")):
        slopes = []
        for h in (1e-3, 2e-3):
            ends = [value(c + s * h * (np.array([1, 2, 4]) == place) * (name == "c"),
                          k + s * h * (name == "k")).value for s in (-1, 1)]  # fmt: skip
            slopes.append((ends[1] - ends[0]) / (2 * h))
        expected = (4 * slopes[0] - slopes[1]) / 3
        by = exact.by(name)
        assert (by.sum() if name == "k" else by[place]) == pytest.approx(expected, rel=1e-6)


def test_the_loss_of_a_contact_and_its_stiffness():
    """A row of beads: by the constant, and by the stiffness that spring and loss share."""
    bead = Bead(4.76e-3, materials["steel"])
    row = chain([bead] * 5, preload=20.0, law=kuwabara_kono(3e-7))
    goal, start = objective.displacement(4), row.at_rest({0: 0.05})
    exact = gradient(goal, row, start, 4e-5, dt=1e-7, method="rk8")

    def value(**changed):
        law = kuwabara_kono(changed.get("c", 3e-7))
        if "scale" in changed:
            steel = materials["steel"]
            other = replace(steel, modulus=steel.modulus * changed["scale"])
            beads = Bead(4.76e-3, other, mass=bead.mass)
        else:
            beads = bead
        one = chain([beads] * 5, preload=20.0, law=law)
        return simulate(one, start, 4e-5, dt=1e-7, method="rk8").final.u[4]

    slopes = [(value(c=3e-7 * (1 + h)) - value(c=3e-7 * (1 - h))) / 6e-7 / h for h in (1e-3, 2e-3)]
    expected = (4 * slopes[0] - slopes[1]) / 3
    assert exact.by("constant").sum() == pytest.approx(expected, rel=1e-6)
    slopes = [(value(scale=1 + h) - value(scale=1 - h)) / 2 / h for h in (1e-3, 2e-3)]
    expected = (4 * slopes[0] - slopes[1]) / 3
    stiffness = row.contacts[0].constant
    assert (exact.by("stiffness") * stiffness).sum() == pytest.approx(expected, rel=1e-6)
    assert (exact.by("modulus") * materials["steel"].modulus).sum() == pytest.approx(
        expected, rel=1e-6
    )


def test_an_ensemble_has_the_gradients_of_its_scenes():
    scenes = [scene(mass=np.multiply(MASS, x)) for x in (1.0, 1.1)]
    start = scenes[0].at_rest(START)
    batch = State(*(np.stack([x, x], axis=-1) for x in (start.u, start.v)))
    both = gradient(OBJECTIVES[0], Ensemble(scenes), batch, 1.0, dt=DT)
    for k, one in enumerate(scenes):
        alone = gradient(OBJECTIVES[0], one, start, 1.0, dt=DT)
        assert both.value[k] == alone.value
        np.testing.assert_array_equal(both.by("c")[:, k], alone.by("c"))


def chain_of(*forces, **more):
    return Chain(SPRING, SITES, MASS, forces=forces, **more)


@pytest.mark.parametrize(
    ("words", "make", "more"),
    [
        ("method 'verlet' has no gradient", scene, {"method": "verlet"}),
        ("springs that change", lambda: Chain(SPRING.over_time(k=1.3 + T), 5), {}),
        ("different things", lambda: chain_of(Force(-K * V, parameters={"k": 0.1})), {}),
        ("different things", lambda: chain_of(Force(K * RATE, "bonds", parameters={"k": 1.0})), {}),
        ("different things", lambda: chain_of(DRAG, Force(C * RATE, "bonds",
                                                          parameters={"c": 0.1})), {}),
        ("is not one of", scene, {"wanted": ["q"]}),
    ],
)  # fmt: skip
def test_what_has_no_gradient_is_refused(words, make, more):
    one = make()
    with pytest.raises(TensegrityError, match=words):
        gradient(OBJECTIVES[0], one, one.at_rest(), 0.4, dt=DT, **more)


def test_loads_of_bonds_beside_a_force_are_refused():
    one = scene()
    with pytest.raises(TensegrityError, match="in which a further force acts"):
        gradient(objective.load(bond=2), one, one.at_rest(), 0.4, dt=DT)
    assert gradient(objective.load(bond=1), one, one.at_rest(START), 0.4, dt=DT).by("c").any()
