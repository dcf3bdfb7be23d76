"""Equilibrium, axial stiffness and hardening against checks that do not use the derivation."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from derivations import elastic, equilibrium, hardening, prism, rigid_response, waves
from tensegrity import Prism

pytestmark = pytest.mark.unchanged()

EXACT = 50  # decimals of the references


def _lengths(base, twist, height):
    """Bar and cross string from the distance of two points, in mpmath."""
    a = base / mpmath.sqrt(3)

    def distance(angle):
        x, y = a * mpmath.cos(angle) - a, a * mpmath.sin(angle)
        return mpmath.sqrt(x * x + y * y + height * height)

    return distance(twist), distance(twist - 2 * mpmath.pi / 3)


def test_energy_is_that_of_3_cross_strings_6_base_strings_and_3_bars():
    """Of the energy per member, and of the same with the twist eliminated by the bar."""
    state = base, twist, height = 1.1, 2.7, 0.6
    natural, springs = (0.5, 0.9, 1.2), (1.0, 2.0, 3.0)
    with mpmath.workdps(EXACT):
        bar, cross = _lengths(*map(mpmath.mpf, state))
        each = [
            k * (length - rest) ** 2 / 2
            for k, length, rest in zip(springs, (cross, base, bar), natural, strict=True)
        ]
    values = {prism.base: base, prism.twist: twist, prism.height: height}
    values |= dict(zip((prism.k_cross, prism.k_base, prism.k_bar), springs, strict=True))
    rests = (prism.natural_cross, prism.natural_base, prism.natural_bar)
    values |= dict(zip(rests, natural, strict=True))
    found = prism.energy().subs(values)
    assert float(found) == pytest.approx(float(3 * each[0] + 6 * each[1] + 3 * each[2]), rel=1e-14)
    values |= {rigid_response.bar: bar, rigid_response.circumradius: base / sp.sqrt(3)}
    values |= {rigid_response.height: height}
    rigid = rigid_response.potential_energy().subs(values)
    assert float(rigid) == pytest.approx(float(3 * each[0]), rel=1e-14)


# --- the axial stiffness ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def hessian():
    """Hessian of U(l, phi, h) at given natural lengths, as a function for mpmath."""
    coordinates = (prism.base, prism.twist, prism.height)
    natural = (prism.natural_cross, prism.natural_base, prism.natural_bar)
    springs = (prism.k_cross, prism.k_base, prism.k_bar)
    matrix = sp.hessian(prism.energy(), coordinates)
    gradient = [sp.diff(prism.energy(), x) for x in coordinates]
    arguments = (*coordinates, *natural, *springs)
    return sp.lambdify(arguments, [list(matrix), gradient], "mpmath", cse=True)


def _condensed(hessian, p):
    """K_h0 by elimination of base and twist at 50 digits; natural lengths from force balance."""
    base, height, p0 = mpmath.mpf(p.base), mpmath.mpf(p.height), mpmath.mpf(p.prestrain)
    twist = 5 * mpmath.pi / 6
    bar, cross = _lengths(base, twist, height)
    springs = [mpmath.mpf(k) for k in (p.k_cross, p.k_base, p.k_bar)]
    density = springs[0] * p0 / (1 + p0)
    natural = (
        cross / (1 + p0),
        base * (1 - density / (mpmath.sqrt(3) * springs[1])),
        bar * (1 + density / springs[2]),
    )
    entries, gradient = hessian(base, twist, height, *natural, *springs)
    round_off = mpmath.mpf(10) ** (5 - EXACT) * sum(springs) * (base + height) ** 2
    assert all(abs(g) < round_off for g in gradient)
    h = mpmath.matrix(3, 3)
    for k, entry in enumerate(entries):
        h[k // 3, k % 3] = entry
    inner, row = h[:2, :2], h[2, :2]
    return h[2, 2] - (row * mpmath.lu_solve(inner, row.T))[0]


def _random_prism(rng):
    base, height, k_cross = 10 ** rng.uniform(-1, 1, 3)
    prestrain = 10 ** rng.uniform(-6, 0)
    least = prestrain / (1 + prestrain) / np.sqrt(3)
    k_base = k_cross * max(10 ** rng.uniform(-2, 6), 1.01 * least)
    k_bar = k_cross * 10 ** rng.uniform(-2, 6)
    return Prism(base, height, prestrain, k_cross, k_base, k_bar)


def test_axial_stiffness_is_the_condensed_hessian(hessian, rng):
    with mpmath.workdps(EXACT):
        for _ in range(150):
            p = _random_prism(rng)
            exact = _condensed(hessian, p)
            assert exact > 0
            assert abs(p.axial_stiffness() / exact - 1) < 1e-12, p


@pytest.mark.parametrize("rigid", [("k_base",), ("k_bar",), ("k_base", "k_bar")])
def test_rigid_members_are_the_limit_of_stiff_ones(hessian, rigid):
    values = {"k_base": 7.0, "k_bar": 30.0}
    with mpmath.workdps(EXACT):
        stiff = Prism(1.0, 0.7, 0.05, 1.3, **(values | dict.fromkeys(rigid, 1e20)))
        exact = _condensed(hessian, stiff)
    found = Prism(1.0, 0.7, 0.05, 1.3, **(values | dict.fromkeys(rigid, np.inf))).axial_stiffness()
    assert found == pytest.approx(float(exact), rel=1e-14)


def test_rigid_axial_stiffness_is_that_of_the_compiled_potential(rng):
    for _ in range(10):
        height, prestrain = rng.uniform(0.2, 3), 10 ** rng.uniform(-6, 0)
        p = Prism(1.0, height, prestrain, 1.0)
        compiled = float(p.potential().stiffness(0.0))
        assert p.axial_stiffness() == pytest.approx(compiled, rel=1e-13)


def test_axial_stiffness_vanishes_without_prestrain():
    assert Prism(1.0, 0.7, 0.0, 1.0, 5.0, 50.0).axial_stiffness() == 0


# --- equilibrium -----------------------------------------------------------------------------


def _energy_gradient_densities(twist, base, height):
    """Force densities that balance the unit load, from virtual work on the three lengths."""
    with mpmath.workdps(30):

        def slopes(k):
            def at(i):
                def moved(x):
                    q = [base, twist, height]
                    q[k] = x
                    return _lengths(*q)[i]

                return mpmath.diff(moved, [base, twist, height][k])

            return at(0), at(1)

        rows, rhs = mpmath.matrix(3, 3), mpmath.matrix([0, 0, -1])
        bar, cross = _lengths(base, twist, height)
        for k in range(3):
            bar_slope, cross_slope = slopes(k)
            base_slope = 1 if k == 0 else 0
            rows[k, 0] = 3 * cross * cross_slope
            rows[k, 1] = 6 * base * base_slope
            rows[k, 2] = -3 * bar * bar_slope
        return mpmath.lu_solve(rows, rhs)


@pytest.mark.parametrize("twist", [2.2, 2.5, 2.9, 1.0])
def test_force_densities_do_the_virtual_work_of_the_load(twist):
    expected = _energy_gradient_densities(mpmath.mpf(twist), mpmath.mpf(1.3), mpmath.mpf(0.8))
    values = {prism.twist: twist, prism.base: 1.3, prism.height: 0.8, equilibrium.load: 1}
    for found, x in zip(equilibrium.force_densities(), expected, strict=True):
        assert float(found.subs(values)) == pytest.approx(float(x), rel=1e-12)


def test_only_the_reference_twist_is_a_tensegrity():
    assert set(equilibrium.self_stress()) == {-sp.pi / 6, 5 * sp.pi / 6}
    assert equilibrium.tensegrity_twist() == prism.REFERENCE_TWIST


def test_members_unload_at_the_ends_of_the_taut_range():
    low, high = equilibrium.taut_range()
    values = {prism.height: 1, equilibrium.load: 1}
    at_low, at_high = (
        [sp.simplify(x.subs({prism.twist: end, **values})) for x in equilibrium.force_densities()]
        for end in (low, high)
    )
    assert [x == 0 for x in at_low] == [False, True, True]
    assert [x == 0 for x in at_high] == [True, False, False]


@pytest.mark.parametrize("offset", [-0.01, 0.01])
def test_all_members_are_taut_inside_the_range_only(offset):
    low, high = (float(x) for x in equilibrium.taut_range())

    def taut(twist):
        return all(float(r.subs(prism.twist, twist)) > 0 for r in equilibrium.ratios())

    assert taut(low + offset) == (offset > 0)
    assert taut(high + offset) == (offset < 0)
    assert all(taut(t) for t in np.linspace(low, high, 52)[1:-1])
    outside = np.concatenate(
        [np.linspace(0, low, 50)[1:-1], np.linspace(high, 2 * np.pi, 50)[1:-1]]
    )
    assert not any(taut(t) for t in outside)


# --- the rigid-elastic prism -----------------------------------------------------------------


def _string_energy(eta, q, r):
    """V / ((3/2) k1 a^2) at elongation r, with the twist from the bar, in mpmath."""
    base, phi = mpmath.sqrt(3), 5 * mpmath.pi / 6
    bar, rest = _lengths(base, phi, eta)
    cosine = 1 - (bar**2 - (eta + r) ** 2) / 2
    _, cross = _lengths(base, mpmath.acos(cosine), eta + r)
    return (cross - (1 - q) * rest) ** 2


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize(("eta", "q"), [(0.9, 0.02), (0.53, 0.4), (2.0, 1e-3)])
def test_derivatives_at_the_reference(order, eta, q):
    found = hardening.derivatives()[order - 2]
    values = {hardening.eta: eta, hardening.extension: q, hardening.radius: 1, prism.k_cross: 1}
    with mpmath.workdps(60):
        eta, q = mpmath.mpf(eta), mpmath.mpf(q)
        expected = 1.5 * mpmath.diff(lambda r: _string_energy(eta, q, r), 0, order)
    assert float(found.subs(values)) == pytest.approx(float(expected), rel=1e-12)


@pytest.mark.parametrize("q", [0.0, 1e-3, 0.3, 0.9])
@pytest.mark.parametrize("above", [1e-4, 0.01, 0.3, 5.0])
def test_hardening_prisms_harden_on_the_whole_compression_side(q, above):
    with mpmath.workdps(40):
        eta = mpmath.sqrt(mpmath.sqrt(3) / 6 + above)
        stroke = eta - mpmath.sqrt(eta**2 - (2 - mpmath.sqrt(3)))
        for part in (0.001, 0.01, 0.1, 0.3, 0.6, 0.9, 0.99):
            r = -part * stroke
            assert mpmath.diff(lambda x: _string_energy(eta, q, x), r, 3, h=1e-10) < 0
            assert _string_energy(eta, q, -r) < _string_energy(eta, q, r)


def test_thick_prisms_soften_first():
    with mpmath.workdps(40):
        eta = mpmath.sqrt(mpmath.sqrt(3) / 6 - mpmath.mpf("0.01"))
        assert mpmath.diff(lambda x: _string_energy(eta, 0.1, x), 0, 3) > 0
        assert _string_energy(eta, 0.1, 0.001) > _string_energy(eta, 0.1, -0.001)


def test_hardening_is_proved():
    assert hardening.prove_hardening() == hardening.hardening_slenderness_squared()


def test_a_failed_proof_is_an_error(monkeypatch):
    hardening.prove_hardening.cache_clear()  # which other tests have filled
    monkeypatch.setattr(hardening, "convexity_coefficients", lambda: [sp.Integer(1), -sp.sqrt(3)])
    with pytest.raises(ArithmeticError, match="convexity"):
        hardening.prove_hardening()


def test_locking_disappears_where_its_height_does():
    eta_squared = hardening.locking_slenderness_squared()
    height_squared = rigid_response.locking_height_squared().subs(
        prism.reference_height, sp.sqrt(eta_squared) * prism.CIRCUMRADIUS
    )
    assert sp.expand(height_squared) == 0


def test_force_near_locking_and_energy_there():
    base, height, p0 = 1.2, 0.9, 0.03
    fields = {prism.base: base, prism.reference_height: height, prism.prestrain: p0}
    fields[prism.k_cross] = 1
    energy = float(rigid_response.locking_energy().subs(fields))
    with mpmath.workdps(40):
        a = mpmath.mpf(base) / mpmath.sqrt(3)
        eta, q = mpmath.mpf(height) / a, mpmath.mpf(p0) / (1 + mpmath.mpf(p0))
        scale = 1.5 * a**2
        lock = mpmath.sqrt(eta**2 - 2 + mpmath.sqrt(3))
        end, start = (_string_energy(eta, q, r) for r in (lock - eta, 0))
        assert energy == pytest.approx(float(scale * (end - start)), rel=1e-12)
        gap = mpmath.mpf("1e-12")
        at = lock + gap - eta
        force = scale / a * mpmath.diff(lambda r: _string_energy(eta, q, r), at, h=1e-20)
        _, rest = _lengths(mpmath.mpf(base), 5 * mpmath.pi / 6, mpmath.mpf(height))
        _, at_lock = _lengths(mpmath.mpf(base), mpmath.pi, lock * a)
    symbols = {str(s): s for s in rigid_response.lock_force().free_symbols}
    leading = rigid_response.lock_force().subs(
        {
            symbols["g"]: float(gap * a), symbols["H"]: float(lock * a), symbols["a"]: float(a),
            symbols["s_lock"]: float(at_lock), symbols["s_N"]: float(rest) / (1 + p0),
            symbols["k_1"]: 1,
        }
    )  # fmt: skip
    assert float(leading) == pytest.approx(float(force), rel=1e-5)


def test_hanging_begins_where_base_strings_and_bars_unload_together():
    """The twist of `taut_range`, which knows forces and no lengths."""
    assert equilibrium.upright_twist() == equilibrium.taut_range()[0]


def test_hanging_without_equilibrium_is_an_error(monkeypatch):
    monkeypatch.setattr(equilibrium, "upright_twist", lambda *_: 3 * sp.pi / 4)
    with pytest.raises(ArithmeticError, match="not in equilibrium without base strings"):
        equilibrium.upright_load.__wrapped__()


def test_equations_vanish_at_the_self_stressed_state():
    natural = dict(
        zip(
            (prism.natural_cross, prism.natural_base, prism.natural_bar),
            prism.natural_lengths(),
            strict=True,
        )
    )
    for g in elastic.equations():
        at_rest = prism.at_reference(g).subs({**natural, elastic.third_load: 0})
        values = {prism.base: 1.1, prism.reference_height: 0.8, prism.prestrain: 0.2}
        values |= {prism.k_cross: 1.5, prism.k_base: 4.0, prism.k_bar: 9.0}
        assert abs(float(at_rest.subs(values).evalf(30))) < 1e-14


def test_small_breathers_of_prisms_exist_below_one_prestrain():
    at = waves.breather_extension()
    q = float(at.subs(hardening.eta, 1.5 * sp.sqrt(3)))
    assert q / (1 - q) == pytest.approx(0.19624381171867, rel=1e-13)

    def condition(prestrain):
        spring = Prism(1.0, 1.5, prestrain, 1.0).potential()
        r = 1e-3 * np.arange(-4, 5)
        slopes = np.polynomial.Polynomial.fit(r, spring.tension(r), 8).deriv
        second, third, fourth = (slopes(k)(0.0) for k in (1, 2, 3))
        return second * fourth / 2 - third**2

    assert condition(0.995 * q / (1 - q)) > 0 > condition(1.005 * q / (1 - q))
    always = sp.nsolve(at - 1, hardening.eta, 1.5) / sp.sqrt(3)  # height over base
    assert float(always) == pytest.approx(0.88, abs=5e-3)
    assert float(at.subs(hardening.eta, 0.85 * sp.sqrt(3))) > 1
