"""Trusses that others computed, as structures of bars."""

import numpy as np
import pytest
import sympy as sp
from mpmath import mp

from figures import response_outside as scene


@pytest.fixture(scope="module")
def path():
    return scene.space_truss()


def of(path, kind):
    return [e for e in path.events if e.kind == kind]


def factor(path, event):
    """The load factor at an event."""
    return event.load * scene.moves(path)[-1, -1] / path.load[-1]


def test_two_bar_truss_snaps_through_at_the_closed_form_load():
    """P = 2 EA (1 - cos(a)^(2/3))^(3/2), where the bars' slope has fallen to cos^3 = cos(a)."""
    cosine = 1 / np.hypot(1, 2 * scene.RISE / scene.SPAN)
    limit = 2 * (1 - cosine ** (2 / 3)) ** 1.5
    apex = np.sqrt(cosine ** (-2 / 3) - 1) * scene.SPAN / 2
    folds = of(scene.two_bars(), "fold")
    assert np.allclose([e.load for e in folds], [limit, -limit], rtol=1e-14, atol=0)
    assert np.allclose([e.shortening for e in folds], [0.5 - apex, 0.5 + apex], rtol=1e-14, atol=0)
    assert np.allclose(scene.two_bars_in_closed_form()[1], [limit, -limit], rtol=1e-14, atol=0)


def test_space_truss_passes_through_the_published_state_to_all_its_digits(path):
    _, found = scene.states(path, 5, scene.STATE_40[5])
    assert list(scene.STATE_40[:5]) in found[:, :5].round(8).tolist()


def test_space_truss_carries_the_published_loads_to_all_their_digits(path):
    """On the stretch between the first two turns of node 5, where it was driven."""
    height = scene.moves(path)[:, 4]
    first, second = (np.flatnonzero(np.diff(np.sign(np.diff(height)))) + 1)[:2]
    for increment, published in scene.DRIVEN.items():
        rows, found = scene.states(path, 4, scene.driven(increment))
        ((*_, load),) = found[(first <= rows) & (rows < second)]
        assert f"{load:.4g}" == f"{float(published):.4g}"


def test_space_truss_has_the_published_limit_points(path):
    """Between the most extreme published load and the top of a parabola through three."""
    loads = [factor(path, e) for e in of(path, "fold")]
    assert len(loads) == len(scene.EXTREMES)
    for load, (before, extreme, after) in zip(loads, scene.EXTREMES.values(), strict=True):
        beyond = (load - extreme) * np.sign(2 * extreme - before - after)
        digit = 10.0 ** (np.floor(np.log10(abs(extreme))) - 3)
        assert -digit / 2 <= beyond <= abs(2 * extreme - before - after) / 8 + digit


def test_space_truss_snaps_back(path):
    """Load and shortening both turn."""
    kinds = [e.kind for e in path.events if e.kind in ("fold", "turn")]
    assert kinds[:8] == ["fold"] * 3 + ["turn"] + ["fold"] * 2 + ["turn", "fold"]


def test_rows_of_the_space_truss_are_equilibria_of_the_energy(path):
    stored, moves = scene.energy(scene.NODES, scene.BARS, scene.LOADS)
    forces = sp.lambdify(moves, [sp.diff(stored, x) for x in moves], "numpy", cse=True)
    *x, load = scene.moves(path).T
    for found, force in zip(forces(*x), scene.LOADS.values(), strict=True):
        assert np.abs(found - load * force).max() < 1e-12


def test_limit_points_agree_with_thirty_digits(path):
    """Gradient and Hessian by SymPy, the extended system by mpmath."""
    stored, moves = scene.energy(scene.NODES, scene.BARS, scene.LOADS)
    gradient = sp.Matrix([stored]).jacobian(moves)
    force = list(scene.LOADS.values())
    total = float(np.linalg.norm(scene.forces(), axis=1).sum())
    with mp.workdps(30):
        evaluate = sp.lambdify(moves, (gradient, gradient.jacobian(moves)), "mpmath", cse=True)

        def system(*x):
            g, h = evaluate(*x[:5])
            null = mp.matrix(x[6:])
            return [
                *(g[i] - x[5] * force[i] for i in range(5)),
                *(h * null),
                mp.fdot(null, null) - 1,
            ]

        for event in of(path, "fold"):
            near = scene.at(path, event, scene.moves(path))
            hessian = np.array(evaluate(*near[:5])[1].tolist(), dtype=float)
            null = np.linalg.svd(hessian)[2][-1]
            exact = mp.findroot(system, [*near, *null], tol=1e-40, maxsteps=20)
            assert abs(exact[5] - factor(path, event)) <= 1e-12 * abs(exact[5])
            work = mp.fdot(force, exact[:5]) / total
            assert abs(work - event.shortening) <= 1e-12
