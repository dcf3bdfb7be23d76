"""Responses of driven networks, guides and packs, and orbits on springs to the ground."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from granular import Bead, hexagonal_pack, materials, y_guide
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Force,
    Network,
    Potential,
    Prism,
    State,
    floquet,
    orbit_path,
    periodic_orbit,
)
from tensegrity.orbits.flow import DrivenFlow

T, W, R, RATE, SLIP, SPEED = sp.symbols("t W r rate slip speed")
X, VX, VY = sp.symbols("u_x v_x v_y")
STIFFENING = Potential(R**2 / 2 + 5 * R**4, R)
DUFFING = Potential(R**2 / 2 + R**4 / 4, R)
PRISM = Prism(1.0, 0.7, 0.1, 1.0).potential()
STEEL = materials["steel"]
BEAD = Bead(diameter=0.01, material=STEEL)
AROUND = {1: Drive(force=(0.02 * sp.cos(W * T), 0.01 * sp.sin(W * T)), parameters={"W": 1.3})}
RAISED = {2: Drive(displacement=(None, 0.02 * sp.sin(W * T)), parameters={"W": 1.3})}


def square(held=(0,), **forcing):
    """Masses on a square of which one site is held, or two."""
    at = [[0, 0], [1, 0], [1, 1], [0, 1]]
    bonds = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]]
    return Network(at, bonds, STIFFENING, mass=[1, 1.5, 0.8, 1.2], held=held, **forcing)


def test_tangents_of_a_driven_network_are_the_derivatives_of_the_flow():
    """Of dashpots that turn with their bonds, friction along them, and drag on sites."""
    rubbed = Force((0.1 * RATE * R**2, -0.3 * SLIP - 0.1 * SLIP**3), "bonds")
    drag = Force((-0.1 * VX * SPEED - 0.1 * X**3 * sp.cos(1.3 * T) ** 2, -0.2 * VY))
    scene = square(drive=AROUND | RAISED, damping=Damping(bond=0.05, ground=0.1),
                   forces=(rubbed, drag))  # fmt: skip
    flow, time, free = DrivenFlow(scene, 30, 3.7), 3.7, np.array([2, 3, 4, 6, 7])
    here, start = np.append(free, 8 + free), scene.at_rest()
    u, v = start.u.ravel(), start.v.ravel()
    u[free], v[free] = np.random.default_rng(0).normal(scale=[[0.05], [0.1]], size=(2, 5))

    def difference(end):
        h = 4e-5
        return (8 * (end(h) - end(-h)) - end(2 * h) + end(-2 * h)) / (12 * h)

    tangent, column = flow.tangents(u, v, time, by="W")[2:]
    columns = [
        difference(lambda s, d=d: np.concatenate(flow.end(u + s * d[0], v + s * d[1], time)))
        for d in np.eye(16).reshape(16, 2, 8)
    ]
    by = difference(lambda s: np.concatenate(flow.end(u, v, time, {"W": 1.3 + s})))
    assert np.abs(np.transpose(columns) - tangent)[np.ix_(here, here)].max() < 1e-11
    assert np.abs(by - column)[here].max() < 1e-11 < np.abs(column[here]).max()


def test_a_network_on_a_line_responds_as_the_chain():
    shaker = Drive(force=0.001 * sp.cos(W * T), parameters={"W": 1.68})
    forcing = {"damping": Damping(ground=0.02), "drive": {1: shaker}}
    line = Network([[0.0], [PRISM.length]], [[0, 1]], PRISM, held=[0], **forcing)
    chain = Chain(PRISM, 2, ends=("fixed", "free"), **forcing)
    of_line, of_chain = (
        orbit_path(periodic_orbit(one, one.at_rest()), by="W", until=1.72) for one in (line, chain)
    )
    for row in (0, -1):
        first, same = of_line.orbits[row], of_chain.orbits[row]
        assert first.state.u[1, 0] == pytest.approx(same.state.u[1], abs=1e-13)
        assert np.abs(floquet(first).multipliers - floquet(same).multipliers).max() < 1e-12


@pytest.mark.parametrize("drive", [AROUND, AROUND | RAISED], ids=["pushed", "and moved"])
def test_the_product_of_the_multipliers_of_a_network_is_that_of_the_decay(drive):
    """Dashpots in the bonds turn: the trace of what they do is that of a line."""
    scene = square((0, 3), drive=drive, damping=Damping(bond=0.05, ground=0.1))
    orbit = periodic_orbit(scene, scene.at_rest())
    run = orbit.run(1e-11)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-11 < 0.005 < np.ptp(orbit.state.u)
    found = floquet(orbit)
    weight = 1 / scene.mass
    weight[[0, 3]] = 0
    if len(drive) == 1:
        trace = 0.05 * weight[scene.bonds].sum() + 0.1 * 2 * weight.sum()
        exact = math.exp(-trace * orbit.period)
        assert np.prod(found.multipliers).real == pytest.approx(exact, rel=1e-10)
    assert found.stable
    assert len(found.multipliers) == 8 - 2 * (len(drive) > 1)


DRIVEN = {
    "pack": hexagonal_pack(
        3, 2, bead=BEAD, floor=STEEL, sides=STEEL, preload=20.0, damping=Damping(bond=5.0),
        drive={4: Drive(force=(0.1 * sp.cos(W * T), 0), parameters={"W": 5e4})},
    ),
    "guide": y_guide(
        2, 2, bead=BEAD, end=STEEL, preload=10.0, damping=Damping(bond=2.0),
        drive={0: Drive(force=(0.1 * sp.sin(W * T), 0), parameters={"W": 5e4})},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DRIVEN)
def test_responses_of_packs_and_guides_return_and_are_followed(name):
    scene = DRIVEN[name]
    orbit = periodic_orbit(scene, scene.at_rest())
    moved = np.abs(orbit.state.u - scene.at_rest().u).max()
    run = orbit.run(1e-11)
    assert np.abs(run.final.u - orbit.state.u).max() < 1e-8 * moved
    assert 1e-9 < moved < 1e-5
    assert orbit.energy == pytest.approx(run.energy[0] - scene.energy(scene.at_rest()), rel=1e-6)
    path = orbit_path(orbit, by="W", until=5.2e4)
    last = path.orbits[-1]
    alone = periodic_orbit(last.scene, last.scene.at_rest())
    assert np.abs(alone.state.u - last.state.u).max() < 1e-8 * moved
    assert last.period == pytest.approx(2 * math.pi / 5.2e4, rel=1e-12)
    softest = np.linalg.eigvalsh(scene.stiffness(scene.at_rest().u).toarray()).min()
    assert np.all(path.stable == (softest > 0))  # the first bead of the guide is pushed aside


def test_what_may_be_shifted_along_one_axis_is_found_where_the_guess_lies():
    shaken = Drive(force=(0.02 * sp.sin(2 * T), 0.01 * sp.cos(2 * T)))
    raised = Drive(displacement=(None, 0.01 * sp.sin(2 * T)))
    drive = {0: Drive(displacement=(None, 0.0)), 1: raised, 2: shaken}
    scene = Network([[0, 0], [1, 0], [0.3, 0.8]], [[0, 1], [1, 2], [2, 0]], STIFFENING,
                    damping=Damping(bond=0.1), drive=drive)  # fmt: skip
    rest = scene.at_rest()
    orbit = periodic_orbit(scene, State(rest.u + np.array([0.3, 0.0]), rest.v))
    assert np.mean(orbit.state.u[:, 0]) == pytest.approx(0.3, abs=1e-12)
    assert np.abs(orbit.run(1e-11).final.u - orbit.state.u).max() < 1e-10
    assert np.sum(np.abs(floquet(orbit).multipliers - 1) < 1e-5) == 2  # shift and boost


def test_masses_on_the_ground_in_phase_have_the_multipliers_of_hills_equations():
    """u'' = -u - u^3 of each; a mode of the bonds of stiffness k sees 1 + k + 3 u^2."""
    n, bond, size = 5, 0.05, 0.6
    scene = Chain(Potential(bond * R**2 / 2, R), n, ground=DUFFING)
    period = 4 * ellipk(size**2 / (2 + 2 * size**2)) / math.sqrt(1 + size**2)
    guess = State(np.full(n, size + 0.02), np.zeros(n))
    orbit = periodic_orbit(scene, guess, period=period)
    assert np.abs(orbit.state.u - size).max() < 1e-9
    assert orbit.energy == pytest.approx(n * (size**2 / 2 + size**4 / 4), rel=1e-9)
    exact = []
    for k in range(1, n):

        def hill(_, y, k=k):
            slope = 1 + 4 * bond * math.sin(math.pi * k / (2 * n)) ** 2 + 3 * y[0] ** 2
            return [y[1], -y[0] - y[0] ** 3, y[3], -slope * y[2], y[5], -slope * y[4]]

        y = solve_ivp(hill, (0, period), [size, 0, 1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-12)
        exact += [*np.linalg.eigvals(y.y[2:, -1].reshape(2, 2).T)]
    found = floquet(orbit)
    assert len(found.multipliers) == len(exact) == 2 * (n - 1)
    assert np.abs(found.multipliers[:, None] - np.array(exact)).min(axis=1).max() < 1e-7
    assert len(found.neutral) == 2
    assert found.stable == bool(np.abs(exact).max() < 1 + 1e-6)
    path = orbit_path(orbit, by="energy", until=2 * orbit.energy)
    squared = np.sqrt(1 + 4 * path.energy / n) - 1
    periods = 4 * ellipk(squared / (2 + 2 * squared)) / np.sqrt(1 + squared)
    assert np.allclose(path.period, periods, rtol=1e-8, atol=0)
