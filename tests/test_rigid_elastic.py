"""The rigid-elastic prism: printed forms, closed forms, and the form that runs."""

import numpy as np
import pytest
import sympy as sp

from derivations import prism as derived_prism
from derivations import rigid_elastic as derived
from tensegrity import Prism

BASE, HEIGHT, PRESTRAIN = 1.3, 0.9, 0.07


@pytest.fixture(scope="module")
def spring():
    return Prism(BASE, HEIGHT, PRESTRAIN, k_cross=2.5).potential()


@pytest.fixture(scope="module")
def heights(spring):
    r = np.linspace(*spring.domain, 41)[1:-1]
    return HEIGHT + r


def _prism_numbers():
    a = BASE / np.sqrt(3)
    b = np.sqrt(HEIGHT**2 + 2 * a**2 * (1 + np.sqrt(3) / 2))
    natural = np.sqrt(HEIGHT**2 + 2 * a**2 * (1 - np.sqrt(3) / 2)) / (1 + PRESTRAIN)
    return a, b, natural


def test_force_equals_the_first_printed_form(spring, heights):
    a, b, natural = _prism_numbers()
    h = heights
    cosine = 1 - (b**2 - h**2) / (2 * a**2)
    twist = np.arccos(cosine)
    s = np.sqrt(h**2 + BASE**2 / 3 * (2 + cosine - np.sqrt(3) * np.sin(twist)))
    root = np.sqrt(-(h**2 - b**2) * (4 * a**2 + h**2 - b**2) / a**4)
    inner = 3 + np.sqrt(3) * (2 * a**2 + h**2 - b**2) / (a**2 * root)
    printed = 3 * 2.5 * (s - natural) * h / (2 * s) * inner
    np.testing.assert_allclose(spring.tension(h - HEIGHT), printed, rtol=1e-11, atol=1e-13)


def test_force_equals_the_second_printed_form(spring, heights):
    a, b, natural = _prism_numbers()
    twist = np.arccos(1 - (b**2 - heights**2) / (2 * a**2))
    sine, cosine, r3 = np.sin(twist), np.cos(twist), np.sqrt(3)
    top = 2.5 / sine * (3 * sine + r3 * cosine)
    top = top * np.sqrt(3 * b**2 + 2 * BASE**2 * cosine - 2 * BASE**2)
    bottom = 2 * np.sqrt(3 * b**2 - r3 * BASE**2 * sine + 3 * BASE**2 * cosine)
    last = np.sqrt(9 * b**2 - 3 * r3 * BASE**2 * sine + 9 * BASE**2 * cosine) - 3 * natural
    printed = top / bottom * last
    np.testing.assert_allclose(spring.tension(heights - HEIGHT), printed, rtol=1e-11, atol=1e-13)


def test_turn_solves_compatibility():
    """Inserted into h^2 - h1^2 = 2 a^2 (cos phi - cos phi1) it leaves nothing."""
    sine, versine = derived.turn()
    phi, phi1 = sp.Rational(23, 10), sp.Rational(13, 5)
    known = {derived.root: 2 * sp.sin(phi), derived.root_1: 2 * sp.sin(phi1)}
    known[derived.gain] = 2 * (sp.cos(phi) - sp.cos(phi1))
    np.testing.assert_allclose(float(sine.subs(known)), np.sin(float(phi - phi1)), rtol=1e-13)
    np.testing.assert_allclose(
        float(versine.subs(known)), 1 - np.cos(float(phi - phi1)), rtol=1e-13
    )


def test_reference_stiffness_and_its_slope_have_the_closed_forms(spring):
    a = BASE / np.sqrt(3)
    eta, q = HEIGHT / a, PRESTRAIN / (1 + PRESTRAIN)
    stiffness = 12 * np.sqrt(3) * 2.5 * q * eta**2
    np.testing.assert_allclose(spring.stiffness(0.0), stiffness, rtol=1e-14)
    np.testing.assert_allclose(
        HEIGHT * spring.stiffness_slope(0.0) / stiffness, 3 - 6 * np.sqrt(3) * eta**2, rtol=1e-13
    )


def test_natural_lengths_leave_the_reference_free_of_load(rng):
    """The gradient of U vanishes there in all three coordinates, for any soft prism."""
    gradient = [sp.diff(derived_prism.energy(), q) for q in
                (derived_prism.base, derived_prism.twist, derived_prism.height)]  # fmt: skip
    d = derived_prism
    symbols = (d.base, d.twist, d.height, d.k_cross, d.k_base, d.k_bar,
               d.natural_cross, d.natural_base, d.natural_bar)  # fmt: skip
    function = sp.lambdify(symbols, gradient)
    for _ in range(20):
        prism = Prism(*rng.uniform((0.5, 0.3, 0, 1, 3, 3), (2, 3, 0.4, 2, 50, 50)))
        stiffness = prism.k_cross, prism.k_base, prism.k_bar
        state = prism.base, 5 * np.pi / 6, prism.height
        left = function(*state, *stiffness, *prism.natural_lengths())
        np.testing.assert_allclose(left, 0, rtol=0, atol=1e-13 * max(stiffness))
