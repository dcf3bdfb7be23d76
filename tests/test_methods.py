"""The coefficients of the methods, apart from any chain."""

from math import factorial

import mpmath
import numpy as np
import pytest
import sympy as sp
from networks import patch, pushed
from numpy.polynomial import Polynomial
from scenes import prism_chain, smooth_blow

from tensegrity import (
    METHODS,
    Chain,
    Nystrom,
    Potential,
    Record,
    Splitting,
    State,
    gradient,
    objective,
    simulate,
)
from tensegrity.engine.methods import RK8, Corrected, Method, default, find, nystrom_of
from tensegrity.engine.openings import zetas
from tensegrity.errors import TensegrityError
from tensegrity.runs.motion import Motion

EXPLICIT = [method for method in METHODS.values() if method.explicit]
SPLITTINGS = [method for method in EXPLICIT if method.symplectic]


@pytest.mark.parametrize("method", SPLITTINGS, ids=lambda method: method.name)
def test_rows_are_consistent_palindromes(method):
    assert len(method.kicks) == len(method.drifts) + 1
    assert method.kicks == method.kicks[::-1]
    assert method.drifts == method.drifts[::-1]
    assert sum(method.kicks) == pytest.approx(1, abs=1e-15)
    assert sum(method.drifts) == pytest.approx(1, abs=1e-15)


def step_matrix(method):
    """A step of the harmonic oscillator, each entry as a polynomial in dt * omega."""
    z = Polynomial([0, 1])
    method = getattr(method, "base", method)  # what is corrected is no smooth force
    x, v = [Polynomial([1]), Polynomial([0])], [Polynomial([0]), Polynomial([1])]
    if not method.symplectic:
        pairs = [rotated(method, *start, z) for start in zip(x, v, strict=True)]
        return tuple(zip(*pairs, strict=True))
    for kick, drift in zip(method.kicks, (*method.drifts, 0.0), strict=True):
        v = [b - kick * z * a for a, b in zip(x, v, strict=True)]
        x = [a + drift * z * b for a, b in zip(x, v, strict=True)]
    return x, v


def rotated(method, x, v, z):
    """A step of a Nystrom method from (x, v/omega)."""
    places = []
    for node, row in zip(method.nodes, method.matrix, strict=True):
        inner = sum((a * p for a, p in zip(row, places, strict=False)), Polynomial([0]))
        places.append(x + node * z * v - z**2 * inner)
    moved = sum(b * p for b, p in zip(method.positions, places, strict=True))
    turned = sum(b * p for b, p in zip(method.velocities, places, strict=True))
    return x + z * v - z**2 * moved, v - z * turned


@pytest.mark.parametrize("method", EXPLICIT, ids=lambda method: method.name)
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


def test_limit_of_the_classical_method_is_the_root_of_its_amplification():
    """|R|^2 = 1 - z^6/72 + z^8/576 of R = sum (i z)^k/k!, k to 4: both found from the series."""
    series = sum(Polynomial([0] * k + [1j**k / factorial(k)]) for k in range(5))
    squared = (series * Polynomial(series.coef.conj())).coef.real
    (limit,) = {float(x.real) for x in Polynomial(squared - [1, *[0] * 8]).roots()
                if abs(x.imag) < 1e-6 and x.real > 1}  # fmt: skip
    assert METHODS["rk4"].stability_limit == pytest.approx(limit, abs=1e-8)


def test_the_nystrom_form_does_the_steps_of_the_tableau():
    """One step of u'' = -sin u against the first-order form with the classical weights."""
    method, dt, y = METHODS["rk4"], 0.3, np.array([0.7, -0.4])

    def rate(y):
        return np.array([y[1], -np.sin(y[0])])

    k = [rate(y)]
    for a in (0.5, 0.5, 1.0):
        k.append(rate(y + a * dt * k[-1]))
    expected = y + dt / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
    r = sp.Symbol("r")
    pendulum = Chain(Potential(1 - sp.cos(r), r), 2, ends=("fixed", "free"))
    end = simulate(pendulum, State([0, y[0]], [0, y[1]]), dt, dt=dt, method=method).final
    np.testing.assert_allclose([end.u[1], end.v[1]], expected, rtol=1e-15)


def test_the_midpoint_rule_turns_the_oscillator_by_a_pade_approximant_of_its_exponential():
    """Eigenvalues (2 + iz)/(2 - iz) and conjugate: of modulus 1 for any step."""
    z = np.array([0.01, 0.5, 3.0, 40.0, 1e4])
    xx, xv, vx, vv = METHODS["midpoint"].step_matrix(z)
    np.testing.assert_allclose(xx * vv - xv * vx, 1, rtol=0, atol=1e-12)
    turn = (2 + 1j * z) / (2 - 1j * z)
    np.testing.assert_allclose(xx + vv, 2 * turn.real, rtol=0, atol=1e-12)


def test_limit_of_verlet_is_two():
    assert METHODS["verlet"].stability_limit == pytest.approx(2, abs=1e-8)


def test_names():
    assert find("rkn6").order == 6
    assert default(None, None, False) == default(None, 1e-6, False) == "rkn6"
    assert default(None, None, True) == default(None, 1e-6, True) == "corrected6"
    assert default(None, 1e-2, True) == default(None, 1e-3, True) == "rkn6"
    assert default(0.1, None, True) == default(0.1, None, False) == "verlet"
    with pytest.raises(TensegrityError, match="method 'euler'"):
        find("euler")


def suzuki(**changed):
    """Suzuki's composition of five steps of Verlet: not a row of the table."""
    a = 1 / (4 - 4 ** (1 / 3))
    drifts = (a, a, 1 - 4 * a, a, a)
    kicks = [(x + y) / 2 for x, y in zip((0.0, *drifts), (*drifts, 0.0), strict=True)]
    given = {
        "name": "suzuki4",
        "order": 4,
        "default_fraction": 0.1,
        "kicks": kicks,
        "drifts": drifts,
    }
    return Splitting(**given | changed)


def midpoint(**changed):
    """The explicit midpoint rule in Nystrom's form."""
    given = {
        "name": "midpoint",
        "order": 2,
        "default_fraction": 0.05,
        "nodes": (0, 0.5),
        "matrix": ((0, 0),) * 2,
    }
    given |= {"positions": (0.5, 0), "velocities": (0, 1)}
    return Nystrom(**given | changed)


KUTTA = Nystrom(
    "kutta3",
    order=3,
    default_fraction=0.05,
    **nystrom_of(((0, 0, 0), (1 / 2, 0, 0), (-1, 2, 0)), (1 / 6, 2 / 3, 1 / 6)),
)


@pytest.mark.parametrize("method", [suzuki(), KUTTA], ids=lambda method: method.name)
def test_a_method_of_ones_own_runs_with_its_order_and_name(method):
    chain = prism_chain(24)
    state = smooth_blow(chain)
    exact = simulate(chain, state, 8.0, tol=1e-12).final
    errors = []
    for steps in (40, 80):
        run = simulate(chain, state, 8.0, dt=8.0 / steps, method=method)
        assert (run.method, run.steps) == (method.name, steps)
        errors.append(np.abs(run.final.u - exact.u).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.35)
    assert simulate(chain, state, 8.0, method=method).energy_error < 1e-4
    assert method.name not in METHODS


def test_a_method_of_ones_own_runs_networks_and_tolerances():
    network = patch(3)
    run = simulate(network, pushed(network), 1.0, method=suzuki(), dt=0.01)
    same = simulate(network, pushed(network), 1.0, method="rkn6", dt=0.01)
    np.testing.assert_allclose(run.final.u, same.final.u, atol=1e-7)
    chain = prism_chain(8)
    state = smooth_blow(chain)
    run = simulate(chain, state, 2.0, method=suzuki(), tol=1e-6)
    exact = simulate(chain, state, 2.0, tol=1e-12).final.u
    assert np.abs(run.final.u - exact).max() <= 1e-6 * np.abs(run.u).max()


def test_rows_become_tuples_of_plain_floats():
    method = suzuki(kicks=np.array(suzuki().kicks), drifts=list(suzuki().drifts))
    assert method == suzuki()
    assert hash(method) == hash(suzuki())
    assert all(type(x) is float for x in (*method.kicks, *method.drifts, method.default_fraction))


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: suzuki(kicks=suzuki().kicks[1:]), "5 kicks and 5 drifts: there must be one kick"),
        (lambda: suzuki(drifts=()), "6 kicks and 0 drifts"),
        (lambda: suzuki(drifts=(), kicks=(1,)), "0 stages must be 1 to"),
        (lambda: suzuki(drifts=(1 / 300,) * 300, kicks=(1 / 301,) * 301), "300 stages must be 1"),
        (lambda: suzuki(drifts=(0.2, 0.2, 0.2, 0.2, 0.3)), r"sum of the drifts is 1\.1, must be 1"),
        (lambda: suzuki(kicks=(0.5, 0, 0, 0, 0, 0.4)), r"sum of the kicks is 0\.9, must be 1"),
        (lambda: suzuki(kicks=(0.5, 0.25, 0, 0, 0, 0.25)), "must be palindromes"),
        (lambda: suzuki(drifts=(0.5, 0.25, 0, 0, 0.25)), "must be palindromes"),
        (lambda: suzuki(kicks="half"), "kicks of 'suzuki4' 'half' must be a sequence"),
        (lambda: suzuki(kicks=("1", 0, 0, 0, 0, 0)), "kicks of 'suzuki4' '1' is not a number"),
        (lambda: suzuki(drifts=1.0), r"drifts of 'suzuki4' 1\.0 must be a sequence"),
        (lambda: suzuki(order=0), "order of 'suzuki4' 0 must be at least 1"),
        (lambda: suzuki(default_fraction=0), "default_fraction of 'suzuki4' 0 must be above 0"),
        (lambda: suzuki(name=4), "name of a method 4 is not a str"),
        (lambda: midpoint(matrix=((0, 0), (0, 0.5))), "0 on its diagonal and above"),
        (lambda: midpoint(matrix=((0, 0), (0,))), "must have 2 entries a row"),
        (lambda: midpoint(nodes=(0,)), "must have 1 entries a row"),
        (lambda: midpoint(velocities=(0, 0.5)), r"sum of the velocities is 0\.5, must be 1"),
        (lambda: midpoint(positions=(1, 0)), r"sum of the positions is 1, must be 0\.5"),
        (lambda: midpoint(nodes=(0, 1)), r"velocities times nodes is 1, must be 0\.5"),
        (lambda: midpoint(matrix=3), "matrix of 'midpoint' 3 must be a sequence"),
        (lambda: Method("bare", 2, 0.1), "is not one of verlet, "),
        (lambda: [], r"method \[\] is not one of"),
        (lambda: METHODS, "is not one of"),
    ],
)
def test_rows_that_are_no_method_are_refused(make, why):
    chain = prism_chain(4)
    with pytest.raises(TensegrityError, match=why):
        simulate(chain, chain.at_rest(), 1.0, method=make())


def test_a_splitting_that_does_not_claim_to_be_reversible_need_not_be_a_palindrome():
    class OneWay(Splitting):
        reversible = False

    method = OneWay("euler", order=1, default_fraction=0.05, kicks=(1, 0), drifts=(1,))
    chain = prism_chain(8)
    assert simulate(chain, smooth_blow(chain), 2.0, dt=0.01, method=method).energy_error < 1e-2


def test_gradients_refuse_methods_with_more_than_kicks_and_drifts():
    class Other(Splitting):
        pass

    chain, method = prism_chain(4), Other("own", 2, 0.05, (0.5, 0.5), (1.0,))
    with pytest.raises(TensegrityError, match="more than kicks and drifts"):
        gradient(objective.displacement(1), chain, chain.at_rest(), 2.0, dt=0.1, method=method)


def test_a_base_of_corrections_must_be_a_splitting():
    with pytest.raises(TensegrityError, match=r"base of 'x'"):
        Corrected("x", 4, 0.1, METHODS["rk4"])


@pytest.mark.parametrize("method", METHODS)
def test_all_methods_of_the_table_pass_the_check(method):
    METHODS[method].check()


def test_rk8_has_its_order_and_limits():
    a, b, c = np.array(RK8.rates), np.array(RK8.velocities), np.array(RK8.nodes)
    for power in range(8):
        assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-14)
    tall = np.linalg.matrix_power(a, 7).sum(axis=1)
    assert b @ tall == pytest.approx(1 / 40320, abs=1e-14)
    assert METHODS["rk4"].decay_limit == pytest.approx(2.785293563, abs=1e-3)
    assert 5 < RK8.decay_limit < 6.5
    RK8.check()


@pytest.mark.parametrize("first", np.linspace(1.0, 2.9, 20))
def test_corrections_have_their_tables_at_every_exponent(first):
    """Zeta functions against mpmath, also where the highest coefficient is exactly 0, which
    depends on the exponent and the machine."""
    for exponent in first + np.linspace(0.0, 0.1, 10):
        orders = -exponent, -exponent - 1, 1 - exponent
        for s, powers in zip(orders, zetas(float(exponent)), strict=True):
            values = [float(mpmath.zeta(s, 1 + q)) for q in (0.0, 0.3, 1.0)]
            assert Polynomial(powers)(np.array([-1.0, -0.4, 1.0])) == pytest.approx(
                values, abs=1e-13
            )


@pytest.mark.parametrize(("record", "attempts"), [({"times": [8.0]}, 1), ({"every": 1}, 33)])
def test_states_that_are_taken_limit_an_attempt_not_the_size_of_the_scene(
    record, attempts, monkeypatch
):
    """Large scenes advanced by single steps as long as they took more than `ROOM` numbers."""
    chain = prism_chain(20)
    start = smooth_blow(chain)
    how = {"dt": 8.0 / 64, "method": "verlet", "record": Record(**record)}
    whole, calls = simulate(chain, start, 8.0, **how), []
    monkeypatch.setattr("tensegrity.runs.march.ROOM", 2 * chain.sites)
    accept = Motion.accept
    monkeypatch.setattr(Motion, "accept", lambda it: calls.append(accept(it)))
    run = simulate(chain, start, 8.0, **how)
    assert len(calls) == attempts
    assert np.array_equal(run.u, whole.u)
    assert np.array_equal(run.energy, whole.energy)
