"""Contacts that lose energy or adhere against closed forms and numbers of other programs.

`contacts.json`: in units in which mass, constant and speed are 1, T = A d^(3/2) + B d^q d' while
above 0; each number by two programs.
"""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from granular import Bead, Contact, Material, chain, dmt, hertz, simulate, tsuji, viscous
from granular.damped_contact import Adhesive
from granular.dissipation import Dissipation
from tensegrity import Potential, TensegrityError

KNOWN = json.loads((Path(__file__).parent / "contacts.json").read_text())
UNIT = Material("unit", modulus=1e9, poisson=0.3, density=8e3)
BALL = Bead(0.02, UNIT, mass=1.0)
POWERS = {"KK": 0.5, "HC": 1.5, "viscous": 0.0, "Tsuji": 0.25}


def contact(law, b, a=1.0, n=1.5):
    if law == "hertz":
        return Contact(a, n)
    names = {"KK": "Kuwabara-Kono", "HC": "Hunt-Crossley"}
    unit = {"KK": 1 / (n * a), "HC": 1 / a, "Tsuji": a**-0.5}
    return Contact(a, n, Dissipation(names.get(law, law), b * unit.get(law, 1.0)))


def ended(law, b):
    """Restitution and duration by smooth rates: of the momentum without losses (Lienard), in the
    root of the overlap, or its fourth root after Tsuji, in place of time."""
    k = 4 if law == "Tsuji" else 2
    q = POWERS[law]

    def speed(z, w):
        return w - b * z ** round(k * (q + 1)) / (q + 1)

    def rates(_, y):  # d = z^k, dt = k z^(k - 1) ds
        z, w, _ = y
        return speed(z, w), -k * z ** (5 * k // 2 - 1), k * z ** (k - 1)

    def force(_, y):
        z, w, _ = y
        return z ** round(k * (1.5 - min(q, 1.5))) + b * z ** round(k * (q - min(q, 1.5))) * speed(
            z, w
        )

    force.terminal = True
    force.direction = -1
    run = solve_ivp(
        rates, (0, 100), (1e-300, 1.0, 0.0), "DOP853", events=force, rtol=3e-14, atol=1e-15
    )
    z, w, t = run.y[:, -1]
    return -speed(z, w), t


@pytest.mark.parametrize("case", KNOWN["restitution"], ids=lambda x: f"{x['law']} {x['B']}")
def test_restitution_and_duration_of_a_collision(case):
    found = contact(case["law"], case["B"]).restitution(1.0, 1.0)
    assert found == pytest.approx((case["e"], case["duration"]), abs=1e-10)
    if case["law"] != "HC":  # whose force ends with the overlap, at the speed -1/c at most
        assert found == pytest.approx(ended(case["law"], case["B"]), abs=1e-10)


@pytest.mark.parametrize(("e", "alpha"), [(0.5, 0.570813678782), (0.9, 0.0766193256892)])
def test_the_damping_of_a_constant_restitution(e, alpha):
    """At any speed, of beads and at walls; a formula without the clamp gives .481769257765 for .5,
    with which the restitution is .550283169627."""
    for other, mass in ((BALL, 0.5), (UNIT, 1.0)):
        one = tsuji(restitution=e)(BALL, other)
        assert one.dissipation.constant / math.sqrt(mass) == pytest.approx(alpha, rel=1e-12)
        assert one == tsuji(one.dissipation.constant / math.sqrt(mass))(BALL, other)
        for speed in (1e-3, 1.0, 30.0):
            assert one.restitution(mass, speed)[0] == pytest.approx(e, abs=1e-10)
    found = contact("Tsuji", 0.481769257765).restitution(1.0, 1.0)[0]
    assert found == pytest.approx(0.550283169627, abs=1e-10)


@pytest.mark.parametrize("beta", [0.1, 0.5, 0.99, 1.0, 1.3, 4.0])
@pytest.mark.parametrize(("law", "n"), [("Tsuji", 1.5), ("Tsuji", 2.0), ("viscous", 1.0)])
def test_the_damping_that_does_not_know_the_speed(law, n, beta):
    side = math.sqrt(abs(1 - beta**2))
    part = math.acos(beta) / side if beta < 1 else math.acosh(beta) / side if side else 1.0
    found = contact(law, 2 * beta * math.sqrt((n + 1) / 2), n=n).restitution(1.0, 1.0)[0]
    assert found == pytest.approx(math.exp(-2 * beta * part), abs=1e-10)


@pytest.mark.parametrize("n", [1.0, 1.5, 2.5])
@pytest.mark.parametrize("a", [0.1, 1.0, 3.0])
def test_hunt_and_crossley_by_lamberts_function(a, n):
    exact = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
    assert contact("HC", a, n=n).restitution(1.0, 1.0)[0] == pytest.approx(exact, abs=1e-10)


def test_adhesion_gives_its_energy_back():
    for case in KNOWN["DMT"]:
        found = Adhesive(1.0, pull=case["Fc"]).restitution(1.0, 1.0)
        assert found == pytest.approx((1.0, case["duration"]), abs=1e-10)
    one = dmt(0.05)(BALL, UNIT)
    assert one.pull == pytest.approx(2 * math.pi * 0.05 * 0.01, rel=1e-15)
    assert one.constant == hertz(BALL, UNIT).constant
    assert one.overlap(0.0) == pytest.approx((one.pull / one.constant) ** (2 / 3), rel=1e-12)
    row = chain([BALL] * 2, law=dmt(1e4))
    run = simulate(row, row.at_rest({0: 1.0}), 2e-2, dt=1e-5)
    assert run.energy[-1] == pytest.approx(run.energy[0], rel=1e-3)
    assert run.final.v.sum() == pytest.approx(1.0, rel=1e-9)


def test_a_bead_rests_on_its_wall_at_the_overlap_of_its_weight():
    row = chain([BALL], end=UNIT, gravity=0.02, law=lambda *_: contact("viscous", 0.1))
    assert row.overlaps(row.at_rest().u)[0] == pytest.approx(
        KNOWN["rest_overlap"]["value"], rel=1e-11
    )


@pytest.mark.parametrize("law", ["KK", "HC", "viscous", "Tsuji"])
def test_a_row_that_is_struck(law):
    (case,) = [x for x in KNOWN["row"] if x["law"] == law and x["n"] == 3]
    row = chain([BALL] * 3, law=lambda *_: contact(law, case["B"]))
    run = simulate(row, row.at_rest({0: 1.0}), case["t"], tol=1e-5)
    error = np.abs(run.final.v - case["v"]).max()
    assert error <= max(run.error_estimate, 1e-9) <= 1e-5


class Wrong(Contact):
    """Two laws in one."""

    @property
    def potential(self):
        r = sp.Symbol("r")
        return Potential(self.constant * sp.Max(-r, 0) ** 3 / 3, r)

    def overlap(self, force):
        return (force / self.constant) ** (2 / 3)


def plateau(one, other):
    """No force over the first part of the overlap, in which a dashpot stops all that is slow."""
    r, k = sp.symbols("r k")
    energy = sp.Piecewise((0, r > -1), (k * (r + 1) ** 2 / 2, True))

    class Late(Contact):
        potential = Potential(energy, r, {k: 1.0})

    return Late(1.0, dissipation=Dissipation("viscous", 10.0))


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("restitution 1.1 must be at most 1", lambda: tsuji(restitution=1.1)),
        ("restitution 0 must be above 0", lambda: viscous(restitution=0.0, speed=1.0)),
        ("alpha -1 must be at least 0", lambda: tsuji(-1.0)),
        ("exactly one of these", lambda: tsuji()),
        ("work -1 J/m.2 must be at least 0", lambda: dmt(-1.0)),
        ("pull-off force -1 N", lambda: Adhesive(1.0, pull=-1.0)),
        ("Wrong: its overlap under", lambda: chain([BALL] * 2, law=lambda *_: Wrong(1.0))),
        ("never ends", lambda: plateau(BALL, BALL).restitution(1.0, 1.0)),
        ("is not one of", lambda: Dissipation("Coulomb", 1.0)),
        ("constant of viscous", lambda: replace(Dissipation("viscous", 1.0), constant=-1.0)),
        ("losses of viscous have 1", lambda: Dissipation("viscous", 1.0, 1.5)),
    ],
)  # fmt: skip
def test_what_no_contact_is_is_refused_by_name(words, call):
    with pytest.raises(TensegrityError, match=words):
        call()
