"""What a user describes: prisms, their potentials, and the errors for impossible ones."""

import math
import pickle

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    EquilibriumError,
    LockingError,
    NoLocking,
    Potential,
    PowerLaw,
    Prism,
    TensegrityError,
)

GOOD = {"base": 1.0, "height": 0.7, "prestrain": 0.01, "k_cross": 1.0}


def test_softest_base_that_is_allowed():
    least = 1.0 * (0.2 / 1.2) / math.sqrt(3)
    with pytest.raises(TensegrityError, match=f"k_base .* must be above {least:g} N/m"):
        Prism(1, 1, 0.2, 1, k_base=0.999 * least)
    assert 0 < Prism(1, 1, 0.2, 1, k_base=1.001 * least).natural_lengths().base < 0.01


def test_locking_height_is_where_the_bars_meet():
    prism = Prism(**GOOD)
    a, bar = prism.base / math.sqrt(3), prism.natural_lengths().bar
    assert math.isclose(prism.locking_height(), math.sqrt(bar**2 - 4 * a**2), rel_tol=1e-14)


def test_a_thick_prism_is_valid_but_never_locks():
    edge = math.sqrt((2 - math.sqrt(3)) / 3)
    with pytest.raises(NoLocking, match="collapses flat"):
        Prism(1, edge * (1 - 1e-12), 0.1, 1).locking_height()
    assert 0 < Prism(1, edge * (1 + 1e-12), 0.1, 1).locking_height() < 1e-5
    thick = Prism(1, 0.25, 0.1, 1)
    assert thick.potential().domain[0] == -0.25
    assert thick.axial_stiffness() > 0


def test_tension_outside_the_domain_names_the_end():
    spring = Prism(**GOOD).potential()
    low, high = spring.domain
    with pytest.raises(LockingError, match="twist pi"):
        spring.tension([0.0, low])
    with pytest.raises(LockingError, match="twist 0"):
        spring.tension(high)
    assert np.isfinite(spring.tension([low * (1 - 1e-15), high * (1 - 1e-15)])).all()
    assert np.isfinite(spring.energy([low, high])).all()  # the energy at locking is finite
    with pytest.raises(TensegrityError, match="nan"):
        spring.energy(math.nan)


def test_preload_shifts_to_the_loaded_equilibrium():
    free, loaded = Prism(**GOOD).potential(), Prism(**GOOD).potential(preload=0.3)
    shift = loaded.length - free.length
    assert abs(loaded.tension(0.0)) < 1e-14
    assert loaded.energy(0.0) == 0
    r = np.linspace(0.9 * loaded.domain[0], 0.5, 31)
    np.testing.assert_allclose(loaded.tension(r), free.tension(r + shift) + 0.3, rtol=0, atol=1e-12)
    np.testing.assert_allclose(loaded.stiffness(r), free.stiffness(r + shift), rtol=1e-10)


def test_preload_up_to_the_limit_point_of_a_thick_prism():
    thick = Prism(1, 0.25, 0.1, 1)
    spring = thick.potential()
    heights = np.linspace(-0.2499, 0, 200_001)
    limit = -spring.tension(heights).min()
    with pytest.raises(EquilibriumError, match="largest axial load"):
        thick.potential(preload=limit * (1 + 1e-6))
    assert thick.potential(preload=limit * (1 - 1e-6)).stiffness(0.0) > 0


def test_without_prestrain_the_reference_is_a_sonic_vacuum():
    """V'' = 0 there; the force grows with the cube of the elongation."""
    spring = Prism(1, 0.8, 0.0, 1).potential()
    assert spring.stiffness(0.0) == 0
    r = np.array([1e-4, 1e-3])
    order = np.log10(spring.tension(r[1]) / spring.tension(r[0]))
    assert abs(order - 3) < 0.02


def test_a_readers_own_energy():
    r, k = sp.symbols("r k")
    toda = Potential(k * (sp.exp(-r) + r - 1), r, {"k": 2.0}, length=1.0)
    x = np.linspace(-1, 1, 11)
    np.testing.assert_allclose(toda.tension(x), 2 * (1 - np.exp(-x)), rtol=1e-14)
    np.testing.assert_allclose(toda.stiffness_slope(x), -2 * np.exp(-x), rtol=1e-14)
    assert toda == Potential(k * (sp.exp(-r) + r - 1), r, {k: 2.0}, length=1.0)
    with pytest.raises(TensegrityError, match="parameter k"):
        Potential(k * r**2, r)
    with pytest.raises(TensegrityError, match="parameter k"):
        Potential(k * r**2, r, {k: math.nan})
    with pytest.raises(TensegrityError, match="not a SymPy"):
        Potential("r**2", r)
    with pytest.raises(TensegrityError, match="domain"):
        Potential(r**2, r, domain=(0.1, 1))


@pytest.mark.parametrize("exponent", [0.5, 1.5, 2, 3.3])
def test_power_law_pushes_only(exponent):
    law = PowerLaw(3.0, exponent)
    r = np.array([-0.3, -0.1, 0.0, 0.2])
    np.testing.assert_allclose(law.tension(r), -3 * np.maximum(-r, 0) ** exponent, rtol=1e-14)
    loaded = PowerLaw(3.0, exponent, preload=0.4)
    overlap = (0.4 / 3) ** (1 / exponent)
    expected = 0.4 - 3 * np.maximum(overlap - r, 0) ** exponent
    np.testing.assert_allclose(loaded.tension(r), expected, rtol=0, atol=1e-15)
    assert abs(loaded.energy(0.0)) < 1e-16


@pytest.mark.parametrize("bad", [(1e-3, 1e-3, 1), (1e-300, 1.5, 1e300)])
def test_impossible_power_laws_are_refused(bad):
    with pytest.raises(TensegrityError):
        PowerLaw(*bad)


@pytest.mark.parametrize("members", [{}, {"k_base": 20.0, "k_bar": 200.0}, {"k_bar": 1e3 / 3}])
@pytest.mark.parametrize("preload", [0.0, 0.05 / 3])
def test_the_potential_of_a_prism_prints_as_the_call_that_makes_it(members, preload):
    spring = Prism(**{**GOOD, "prestrain": 0.1 / 3}, **members).potential(preload)
    again = eval(repr(spring), {"Prism": Prism})
    assert again == spring
    assert repr(again) == repr(spring)


def test_potentials_print_what_a_user_gave():
    spring = Prism(base=1, height=0.7, prestrain=0.01, k_cross=1).potential(preload=0.05)
    shown = "Prism(base=1, height=0.7, prestrain=0.01, k_cross=1).potential(preload=0.05)"
    assert repr(spring) == shown
    r, k = sp.symbols("r k")
    toda = Potential(k * (sp.exp(-r) + r - 1), r, {k: 2.0}, domain=(-1, math.inf))
    assert repr(toda) == "Potential(k*(r - 1 + exp(-r)), r, {'k': 2}, domain=(-1, inf))"
    names = {"Potential": Potential, "exp": sp.exp, "r": r, "k": k, "inf": math.inf}
    assert eval(repr(toda), names) == toda


@pytest.mark.parametrize("law", [(2.0, 1.5), (1 / 3, 1.4, 0.1), (5e9, 1.5, 0.3, 4.76e-3)])
def test_power_laws_print_as_the_call_that_makes_them(law):
    spring = PowerLaw(*law)
    assert eval(repr(spring), {"PowerLaw": PowerLaw}) == spring
    assert repr(PowerLaw(2.0, 1.5)) == "PowerLaw(stiffness=2, exponent=1.5, preload=0)"


def test_potentials_survive_pickling():
    for spring in (Prism(**GOOD).potential(0.1), PowerLaw(1.0, 1.5)):
        copy = pickle.loads(pickle.dumps(spring))
        assert copy == spring
        assert copy.tension(-0.01) == spring.tension(-0.01)


@pytest.mark.parametrize("exponent", [0.5, 1.37, 1.5, 3])
@pytest.mark.parametrize("preload", [0.0, 0.4])
def test_an_open_contact_has_no_stiffness(exponent, preload):
    law = PowerLaw(3.0, exponent, preload)
    opening = (preload / 3) ** (1 / exponent)
    r = opening + np.array([0.0, 1e-200, 1e-9, 0.5])
    for derivative in (law.stiffness, law.stiffness_slope):
        assert np.array_equal(derivative(r), np.zeros(4))


def test_energies_in_pieces_and_with_signs():
    r, k = sp.symbols("r k")
    bilinear = Potential(sp.Piecewise((k * r**2, r < 0), (k * r**2 / 2, True)), r, {k: 3.0})
    np.testing.assert_allclose(bilinear.tension([-0.5, 0.5]), [-3.0, 1.5])
    np.testing.assert_allclose(Potential(sp.sign(r) * r**3 / 3, r).tension([-2.0, 2.0]), [-4, 4])


@pytest.mark.parametrize(
    ("energy", "why"),
    [
        (sp.Function("f")(sp.Symbol("r")), "cannot be translated"),
        (sp.LambertW(sp.Symbol("r")), "cannot be translated"),
        (sp.I * sp.Symbol("r") ** 2, "contains I"),
        (sp.oo * sp.Symbol("r") ** 2, "contains"),
    ],
)
def test_energies_that_cannot_run_are_refused_when_made(energy, why):
    with pytest.raises(TensegrityError, match=why):
        Potential(energy, sp.Symbol("r"))


def test_parameters_of_any_name():
    r, exp, keyword = sp.symbols("r exp lambda")
    spring = Potential(exp * sp.exp(r) + keyword * r**2, r, {"exp": 2.0, "lambda": np.float64(3)})
    np.testing.assert_allclose(spring.tension(0.5), 2 * np.exp(0.5) + 3)
    with pytest.raises(TensegrityError, match="parameters kk"):
        Potential(exp * r**2, r, {"exp": 1.0, "kk": 2.0})
    with pytest.raises(TensegrityError, match="each must name one symbol"):
        Potential(sp.Symbol("a") * r**2 + sp.Symbol("a", positive=True), r, {"a": 1.0})
