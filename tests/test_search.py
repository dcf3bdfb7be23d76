"""How far springs come with an energy, and how stiff they are there."""

import math

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    LockingError,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    StabilityError,
    TensegrityError,
)
from tensegrity.springs import collection
from tensegrity.springs.collection import Springs

R, K, W = sp.symbols("r k w")
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


def inside(springs, ranges):
    """Ranges that end short of the ends of the domains."""
    half = springs.domains / 2
    return np.clip(ranges, half[:, :1], half[:, 1:])


@pytest.mark.parametrize("group", GROUPS)
def test_ranges_end_where_the_energy_does_and_hold_the_largest_values(group):
    springs, scale = Springs(GROUPS[group]), 1e-12 if "micro" in group else 1.0
    for energy in 10.0 ** np.arange(-8.0, 3.0) * scale:
        ranges, locks = springs.reachable(energy)
        within = inside(springs, np.clip(ranges, -1e3, 1e3))
        largest = {name: springs.largest(name, within) for name in ("tension", "stiffness")}
        for number, spring in enumerate(springs.different):
            rest, r = float(spring.energy(0.0)), np.linspace(*within[number], 501)
            assert (spring.energy(r) - rest <= energy * (1 + 1e-6) + 1e-15).all()
            for end in ranges[number]:
                beyond = abs(end) > 0.999 * max(map(abs, spring.domain)) or abs(end) > 1e250
                enough = beyond or spring.energy(end) - rest >= energy * (1 - 1e-9) - 1e-15
                assert enough or locks[number]
            for name, most in largest.items():
                seen = np.abs(getattr(spring, name)(r)).max()
                narrow = spring == barrier() or spring in contacts(0.5)  # which samples may miss
                assert narrow or 0.99 * seen <= most[number] <= 1.01 * seen


def test_a_linear_spring_reaches_the_root_of_twice_the_energy():
    for energy in 10.0 ** np.arange(-300, 301, 25):
        ranges, locks = Springs([quadratic(3.0), quadratic(1e6)]).reachable(energy)
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


def test_stiffness_that_is_not_finite_is_refused_by_its_range():
    sharp = Potential(sp.Abs(R) ** sp.Rational(3, 2), R)  # stiffness |r|^(-1/2)
    for ranges in ([[-1.0, 2.0]], [[-1.0, 0.0]]):
        with pytest.raises(StabilityError, match=r"stiffness (inf|nan) between elongations -1 m"):
            Springs([sharp]).largest("stiffness", np.array(ranges))


def test_ranges_outside_of_the_domain_are_refused():
    springs = Springs([quadratic(), quadratic(domain=(-0.1, 0.2))])
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
    assert springs.largest("stiffness", np.array([[-1.0, 1.0]])) == [8.0]
