"""Gaps between beads, designs that deviate at random, and searches of a quantile over these."""

import numpy as np
import pytest
from designs import BIG, BLOW, STEEL, STRIKER, spelled

from granular import (
    Bead,
    Striker,
    chain,
    diamond_guide,
    sensor_force,
    simulate,
    wall_force,
    y_guide,
)
from granular.design import Order, Scatter, Sizes, objective, peak_force, robustness, search
from granular.design.spaces import Designs
from granular.lammps import to_lammps
from tensegrity import Record, State, TensegrityError, largest_peak

SHORT = {**BLOW, "t_end": 1e-3}
STEPPED = spelled("AAAAbbbb")


def followed(scene, t_end, dt=1e-7, every=1):
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=dt, record=Record(every=every))


def test_a_gap_closes_after_the_free_flight_of_the_striker():
    """First instant of force: gap over speed; its maximum a known time later (Landau, Lifshitz)."""
    gap, v, dt = 3e-6, 0.44, 2e-8
    scene = chain([BIG], striker=Striker(BIG, v), gaps=[gap])
    run = followed(scene, 4e-5, dt)
    force = scene.contact_forces(run.u)[:, 0]
    free = run.t < gap / v - 1e-12
    assert free.sum() > 300
    assert not force[free].any()
    assert (force[(run.t > gap / v + 1e-12) & (run.t < gap / v + 2e-5)] > 0).all()
    np.testing.assert_allclose(run.u[free, 0], v * run.t[free], rtol=1e-12)
    reduced, constant = BIG.mass / 2, scene.contacts[0].constant
    overlap = (5 * reduced * v**2 / (4 * constant)) ** 0.4
    half = 1.4716375 * overlap / v  # of the time of contact, 2.943 overlap/v
    instant, top = largest_peak(run.t, force)
    assert instant == pytest.approx(gap / v + half, rel=1e-6)
    assert top == pytest.approx(constant * overlap**1.5, rel=1e-7)


def test_beads_before_a_wall_close_their_gaps_one_after_another():
    """Equal beads far from each other exchange their velocities: each crosses its own gap."""
    gaps = np.array([0.0, 3e-4, 1e-4, 2e-4])
    scene = chain([BIG] * 3, striker=STRIKER, end=STEEL, gaps=gaps)
    start = scene.start()
    assert start.u[-1] == 0
    np.testing.assert_allclose(-scene.overlaps(start.u), gaps, atol=1e-18)
    np.testing.assert_array_equal(scene.at_rest().u, start.u)
    run = followed(scene, 1.6e-3)
    begun = [run.t[np.argmax(force > 0)] for force in scene.contact_forces(run.u).T]
    speed = run.v[np.searchsorted(run.t, begun[1:]) - 1, [1, 2, 3]]
    np.testing.assert_allclose(speed, STRIKER.speed, rtol=1e-8)
    assert (np.diff(begun) > gaps[1:] / STRIKER.speed).all()  # a collision takes time too
    assert run.energy_error < 1e-7


def test_energy_is_conserved_while_contacts_close_and_open():
    scene = chain(STEPPED, striker=STRIKER, end=STEEL, gaps=2e-6)
    coarse, fine = (followed(scene, 1e-3, dt, every=50).energy_error for dt in (1e-7, 2.5e-8))
    assert coarse < 1e-7
    assert fine < coarse / 8
    assert chain(STEPPED, striker=STRIKER, gaps=2e-6).start().u[0] == 0


def test_no_gaps_are_the_bits_of_touching_beads():
    same = chain(STEPPED, striker=STRIKER, end=STEEL)
    for gaps in (0.0, np.zeros(len(STEPPED) + 1)):
        other = chain(STEPPED, striker=STRIKER, end=STEEL, gaps=gaps)
        assert other == same
        assert other.start().u.tobytes() == same.start().u.tobytes()
    loaded = chain(STEPPED, striker=STRIKER, end=STEEL, gravity=9.81, gaps=0.0)
    assert loaded.start().u[0] < 0


def test_gaps_come_back_from_a_file(tmp_path):
    from tensegrity import Run

    how = {"striker": STRIKER, "end": STEEL, "gaps": 1e-6}
    for scene in (chain([BIG] * 3, **how), y_guide(3, 3, bead=BIG, **how)):
        run = followed(scene, 1e-5)
        run.save(tmp_path / "run.npz")
        again = Run.load(tmp_path / "run.npz").scene
        forces = [one.overlaps(run.final.u).tobytes() for one in (again, scene)]
        assert forces[0] == forces[1]
        assert again.start().u.tobytes() == scene.start().u.tobytes()


def test_the_stem_of_a_guide_closes_its_gaps_as_a_chain_does():
    """Until the wave returns from the junction."""
    gaps = np.linspace(2e-6, 0.5e-6, 12)
    guide = y_guide(stem=12, branch=3, bead=BIG, striker=STRIKER)
    each = np.zeros(len(guide.bonds))
    each[:12] = gaps
    guide = y_guide(stem=12, branch=3, bead=BIG, striker=STRIKER, gaps=each)
    np.testing.assert_allclose(-guide.overlaps(guide.start().u), each, atol=1e-17)
    straight = chain([BIG] * 12, striker=STRIKER, gaps=gaps)
    runs = [followed(scene, 1.8e-4) for scene in (guide, straight)]
    forces = [run.scene.contact_forces(run.u)[:, :11] for run in runs]
    assert (forces[1].max(axis=0) > 10)[:9].all()  # the wave came this far
    np.testing.assert_allclose(forces[0], forces[1], rtol=0, atol=1e-9 * forces[1].max())


def test_equal_gaps_keep_the_halves_of_a_diamond_equal_and_delay_the_wave_at_its_end():
    def arrival(**gaps):
        guide = diamond_guide(stem=3, branch=5, bead=BIG, striker=STRIKER, end=STEEL, **gaps)
        run = followed(guide, 6e-4, every=4)
        assert run.energy_error < 1e-6
        upper, lower = (sensor_force(run, f"branch {k}", 3) for k in (1, 2))
        np.testing.assert_allclose(upper, lower, rtol=0, atol=1e-9 * upper.max())
        force = wall_force(run, "end of stem 2")
        return run.t[np.argmax(force > 0.01 * force.max())]

    touching, apart = arrival(), arrival(gaps=1e-6)
    flights = 11 * 1e-6 / STRIKER.speed  # at least: no bead of the row is faster than the striker
    assert apart - touching > flights


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: y_guide(3, 3, bead=BIG, gaps=-1e-6), "gap 0 -1e-06 m must be at least 0"),
        (lambda: y_guide(3, 3, bead=BIG, gaps=[1e-6]), r"must be \(9,\)"),
        (lambda: y_guide(3, 3, bead=BIG, end=STEEL, gaps=1e-6, gravity=9.81),
         "require gravity and preload 0"),
        (lambda: to_lammps(y_guide(3, 3, bead=BIG, gaps=1e-6), State(*np.zeros((2, 9, 2))),
                           1e-5, 1e-6, "unwritten"), "gaps between the beads of a guide"),
        (lambda: chain([BIG] * 3, gaps=-1e-6), "gap 0 -1e-06 m must be at least 0"),
        (lambda: chain([BIG] * 3, gaps=[1e-6] * 3), r"must be \(2,\)"),
        (lambda: chain([BIG] * 3, gaps=1e308), "sum of the gaps inf m is not finite"),
        (lambda: chain([BIG] * 3, gaps=1e-6, preload=1.0), "require gravity and preload 0"),
        (lambda: chain([BIG] * 3, gaps=1e-6, start_wall=STEEL, end=STEEL), "one wall at most"),
        (lambda: robustness([STEPPED, STEPPED], **SHORT), "2 designs: give the beads of one"),
        (lambda: robustness(STEPPED, gaps=1e-3, **SHORT), "arrives in [0-9]+ of 100 draws"),
        (lambda: search(Sizes(8, (4e-3, 1e-2), 0.056, STEEL), scatter=Scatter(),
                        method="gradient", **SHORT), "no scatter"),
    ],
)  # fmt: skip
def test_bad_input_names_the_quantity_and_its_bound(call, words):
    with pytest.raises(TensegrityError, match=words):
        call()


def test_without_deviations_every_draw_has_the_peak_force():
    found = robustness(STEPPED, draws=5, **SHORT)
    np.testing.assert_array_equal(found.peaks, peak_force(STEPPED, **SHORT))
    assert found.quantile(0.3) == found.peaks[0]


def test_a_draw_is_the_chain_with_its_diameters_gaps_and_speed():
    scatter = Scatter(diameters=0.02, gaps=3e-6, speed=0.03, draws=12, seed=4)
    found = robustness(STEPPED, diameters=0.02, gaps=3e-6, speed=0.03, draws=12, seed=4, **SHORT)
    varied, gaps, speeds = scatter.varied(Designs.of([STEPPED]), STRIKER.speed)
    assert not gaps[:, 0].any()
    for k in (0, 7, 11):
        beads = [Bead(2 * r, STEEL) for r in varied.radius[k]]
        np.testing.assert_allclose([b.mass for b in beads], varied.mass[k], rtol=1e-12)
        scene = chain(beads, striker=Striker(BIG, speeds[k]), end=STEEL, gaps=gaps[k])
        run = followed(scene, 1e-3, 2e-7)
        assert found.peaks[k] == pytest.approx(
            largest_peak(run.t, wall_force(run, "end"))[1], rel=1e-4
        )


def test_deviations_have_the_stated_moments():
    scatter = Scatter(diameters=0.02, gaps=3e-6, speed=0.03, draws=4000)
    designs = Designs.of([STEPPED])
    varied, gaps, speeds = scatter.varied(designs, 2.0)
    factor = varied.radius / designs.radius
    assert factor.std() == pytest.approx(0.02, rel=0.02)
    assert factor.mean() == pytest.approx(1, abs=1e-3)
    assert (speeds / 2).std() == pytest.approx(0.03, rel=0.05)
    assert gaps[:, 1:].mean() == pytest.approx(1.5e-6, rel=0.02)
    assert gaps.max() <= 3e-6
    assert np.abs(np.corrcoef(np.column_stack([factor, gaps[:, 1:]]).T) - np.eye(16)).max() < 0.1


def test_a_faster_striker_scales_every_force():
    """F ~ v^(6/5) of touching beads, for any design and speed."""
    found = robustness(STEPPED, speed=0.05, draws=20, **SHORT)
    speeds = Scatter(speed=0.05, draws=20).varied(Designs.of([STEPPED]), 1.0)[2]
    np.testing.assert_allclose(found.peaks, peak_force(STEPPED, **SHORT) * speeds**1.2, rtol=2e-4)


def test_a_search_of_a_quantile_finds_the_best_of_all_orders():
    scatter = Scatter(diameters=0.01, gaps=1e-6, draws=16, quantile=0.9)
    best = search(Order(STEPPED), scatter=scatter, budget=1000, **SHORT)
    assert best.evaluations == 70  # every order
    again = robustness(best.beads, diameters=0.01, gaps=1e-6, draws=16, **SHORT)
    assert best.peak_force == pytest.approx(again.quantile(0.9), rel=1e-3)
    exact = search(Order(STEPPED), budget=1000, **SHORT)
    nominal = robustness(exact.beads, diameters=0.01, gaps=1e-6, draws=16, **SHORT)
    assert again.quantile(0.9) <= nominal.quantile(0.9) * (1 + 1e-3)


def test_common_random_numbers_make_a_comparison_sharper():
    """The variance of a difference of two designs is less with the same draws."""
    one, other = STEPPED, spelled("AAAbAbbb")
    deviations = {"diameters": 0.01, "speed": 0.05, "draws": 200}
    a, b = (robustness(x, **deviations, **SHORT).peaks for x in (one, other))
    c = robustness(other, seed=1, **deviations, **SHORT).peaks
    assert (a - b).var() < 0.5 * (a - c).var()


def test_a_bead_that_is_still_flying_has_not_arrived():
    designs, gaps = Designs.of([[BIG, BIG]]), np.array([[0.0, 0.0, 1.0]])
    found = objective.largest(designs, STRIKER, STEEL, 2e-4, 400, gaps)
    assert np.isinf(found.first[0])
    assert found.force[0] == 0
