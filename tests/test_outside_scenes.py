"""Trusses that others computed, followed by the solver of the prisms."""

import numpy as np
import pytest

from figures import response_outside as scene


@pytest.fixture(scope="module")
def branch():
    return scene.space_truss()


def of(branch, kind):
    return [e for e in branch.events if e.kind == kind]


def test_two_bar_truss_snaps_through_at_the_closed_form_load():
    """P = 2 EA (1 - cos(a)^(2/3))^(3/2), where the bars' slope has fallen to cos^3 = cos(a)."""
    cosine = 1 / np.hypot(1, 2 * scene.RISE / scene.SPAN)
    limit = 2 * (1 - cosine ** (2 / 3)) ** 1.5
    apex = np.sqrt(cosine ** (-2 / 3) - 1) * scene.SPAN / 2
    folds = of(scene.two_bars(), "fold")
    assert np.allclose([e.factor for e in folds], [limit, -limit], rtol=1e-14, atol=0)
    assert np.allclose([e.z3 for e in folds], [apex - 0.5, -apex - 0.5], rtol=1e-14, atol=0)
    assert np.allclose(scene.two_bars_in_closed_form()[1], [limit, -limit], rtol=1e-14, atol=0)


def test_space_truss_passes_through_the_published_state_to_all_its_digits(branch):
    names = ("x4", "y4", "z4", "x5", "z5")
    found = [[round(e.at[name], 8) for name in names] for e in of(branch, "state")]
    assert list(scene.STATE_40[:5]) in found


def test_space_truss_carries_the_published_loads_to_all_their_digits(branch):
    """On the stretch between the first two turns of node 5, where it was driven."""
    first, second = (e.row for e in of(branch, "turn")[:2])
    for increment, published in scene.DRIVEN.items():
        (event,) = (e for e in of(branch, str(increment)) if first < e.row <= second)
        assert f"{event.factor:.4g}" == f"{float(published):.4g}"


def test_space_truss_has_the_published_limit_points(branch):
    """Between the most extreme published load and the top of a parabola through three."""
    loads = [e.factor for e in of(branch, "fold")]
    assert len(loads) == len(scene.EXTREMES)
    for load, (before, extreme, after) in zip(loads, scene.EXTREMES.values(), strict=True):
        beyond = (load - extreme) * np.sign(2 * extreme - before - after)
        digit = 10.0 ** (np.floor(np.log10(abs(extreme))) - 3)
        assert -digit / 2 <= beyond <= abs(2 * extreme - before - after) / 8 + digit


def test_space_truss_snaps_back(branch):
    """Load and displacement of node 5 both turn, and the load in between changes its sign."""
    kinds = [e.kind for e in branch.events if e.kind in ("fold", "turn")]
    assert kinds[:8] == ["fold"] * 3 + ["turn"] + ["fold"] * 2 + ["turn", "fold"]
    assert branch.residual.max() <= 1e-12


def test_limit_points_agree_with_thirty_digits(branch):
    """Gradient and Hessian by SymPy, the extended system by mpmath."""
    import sympy as sp
    from mpmath import mp

    stored, moves = scene.energy(scene.NODES, scene.BARS, scene.LOADS)
    gradient = sp.Matrix([stored]).jacobian(moves)
    force = list(scene.LOADS.values())
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

        for event in of(branch, "fold"):
            z = [event.at[name] for name in (*scene.LOADS, "factor")]
            hessian = np.array(evaluate(*z[:5])[1].tolist(), dtype=float)
            null = np.linalg.svd(hessian)[2][-1]
            exact = mp.findroot(system, [*z, *null], tol=1e-40, maxsteps=20)
            assert abs(exact[5] - event.factor) <= 1e-12 * abs(event.factor)
            assert max(abs(exact[i] - z[i]) for i in range(5)) <= 1e-12
