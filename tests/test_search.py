"""How far springs come with an energy, and how stiff they are there: in C, in NumPy, exactly."""

import ctypes
import math

import numpy as np
import pytest
import sympy as sp
from networks import fork, patch, pushed
from scenes import prism_chain, smooth_blow

from tensegrity import (
    Chain,
    Ensemble,
    LockingError,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    StabilityError,
    TensegrityError,
    simulate,
)
from tensegrity.engine.compiled import single
from tensegrity.runs.problem import Guard
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs import collection
from tensegrity.springs.collection import ORDERS, Springs

R, K, W = sp.symbols("r k w")
ENERGIES = (0.0, *10.0 ** np.arange(-300, 301, 30), *10.0 ** np.arange(-18.0, 4.0), math.inf)
FINEST = 1e-8  # by which a range may be too wide


def quadratic(k=1.0, domain=(-math.inf, math.inf)):
    return Potential(K * R**2 / 2, R, {K: k}, domain=domain)


def barrier(height=10.0):
    """A spring with a barrier about 0.3 m, some centimetres wide."""
    well = sp.exp(-(((R - sp.Rational(3, 10)) / W) ** 2))
    return Potential(R**2 / 2 + K * well, R, {K: height, W: 0.03})


def prisms(size):
    """Springs of prisms of a size [m], some under a preload."""
    return [
        Prism(size, 0.7 * size, 0.01, 1.0).potential(),
        Prism(size, 0.8 * size, 0.1, 2.0).potential(preload=0.01 * size),
    ]


def contacts(exponent, size=1.0):
    return [PowerLaw(2 * size ** (1 - exponent), exponent, p * size) for p in (0.0, 0.01)]


USER = (
    quadratic(domain=(-0.1, 0.2)),
    barrier(),
    Potential(K * (R - sp.log(1 + R)), R, {K: 1.0}, domain=(-1.0, math.inf)),
    Potential(K * (sp.exp(-R) + R - 1), R, {K: 2.0}),
)
GROUPS = {
    "prisms": prisms(1.0),
    "prisms of micrometres": prisms(1e-6),
    "an elastic prism": [Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05)],
    "contacts": [spring for n in (0.5, 1.0, 1.2, 1.5, 2.0, 3.0) for spring in contacts(n)],
    "contacts of micrometres": contacts(1.5, 1e-6),
    "user": list(USER),
    "mixed": [*prisms(1.0), *USER, *contacts(1.5), prisms(2.0)[0]],
}
GROUPS["polynomials"] = [Polynomial(spring, -0.02, 0.01, 1e-9) for spring in prisms(1.0)]
GROUPS["polynomials too"] = GROUPS["polynomials"] + GROUPS["mixed"]
NONE: dict = {}
COMPILED = {
    **{group: set(ORDERS) for group in GROUPS},
    "an elastic prism": {"energy"},
    "polynomials": {"energy", "tension"},
    "polynomials too": {"tension"},
}


class OfTheSameValues(Springs):
    """Searched by NumPy, with what the search in C calls for the values of the laws."""

    _searches = NONE

    def _each(self, name, r, numbers):
        out = np.empty_like(r)
        for column, number in enumerate(numbers):
            spring = self.different[number]
            points, found = np.ascontiguousarray(r[:, column]), np.empty(len(r))
            given = (ctypes.c_void_p(x.ctypes.data) for x in (spring.values, points, found))
            single(spring.law).library.values(
                *map(ctypes.c_longlong, (ORDERS.index(name), len(r))), *given
            )
            out[:, column] = found
        return out


class InNumpy(Springs):
    """Searched without C."""

    _searches = NONE


def inside(springs, ranges):
    """Ranges that end short of the ends of the domains."""
    half = springs.domains / 2
    return np.clip(ranges, half[:, :1], half[:, 1:])


def said(function, *arguments):
    """What a call gives, or the kind and the text of its error."""
    try:
        return function(*arguments)
    except TensegrityError as error:
        return type(error), str(error)


@pytest.mark.parametrize("group", GROUPS)
def test_which_springs_are_searched_by_compiled_functions(group):
    assert Springs(GROUPS[group])._searches.keys() == COMPILED[group]


@pytest.mark.parametrize("group", [x for x in GROUPS if COMPILED[x] == set(ORDERS)])
def test_the_same_values_give_the_same_bits(group):
    springs, others = (kind(GROUPS[group]) for kind in (Springs, OfTheSameValues))
    assert len(springs._searches) == len(ORDERS)
    for energy in (*ENERGIES, math.nan):
        (ranges, locks), (wanted, locked) = (x.reachable(energy) for x in (springs, others))
        np.testing.assert_array_equal(ranges, wanted)
        np.testing.assert_array_equal(locks, locked)
        for name in ("tension", "stiffness"):
            one, other = (said(x.largest, name, inside(x, ranges)) for x in (springs, others))
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("group", GROUPS)
def test_ranges_are_those_that_arrays_give(group):
    springs, others = Springs(GROUPS[group]), InNumpy(GROUPS[group])
    for energy in 10.0 ** np.arange(-8.0, 3.0) * (1e-12 if "micro" in group else 1.0):
        (ranges, locks), (wanted, locked) = (x.reachable(energy) for x in (springs, others))
        np.testing.assert_allclose(ranges, wanted, rtol=1e-6)
        np.testing.assert_array_equal(locks, locked)
        for name in ("tension", "stiffness"):
            one, other = (said(x.largest, name, inside(x, wanted)) for x in (springs, others))
            if isinstance(other, tuple):
                assert one == other
            else:
                np.testing.assert_allclose(one, other, rtol=1e-13)


@pytest.mark.parametrize("kind", [Springs, InNumpy])
def test_a_linear_spring_reaches_the_root_of_twice_the_energy(kind):
    for energy in 10.0 ** np.arange(-300, 301, 25):
        ranges, locks = kind([quadratic(3.0), quadratic(1e6)]).reachable(energy)
        exact = np.sqrt(2 * energy / np.array([3.0, 1e6]))
        assert not locks.any()
        for sign, end in zip((-1, 1), ranges.T, strict=True):
            assert np.all(sign * end >= exact)
            np.testing.assert_allclose(sign * end, exact, rtol=FINEST)


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.5, 3.0])
def test_a_contact_is_pressed_as_far_as_its_energy_and_opens_for_ever(exponent):
    for energy in 10.0 ** np.arange(-40, 41, 10.0):
        ((low, high),), _ = Springs([PowerLaw(2.0, exponent)]).reachable(energy)
        pressed = ((exponent + 1) * energy / 2) ** (1 / (exponent + 1))
        assert -low >= pressed
        assert -low == pytest.approx(pressed, rel=FINEST)
        assert high == collection.WAYS.sizes[-1]


def test_the_end_of_a_domain_is_reached_with_the_energy_there():
    spring = quadratic(domain=(-0.1, 0.2))
    for share, locks in ((0.99, False), (1.01, True)):
        found = Springs([spring]).reachable(share * 0.1**2 / 2)
        assert found[1] == [locks]
        assert found[0][0, 0] == pytest.approx(-0.1 * min(math.sqrt(share), 1), rel=FINEST)


def test_a_narrow_barrier_holds_what_has_less_energy():
    low = quadratic(domain=(-0.1, 0.2))
    found, _ = Springs([barrier(10.0), low, barrier(0.001)]).reachable(1.0)
    assert found[0, 1] == pytest.approx(0.3, abs=0.05)
    assert found[2, 1] == pytest.approx(math.sqrt(2), rel=FINEST)


@pytest.mark.parametrize("group", ["mixed", "contacts", "prisms"])
def test_each_of_many_springs_is_searched_as_if_alone(group):
    springs = GROUPS[group]
    together, numbers = Springs(springs), np.arange(len(springs))[::-2]
    ranges, locks = together.reachable(1e-4)
    columns = np.asfortranarray(inside(together, ranges))
    stiffness = together.largest("stiffness", columns, numbers)
    for number, stiff in zip(numbers, stiffness, strict=True):
        alone = Springs([springs[number]])
        mine, locked = alone.reachable(1e-4)
        assert (mine[0] == ranges[number]).all()
        assert locked == [locks[number]]
        assert alone.largest("stiffness", inside(alone, mine)) == [stiff]


def test_ranges_do_not_depend_on_the_units():
    """But where the preload's own energy leaves no digits of that of the motion."""
    for make in (prisms, lambda size: contacts(1.5, size)):
        for energy in 10.0 ** np.arange(-8.0, 3.0):
            small, large = (Springs(make(x)).reachable(energy * x**2) for x in (1e-6, 1.0))
            np.testing.assert_array_equal(small[1], large[1])
            near = np.abs(large[0]) < 1e250  # not where a contact opens for ever
            wide = 1e-6 * large[0][near]
            np.testing.assert_allclose(small[0][near], wide, rtol=FINEST)


@pytest.mark.parametrize("kind", [Springs, InNumpy])
def test_stiffness_that_is_not_finite_is_refused_by_its_range(kind):
    sharp = Potential(sp.Abs(R) ** sp.Rational(3, 2), R)  # stiffness |r|^(-1/2)
    for ranges in ([[-1.0, 2.0]], [[-1.0, 0.0]]):
        with pytest.raises(StabilityError, match=r"stiffness (inf|nan) between elongations -1 m"):
            kind([sharp]).largest("stiffness", np.array(ranges))


@pytest.mark.parametrize("kind", [Springs, InNumpy])
def test_ranges_outside_of_the_domain_are_refused(kind):
    springs = kind([quadratic(), quadratic(domain=(-0.1, 0.2))])
    for ends in ([-0.1, 0.1], [-0.05, 0.2], [-0.05, 0.3], [-1.0, 0.1]):
        with pytest.raises(LockingError, match=r"elongation .* m is at or"):
            springs.largest("stiffness", np.array([[-1.0, 1.0], ends]))
    with pytest.raises(TensegrityError, match="elongation nan m is not a number"):
        springs.largest("tension", np.array([[-1.0, 1.0], [-0.05, math.nan]]))


def test_what_a_spring_has_of_its_own_is_not_passed_over():
    class Stiffer(Potential):
        def stiffness(self, r):
            return 4 * super().stiffness(r)

    springs = Springs([Stiffer(K * R**2 / 2, R, {K: 2.0})])
    assert springs._searches.keys() == {"tension"}
    assert springs.largest("stiffness", np.array([[-1.0, 1.0]])) == [8.0]


def test_without_a_compiler_numpy_searches(monkeypatch):
    wanted = Springs(GROUPS["user"]).reachable(1e-4)[0]
    monkeypatch.setattr(collection, "single", lambda law: None)
    springs = Springs(GROUPS["user"])
    assert not springs._searches
    np.testing.assert_allclose(springs.reachable(1e-4)[0], wanted, rtol=1e-6)


@pytest.mark.parametrize("more", [(), (3.0, 4.0)])
def test_an_elongation_at_an_end_of_a_domain_is_not_inside(more):
    springs = [quadratic(k, domain=(-0.1, 0.2)) for k in (1.0, *more)]
    guard = Guard(None, dynamics(Chain(springs, len(springs) + 1)), 0.1, 1.0)
    met, near = np.zeros((len(springs), 2)), 1 - 1e-12
    for spring in range(len(springs)):
        for side, end in enumerate((-0.1, 0.2)):
            met[spring, side] = end
            assert not guard.is_inside(met)
            met[spring, side] = near * end
            assert guard.is_inside(met)


def ensemble():
    scenes = [Chain(spring, 6) for spring in contacts(1.5)]
    return Ensemble(scenes), Ensemble(scenes).at_rest({0: [0.1, 0.2]})


SCENES = {
    "prisms": lambda: (prism_chain(12), smooth_blow(prism_chain(12))),
    "tapered": lambda: (
        tapered := Chain([PowerLaw(1 + k / 9, 1.5, 0.1) for k in range(9)], 10),
        tapered.at_rest({0: 0.1}),
    ),
    "network": lambda: (patch(3), pushed(patch(3))),
    "walls": lambda: (fork(), fork().at_rest({0: (0.1, 0.0)})),
    "ensemble": ensemble,
}


@pytest.mark.parametrize("name", SCENES)
def test_the_default_step_is_that_of_a_search_in_numpy(name, monkeypatch):
    t_end = 1e-4 if name == "walls" else 1.0
    scene, state = SCENES[name]()
    run = simulate(scene, state, t_end)
    monkeypatch.setattr(Springs, "_searches", {})
    scene, state = SCENES[name]()
    other = simulate(scene, state, t_end)
    assert (run.steps, run.dt) == (other.steps, other.dt)
    np.testing.assert_array_equal(run.u, other.u)
