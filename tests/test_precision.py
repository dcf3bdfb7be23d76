"""The rigid-elastic potential in double against the plain formula at 50 digits.

The reference takes the elongation and the prism's fields as exact and knows nothing of the
form that runs: it differentiates V(h) of `derivations.rigid_elastic` at 50 digits.
"""

import mpmath
import numpy as np
import pytest
import sympy as sp

from derivations import prism as derived_prism
from derivations import rigid_elastic as derived
from tensegrity import Prism

EPS = np.finfo(float).eps
SAMPLES = 12

PRISMS = {
    "stiffening": (1.0, 0.7, 0.01),
    "slender": (1.0, 2.5, 0.05),
    "thick, softens then locks": (1.0, 0.305, 0.02),
    "no locking": (1.0, 0.25, 0.1),
    "nearly no prestrain": (1.0, 0.8, 1e-6),
    "no prestrain": (0.3, 0.2, 0.0),
    "strong prestrain": (2.0, 1.7, 0.4),
}


def _plain(order):
    """Derivative of V(h), as a function for mpmath of (h, l, h0, p0)."""
    bar = sp.sqrt(derived_prism.at_reference(derived_prism.bar_length_squared()))
    expression = derived.force(order) if order else derived.potential_energy()
    expression = expression.subs(
        {
            derived.bar: bar,
            derived.circumradius: derived_prism.CIRCUMRADIUS,
            derived.natural_cross: derived_prism.natural_lengths()[0],
            derived.k_cross: 1,
        }
    )
    arguments = (
        derived.height, derived_prism.base, derived_prism.reference_height, derived_prism.prestrain,
    )  # fmt: skip
    return sp.lambdify(arguments, expression, "mpmath", cse=True)


@pytest.fixture(scope="module")
def plain():
    return [_plain(order) for order in range(5)]


def _elongations(potential, rng):
    """Log-spaced at random towards 0, from both sides, and towards both ends."""
    low, high = potential.domain
    scale = 10 ** rng.uniform(-12, -0.3, (2, SAMPLES))
    towards_ends = np.concatenate([low * (1 - scale[0]), high * (1 - scale[0])])
    towards_zero = np.concatenate([low * scale[1], high * scale[1]])
    return np.concatenate([towards_ends, towards_zero])


def errors(plain, fields, preload, order, rng):
    """Error over its bound, 16 eps (1 + condition number in the height), per elongation."""
    potential = Prism(*fields, k_cross=1.0).potential(preload)
    r = _elongations(potential, rng)
    methods = (potential.energy, potential.tension, potential.stiffness, potential.stiffness_slope)
    computed = methods[order](r)
    ratios = []
    with mpmath.workdps(50):
        fixed = [mpmath.mpf(x) for x in fields]
        rest = mpmath.mpf(potential.length)

        def exact(k, elongation):
            value = plain[k](rest + elongation, *fixed)
            if k == 0:
                value += preload * elongation - plain[0](rest, *fixed)
            return value + preload if k == 1 else value

        for x, y in zip(r.tolist(), computed.tolist(), strict=True):
            x = mpmath.mpf(x)
            value, slope = exact(order, x), exact(order + 1, x)
            bound = 16 * EPS * (abs(value) + abs((rest + x) * slope))
            ratios.append(float(abs(y - value) / bound))
    return np.array(ratios)


@pytest.mark.parametrize("order", range(4), ids=["energy", "tension", "stiffness", "slope"])
@pytest.mark.parametrize("name", PRISMS)
def test_error_is_within_the_condition_number(plain, name, order, rng):
    assert errors(plain, PRISMS[name], 0.0, order, rng).max() <= 1


@pytest.mark.parametrize("order", range(4), ids=["energy", "tension", "stiffness", "slope"])
@pytest.mark.parametrize("name", ["stiffening", "slender", "no locking", "strong prestrain"])
def test_error_under_preload_is_within_the_condition_number(plain, name, order, rng):
    preload = 0.02 if name == "no locking" else 0.1
    assert errors(plain, PRISMS[name], preload, order, rng).max() <= 1
