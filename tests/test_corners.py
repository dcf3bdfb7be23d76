"""Laws in pieces: corners are found wherever they are, corrected, and jumps are refused."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from tensegrity import (
    Chain,
    Network,
    Potential,
    PowerLaw,
    State,
    TensegrityError,
    simulate,
)
from tensegrity.springs.kinks import UNKNOWN
from tensegrity.structures.member_springs import MemberSpring

r, k, a = sp.symbols("r k a", real=True)
HALF = sp.Rational(5, 2)
GAP = sp.Max(r - 0.1, 0) ** 2 + sp.Max(-r - 0.15, 0) ** 2
"""Strings on both sides of a gap."""
LINES = sp.Piecewise(
    (r**2 / 2, r < 0.1),
    (0.005 + 0.1 * (r - 0.1) + (r - 0.1) ** 2, r < 0.2),
    (0.025 + 0.3 * (r - 0.2) + (r - 0.2) ** 2 / 4, True),
)
"""A tension of three lines."""
CUBES = sp.Abs(r) ** 3 / 3 + r**2 / 4 + sp.Max(r - 0.1, 0) ** HALF * (1 - r)
"""Corners of several exponents, two of them at one place."""
LAWS = {"gap": GAP, "lines": LINES, "cubes": CUBES}


@pytest.mark.parametrize(
    ("energy", "expected"),
    [
        (k * r**2, ()),
        (k * sp.Max(-r, 0) ** HALF + 3 * r**2, [(0.0, 5.0, 1.5, -1.0)]),
        (k * sp.Max(1 - k * r, 0) ** 2, [(0.5, 16.0, 1.0, -1.0)]),
        (k * r * sp.Max(r, 0) ** 2, [(0.0, 6.0, 2.0, 1.0)]),
        (sp.Max(r, 0) ** 2 + sp.Max(r, 0) ** 3, [(0.0, 2.0, 1.0, 1.0), (0.0, 3.0, 2.0, 1.0)]),
        (sp.Max(-r, 0) ** HALF * (1 + r), [(0.0, 2.5, 1.5, -1.0), (0.0, -3.5, 2.5, -1.0)]),
        (sp.Max(-r, 0) ** 2.37, [(0.0, 2.37, 1.37, -1.0)]),
        (sp.Max(sp.Abs(r) - 0.1, 0) ** 2, [(-0.1, 2.0, 1.0, -1.0), (0.1, 2.0, 1.0, 1.0)]),
        (sp.Abs(r) ** 2.5, [(0.0, 2.5, 1.5, -1.0), (0.0, 2.5, 1.5, 1.0)]),
        (LINES, [(0.1, 1.0, 1.0, 1.0), (0.2, 1.5, 1.0, -1.0)]),
        (1e9 * sp.Max(1e-6 - r, 0) ** 2.5, [(1e-6, 2.5e9, 1.5, -1.0)]),
        (sp.Max(sp.log(1 + r), 0) ** 2, [(0.0, 2.0, 1.0, 1.0), (0.0, -3.0, 2.0, 1.0),
                                         (0.0, 11 / 3, 3.0, 1.0)]),
        (r**2 + sp.Max(sp.sin(r), 0) ** 2, [UNKNOWN]),
        (r**2 / 2 + sp.Max(r, 0) / 10, [(0.0, 0.1, 0.0, 1.0)]),
        (sp.Piecewise((r**2, r < 1), (r**2 + 1, True)), [(1.0, 1.0, -1.0, 1.0)]),
    ],
)  # fmt: skip
def test_corners_of_a_law(energy, expected):
    given = {k: 2.0} if energy.has(k) else {}
    spring = Potential(energy, r, given, domain=(-0.9, 2e20))
    np.testing.assert_allclose(np.array(spring.kinks), np.array(expected), rtol=1e-15)
    assert spring.smooth == (not len(expected))


def test_a_root_of_a_square_is_a_corner_whatever_the_symbol():
    x = sp.Symbol("x")
    assert Potential(sp.sqrt(x**2) ** 3, x).kinks == ((0.0, 6.0, 2.0, 1.0),)


def test_corners_move_with_the_parameters():
    spring = Potential(k * sp.Max(a - r, 0) ** 2, r, {k: 1.0, a: 0.1})
    assert spring.kinks == ((0.1, 2.0, 1.0, -1.0),)
    assert spring.varied({"a": -0.3, "k": 2.0}).kinks == ((-0.3, 4.0, 1.0, -1.0),)


@pytest.mark.parametrize("energy", LAWS.values(), ids=LAWS)
def test_a_tension_without_its_corners_has_none(energy):
    """A cubic through points on one side of a place goes through that on the other."""
    spring, small = Potential(energy, r), mpmath.mpf(10) ** -5
    tension = sp.lambdify(r, sp.diff(energy, r), "mpmath")

    def left(x):
        parts = (
            side * strength * max(side * (x - place), 0) ** exponent
            for place, strength, exponent, side in spring.kinks
        )
        return tension(x) - sum(parts)

    with mpmath.workdps(60):
        for place in {opening[0] for opening in spring.kinks}:
            one, two, three, four = (left(place + n * small) for n in range(1, 5))
            there = 10 * one - 20 * two + 15 * three - 4 * four
            assert abs(there - left(place - small)) < 1e-14
            assert abs(tension(place - small) - tension(place + small)) > 1e-12


def chain_of(energy, **how):
    return Chain(Potential(energy, r), 6, ends=("fixed", "fixed"), **how)


def net_of(energies):
    """Bonds of all laws in one network."""
    positions = np.array([[0, 0.0], [1, 0], [0.5, 0.8], [1.5, 0.8]])
    bonds = [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)]
    springs = [Potential(energy, r) for energy in energies]
    springs = [springs[k % len(springs)] for k in range(len(bonds))]
    return Network(positions, bonds, springs, mass=[1.0, 1.2, 0.8, 1.1])


SCENES = {name: chain_of(energy) for name, energy in LAWS.items()} | {"net": net_of(LAWS.values())}


def thrown(scene):
    velocity = np.random.default_rng(3).uniform(-0.4, 0.4, scene.shape)
    velocity[list(scene.held)] = 0
    return State(np.zeros(scene.shape), velocity)


def order(scene, state, method):
    """Least-squares power of the step in the error, and the errors."""
    counts = np.unique(np.geomspace(40, 300, 24).astype(int))

    def moved(n, method):
        end = simulate(scene, state, 8.0, method=method, dt=8.0 / n).final
        return np.stack([end.u, end.v])

    exact = moved(3000, "corrected6")
    errors = np.array([np.max(np.abs(moved(n, method) - exact)) for n in counts])
    return -np.polyfit(np.log(counts), np.log(errors), 1)[0], errors


@pytest.mark.parametrize("name", SCENES)
def test_all_corners_of_a_law_are_corrected(name):
    scene = SCENES[name]
    state = thrown(scene)
    found, errors = order(scene, state, "corrected6")
    plain, others = order(scene, state, "rkn6")
    assert found > 3.4
    assert plain < 2.7
    assert np.median(errors / others) < 2e-2


def adaptive(chain, tension, state, t_end):
    """u and v from an adaptive method, which makes small steps over corners."""

    def rates(_, y):
        u, v = y.reshape(2, -1)
        pull = tension(np.diff(u))
        force = np.append(pull, 0) - np.append(0, pull)
        force[list(chain.held)] = 0
        return np.concatenate([v, force])

    start = np.concatenate([state.u, state.v])
    found = solve_ivp(rates, (0, t_end), start, "DOP853", rtol=1e-12, atol=1e-14)
    return found.y[:, -1].reshape(2, -1)


@pytest.mark.parametrize("energy", LAWS.values(), ids=LAWS)
def test_a_tolerance_is_kept_where_forces_have_corners(energy):
    chain = chain_of(energy)
    state = thrown(chain)
    tension = sp.lambdify(r, sp.diff(energy, r), "numpy")
    exact = adaptive(chain, tension, state, 8.0)
    for tol in (1e-4, 1e-7):
        run = simulate(chain, state, 8.0, tol=tol)
        assert run.method == "corrected6"
        assert run.steps < 1500
        for found, right, rows in zip(
            (run.final.u, run.final.v), exact, (run.u, run.v), strict=True
        ):
            assert np.max(np.abs(found - right)) < tol * np.max(np.abs(rows))


def test_contacts_and_strings_have_their_corner():
    assert PowerLaw(2.0, 1.5).kinks == ((0.0, 2.0, 1.5, -1.0),)
    assert MemberSpring(3.0, 1.0, string=True).kinks == ((0.0, 3.0, 1.0, 1.0),)
    assert MemberSpring(3.0, 1.0).smooth


# jumps


JUMPS = {
    "tension": (sp.Max(r, 0) / 10 + r**2 / 2, 0.0),
    "away from rest": (sp.Min(r**2 / 2, r**2 / 4 + 0.01), 0.2),
    "energy": (sp.Piecewise((r**2 / 2, r < 0.1), (r**2 / 2 + 1, True)), 0.1),
}


@pytest.mark.parametrize("exponent", [1.5, sp.Rational(5, 2), k])
def test_a_power_of_a_maximum_has_all_derivatives_beyond_its_corner(exponent):
    """0 to a power below 0 is infinite, and that times 0 no number."""
    given = {k: 1.75} if exponent is k else {}
    spring = Potential(sp.Max(-r, 0) ** exponent, r, given)
    at, n = np.array([-0.3, 0.0, 0.3]), float(given.get(k, exponent))
    factor = 1.0
    for name, step in (("tension", -1), ("stiffness", -1), ("stiffness_slope", -1)):
        factor, n = step * factor * n, n - 1
        found = getattr(spring, name)(at)
        assert found[0] == pytest.approx(factor * 0.3**n, rel=1e-14)
        assert np.all(found[1:] == 0)
    chain = Chain(spring, 4)
    run = simulate(chain, thrown(chain), 1.0, tol=1e-3)
    assert run.energy_error < 1e-4


@pytest.mark.parametrize(("energy", "place"), JUMPS.values(), ids=JUMPS)
def test_a_tolerance_is_refused_where_a_force_jumps(energy, place):
    chain = Chain(Potential(energy, r, length=2.0), 4)
    state = chain.at_rest({0: -1.0})
    with pytest.raises(TensegrityError, match=r"jumps by .* at the elongation") as caught:
        simulate(chain, state, 20.0, tol=1e-6)
    assert f"{place:g} m (strain {place / 2:g})" in str(caught.value).replace("-", "")


def test_a_jump_that_is_not_met_is_no_matter():
    chain = Chain(Potential(JUMPS["away from rest"][0], r), 4)
    assert simulate(chain, chain.at_rest({0: 0.05}), 5.0, tol=1e-9).complete


def test_steps_given_run_over_a_jump_with_an_error_of_first_order():
    """A mass on a spring whose tension jumps by 2 f where it has none: in closed form."""
    f, speed = 0.3, 1.0
    chain = Chain(Potential(r**2 / 2 + f * sp.Abs(r), r), 2, ends=("fixed", "free"))
    largest, phase = np.hypot(f, speed), np.arctan2(f, speed)
    back = np.pi - 2 * phase  # when it passes the jump
    exact = f - largest * np.sin(0.3 * back + phase)
    steps, errors = np.unique(np.geomspace(50, 2000, 40).astype(int)), []
    for n in steps.tolist():
        t_end, start = 1.3 * back, chain.at_rest({1: speed})
        run = simulate(chain, start, t_end, method="rkn6", dt=t_end / n)
        errors.append(abs(run.final.u[1] - exact))
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(1, abs=0.35)
    assert max(errors * steps) < 3
