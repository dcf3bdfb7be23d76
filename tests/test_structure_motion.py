"""Structures in motion: strings that go slack and taut, against an integrator that switches."""

import numpy as np
import pytest

from tensegrity import Prism, Record, State, Structure, simulate

PRISM = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)
ENDS = Record(every=10**9)


def by_hand(stages):
    """Prisms on one another with shared triangles, chirality alternating."""
    turn, radius, third = 5 * np.pi / 6, 3**-0.5, 2 * np.pi / 3
    nodes, bars, cross, base, shares = [], [], [], [], []
    for level in range(stages + 1):
        start = turn * (level % 2)
        nodes += [
            (radius * np.cos(start + third * i), radius * np.sin(start + third * i), 0.7 * level)
            for i in range(3)
        ]
        base += [(3 * level + i, 3 * level + (i + 1) % 3) for i in range(3)]
        shares += [1 if level in (0, stages) else 2] * 3
    for level in range(stages):
        step = 2 if level % 2 == 0 else 1
        bars += [(3 * level + i, 3 * level + 3 + i) for i in range(3)]
        cross += [(3 * level + i, 3 * level + 3 + (i + step) % 3) for i in range(3)]
    rest = PRISM.natural_lengths()
    return Structure(
        nodes,
        bars=bars,
        strings=cross + base,
        k_bar=50.0,
        k_string=[1.0] * len(cross) + [5.0 * x for x in shares],
        natural_lengths=[rest.bar] * len(bars)
        + [rest.cross] * len(cross)
        + [rest.base] * len(base),
    )


def test_one_prism_moves_as_the_reference():
    scene = by_hand(1).network()
    u = np.zeros((6, 3))
    u[3] = (0.004, -0.002, 0.006)
    run = simulate(scene, State(u, 0 * u), 20.0, tol=1e-10, record=ENDS)
    wanted = (-0.4990101488166, 0.2879068589488, 0.7016398917978)
    assert scene.positions[3] + run.final.u[3] == pytest.approx(wanted, abs=1e-11)


def test_two_stages_move_as_the_reference_through_slack():
    s = by_hand(2)
    scene = s.network()
    start = scene.at_rest({n: (0, 0, -0.3) for n in (6, 7, 8)})
    run = simulate(scene, start, 4.0, tol=1e-8, record=Record(times=[0.55, 0.7, 0.9, 4.0]))
    wanted = (0.5954090760418, -0.05692815122564, 0.9436501335865)
    assert scene.positions[6] + run.final.u[6] == pytest.approx(wanted, abs=1e-9)
    assert run.energy[0] == pytest.approx(0.153528844699029, rel=1e-12)
    assert np.ptp(run.energy) < 1e-9 * run.energy[0]
    upper = slice(9, 12)  # its cross strings are slack from 0.590231582642 to 0.879311273
    slack = [s.at(scene.positions + u).slack[upper] for u in run.u]
    assert [x.all() for x in slack] == [False, True, False, False] or not slack[0].any()
    assert slack[1].all()
    assert not slack[0].any()
    assert not slack[2].any()


def test_force_of_the_scene_is_the_gradient_of_the_structure(rng):
    s = by_hand(2)
    scene = s.network()
    u = 0.1 * rng.normal(size=s.positions.shape)
    moved = s.at(s.positions + u)
    assert moved.slack.any()
    assert scene.bond_tension(u) == pytest.approx(moved.tensions, rel=1e-12, abs=1e-13)
    energy = scene.energy(State(u, 0 * u))
    assert energy == pytest.approx(s.members.energy(s.positions + u), rel=1e-13)
