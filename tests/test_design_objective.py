"""The largest wall force of protectors: reference numbers, closed form, scaling, lanes."""

import numpy as np
import pytest
from designs import BIG, BLOW, SMALL, SOFT, STEEL, STRIKER, before_a_wall, spelled

from granular import Bead, Striker, hertz, materials
from granular.design import Choice, Order, Sizes, objective, peak_force
from granular.design.objective import wall_peak
from tensegrity import TensegrityError

BEST_T1 = spelled("bbAAAbAAAbbbAAAbAbbb")
REFERENCES = [  # measured with independent codes, to 7 digits or more
    (BEST_T1, 1e-3, 35.3362969),
    (spelled("AAAAAAAAAAbbbbbbbbbb"), 1e-3, 57.6640846),
    (spelled("bbAAAbbbbAAAAAAbAbbb"), 1e-3, 35.4461969),
    ([BIG] * 20, 1e-3, 151.2538190),
    ([SMALL] * 20, 1e-3, 67.8448928),
    ([Bead(7e-3, STEEL)] * 20, 1e-3, 130.8202384),
    (spelled("AAAAAAAAAAbbbbbbbbbb", SOFT), 8e-3, 22.2430417),
    (spelled("bAAAAAAAbbbbbbAbAAbb", SOFT), 8e-3, 5.4411505),
    ([SOFT] * 20, 8e-3, 22.6529284),
    (spelled("RRBSSSSSSSBGRNRRRRSR"), 12e-3, 2.24183771),
    (spelled("RRRRRRRRRRRRRRRRRRRR"), 12e-3, 12.2135303),
]


@pytest.mark.parametrize(("beads", "t_end", "force"), REFERENCES)
def test_default_step_keeps_its_promise_at_reference_designs(beads, t_end, force):
    assert peak_force(beads, t_end=t_end, **BLOW) == pytest.approx(force, rel=1e-4)


def test_a_finer_step_gives_the_reference_to_eight_digits():
    fine = peak_force(BEST_T1, t_end=1e-3, dt=2e-7, **BLOW)
    assert fine == pytest.approx(35.3362969, abs=1e-7)


def test_random_orders_of_steel_keep_the_promise_of_the_default_and_of_twice_the_step(rng):
    space = Order([BIG] * 10 + [SMALL] * 10)
    designs = space.designs(space.random(rng, 64))
    unit = float(designs.behind(BIG).unit(STEEL, STRIKER.speed).min())

    def forces(share):
        steps = objective.step_count(unit, 1e-3, share * unit)
        return objective.largest(designs, STRIKER, STEEL, 1e-3, steps).force

    limit = forces(objective.STEP_FRACTION / 4)
    for factor, bound in ((1, 1e-4), (2, 1e-3)):
        error = np.abs(forces(factor * objective.STEP_FRACTION) / limit - 1)
        assert error.max() < bound
        assert np.median(error) < bound / 10


def test_a_bead_without_mass_passes_the_blow_on_as_the_closed_form_says():
    """Two contacts in series between the striker and the wall: one law of exponent 3/2."""
    bead, v = Bead(9.53e-3, STEEL), 1.65

    def closed_form(alpha):
        return alpha * (5 * bead.mass * v**2 / (4 * alpha)) ** 0.6

    wall = hertz(bead, STEEL).constant
    assert closed_form(wall) == pytest.approx(708.8095685, rel=1e-9)  # a direct hit
    series = (wall ** (-2 / 3) + hertz(bead, bead).constant ** (-2 / 3)) ** -1.5
    errors = []
    for share in (1e-4, 1e-6):  # the light bead rattles less and less
        light = Bead(bead.diameter, STEEL, mass=share * bead.mass)
        felt = peak_force([light], striker=Striker(bead, v), wall=STEEL, t_end=1e-4)
        errors.append(abs(felt / closed_form(series) - 1))
    assert errors[1] < 2e-3
    assert errors[1] < errors[0] / 3


def test_force_scales_with_speed_to_the_power_six_fifths_and_with_size_squared():
    force = peak_force(BEST_T1, t_end=1e-3, dt=4e-7, **BLOW)
    fast = Striker(BIG, 1.0)
    stretch = (1.0 / 0.44) ** -0.2  # of time
    faster = peak_force(BEST_T1, t_end=1e-3 * stretch, dt=4e-7 * stretch, striker=fast, wall=STEEL)
    assert faster == pytest.approx(force / 0.44**1.2, rel=1e-9)
    assert faster == pytest.approx(94.6406737, rel=1e-6)
    double = [Bead(2 * bead.diameter, bead.material) for bead in BEST_T1]
    larger = peak_force(
        double, striker=Striker(Bead(20e-3, STEEL), 0.44), wall=STEEL, t_end=2e-3, dt=8e-7
    )
    assert larger == pytest.approx(4 * force, rel=1e-9)


def test_a_design_has_one_value_to_the_bit_however_the_list_is_cut(rng):
    space = Order([BIG] * 5 + [SOFT] * 5)
    chains = [space.beads(row) for row in space.random(rng, 70)]
    together = peak_force(chains, t_end=2e-3, **BLOW)
    for part in (slice(0, 1), slice(3, 10), slice(5, 22), slice(30, 70)):
        np.testing.assert_array_equal(peak_force(chains[part], t_end=2e-3, **BLOW), together[part])


def test_designs_of_different_length_and_step_come_back_in_their_order():
    chains = [[BIG] * 5, [SMALL] * 7, [BIG] * 6, [SMALL] * 5]
    each = [peak_force(one, t_end=1e-3, **BLOW) for one in chains]
    np.testing.assert_array_equal(peak_force(chains, t_end=1e-3, **BLOW), each)


def test_maxima_between_the_steps_count():
    """With steps so long that the largest value at a step misses the maximum by a per cent."""
    beads, dt = [BIG] * 8, 6e-6
    limit = peak_force(beads, t_end=6e-4, **BLOW)
    coarse = [peak_force(beads, t_end=t_end, dt=dt, **BLOW) for t_end in np.linspace(5e-4, 6e-4, 9)]
    assert np.abs(np.array(coarse) / limit - 1).max() < 3e-3


def test_a_scene_that_is_built_feels_the_same_as_the_chain():
    beads = [BIG, SOFT] * 5
    force, time = wall_peak(before_a_wall, beads, 2e-3, 2e-6)
    assert force == pytest.approx(peak_force(beads, t_end=2e-3, **BLOW), rel=1e-3)
    assert 0 < time < 2e-3


def test_too_short_a_time_says_when_the_wave_arrives():
    with pytest.raises(TensegrityError, match=r"before the wave through design 0 .* 0\.0003344 s"):
        peak_force(BEST_T1, t_end=5e-5, **BLOW)
    with pytest.raises(TensegrityError, match="design 1 arrives"):
        peak_force([[BIG] * 2, [BIG] * 20], t_end=1.5e-4, **BLOW)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Sizes(20, (4e-3, 10e-3), 0.3, STEEL), "0.08 m at least and 0.2 m at most"),
        (lambda: Sizes(20, (10e-3, 4e-3), 0.14, STEEL), "largest diameter 0.004 m must be above"),
        (lambda: Choice(5, 1e-2, ["steel", "ptfe"]), "'steel' is not a Material"),
        (lambda: Choice(5, 1e-2, [STEEL]), "no choice"),
        (lambda: Choice(5, 1e-2, [materials["stone"]]), "'stone' is not one of steel"),
        (lambda: Order([BIG] * 3), "one order only"),
        (lambda: Order([BIG, "steel"]), "'steel' is not a Bead"),
        (lambda: peak_force([BIG], t_end=1e9, **BLOW), "steps, must be at most"),
        (lambda: peak_force([BIG], t_end=1, dt=0.1, **BLOW), "dt 0.1 s must be at most 1.*e-05 s"),
        (lambda: peak_force([[BIG], [None]], t_end=1e-3, **BLOW), "bead 0 of design 1 is None"),
        (lambda: peak_force([], t_end=1e-3, **BLOW), "not a sequence of Beads"),
    ],
)
def test_bad_input_names_the_quantity_and_its_bound(call, words):
    with pytest.raises(TensegrityError, match=words):
        call()


def test_projected_diameters_fill_the_length_and_are_the_nearest(rng):
    from scipy.optimize import minimize

    space = Sizes(5, (4e-3, 10e-3), 0.035, STEEL)
    rows = rng.uniform(0, 0.014, (20, 5))
    near = space.projected(rows)
    np.testing.assert_allclose(near.sum(axis=1), 0.035, rtol=1e-14)
    assert near.min() >= 4e-3
    assert near.max() <= 10e-3
    for row, mine in zip(1e3 * rows[:3], 1e3 * near[:3], strict=True):
        found = minimize(
            lambda x, row=row: np.sum((x - row) ** 2), np.full(5, 7.0), bounds=[(4, 10)] * 5,
            constraints={"type": "eq", "fun": lambda x: x.sum() - 35}, method="SLSQP", tol=1e-12,
        )  # fmt: skip
        np.testing.assert_allclose(mine, found.x, atol=1e-5)


def test_moves_keep_the_beads_of_an_order_and_what_parents_share(rng):
    space = Order([BIG] * 3 + [SMALL] * 4 + [SOFT] * 2)
    one, other = space.random(rng, 200), space.random(rng, 200)
    counts = np.sort(space.row)
    for rows in (space.children(rng, one, other), space.mutants(rng, one)):
        np.testing.assert_array_equal(np.sort(rows, axis=1), np.tile(counts, (200, 1)))
    children = space.children(rng, one, other)
    assert (children == one)[one == other].all()
    assert (space.mutants(rng, one) != one).any(axis=1).mean() > 0.7
