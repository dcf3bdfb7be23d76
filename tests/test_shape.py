"""Numbers of energies and forces are parameters: what is compiled belongs to their shape."""

import os
import pickle
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegrity import Chain, Force, Potential, PowerLaw, TensegrityError, gradient, simulate
from tensegrity import objective as o

R, K, V = sp.symbols("r k v")
LABORATORY = st.floats(1e-6, 1e9, allow_subnormal=False).map(lambda x: float(f"{x:.6g}"))


def polynomial(a, b):
    return Potential(R**2 / 2 + a * R**3 / 3 + b * R**4 / 4, R)


def run(spring, forces=()):
    chain = Chain(spring, sites=8, forces=forces)
    return simulate(chain, chain.at_rest({0: 0.05}), t_end=1.0, dt=0.02, method="rk4").final.u


KERNELS = """
import os, sys
from pathlib import Path
import sympy as sp
from tensegrity import Chain, Force, Potential, PowerLaw, simulate
R, V = sp.symbols("r v")
def run(spring, *forces):
    chain = Chain(spring, sites=8, forces=forces)
    simulate(chain, chain.at_rest({0: 0.05}), t_end=1.0, dt=0.02, method="rk4")
MAKERS = [
    lambda x: run(PowerLaw(1.0, 1.3 + x, 0.01)),
    lambda x: run(Potential(R**2 / 2 + (0.21 + x) * R**3 / 3 + 0.11 * R**4 / 4, R)),
    lambda x: run(Potential(R**2 / 2 + (0.03 + x) * R**3 + (0.33 - x) * R**4, R)),  # by size
    lambda x: run(Potential((1.7 + x) * (sp.exp(-R) + R - 1), R)),
    lambda x: run(Potential(sp.Piecewise((R**2 / 2, R < 0), ((1.1 + x) * R**2 / 2, True)), R)),
    lambda x: run(Potential((70 + int(100 * x)) * R**2, R)),
    lambda x: run(PowerLaw(1.0, 1.5, 0.01), Force(-(0.1 + x) * V * sp.Abs(V))),
]
cache = Path(os.environ["XDG_CACHE_HOME"]) / "tensegrity"
for make in MAKERS:
    make(0.07)
first = len(list(cache.glob("*/kernel.so")))
for make in MAKERS:
    for x in (0.11, 0.13, 0.29):
        make(x)
print(first, len(list(cache.glob("*/kernel.so"))))
"""


def test_another_number_compiles_nothing(tmp_path):
    answer = subprocess.run(
        [sys.executable, "-c", KERNELS], env=os.environ | {"XDG_CACHE_HOME": str(tmp_path)},
        cwd=Path(__file__).parent.parent, check=True, capture_output=True, text=True,
    )  # fmt: skip
    first, last = map(int, answer.stdout.split())
    assert first == last > 7


def test_a_force_with_numbers_is_that_with_parameters():
    spring = polynomial(0.21, 0.11)
    ends = [run(spring, (Force(-x * V * sp.Abs(V)),)) for x in (0.071, 0.137)]
    named = Force(-K * V * sp.Abs(V), parameters={"k": 0.137})
    assert np.allclose(run(spring, (named,)), ends[1], rtol=1e-13, atol=0)
    assert not np.allclose(ends[0], ends[1], rtol=1e-6)


@given(a=LABORATORY, b=LABORATORY, r=st.floats(-0.4, 0.4))
@settings(max_examples=60, deadline=None)
def test_numbers_count_as_they_are_written(a, b, r):
    spring = Potential(a * R**2 / 2 + b * R**3 / 3, R)
    exact = a * r + b * r**2
    size = abs(a * r) + b * r**2
    assert abs(float(spring.tension(r)) - exact) <= 4e-16 * size
    assert spring.parameters == {}
    assert sp.simplify(spring.expression - (a * R**2 / 2 + b * R**3 / 3)) == 0


def test_equal_numbers_stay_equal_where_pieces_meet():
    edge, stiff = 0.123, 7.77
    joined = sp.Piecewise((R**2 / 2, edge > R), (edge**2 / 2 + edge * (R - edge)
                          + stiff * (R - edge) ** 2 / 2, True))  # fmt: skip
    ((place, strength, exponent, side),) = Potential(joined, R).kinks
    assert (place, exponent, side) == (edge, 1.0, 1.0)
    assert strength == pytest.approx(stiff - 1, rel=1e-12)


def test_springs_that_differ_in_a_number_only_differ():
    one, other = polynomial(0.21, 0.11), polynomial(0.23, 0.11)
    assert one != other
    assert one.law == other.law
    assert "0.07" in repr(one)
    back = pickle.loads(pickle.dumps(one))
    assert back == one
    assert repr(back) == repr(one)
    assert back.tension(0.1) == one.tension(0.1)
    varied = Potential(0.21 * K * R**2, R, {"k": 1.0}).varied({"k": 2.0})
    assert varied.tension(0.1) == pytest.approx(0.084, rel=1e-15)


@pytest.mark.parametrize(("exponent", "preload", "method"), [
    pytest.param(*one, marks=[pytest.mark.slow] * bool((k + k // 4) % 4))
    for k, one in enumerate(product([1.5, 1.37, 2.6], [0.0, 0.02], ["verlet", "rkn6"]))
])  # fmt: skip
def test_the_derivative_by_the_exponent_is_that_of_differences(exponent, preload, method):
    def chain(n):
        return Chain([PowerLaw(1.3, x, preload) for x in n], sites=4)

    def value(n):
        found = gradient(peak, chain(n), start, 3.0, dt=0.01, method=method, wanted=("exponent",))
        return found.value, found.by("exponent")

    start, peak = chain([exponent] * 3).at_rest({0: 0.3}), o.velocity(2)
    _, by = value([exponent] * 3)
    h = 1e-5
    for k in range(3):
        up, down = ([exponent + s * h * (i == k) for i in range(3)] for s in (1, -1))
        difference = (value(up)[0] - value(down)[0]) / (2 * h)
        assert by[k] == pytest.approx(difference, rel=1e-6, abs=1e-9)


def test_a_contact_varies_in_what_it_was_given():
    contact = PowerLaw(2.0, 1.5, 0.1)
    assert contact.varied({"exponent": 1.6}) == PowerLaw(2.0, 1.6, 0.1)
    with pytest.raises(TensegrityError, match="'overlap' is not an argument"):
        contact.varied({"overlap": 0.3})


def test_a_contact_as_a_force_keeps_its_exponent():
    with pytest.raises(TensegrityError, match="parameter exponent of it does not exist"):
        Force(PowerLaw(1.0, 1.5), parameters={"exponent": 2.0})
    springs = [PowerLaw(1.0, 1.5), PowerLaw(1.0, 2.3)]
    chain = Chain(Potential(0 * R**2, R), 2, ground=springs)
    start = chain.at_rest({0: -0.3, 1: -0.3})
    together = simulate(chain, start, 1.0, dt=0.01).final.u
    for k, spring in enumerate(springs):
        alone = Chain(Potential(0 * R**2, R), 2, ground=spring)
        assert together[k] == simulate(alone, start, 1.0, dt=0.01).final.u[k]


def test_limits_of_sums_stay_whole():
    k = sp.Symbol("k", integer=True)
    spring = Potential(sp.Sum(R**k / 100**k, (k, 2, 30)), R)
    x = 0.1 / 100
    assert float(spring.tension(0.1)) == pytest.approx((1 / (1 - x) ** 2 - 1) / 100, rel=1e-13)


def test_numbers_beyond_floats_are_refused():
    with pytest.raises(TensegrityError, match="number in the energy inf is not finite"):
        Potential(sp.Float("1e400") * R**2, R)


def test_what_is_no_expression_is_refused_by_name():
    x = np.linspace(-1, 1, 21)
    table = Potential.from_table(x, x + x**3)
    for call in (lambda: Force(table), lambda: table.expression,
                 lambda: Chain(PowerLaw(1.0, 1.5), 3, ground=table)):  # fmt: skip
        with pytest.raises(TensegrityError, match="is no expression"):
            call()
