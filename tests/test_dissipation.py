"""Contacts that dissipate: restitution against independent numbers, runs against restitution."""

import math
from itertools import pairwise

import numpy as np
import pytest

from granular import (
    Bead,
    Contact,
    Material,
    Striker,
    carretero_gonzalez,
    chain,
    hunt_crossley,
    kuwabara_kono,
    sensor_force,
    simulate,
    viscous,
    wall_force,
    y_guide,
)
from tensegrity import Run, TensegrityError

STEEL = Material("steel", density=0.45e-3 / (math.pi / 6 * 4.76e-3**3), modulus=193e9, poisson=0.3)
BEAD = Bead(4.76e-3, STEEL)
LAWS = {
    "kuwabara_kono": (kuwabara_kono, 1e-6),
    "hunt_crossley": (hunt_crossley, 0.1),
    "viscous": (viscous, 0.5),
    "carretero_gonzalez": (lambda *x, **k: carretero_gonzalez(*x, a=1.8, **k), 0.5),
}
"""Restitution and contact time [s] of two steel beads, by speed [m/s]; from another program."""
KNOWN = [
    (kuwabara_kono(1e-6), 0.1, 0.797230851, 22.7339e-6),
    (kuwabara_kono(1e-6), 1.0, 0.704875297, 14.0523e-6),
    (hunt_crossley(0.1), 0.1, 0.993377454, None),
    (hunt_crossley(0.1), 1.0, 0.937475580, None),
]


def pair(law, speed):
    return chain([BEAD], striker=Striker(BEAD, speed), law=law)


@pytest.mark.parametrize(("law", "speed", "expected", "duration"), KNOWN)
def test_restitution_has_the_known_values(law, speed, expected, duration):
    found, time = law(BEAD, BEAD).restitution(BEAD.mass / 2, speed)
    assert found == pytest.approx(expected, abs=1.1e-9)
    if duration:
        assert time == pytest.approx(duration, abs=1e-10)


def test_little_loss_grows_with_the_fifth_root_of_speed():
    speeds = np.array([0.01, 0.1, 1.0, 10.0])
    contact = kuwabara_kono(1e-10)(BEAD, BEAD)
    lost = [1 - contact.restitution(BEAD.mass / 2, v)[0] for v in speeds]
    assert np.diff(np.log10(lost)) == pytest.approx(0.2, abs=2e-3)


def test_hunt_and_crossley_lose_in_proportion_to_speed_at_first():
    """1 - e ~ (2/5) c v for contacts with exponent 3/2, whatever their stiffness: the integral of
    the loss over the elastic motion, 2 c A int d^(3/2) d'^2 dt = (8/15) c m v^3."""
    contact = hunt_crossley(1e-4)(BEAD, BEAD)
    for speed in (0.1, 1.0):
        lost = 1 - contact.restitution(BEAD.mass / 2, speed)[0]
        d = np.linspace(0, 1, 200_001)
        share = 2 * np.trapezoid(d**1.5 * np.sqrt(np.maximum(1 - d**2.5, 0)), d)
        # m v dv = work of c A d^(3/2) d' over d, both ways; overlaps in units of the largest
        assert lost == pytest.approx(share * 1.25 * 1e-4 * speed, rel=2e-3)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("wall", [False, True])
def test_a_constant_follows_from_the_restitution(name, wall):
    law, constant = LAWS[name]
    contact = law(constant)(BEAD, STEEL if wall else BEAD)
    mass = BEAD.mass if wall else BEAD.mass / 2
    e = contact.restitution(mass, 0.7)[0]
    found = law(restitution=e, speed=0.7)(BEAD, STEEL if wall else BEAD)
    assert found.dissipation.constant == pytest.approx(constant, rel=1e-8)
    assert law(restitution=1.0, speed=0.7)(BEAD, BEAD).dissipation.constant == 0


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("tol", [1e-3, 1e-4])
def test_a_run_has_the_restitution(name, tol):
    law, constant = LAWS[name]
    row = pair(law(constant), 1.0)
    run = simulate(row, row.start(), 40e-6, tol=tol)
    e = run.final.v[1] - run.final.v[0]
    assert e == pytest.approx(row.contacts[0].restitution(BEAD.mass / 2, 1.0)[0], abs=2 * tol)
    balance = run.energy + run.loss - run.energy[0]
    assert np.abs(balance).max() < tol * run.energy[0]
    assert run.v @ row.mass == pytest.approx(BEAD.mass, rel=1e-12)
    assert row.contact_forces(run.u, run.v).min() >= -1e-12  # never attractive


def test_the_order_at_a_closing():
    """The force begins as the root of time: v errs with the step to the power 3/2 or so."""
    row = pair(kuwabara_kono(1e-6), 1.0)
    known = row.contacts[0].restitution(BEAD.mass / 2, 1.0)[0]
    steps, wrong = [400, 800, 1600, 3200, 6400, 12800], []
    for count in steps:
        run = simulate(row, row.start(), 40e-6, dt=40e-6 / count, method="rk8")
        wrong.append(abs(run.final.v[1] - run.final.v[0] - known))
    order = -np.polyfit(np.log(steps), np.log(wrong), 1)[0]
    assert 1.3 < order < 2.4


def test_order_where_contacts_stay_closed():
    row = chain([BEAD] * 6, preload=50.0, end=STEEL, law=kuwabara_kono(2e-7))
    state = row.at_rest({2: 0.01})
    ends = [
        simulate(row, state, 60e-6, dt=60e-6 / n, method="rk4").final.u for n in (100, 200, 400)
    ]
    first, second = (np.abs(a - b).max() for a, b in pairwise(ends))
    assert np.log2(first / second) > 3.7


def test_sensors_read_the_whole_force():
    row = chain([BEAD] * 5, striker=Striker(BEAD, 0.5), end=STEEL, law=kuwabara_kono(5e-7))
    run = simulate(row, row.start(), 120e-6, tol=1e-5)
    each = row.contact_forces(run.u, run.v)
    np.testing.assert_allclose(sensor_force(run, "chain", 3), each[:, 2:4].mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(wall_force(run, "end"), each[:, -1], rtol=1e-12)
    impulse = row.mass[:-1] @ (run.v[0, :-1] - run.v[-1, :-1])
    assert np.trapezoid(wall_force(run, "end"), run.t) == pytest.approx(impulse, rel=2e-3)
    with pytest.raises(TensegrityError, match="give v"):
        row.contact_forces(run.u)


def test_a_chain_without_loss_is_the_elastic_one():
    plain = chain([BEAD] * 5, striker=Striker(BEAD, 0.5), end=STEEL)
    none = chain([BEAD] * 5, striker=Striker(BEAD, 0.5), end=STEEL, law=kuwabara_kono(0.0))
    one, two = (simulate(x, x.start(), 5e-5, tol=1e-6) for x in (plain, none))
    np.testing.assert_array_equal(one.final.u, two.final.u)
    assert two.loss is None


def test_chains_that_dissipate_are_stored(tmp_path):
    row = chain([BEAD] * 3, striker=Striker(BEAD, 0.5), end=STEEL, law=viscous(0.1))
    run = simulate(row, row.start(), 5e-5, dt=1e-7)
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.scene == row
    np.testing.assert_array_equal(again.u, run.u)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("exactly one of these", lambda: kuwabara_kono()),
        ("exactly one of these", lambda: viscous(1.0, restitution=0.5, speed=1.0)),
        ("exactly one of these", lambda: hunt_crossley(restitution=0.5)),
        ("c of Kuwabara-Kono", lambda: kuwabara_kono(-1e-6)),
        ("must be at most 1", lambda: kuwabara_kono(restitution=1.1, speed=1.0)),
        ("restitution", lambda: kuwabara_kono(restitution=0.0, speed=1.0)),
        ("speed of the restitution", lambda: viscous(restitution=0.5, speed=0.0)),
        ("exponent a", lambda: carretero_gonzalez(1.0, 0.0)),
        (
            "for chains of beads",
            lambda: y_guide(bead=BEAD, law=viscous(1.0)),
        ),
        ("dissipation", lambda: Contact(1e9, 1.5, 3.0)),
    ],
)
def test_wrong_laws_are_refused(words, call):
    with pytest.raises(TensegrityError, match=words):
        call()
