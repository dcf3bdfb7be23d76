"""Units with two stable states: thresholds, wells, and how they end; a front of such units."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, minimize, minimize_scalar

from derivations import bistable as form
from derivations import ledger, one_well
from tensegrity import (
    Chain,
    Damping,
    Potential,
    Prism,
    TensegrityError,
    catalogue,
    control_path,
    equilibrium_path,
    held,
    plates,
    simulate,
)
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
    energy = weak.expression.subs({s: values[str(s)] for s in weak.expression.free_symbols
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


BIASES = {"torque": form.torque, "other_prestrain": form.other,
          "other_k_string": form.other_stiffness}  # fmt: skip


@pytest.mark.parametrize("name", BIASES)
@pytest.mark.parametrize("place", [0.1, 0.2])
def test_every_bias_ends_a_well_where_the_derivation_says(name, place):
    """The program's natural length and bias for a well that ends at a given twist."""
    at = {form.sides: 3, form.height: 1.0, form.radius: 1 / np.sqrt(3), form.stiffness: 3.0}
    length = form.twin_strings().subs(at)
    limits = form.limit_of(BIASES[name], length, form.twist)[-1]
    rest, bias = sp.lambdify((form.x, form.stiffness), limits)(place, 3.0)
    given = {"torque": bias, "other_prestrain": np.sqrt(2) / bias - 1, "other_k_string": bias / 3}
    prestrain, equal = np.sqrt(2) / rest - 1, {"torque": 0.0, "other_k_string": 1.0}.get(name)
    equal = prestrain if equal is None else equal
    ending = unit(prestrain, **{name: given[name]})
    assert float(ending.tension(place)) == pytest.approx(0, abs=1e-14)
    assert float(ending.stiffness(place)) == pytest.approx(0, abs=1e-12)
    inside, beyond = (unit(prestrain, **{name: equal + part * (given[name] - equal)})
                      for part in (0.98, 1.02))  # fmt: skip
    assert [len(wells(one)) for one in (inside, beyond)] == [2, 1]


@pytest.mark.parametrize("name", BIASES)
def test_every_small_bias_lifts_a_well_by_the_derived_energy(name):
    rest = np.sqrt(2) / 1.1
    step, per_length = 1e-6, -rest / 1.1  # of a natural length by prestrain
    (equal, rate) = {"torque": (0.0, 1.0), "other_prestrain": (0.1, per_length),
                     "other_k_string": (1.0, 3.0)}[name]  # fmt: skip
    biased = unit(**{name: equal + step})
    low, high = wells(biased)
    lifted = float(biased.energy(low) - biased.energy(high))
    place = wells(unit())[1]
    lengths = [np.sqrt(float(form.twin_strings().subs(
        {form.sides: 3, form.height: 1.0, form.radius: 1 / np.sqrt(3), form.twist: sign * place}
    ))) for sign in (1, -1)]  # fmt: skip
    values = dict(zip((form.longer, form.shorter), lengths, strict=True))
    derived = form.released(BIASES[name]).subs(values | {
        form.x: place, form.natural: rest, form.stiffness: 3.0})  # fmt: skip
    assert lifted == pytest.approx(float(derived) * rate * step, rel=1e-4)


def energy(x, rest, k_base, k_bar):
    """Of a triangular prism, its strings taut or slack [J]; x: side along and across, height."""
    side, twist, up = np.hypot(x[0], x[1]), np.arctan2(x[1], x[0]), x[2]
    turned = 2 / 3 * side**2
    cross = np.sqrt(up**2 + turned * (1 - np.cos(twist - 2 * np.pi / 3)))
    bar = np.sqrt(up**2 + turned * (1 - np.cos(twist)))
    pull = max(cross - rest.cross, 0), max(side - rest.base, 0)
    return 1.5 * (pull[0] ** 2 + 2 * k_base * pull[1] ** 2 + k_bar * (bar - rest.bar) ** 2)


def test_a_prism_has_one_minimum_from_any_start():
    """As the derivation says; energies by SciPy from random sides, twists and heights."""
    random = np.random.default_rng(1)
    assert one_well.mismatch_slope().is_positive
    (first, second) = (dict(one_well.self_stress())[at] for at in one_well.self_stress())
    assert first[1].subs(one_well.half_angle, sp.pi / 3) == 1 / sp.sqrt(3)
    assert second[1] == -first[1]
    for _ in range(6):
        height, prestrain = random.uniform(0.4, 1.4), random.uniform(0.05, 0.6)
        k_base, k_bar = 10 ** random.uniform(0.6, 1.7), 10 ** random.uniform(0.0, 2.3)
        prism = Prism(1.0, height, prestrain, 1.0, k_base, k_bar)
        rest = prism.natural_lengths()
        found = []
        for _ in range(8):
            start = random.uniform([-1.2, -1.2, 0.3], [1.2, 1.2, 1.6])
            best = minimize(energy, start, (rest, k_base, k_bar), "Nelder-Mead",
                            options={"xatol": 1e-9, "fatol": 1e-15, "maxiter": 4000})  # fmt: skip
            if abs(best.x[2]) > 1e-3:
                found.append(np.abs(best.x))
        assert len(found) > 1
        at_rest = np.abs([np.cos(5 * np.pi / 6), np.sin(5 * np.pi / 6), height])
        assert np.array(found) == pytest.approx(np.tile(at_rest, (len(found), 1)), abs=1e-5)


LENGTH = np.sqrt(2)  # of strings at twist 0
STIFFNESSES = 1e3, 1e4  # of bars: what is left decreases in proportion to its inverse


def turned(positions, sides=3):
    """Twist of the upper polygon on the lower one [rad]."""
    upper, lower = positions[..., sides, :], positions[..., 0, :]
    return np.arctan2(upper[..., 1], upper[..., 0]) - np.arctan2(lower[..., 1], lower[..., 0])


def supports(sides=3):
    return held(range(sides)) + plates([], range(sides, 2 * sides))


def drawn(prestrain, k_bar, sides=3, branch="stable", start=0.05):
    """The structure, its path as all strings are drawn in, and where that ends, as a structure."""
    s = catalogue.twin_prism(sides, prestrain=start, k_bar=k_bar)
    strings = range(s.bars, len(s.ends))
    path = control_path(
        s, dict.fromkeys(strings, LENGTH / (1 + prestrain)), supports(sides), branch
    )
    natural = s.natural_lengths.copy()
    natural[s.bars :] = LENGTH / (1 + prestrain)
    return s, path, s.at(path.positions[-1], natural_lengths=natural)


@pytest.mark.parametrize(("sides", "start", "end"), [(3, 0.05, 0.1), (4, 0.2, 0.3)])
def test_the_path_of_the_structure_splits_at_the_threshold_of_the_shape(sides, start, end):
    shape = {form.sides: sides, form.base: 1, form.height: 1}
    threshold = float(form.of_prism().subs(shape))
    well = wells(unit(end, sides=sides))[1]
    off, twists = [], []
    for k_bar in STIFFNESSES:
        s, path, there = drawn(end, k_bar, sides, start=start)
        (split,) = path.events
        assert split.kind == "bifurcation"
        natural = LENGTH / (1 + start)  # of strings in bars that do not shorten
        natural += split.control * (LENGTH / (1 + end) - natural)
        off.append(LENGTH / natural - 1 - threshold)
        twists.append(abs(turned(path.positions[-1], sides)) - well)
        assert there.is_stable(supports(sides))
        straight = drawn(end, k_bar, sides, "symmetric", start)[1]
        assert np.abs(turned(straight.positions, sides)).max() < 1e-8
        assert not straight.stable_load[-1]
        mirrored = there.positions * [1, -1, 1]
        order = (-np.arange(sides)) % sides
        mirrored = mirrored[np.append(order, sides + order)]
        other = s.at(mirrored, natural_lengths=there.natural_lengths)
        assert np.abs(other.members.gradient(mirrored)[sides:, :2]).max() < 1e-10
        assert other.is_stable(supports(sides))
        assert turned(mirrored, sides) == pytest.approx(-turned(there.positions, sides), abs=1e-12)
    for ends in (off, twists):
        assert abs(ends[1]) < 1e-4
        assert ends[0] / ends[1] == pytest.approx(10, rel=0.03)


def test_tangential_forces_switch_the_wells_of_the_structure_at_two_folds():
    equal = unit()

    def force(twist):  # total, of dead forces along the tangents at twist 0
        return float(equal.tension(twist)) * np.sqrt(3) / np.cos(twist)

    fold = -minimize_scalar(force, bounds=(0.1, 0.3), method="bounded").fun
    off = []
    for k_bar in STIFFNESSES:
        s, path, there = drawn(0.1, k_bar)
        sense = -np.sign(turned(path.positions[-1]))
        tangents = sense * np.cross([0, 0, 1], s.positions[3:])
        back = equilibrium_path(there, supports=supports(), max_shortening=0.4,
                                loads=dict(zip((3, 4, 5), tangents, strict=True)))  # fmt: skip
        first, second = back.events
        assert [first.kind, second.kind] == ["fold", "fold"]
        assert second.load == pytest.approx(-first.load, rel=1e-9)
        assert back.stable_load[: first.row].all()
        assert not back.stable_load[first.row + 1 : second.row].any()
        assert back.stable_load[second.row + 1 :].all()
        reached = turned(back.positions)
        assert reached[0] * reached[-1] < 0
        off.append(first.load / fold - 1)
    assert abs(off[1]) < 6e-4
    assert off[0] / off[1] == pytest.approx(10, rel=0.03)


def test_unequal_natural_lengths_unfold_the_pitchfork_and_end_a_well_of_the_structure():
    """Strings of the hand that the well stretches are drawn in, or the others let out."""
    at = {form.sides: 3, form.height: 1, form.radius: 1 / sp.sqrt(3), form.stiffness: 3}
    limits = form.limit_of(form.other, form.twin_strings().subs(at), form.twist)[0]
    first, second = (sp.lambdify(form.x, one) for one in limits)
    rest = LENGTH / 1.1
    place = brentq(lambda x: second(x) - rest, 0.1, 0.3)
    closed = first(place) / rest
    off = []
    for k_bar in STIFFNESSES:
        s, path, there = drawn(0.1, k_bar)
        hand = s.bars if turned(path.positions[-1]) > 0 else s.bars + 3  # stretched there
        path = control_path(there, dict.fromkeys(range(hand, hand + 3), 0.98 * rest), supports())
        (fold,) = path.events
        assert fold.kind == "fold"
        off.append(1 - 0.02 * fold.control - closed)
    assert abs(off[1]) < 2e-5
    assert off[0] / off[1] == pytest.approx(10, rel=0.05)
    s = catalogue.twin_prism()
    ends = {
        m: LENGTH / (1 + (0.1 if m < s.bars + 3 else 0.101)) for m in range(s.bars, len(s.ends))
    }
    unfolded = control_path(s, ends, supports())
    assert unfolded.events == ()
    assert unfolded.stable_load.all()
    assert abs(turned(unfolded.positions[-1])) > 0.3


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


def test_a_unit_too_large_for_numbers_is_refused():
    with pytest.raises(TensegrityError, match="too large"):
        catalogue.twin_strings(base=1e308, height=1e308)


def test_a_slender_unit_turns_until_its_bars_meet():
    assert catalogue.twin_strings(base=1e-200).domain == (-np.pi, np.pi)


def test_the_picture_of_units_counts_wells_where_the_derivation_has_them():
    from figures import transition_units as picture

    for sides, height in ((3, 0.8), (4, 1.3)):
        least, most = picture.threshold(sides, height), picture.last(sides, [height])[0]
        for prestrain, count in ((0.96 * least, 1), (1.04 * least, 2), (0.97 * most, 2),
                                 (1.03 * most, 0)):  # fmt: skip
            shape = picture.of_shape(sides, height, prestrain)
            assert len(picture.wells(shape, sides)) == count
    at, torque, folds = picture.pushed(0.1)
    exact = picture.of_shape(3, 1.0, 0.1).tension(at)
    assert np.abs(torque - exact)[np.abs(at) < 0.4].max() < 1e-5
    assert at[0] < folds[0] < 0 < folds[1] < at[-1]


@pytest.mark.slow
def test_two_rows_that_meet_compute_and_or_or_by_one_torque():
    from figures import transition_logic as picture

    for gate, one in (("AND", 0), ("OR", picture.DISCS)):
        found = [picture.run(picture.GATES[gate], inputs).u[-1, :, 0] for inputs in ("A", "AB")]
        single, both = (picture.switched(twist) for twist in found)
        assert single == {"A": picture.DISCS, "B": 0, "output": one}
        assert both == dict.fromkeys(picture.PARTS, picture.DISCS)


def test_bonds_with_two_wells_push_the_wall_no_more_than_ends_a_well():
    from figures import transition_trap as picture

    below, above = 0.18, 0.285  # prestrains, of one well and of two
    peaks, kept = [], []
    for prestrain in (below, above):
        _, torque, twist = picture.run([prestrain])
        peaks.append(torque.max())
        kept.append(picture.stored(prestrain, twist))
    assert peaks[0] > 4 * peaks[1]
    assert peaks[1] == pytest.approx(picture.fold(above), rel=1e-5)
    assert kept[0] == (0, 0)
    bonds, part = kept[1]
    upper, lower = picture.well(above, -1), picture.well(above)
    lifted = float(np.subtract(*picture.bond(above).energy([upper, lower])))
    assert bonds == 2
    assert part == pytest.approx(2 * lifted / (0.2**2 / 2), rel=1e-12)
    assert 0.2 < part < 0.3


def test_the_gradient_of_the_push_by_prestrain_is_that_of_neighbouring_chains():
    from figures import transition_trap as picture

    step = 1e-6
    _, slopes = picture.peak([picture.START])
    more, less = (picture.peak([picture.START + s])[0] for s in (step, -step))
    assert slopes[0] == pytest.approx((more - less) / (2 * step), rel=1e-4)


@pytest.mark.slow
def test_gradients_lower_the_push_by_prestrains_of_groups():
    from figures import transition_trap as picture

    way, groups = picture.descended(np.full(picture.GROUPS, picture.START))
    assert (np.diff(way) <= 0).all()
    assert way[-1] < 0.3 * way[0]
    assert all(picture.RANGE[0] <= p <= picture.RANGE[1] for p in groups)
    _, torque, _ = picture.run(groups)
    assert torque.max() == pytest.approx(way[-1], rel=1e-3)
