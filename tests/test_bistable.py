"""Units with two stable states: thresholds, wells, and how they end; a front of such units."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from derivations import bistable as form
from derivations import ledger
from tensegrity import Chain, Damping, Potential, TensegrityError, catalogue, simulate
from tensegrity import transition_wave as front_between

GRID = np.linspace(-1.0, 1.0, 801)


def unit(prestrain=0.1, **more):
    return catalogue.twin_strings(prestrain=prestrain, **more)


def equilibria(potential):
    """Twists and stiffnesses of the equilibria near twist 0, in order."""
    force = potential.tension(GRID)
    found = []
    for k in np.flatnonzero(np.diff(np.sign(force)) != 0):
        at = brentq(lambda x: float(potential.tension(x)), GRID[k], GRID[k + 1], xtol=1e-15)
        if not found or at - found[-1] > 1e-6:
            found.append(at)
    return np.array(found), potential.stiffness(np.array(found))


def wells(potential):
    """The stable equilibria between the outermost maxima, where the strings turn over."""
    places, stiffness = equilibria(potential)
    return places[stiffness > 0]


def test_wells_and_barrier_have_the_numbers_of_the_closed_energy():
    two = unit()
    found = wells(two)
    np.testing.assert_allclose(found, [-0.33076027675307, 0.33076027675307], rtol=1e-12)
    barrier = float(two.energy(0.0) - two.energy(found[1]))
    assert barrier == pytest.approx(1.2415678255079e-3, rel=1e-11)
    assert float(two.stiffness(found[1])) == pytest.approx(0.090552376007811, rel=1e-11)
    assert float(two.stiffness(0.0)) == pytest.approx(-0.045454545454545, rel=1e-12)
    drop = 1 - np.sqrt(1 - 2 / 3 * (1 - np.cos(found[1])))
    assert drop == pytest.approx(0.0182343430483, abs=1e-12)


@pytest.mark.parametrize(("sides", "base", "height"), [(3, 1.0, 1.0), (4, 0.7, 1.2), (6, 2.0, 1.0)])
def test_the_well_splits_at_the_threshold(sides, base, height):
    at = {form.sides: sides, form.base: base, form.height: height}
    threshold = float(form.of_prism().subs(at))
    closed = (base / np.tan(np.pi / sides)) ** 2 / (2 * (height**2 + base**2))
    assert threshold == pytest.approx(closed, rel=1e-14)
    shape = {"sides": sides, "base": base, "height": height}

    def stiffness(prestrain):
        return float(unit(prestrain, **shape).stiffness(0.0))

    assert brentq(stiffness, threshold / 2, 2 * threshold) == pytest.approx(threshold, rel=1e-10)
    assert stiffness(0.9 * threshold) > 0 > stiffness(1.1 * threshold)


def test_the_rotor_splits_at_its_threshold():
    at = {form.distance: 1.3, form.arm: 0.4, form.angle: 2.0}
    length = sp.sqrt(form.rotor().subs(at))
    threshold = float(form.threshold_of(form.rotor(), form.x).subs(at))
    rest = length.subs(form.x, 0) / (1 + threshold)
    energy = (length - rest) ** 2 + (length.subs(form.x, -form.x) - rest) ** 2
    second, fourth = (float(sp.diff(energy, form.x, k).subs(form.x, 0)) for k in (2, 4))
    assert abs(second) < 1e-14
    assert abs(fourth) > 1e-3
    for entry in ledger.entries():
        if entry.name in ("ours.rotor", "ours.twin_strings"):
            assert ledger.check(entry).confirmed


def test_wells_end_where_strings_go_slack():
    """With strings that could push, the wells at prestrain 0.2 would press one hand by 0.0658 m."""
    twist = np.linspace(0.2, 1.2, 4001)
    squared = [
        1 - 2 / 3 * (1 - np.cos(twist)) + 2 / 3 * (1 - np.cos(sign * twist + 2 * np.pi / 3))
        for sign in (1, -1)
    ]
    natural = np.sqrt(2) / 1.2
    stretches = np.sqrt(squared) - natural
    least = int(np.argmin((stretches**2).sum(axis=0)))
    assert stretches[1, least] == pytest.approx(-0.0658, abs=1e-4)
    assert list(wells(unit(0.2))) == []
    for sides in (3, 4):
        radius = 1 / (2 * np.sin(np.pi / sides))
        at = {form.sides: sides, form.height: 1.0, form.radius: radius}
        last, turned = float(form.last_of_prism().subs(at)), np.pi / 2 - np.pi / sides
        ending = unit(last, sides=sides).tension(np.linspace(0.2, turned, 20001))
        assert ending.argmax() == 20000  # the well meets the kink where the others go slack
        assert ending.max() == pytest.approx(0, abs=1e-14)
        assert len(wells(unit(0.97 * last, sides=sides))) == 2
        assert len(wells(unit(1.01 * last, sides=sides))) == 0
    assert last == pytest.approx(np.sqrt(2) - 1, rel=1e-14)


def test_a_torque_lifts_a_well_and_ends_it():
    weak = unit(0.09)
    place = wells(weak)[1]
    torque = 1e-6
    biased = unit(0.09, torque=torque)
    low, high = wells(biased)
    lifted = float(biased.energy(low) - biased.energy(high))
    assert lifted == pytest.approx(2 * torque * place, rel=1e-4)
    twist = sp.Symbol("varphi", real=True)
    values = {str(name): value for name, value in weak.parameters.items()}
    energy = weak.law.energy.subs({s: values[str(s)] for s in weak.law.energy.free_symbols
                                   if str(s) in values})  # fmt: skip
    taut = energy.replace(sp.Max, lambda *x: sum(x))
    second, fourth = (float(sp.diff(taut, twist, k).subs(twist, 0)) for k in (2, 4))
    near = {form.curvature: second, form.quartic: fourth}
    assert place == pytest.approx(float(form.wells()[0].subs(near)), rel=0.1)
    limit = float(form.wells()[1].subs(near))
    grid = np.linspace(0, place, 400)
    fold = -float(weak.tension(grid).min())
    assert limit == pytest.approx(fold, rel=0.1)  # of the normal form; the energy has this one:
    assert len(wells(unit(0.09, torque=0.99 * fold))) == 2
    assert len(wells(unit(0.09, torque=1.01 * fold))) == 1


def test_unequal_prestrains_lift_a_well_and_end_it():
    counts = [len(wells(unit(0.1, other_prestrain=p))) for p in (0.1, 0.102, 0.115)]
    assert counts == [2, 2, 1]
    biased = unit(0.1, other_prestrain=0.102)
    low, high = wells(biased)
    mirrored = unit(0.102, other_prestrain=0.1)
    np.testing.assert_allclose(wells(mirrored), [-high, -low], rtol=1e-10)
    released = float(biased.energy(low) - biased.energy(high))
    assert released * float(mirrored.energy(-low) - mirrored.energy(-high)) > 0
    assert abs(released) > 1e-5


def test_a_row_of_discs_on_unequal_units_switches_one_way():
    twist = sp.Symbol("r")
    spring, damping = Potential(0.05 * twist**2, twist), Damping(ground=0.2)
    biased = unit(torque=1e-3)
    low, high = wells(biased)
    front = front_between(spring, ahead=low, behind=high, ground=biased, damping=damping)
    released = float(biased.energy(low) - biased.energy(high))
    assert front.released == pytest.approx(released, rel=1e-12)
    assert front.residual < 1e-9
    row = Chain(spring, 160, ground=biased, damping=damping)
    time = 30 / front.speed
    run = simulate(row, front.launch(row, at=60.0, tail=1e-7), time, tol=1e-8)
    expected = front.displacement(np.arange(160) - 90.0)
    np.testing.assert_allclose(run.final.u, expected, rtol=0, atol=1e-6)
    with pytest.raises(TensegrityError, match="must be above 0"):
        front_between(spring, ahead=high, behind=low, ground=biased, damping=damping)


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("sides", {"sides": 2}),
        ("base", {"base": 0.0}),
        ("height", {"height": -1.0}),
        ("prestrain", {"prestrain": -1.0}),
        ("other_prestrain", {"other_prestrain": -2.0}),
        ("k_string", {"k_string": 0.0}),
        ("torque", {"torque": np.nan}),
        ("too large", {"base": 1e308, "height": 1e308}),
    ],
)
def test_wrong_units_are_refused(words, given):
    with pytest.raises(TensegrityError, match=words):
        catalogue.twin_strings(**given)
