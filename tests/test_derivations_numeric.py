"""Potentials as they are computed, against SymPy at 50 digits."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from derivations import prism, rigid_response
from tensegrity import Prism

pytestmark = pytest.mark.unchanged()

EPS = np.finfo(float).eps
ORDERS = ("energy", "tension", "stiffness")


@pytest.fixture(scope="module")
def exact():
    """V, V', V'', V''' of (h, l, h0, p0) with k1 = 1, by SymPy, for mpmath."""
    bar = sp.sqrt(prism.at_reference(prism.bar_length_squared()))
    values = {
        rigid_response.bar: bar,
        rigid_response.circumradius: prism.CIRCUMRADIUS,
        rigid_response.natural_cross: prism.natural_lengths()[0],
        prism.k_cross: 1,
    }
    arguments = (rigid_response.height, prism.base, prism.reference_height, prism.prestrain)
    forms = [rigid_response.potential_energy(), *(rigid_response.force(k) for k in (1, 2, 3))]
    return [sp.lambdify(arguments, f.subs(values), "mpmath", cse=True) for f in forms]


@pytest.mark.parametrize("order", range(3), ids=ORDERS)
def test_potentials_are_those_of_sympy_at_the_same_points(exact, order, rng):
    for _ in range(5):
        fields = rng.uniform(0.5, 2), rng.uniform(0.4, 2), 10 ** rng.uniform(-5, -0.5)
        potential = Prism(*fields, 1.0).potential()
        r = rng.uniform(*potential.domain, 8) * 0.98
        found = getattr(potential, ORDERS[order])(r)
        with mpmath.workdps(50):
            known = [mpmath.mpf(x) for x in fields]
            for k, x in enumerate(r):
                height = known[1] + mpmath.mpf(float(x))
                value, slope = exact[order](height, *known), exact[order + 1](height, *known)
                if order == 0:
                    value -= exact[0](known[1], *known)
                bound = 32 * EPS * (abs(value) + abs(height * slope))
                assert abs(float(found[k]) - value) <= bound


def test_force_and_energy_grow_towards_locking_with_the_stated_powers():
    """Slopes in log-log scale of the force and of what the energy lacks at locking."""
    numbers = {prism.base: 1, prism.reference_height: sp.Rational(7, 10), prism.k_cross: 1}
    numbers[prism.prestrain] = sp.Rational(1, 100)
    bar = sp.sqrt(prism.at_reference(prism.bar_length_squared()))
    known = {rigid_response.bar: bar, rigid_response.circumradius: prism.CIRCUMRADIUS}
    known[rigid_response.natural_cross] = prism.natural_lengths()[0]
    lock = sp.sqrt(rigid_response.locking_height_squared())
    forms = [rigid_response.force(), rigid_response.potential_energy()]
    force, energy = (f.subs(known).subs(numbers) for f in forms)
    lock = lock.subs(numbers)

    def at(form, gap):
        return form.subs(rigid_response.height, lock + gap).evalf(60)

    gaps = [sp.Rational(1, 10**k) for k in (24, 25)]
    held = energy.subs(rigid_response.height, lock).evalf(60)
    for stated, (near, nearer) in zip(
        rigid_response.lock_order(),
        ([at(force, g) for g in gaps], [held - at(energy, g) for g in gaps]),
        strict=True,
    ):
        assert abs(sp.log(near / nearer, 10).evalf() - stated) < 1e-6
