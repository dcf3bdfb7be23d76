"""Prisms with any number of sides: the derivations, the closed forms, paths; and from members.

Numbers with many digits are references from independent codes.
"""

import math

import numpy as np
import pytest
import sympy as sp

from derivations import elastic, hardening, polygon, prism, regular, rigid_response
from tensegrity import (
    Chain,
    EquilibriumError,
    Prism,
    equilibrium_path,
    member_stiffness,
    plates,
    simulate,
)

THREE = {
    regular.number_of_sides: 3,
    regular.half_sine: sp.sqrt(3) / 2,
    regular.half_cosine: sp.Rational(1, 2),
}
SHAPES = [(0.8, 0.01, 10.0, 100.0), (1.3, 0.1, 5.0, 50.0), (2.0, 0.3, 20.0, 1000.0)]
STIFFNESS = {
    3: [0.129763431837443, 2.46804004716999686, 16.0502188979485],
    5: [0.0565566202784938, 1.23627654730819, 7.68995458559536],
    7: [0.0471603014394845, 1.04380706379886, 6.46251917283464],
}


def made(sides, shape):
    eta, prestrain, k_base, k_bar = shape
    return Prism(2 * math.sin(math.pi / sides), eta, prestrain, 1.0, k_base, k_bar, sides=sides)


@pytest.mark.parametrize("sides", STIFFNESS)
@pytest.mark.parametrize("number", [0, 1, 2])
def test_axial_stiffness_is_the_reference_one(sides, number):
    p = made(sides, SHAPES[number])
    assert p.axial_stiffness() == pytest.approx(STIFFNESS[sides][number], rel=4e-14)
    assert p.potential().stiffness(0.0) == pytest.approx(p.axial_stiffness(), rel=1e-13)


def test_statements_for_three_sides_are_the_case_three():
    for general, special in (
        (
            hardening.hardening_slenderness_squared(regular.ANY),
            hardening.hardening_slenderness_squared(),
        ),
        (
            hardening.locking_slenderness_squared(regular.ANY),
            hardening.locking_slenderness_squared(),
        ),
        (hardening.curvature_ratio(regular.ANY), hardening.curvature_ratio()),
        (polygon.derivatives()[0], hardening.derivatives()[0]),
        (polygon.derivatives()[1], hardening.derivatives()[1]),
        (prism.natural_lengths(regular.ANY)[1], prism.natural_lengths()[1]),
        (prism.least_k_base(regular.ANY), prism.least_k_base()),
        (
            rigid_response.locking_height_squared(regular.ANY),
            rigid_response.locking_height_squared(),
        ),
    ):
        assert sp.simplify(general.subs(THREE) - special) == 0
    same = elastic.string_hessian(regular.ANY).subs(THREE) - elastic.string_hessian()
    assert same.applyfunc(sp.simplify) == sp.zeros(3, 3)


def test_what_holds_for_every_n_is_that_of_the_reference():
    s, c, n = regular.half_sine, regular.half_cosine, regular.number_of_sides
    q, eta, k = hardening.extension, hardening.eta, prism.k_cross
    second, third = polygon.derivatives()
    assert sp.simplify(second - 2 * n * k * q * s * eta**2 / c**2) == 0
    wanted = 6 * n * k * q * s * eta * (c**2 - s * eta**2) / (c**4 * hardening.radius)
    assert sp.simplify(third - wanted) == 0
    assert sp.simplify(hardening.locking_slenderness_squared(regular.ANY) - 2 * (1 - s)) == 0
    assert sp.simplify(hardening.hardening_slenderness_squared(regular.ANY) - c**2 / s) == 0


@pytest.mark.parametrize("sides", [3, 4, 7])
@pytest.mark.parametrize("part", [0.9, 1.1])
def test_prisms_below_the_slenderness_of_hardening_soften_first(sides, part):
    angle = math.pi / sides
    known = {regular.half_sine: math.sin(angle), regular.half_cosine: math.cos(angle)}
    square = hardening.hardening_slenderness_squared(regular.ANY).subs(known)
    eta = math.sqrt(part * float(square))
    prism = Prism(2 * math.sin(angle), eta, 0.1, 1.0, sides=sides)
    pressed = prism.potential().stiffness(-1e-3 * eta)
    assert (pressed < prism.potential().stiffness(0.0)) == (part < 1)


@pytest.mark.parametrize("sides", [4, 6])
def test_rigid_load_is_that_of_the_twist(sides):
    p = Prism(1.0, 1.5, 0.1, 2.0, sides=sides)
    path = equilibrium_path(p)
    inner = path[1:-2]
    cross = np.sqrt(inner.height**2 + 2 * p.circumradius**2
                    * (1 - np.cos(inner.twist - 2 * np.pi / sides)))  # fmt: skip
    wanted = sides * inner.height * 2.0 * (1 - p.natural_lengths().cross / cross)
    wanted = wanted * (np.sin(inner.twist - 2 * np.pi / sides) / np.sin(inner.twist) - 1)
    assert inner.load == pytest.approx(wanted, rel=1e-8)


@pytest.mark.parametrize("sides", [3, 4, 5, 8])
def test_one_self_stress_and_2n_less_5_mechanisms(sides):
    p = made(sides, SHAPES[1])
    s = p.structure()
    assert len(s.self_stress().states) == 1
    assert len(s.mechanisms()) == 2 * sides - 5
    assert np.abs(s.members.gradient(s.positions)).max() < 1e-13
    q = s.self_stress().feasible
    cross, base, bar = q[sides], q[2 * sides], q[0]
    assert (base / cross, bar / cross) == pytest.approx((1 / (2 * math.sin(math.pi / sides)), -1))
    assert s.is_stable()


def test_four_sided_prism_has_the_reference_tangent():
    s = made(4, SHAPES[1]).structure()
    assert s.modes(1).eigenvalues[0] == pytest.approx(0.09410418097672, rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "wanted"),
    [
        ((0.5, 0.4, 2, 20), [0.6521131380449641, 1.24283192140]),
        ((1, 0.1, 5, 50), [0.29010453666387]),
    ],
)
def test_three_sided_prism_has_the_reference_tangent(shape, wanted):
    h, p0, k2, k3 = shape
    found = Prism(1.0, h, p0, 1.0, k2, k3).structure().modes(2).eigenvalues
    distinct = [found[0], *[x for x in found[1:] if x > 1.001 * found[0]]][: len(wanted)]
    assert distinct == pytest.approx(wanted, rel=1e-11)


def test_path_and_potential_of_five_sides_are_those_of_all_coordinates():
    p = Prism(1.0, 1.2, 0.1, 1.0, 5.0, 50.0, sides=5)
    path = equilibrium_path(p, max_height=1.3)
    potential = p.potential()
    inner = path[2:-1]
    tension = potential.tension(inner.height - potential.length)
    assert np.abs(tension + inner.load).max() < 1e-12
    full = equilibrium_path(p.structure(), supports=plates(range(5), range(5, 10)),
                            branch="symmetric", max_shortening=0.3)  # fmt: skip
    assert np.abs(potential.tension(-full.shortening) + full.load).max() < 1e-12


def test_chain_of_five_sided_prisms_keeps_its_energy():
    chain = Chain(Prism(1.0, 1.2, 0.1, 1.0, sides=5).potential(), 12)
    run = simulate(chain, chain.at_rest({0: 0.05}), 30.0, tol=1e-8)
    assert np.ptp(run.energy) < 1e-9 * run.energy[0]


STRONG = 2495.05288548


def test_laboratory_prism_comes_from_its_members():
    k = {"k_cross": member_stiffness(5.5e9, math.pi / 4 * 0.76e-3**2, 0.13),
         "k_base": member_stiffness(5.5e9, math.pi / 4 * 0.76e-3**2, 0.08),
         "k_bar": member_stiffness(210e9, 36.6e-6, 0.1623)}  # fmt: skip
    p = Prism.from_members(0.13, 0.08, 0.1623, **k)
    found = (p.base, p.height, p.prestrain, p.axial_stiffness())
    wanted = (0.081417138934, 0.134513813897, 0.0515140463299, 111618.254469)
    assert found == pytest.approx(wanted, rel=1e-11)
    tensions = p.structure().tensions[[3, 6, 0]]
    assert tensions == pytest.approx([128.530269938, 44.1979573381, -152.600826560], rel=1e-9)
    loads = -p.potential().tension(np.array([-1e-3, -2e-3, -5e-3]))
    assert loads == pytest.approx([123.051159444, 272.804339012, 848.376431797], rel=1e-9)
    assert p.natural_lengths() == pytest.approx((0.13, 0.08, 0.1623), rel=1e-13)


def test_members_of_four_sides_and_of_no_prism():
    p = Prism.from_members(0.1, 0.09, 0.1525, 2e4, 2.5e4, 4e7, sides=4)
    found = (p.base, p.height, p.prestrain, p.axial_stiffness())
    wanted = (0.0926815791636, 0.0926888693001, 0.0539042966098, 19028.9951353)
    assert found == pytest.approx(wanted, rel=1e-11)
    with pytest.raises(EquilibriumError, match=r"bN\^2 = 0.0196 m\^2 must be above sN\^2"):
        Prism.from_members(0.1, 0.09, 0.14, 2e4, 2.5e4, 4e7, sides=4)
    with pytest.raises(EquilibriumError, match=r"h\^2 = .* must be above 0"):
        Prism.from_members(0.01, 0.09, 0.1525, 2e6, 2.5e4, 4e7, sides=4)


@pytest.mark.parametrize("sides", [3, 4, 7])
def test_a_polygon_of_a_number_of_sides_is_the_general_one_there(sides):
    of, angle = regular.Polygon(sides), sp.pi / sides
    at = dict(zip((*regular.SIDES, regular.half_angle),
                  (sides, sp.sin(angle), sp.cos(angle), angle), strict=True))  # fmt: skip
    for form in (prism.bar_length, prism.cross_length, prism.energy):
        left = form(of) - form(regular.ANY).subs(at)
        numbers = {s: 0.7 + 0.1 * k for k, s in enumerate(sorted(left.free_symbols, key=str))}
        assert abs(sp.N(left.subs(numbers), 20)) < 1e-14
    assert regular.Polygon(3) == regular.TRIANGLE


@pytest.mark.parametrize("sides", [2, -1, 3.5, sp.pi, True])
def test_what_is_no_number_of_sides_is_refused(sides):
    with pytest.raises(ValueError, match="must be a whole number, at least 3"):
        regular.Polygon(sides)
