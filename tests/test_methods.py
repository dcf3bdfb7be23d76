"""The coefficients of the methods, apart from any chain."""

from math import factorial

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from tensegrity.errors import TensegrityError
from tensegrity.methods import METHODS, default, find


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_rows_are_consistent_palindromes(method):
    assert len(method.kicks) == len(method.drifts) + 1
    assert method.kicks == method.kicks[::-1]
    assert method.drifts == method.drifts[::-1]
    assert sum(method.kicks) == pytest.approx(1, abs=1e-15)
    assert sum(method.drifts) == pytest.approx(1, abs=1e-15)


def step_matrix(method):
    """A step of the harmonic oscillator, each entry as a polynomial in dt * omega."""
    z = Polynomial([0, 1])
    x, v = [Polynomial([1]), Polynomial([0])], [Polynomial([0]), Polynomial([1])]
    for kick, drift in zip(method.kicks, (*method.drifts, 0.0), strict=True):
        v = [b - kick * z * a for a, b in zip(x, v, strict=True)]
        x = [a + drift * z * b for a, b in zip(x, v, strict=True)]
    return x, v


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_step_of_the_oscillator_has_the_series_of_its_rotation(method):
    """cos and sin to the order of the method, each coefficient to 14 digits, and no further."""
    (xx, xv), (vx, vv) = step_matrix(method)
    cosine = [(-1) ** (k // 2) / factorial(k) * (k % 2 == 0) for k in range(method.order + 2)]
    sine = [(-1) ** (k // 2) / factorial(k) * (k % 2) for k in range(method.order + 2)]
    for entry, series, sign in ((xx, cosine, 1), (vv, cosine, 1), (xv, sine, 1), (vx, sine, -1)):
        found = entry.coef[: method.order + 1]
        np.testing.assert_allclose(
            found, sign * np.array(series[:-1])[: len(found)], rtol=0, atol=2e-14
        )
    beyond = abs(xv.coef[method.order + 1 :][:1].sum() - sine[-1]) if method.order % 2 == 0 else 0
    assert beyond > 1e-9  # the order is not higher than said


def test_limit_of_verlet_is_two():
    assert METHODS["verlet"].stability_limit == pytest.approx(2, abs=1e-8)


def test_names():
    assert find("rkn6").order == 6
    assert default(None, None) == default(None, 1e-6) == "rkn6"
    assert default(0.1, None) == default(None, 1e-2) == "verlet"
    with pytest.raises(TensegrityError, match="method 'euler'"):
        find("euler")
