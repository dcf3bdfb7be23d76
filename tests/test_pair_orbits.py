"""Periodic orbits of rows of pair laws, and their multipliers."""

import numpy as np
import pytest
import sympy as sp

from tensegrity import Chain, PairLaw, Potential, State, floquet, modes, periodic_orbit, simulate

u, a, U, A, r = sp.symbols("u a U A r")


def by_angle(multipliers):
    return sorted(multipliers, key=lambda x: (round(x.real, 6), x.imag))


def test_springs_to_the_ground_as_energies_of_sites_have_the_same_orbit_and_multipliers():
    """Energies of sites leave no motion that changes no energy."""
    twin = Chain(Potential(r**2 / 2 + r**4 / 4, r), 4, ground=Potential(r**2 / 2, r))
    bond = (U - u) ** 2 / 2 + (U - u) ** 4 / 4
    row = Chain(PairLaw(bond, (u,), (U,), site=u**2 / 2), 4)
    start, period = np.array([0.1, -0.23, 0.22, -0.09]), 2 * np.pi / 2.15
    known = periodic_orbit(twin, State(start, 0 * start), period=period)
    orbit = periodic_orbit(row, State(start[:, None], 0 * start[:, None]), period=period)
    assert orbit.state.u[:, 0] == pytest.approx(known.state.u, abs=1e-11)
    own, others = (by_angle(floquet(x).multipliers) for x in (orbit, known))
    assert len(own) == 6
    assert own == pytest.approx(others, abs=1e-9)


def test_multipliers_of_turning_units_are_those_of_runs_from_displaced_states():
    """The row may be shifted, the units must not be turned: one motion changes no energy."""
    bond = (U - u + (A**2 + a**2) / 4) ** 2 / 2 + (A - a) ** 2 / 20 + (a + A) ** 2 / 40
    row = Chain(PairLaw(bond, (u, a), (U, A), site=a**2 / 8 + a**4), 3, mass=(1.0, 0.2))
    softest = modes(row)
    number = 2
    start = 0.15 * softest.shapes[number] / np.abs(softest.shapes[number]).max()
    period = 2 * np.pi / (1.01 * softest.frequencies[number])
    orbit = periodic_orbit(row, State(start, 0 * start), period=period)
    found = floquet(orbit)
    assert len(found.neutral) == 4
    assert np.abs(found.neutral - 1).max() < 1e-6
    x, step, columns = np.stack([orbit.state.u, orbit.state.v]), 1e-5, []
    for place in range(x.size):
        moved = []
        for sign in (1, -1):
            start = x.copy()
            start.flat[place] += sign * step
            end = simulate(row, State(*start), period, method="rkn6", dt=period / 400).final
            moved.append(np.concatenate([end.u.ravel(), end.v.ravel()]))
        columns.append((moved[0] - moved[1]) / (2 * step))
    whole = np.linalg.eigvals(np.transpose(columns))
    away = [x for x in whole if abs(x - 1) > 1e-2]
    assert by_angle(away) == pytest.approx(by_angle(found.multipliers), abs=1e-6)
