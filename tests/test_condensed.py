"""The potential of prisms with elastic members, against plain energies and its own derivatives."""

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve

from derivations import prism
from tensegrity import EquilibriumError, LockingError, Prism, equilibrium_path
from tensegrity.prisms.condensed import ElasticPotential

INF = math.inf
EPS = np.finfo(float).eps

PRISMS = {
    "contact": (1.0, 1.0, 0.1, 1.0, 5.0, 50.0),
    "goes flat": (1.0, 0.5, 0.4, 1.0, 2.0, 20.0),
    "stiff": (2.0, 1.5, 1e-6, 3.0, 1e8, 1e8),
    "soft bars": (1.0, 0.2, 1e-6, 1.0, 1e8, 1.0),
    "rigid bases": (1.0, 0.7, 0.01, 1.0, INF, 10.0),
    "rigid bars": (0.1, 0.07, 0.01, 200.0, 2e3, INF),
    "no prestrain": (1.0, 0.8, 0.0, 1.0, 10.0, 30.0),
}


def inside(potential, count=101):
    low, high = potential.domain
    return np.linspace(low, high, count)


# --- numbers ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PRISMS)
@pytest.mark.parametrize("loaded", [0.0, 0.5])
def test_tension_is_preload_less_the_load_of_the_path(name, loaded):
    """To 1e-12 (1 + condition number in height)."""
    p = Prism(*PRISMS[name])
    path = equilibrium_path(p, max_height=1.1 * p.height)
    folds = [e.load for e in path.events if e.kind == "fold"]
    preload = loaded * min([*folds, path.load.max()])
    potential = p.potential(preload)
    low, high = potential.domain
    r = path.height - potential.length
    rows = (r >= low) & (r <= high)
    assert rows.sum() > len(path) / 4
    r, height, load = r[rows], path.height[rows], path.load[rows]
    condition = np.abs(height * potential.stiffness(r))
    error = np.abs(potential.tension(r) - (preload - load))
    assert (error <= 1e-12 * (np.abs(load) + preload + condition)).all()


@pytest.mark.parametrize("name", ["contact", "goes flat", "stiff", "soft bars"])
def test_energy_and_tension_agree_with_the_plain_energy_at_fifty_digits(name):
    fields = PRISMS[name]
    potential = Prism(*fields).potential()
    symbols = (prism.base, prism.twist, prism.height)
    constants = (prism.k_cross, prism.k_base, prism.k_bar, prism.natural_cross,
                 prism.natural_base, prism.natural_bar)  # fmt: skip
    u = prism.energy()
    plain = sp.lambdify(
        (*symbols, *constants), [u, *(sp.diff(u, x) for x in symbols)], "mpmath", cse=True
    )
    natural = sp.lambdify(
        (prism.base, prism.reference_height, prism.prestrain, *constants[:3]),
        prism.natural_lengths(),
        "mpmath",
    )
    with mpmath.workdps(50):
        numbers = [mpmath.mpf(x) for x in fields]
        given = (*numbers[3:], *natural(*numbers))
        rest = plain(numbers[0], 5 * mpmath.pi / 6, numbers[1], *given)[0]
        elongations = np.concatenate(
            [inside(potential, 9)[1:-1], potential.domain[0] * 10.0 ** np.arange(-8, 0, 2)]
        )
        states = potential.states(elongations)
        for r, z in zip(elongations.tolist(), states.tolist(), strict=True):
            h = numbers[1] + mpmath.mpf(r)
            start = (numbers[0] + z[1] * fields[3] / fields[4] * fields[0],
                     5 * mpmath.pi / 6 + 2 * mpmath.atan(z[0]))  # fmt: skip
            side, phi = mpmath.findroot(
                lambda side, phi, h=h: plain(side, phi, h, *given)[1:3], start, tol=1e-70
            )
            energy, _, _, tension = plain(side, phi, h, *given)
            condition = abs(h * mpmath.mpf(float(potential.stiffness(r))))
            assert abs(potential.tension(r) - tension) <= 1e-13 * (abs(tension) + condition)
            slope = abs(h * tension)
            assert abs(potential.energy(r) - (energy - rest)) <= 1e-13 * (
                abs(energy - rest) + slope
            )


@pytest.mark.parametrize("name", PRISMS)
@pytest.mark.parametrize("order", [0, 1, 2])
def test_each_derivative_is_the_slope_of_the_one_before(name, order):
    """Central differences at two steps: the error falls with the square of the step."""
    potential = Prism(*PRISMS[name]).potential()
    methods = (potential.energy, potential.tension, potential.stiffness, potential.stiffness_slope)
    low, high = potential.domain
    r = np.linspace(0.4 * low, 0.8 * high, 41)
    errors = []
    for step in (1e-3 * high, 0.5e-3 * high):
        slope = (methods[order](r + step) - methods[order](r - step)) / (2 * step)
        errors.append(np.abs(slope - methods[order + 1](r)).max())
    size = np.abs(methods[order + 1](r)).max()
    assert errors[0] <= 1e-4 * size
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize("name", PRISMS)
def test_rest_is_an_equilibrium_under_the_preload(name):
    p = Prism(*PRISMS[name])
    path = equilibrium_path(p)
    preload = 0.3 * path.load[: len(path) // 2].max()
    potential = p.potential(preload)
    assert abs(potential.energy(0.0)) <= 1e-15 * (p.k_cross * p.base**2 + preload * p.height)
    assert abs(potential.tension(0.0)) <= 4e-15 * (preload + float(potential.stiffness(0.0)))
    assert potential.length < p.height
    assert p.potential().length == p.height


def test_potentials_at_different_preload_are_shifts_of_one_another():
    p = Prism(*PRISMS["contact"])
    one, other = p.potential(), p.potential(0.8)
    shift = other.length - one.length
    low, high = other.domain
    r = np.linspace(low, high, 50)[1:-1]
    assert np.allclose(other.tension(r), one.tension(r + shift) + 0.8, rtol=0, atol=1e-14)
    exact = one.energy(r + shift) - one.energy(shift) + 0.8 * r
    assert np.allclose(other.energy(r), exact, rtol=0, atol=1e-15)
    assert np.allclose(np.array(other.domain) + shift, one.domain, atol=1e-15)


@pytest.mark.parametrize("name", PRISMS)
def test_stiffness_at_rest_is_the_axial_stiffness(name):
    """K = (load just below) / shortening, at second order."""
    p = Prism(*PRISMS[name])
    potential = p.potential()
    step = 1e-4 * p.height
    slope = (potential.tension(step) - potential.tension(-step)) / (2 * step)
    assert p.axial_stiffness() == pytest.approx(float(slope), rel=1e-4, abs=1e-4 * p.k_cross)
    assert p.axial_stiffness() >= 0


def test_shapes_are_kept():
    potential = Prism(*PRISMS["contact"]).potential()
    assert potential.tension(0.01).shape == ()
    assert potential.energy(np.zeros((2, 3))).shape == (2, 3)
    assert potential.stiffness([]).shape == (0,)
    grid = np.array([[0.0, 0.01], [-0.02, -0.1]])
    one_by_one = [[float(potential.tension(x)) for x in row] for row in grid]
    assert np.allclose(potential.tension(grid), one_by_one, rtol=1e-14, atol=1e-16)


# --- domain and errors -----------------------------------------------------------------------


def test_domain_ends_at_contact_and_where_base_strings_unload():
    p = Prism(*PRISMS["contact"])
    path = equilibrium_path(p, max_height=1.2)
    low, high = p.potential().domain
    slack, contact = path.events
    assert p.height + low == pytest.approx(contact.height, rel=1e-14)
    assert p.height + high == pytest.approx(slack.height, rel=1e-14)


def test_domain_ends_flat_for_a_thick_prism():
    assert Prism(*PRISMS["goes flat"]).potential().domain[0] == pytest.approx(-0.5, rel=1e-15)
    loaded = Prism(*PRISMS["goes flat"]).potential(0.1)
    assert loaded.domain[0] == pytest.approx(-loaded.length, rel=1e-15)


@pytest.mark.parametrize(("side", "words"), [(0, "the bars meet"), (1, "unloaded")])
def test_beyond_the_domain_is_an_error_that_says_why(side, words):
    potential = Prism(*PRISMS["contact"]).potential()
    end = potential.domain[side]
    assert np.isfinite(potential.tension(end))
    with pytest.raises(LockingError, match=words):
        potential.tension([0.0, end * (1 + 1e-12)])


def test_preload_beyond_the_largest_load_is_refused_with_that_load():
    path = equilibrium_path(Prism(*PRISMS["goes flat"]))
    with pytest.raises(EquilibriumError, match=f"is beyond {path.events[0].load:g} N"):
        Prism(*PRISMS["goes flat"]).potential(path.events[0].load * (1 + 1e-9))
    Prism(*PRISMS["goes flat"]).potential(path.events[0].load * (1 - 1e-9))


def test_equal_prisms_give_equal_potentials():
    one, other = (Prism(*PRISMS["contact"]).potential(0.1) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert one != Prism(*PRISMS["contact"]).potential()
    assert one != Prism(1.0, 0.7, 0.01, 1.0).potential()
    assert "k_base=5" in repr(one)
    assert isinstance(one, ElasticPotential)


def powers(low, high):
    return st.floats(math.log10(low), math.log10(high)).map(lambda x: 10.0**x)


@settings(max_examples=40, deadline=None)
@given(powers(0.2, 3), powers(1e-6, 0.4), powers(1, 1e8), powers(1, 1e8))
@example(0.5530254382244238, 1e-06, 1.0, 13019.052455476109)  # ends where both must agree
def test_identity_with_the_path_holds_for_any_admissible_prism(height, prestrain, k2, k3):
    p = Prism(1.0, height, prestrain, 1.0, k2, k3)
    potential, path = p.potential(), equilibrium_path(p)
    r = path.height - potential.length
    error = np.abs(potential.tension(r) + path.load)
    condition = np.abs(path.height * potential.stiffness(r))
    rounded = np.spacing(potential.length) * np.abs(potential.stiffness(r))  # r is a difference
    assert (error <= 1e-12 * (np.abs(path.load) + condition) + rounded).all()


@pytest.mark.parametrize(("k_base", "k_bar", "height"), [(0.01, 1.0, 0.3), (0.001, 20.0, 0.7)])
def test_unprestressed_prism_of_soft_bases_has_the_path_of_least_energy(k_base, k_bar, height):
    """All its members are unloaded where the path begins: forces grow like the shortening squared,
    and residuals over them are round-off there."""
    twist, base, h = sp.symbols("twist base h", positive=True)
    prism = Prism(1.0, height, 0.0, 1.0, k_base, k_bar)
    radius = base / sp.sqrt(3)
    cross, bar = (
        sp.sqrt(h**2 + 2 * radius**2 * (1 - sp.cos(twist - turn))) for turn in (2 * sp.pi / 3, 0)
    )
    at = {twist: 5 * sp.pi / 6, base: 1, h: height}
    springs = ((3, 1.0, cross), (6, k_base, base), (3, k_bar, bar))
    energy = sum(n * k * (x - x.subs(at).evalf(30)) ** 2 / 2 for n, k, x in springs)
    slopes = sp.lambdify((twist, base, h), [sp.diff(energy, x) for x in (twist, base, h)])
    path = equilibrium_path(prism)
    assert len(path) > 20
    for k in (len(path) // 2, len(path) - 2):
        start = path.twist[k] * 1.001, path.base[k] * 1.001
        found = fsolve(lambda x, k=k: slopes(*x, path.height[k])[:2], start, xtol=1e-13)
        assert path.twist[k] == pytest.approx(found[0], rel=1e-9)
        assert path.base[k] == pytest.approx(found[1], rel=1e-9)
        assert path.load[k] == pytest.approx(-slopes(*found, path.height[k])[2], rel=1e-6)
        tension = prism.potential().tension(path.height[k] - height)
        assert -tension == pytest.approx(path.load[k], rel=1e-9)
