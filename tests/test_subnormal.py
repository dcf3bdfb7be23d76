"""Numbers below the smallest normal one are 0 within compiled loops, and nowhere else."""

import platform
import sys

import numpy as np
import pytest
import sympy as sp
from springs import series

from tensegrity import (
    Chain,
    Damping,
    Drive,
    Network,
    PowerLaw,
    State,
    gradient,
    objective,
    simulate,
)

pytestmark = [
    pytest.mark.skipif(
        platform.machine() not in ("x86_64", "AMD64", "aarch64", "arm64"),
        reason="what the processor makes of such numbers is not set there",
    ),
]
TINY = sys.float_info.min / 128  # m/s
SPRING = series(0, 1 / 4, length=1.0)
PLACES = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]
NEXT = [(0, 1), (1, 2), (2, 3)]
REST = {0: Drive(force=0 * sp.Symbol("t"))}
SCENES = {
    "chain": Chain(SPRING, 4),
    "network": Network(PLACES, NEXT, SPRING),
    "contacts": Chain(PowerLaw(1.0, 1.5), 4),
    "damped": Chain(SPRING, 4, damping=Damping(ground=0.1)),
    "driven": Chain(SPRING, 4, drive=REST, damping=Damping(bond=0.1)),
}
WAYS = [
    *(("chain", method) for method in ("verlet", "rkn6", "rk4")),
    *(("network", method) for method in ("verlet", "rk4")),
    *(("contacts", method) for method in ("verlet", "corrected6")),
    ("damped", "verlet"),
    ("driven", "verlet"),
]


def moving(scene, speed):
    v = np.zeros(scene.shape)
    v.flat[scene.shape[-1] if v.ndim > 1 else 1] = speed
    return State(np.zeros(scene.shape), v)


@pytest.mark.parametrize(("name", "method"), WAYS)
def test_what_moves_by_less_than_the_smallest_normal_number_stays(name, method):
    scene = SCENES[name]
    assert not simulate(scene, moving(scene, TINY), 4.0, dt=0.1, method=method).final.u.any()
    seen = simulate(scene, moving(scene, 1e10 * TINY), 4.0, dt=0.1, method=method).final.u
    assert seen.any()


@pytest.mark.parametrize(("name", "method"), WAYS)
def test_after_a_run_such_numbers_are_numbers_again(name, method):
    simulate(SCENES[name], moving(SCENES[name], 0.1), 1.0, dt=0.1, method=method)
    for tiny in (TINY, np.full(3, TINY)):
        assert np.all(tiny / 2 * 2 == tiny)


def test_derivatives_below_the_smallest_normal_number_are_0():
    def last(scale):
        def rule(t, y):
            slope = np.zeros_like(y)
            slope[0, -1] = scale
            return scale * y[0, -1], slope

        chain = SCENES["chain"]
        number = objective.of([objective.displacement(2)], rule)
        return gradient(number, chain, moving(chain, 0.1), 4.0, dt=0.1, method="verlet")

    assert not last(TINY).u.any()
    assert last(1e10 * TINY).u.any()
    assert np.all(TINY / 2 * 2 == TINY)


def test_energies_below_the_smallest_normal_number_are_0():
    chain = SCENES["chain"]
    small = TINY**0.5
    state = State(np.array([0.0, small, small, 0.0]), np.zeros(4))
    assert simulate(chain, state, 0.1, dt=0.1, method="verlet").energy[0] == 0
    assert small**2 > 0
