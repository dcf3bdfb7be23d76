"""The Y-shaped guide: the paper's first scene converged, symmetry, balances, bad input."""

import math
from dataclasses import replace

import numpy as np
import pytest

from derivations import ledger_paper
from figures._guide import HEAVY, PARYLENE, PTFE, STEEL, light
from granular import (
    Bead,
    Striker,
    chain,
    diamond_guide,
    energies,
    fcc_pack,
    hexagonal_pack,
    materials,
    overlaps,
    pack,
    power,
    sensor_force,
    simulate,
    y_guide,
)
from granular.contact_network import contacts_of, rows
from granular.guide import Guide
from granular.layout import y_layout
from tensegrity import (
    ContactError,
    Record,
    StabilityError,
    State,
    TensegrityError,
    directions,
    first_peak,
    speed,
    wall_gaps,
)

END = 420e-6  # s: the reflected wave has passed the sensors of stem 1


def single(dt=None, every=1, guide=None, **how):
    guide = guide or y_guide(bead=STEEL, striker=light(0.585))
    return simulate(guide, guide.start(), END, dt=dt, record=Record(every=every), **how)


def ratios(run):
    """V_t/V_i, V_r/V_i, F_i/F_t, F_i/F_r by eq. (5) and located peaks."""
    scene = run.scene
    (first, _), (second, height) = (
        first_peak(run.t, sensor_force(run, "stem 1", n)) for n in (12, 16)
    )
    after = second + 40e-6, math.inf
    incident = scene.distance("stem 1", (12, 16)) / (second - first)
    transmitted = speed(run, "branch 1", (4, 8))
    reflected = -speed(run, "stem 1", (12, 16), after)
    there = first_peak(run.t, sensor_force(run, "branch 1", 4))[1]
    back = first_peak(run.t, sensor_force(run, "stem 1", 16), after)[1]
    return np.array([transmitted / incident, reflected / incident, height / there, height / back])


@pytest.fixture(scope="module")
def fig2():
    return single(dt=0.1e-6, every=2, method="rkn6")


@pytest.fixture(scope="module")
def mixed():
    """Parylene branch, heavy striker, until walls and corner have worked."""
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PARYLENE), striker=Striker(HEAVY, 0.35))
    how = {"dt": 0.1e-6, "method": "rkn6", "record": Record(every=20)}
    return simulate(guide, guide.start(), 1.0e-3, **how)


def test_ratios_of_the_split_wave_are_converged_in_the_step(fig2):
    coarse, fine = ratios(single(dt=0.4e-6, every=1, method="rkn6")), ratios(fig2)
    np.testing.assert_allclose(coarse, fine, rtol=1e-5)
    second = ratios(single(dt=0.05e-6, every=4, method="verlet"))  # another method, other errors
    np.testing.assert_allclose(second, fine, rtol=1e-4)


def test_symmetric_guide_stays_symmetric(fig2):
    one, two = (list(fig2.scene.parts[f"branch {k}"]) for k in (1, 2))
    scale = np.abs(fig2.u).max()
    assert np.abs(fig2.u[:, one] * [1, -1] - fig2.u[:, two]).max() < 1e-10 * scale
    stem = list(fig2.scene.parts["stem 1"])
    assert np.abs(fig2.u[:, stem, 1]).max() < 1e-10 * scale


def test_walls_carry_next_to_nothing_in_the_symmetric_guide(fig2):
    assert 0 < energies(fig2).parts["walls"].max() < 1e-6 * fig2.energy[0]


def test_energy_keeps_to_1e_8_with_the_default_step():
    assert single().energy_error < 1e-8


@pytest.mark.slow
def test_energy_keeps_to_1e_8_with_the_default_step_in_a_full_guide_of_two_kinds_of_beads():
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PARYLENE), striker=Striker(HEAVY, 0.35))
    run = simulate(guide, guide.start(), 2.4e-3, record=Record(every=20))
    assert run.energy_error < 1e-8


def test_energy_keeps_to_1e_9_at_a_step_of_0_03_us():
    assert single(dt=0.03e-6, every=50, method="rkn6").energy_error < 1e-9


@pytest.mark.parametrize("branches", [(STEEL, STEEL), (STEEL, PTFE)])
def test_momentum_balances_with_the_impulse_of_the_walls(branches):
    guide = diamond_guide(bead=STEEL, branches=branches, striker=light(0.5))
    run = simulate(guide, guide.start(), 0.8e-3, dt=0.4e-6, method="rkn6")
    start = guide.mass[0] * guide.striker.speed
    assert np.abs(run.impulse.sum(axis=1)).max() > 1e-2 * start  # walls have worked
    np.testing.assert_allclose(run.momentum(), [[start, 0.0]] * len(run.t), atol=1e-10 * start)


def test_energies_of_the_parts_and_walls_add_up(mixed):
    parts = energies(mixed).parts
    assert set(parts) == {*mixed.scene.parts, "walls"}
    np.testing.assert_allclose(sum(parts.values()), mixed.energy, rtol=1e-10)
    assert parts["walls"].max() > 1e-3 * mixed.energy[0]


def test_eq_5_is_the_derived_force_across_the_middle_plane(mixed):
    """At an inner bead with two contacts, from contact forces and angles alone."""
    scene, number = mixed.scene, 10
    site = scene.site("branch 2", number)
    ahead, behind = (scene.bonds.tolist().index(sorted((site, site + k))) for k in (1, -1))
    forces = scene.contact_forces(mixed.u)
    k = mixed.u[:, site] / np.maximum(np.linalg.norm(mixed.u[:, site], axis=1), 1e-300)[:, None]
    walls = [c for c in contacts_of(scene).of_site(site) if c >= len(scene.bonds)]
    free = forces[:, walls].max(axis=1) < 1e-9
    angle = [
        np.arccos(np.clip(np.sum(sign * directions(scene, mixed.u)[:, c] * k, axis=1), -1, 1))
        for c, sign in ((ahead, 1), (behind, -1))
    ]
    import sympy as sp

    symbols = (ledger_paper.f_1, ledger_paper.f_2, ledger_paper.theta_1, ledger_paper.theta_2)
    derived = sp.lambdify(symbols, ledger_paper._section_force())
    expected = derived(forces[:, ahead], forces[:, behind], *angle)
    moved = free & (forces[:, ahead] + forces[:, behind] > 1e-3)
    assert moved.sum() > 50
    sensed = sensor_force(mixed, "branch 2", number)
    np.testing.assert_allclose(sensed[moved], expected[moved], rtol=1e-6)


def test_eq_5_and_the_plain_mean_differ_at_the_corner_only(fig2, mixed):
    def ratio(run, part, number):
        """Largest force by eq. (5) over that of the plain mean."""
        touching = contacts_of(run.scene).of_site(run.scene.site(part, number))
        mean = run.scene.contact_forces(run.u)[:, touching].sum(axis=-1) / 2
        return sensor_force(run, part, number).max() / mean.max()

    assert 0.01 < abs(ratio(mixed, "branch 1", 24) - 1) < 0.2
    assert ratio(fig2, "branch 1", 8) == pytest.approx(1, rel=1e-9)
    assert (sensor_force(mixed, "stem 2", 19)[:10] == 0).all()  # not yet touched


def test_density_holds_the_sensor_of_each_site(mixed):
    scene = mixed.scene
    sites = [scene.site("stem 1", 5), scene.site("branch 1", 24)]
    found = sensor_force(mixed, sites)
    np.testing.assert_allclose(found[:, 1], sensor_force(mixed, "branch 1", 24))
    assert found.shape == (len(mixed.t), 2)


def test_sensors_need_only_their_neighbours(fig2):
    guide = fig2.scene
    needed = contacts_of(guide).neighbours(guide.site("branch 1", 1))
    assert len(needed) == 4  # itself, the junction, its twin across, the next
    some = simulate(
        guide, guide.start(), 200 * fig2.dt, dt=fig2.dt, method="rkn6",
        record=Record(every=2, sites=needed),
    )  # fmt: skip
    part = sensor_force(some, "branch 1", 1)
    full = sensor_force(fig2, "branch 1", 1)
    np.testing.assert_allclose(part, full[: len(part)], rtol=1e-9)
    with pytest.raises(TensegrityError, match="was not recorded"):
        rows(some, [5])


def test_parylene_overlaps_stay_within_the_coating(mixed):
    largest, mean = overlaps(mixed, "branch 2")
    assert 5e-6 < mean < largest < 50e-6


def test_walls_that_run_on_change_the_ptfe_branch_and_nothing_symmetric():
    heights = {}
    for branches in ((STEEL, STEEL), (STEEL, PTFE)):
        for through in (0.0, STEEL.radius / 2):
            guide = y_guide(bead=STEEL, branches=branches, striker=light(0.585), through=through)
            run = simulate(guide, guide.start(), 0.6e-3, dt=0.2e-6, method="rkn6",
                           record=Record(every=4))  # fmt: skip
            heights[branches[1], through] = sensor_force(run, "branch 2", 7).max()
    steel, ptfe = (heights[b, STEEL.radius / 2] / heights[b, 0.0] - 1 for b in (STEEL, PTFE))
    assert abs(steel) < 1e-6
    assert abs(ptfe) > 0.02


def test_junction_bead_comes_to_touch_the_bevel_of_its_edge_in_a_guide_without_symmetry():
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PARYLENE), striker=Striker(HEAVY, 0.35))
    record = Record(every=20)
    run = simulate(guide, guide.start(), 1.4e-3, dt=0.2e-6, method="rkn6", record=record)
    number = [guide.layout.walls[w].is_bevel for _, w in guide.wall_contacts]
    assert guide.wall_load(run.u)[:, number].max() > 0.1
    total = run.momentum()
    assert np.abs(total - total[0]).max() < 1e-10 * total[0, 0]


def test_guides_and_chains_say_what_they_are():
    guide = repr(y_guide(4, 5, bead=STEEL, striker=light(0.3)))
    assert guide.startswith(
        "Guide(striker: 1, stem 1: 4, branch 1: 5, branch 2: 5, struck at 0.3 m/s) on Network(15 "
    )
    line = repr(chain([STEEL] * 3, end=materials["ptfe"]))
    assert line.startswith("BeadChain(chain: 3, wall: 1) on Chain(4 sites")


def test_end_walls_hold_the_last_beads():
    guide = y_guide(4, 5, bead=STEEL, striker=light(0.3), end=materials["steel"])
    run = simulate(guide, guide.start(), 3e-4)
    assert energies(run).parts["walls"].max() > 0.1 * run.energy[0]
    assert run.energy_error < 1e-8


def test_gap_of_the_walls_is_in_the_contact_law():
    guide = y_guide(bead=STEEL, striker=light(0.3), gap=1e-4)
    gaps = wall_gaps(guide, np.zeros(guide.shape))
    junction = guide.wall_contacts[:, 0] == guide.site("stem 1", 19)
    np.testing.assert_allclose(gaps[~junction], 1e-4, rtol=1e-12)
    assert (gaps[junction] > 1e-4).all()


def test_a_step_too_large_for_the_stiffest_contact_is_refused():
    guide = y_guide(bead=STEEL, striker=light(0.585))
    with pytest.raises(StabilityError, match=r"dt 3e-05 s .* beyond"):
        simulate(guide, guide.start(), END, dt=30e-6, method="verlet")


def test_a_contact_that_is_not_in_the_list_is_named():
    """Branches opened so far that their first beads do not touch, then driven together."""
    layout = replace(y_layout(5, 6, math.radians(40), STEEL.diameter), walls=())
    guide = Guide(layout, dict.fromkeys(layout.parts, STEEL), materials["ptfe"], light(0.3))
    state = guide.start()
    v = state.v.copy()
    one, two = (guide.site(f"branch {k}", 1) for k in (1, 2))
    v[one], v[two] = [0, -60.0], [0, 60.0]
    with pytest.raises(ContactError, match=rf"{one}.*{two}"):
        simulate(guide, State(state.u, v), 2e-4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: y_guide(bead="steel"), "'steel' is not a Bead"),
        (lambda: y_guide(bead=STEEL, wall="ptfe"), "wall 'ptfe' is not a Material"),
        (lambda: y_guide(bead=STEEL, end="ptfe"), "end 'ptfe' is not a Material"),
        (lambda: y_guide(bead=STEEL, striker=STEEL), "not a Striker"),
        (lambda: y_guide(bead=STEEL, branches=(STEEL,)), "must be two beads"),
        (lambda: y_guide(bead=STEEL, branches=(STEEL, None)), "None of branch 2 is not a Bead"),
        (
            lambda: diamond_guide(
                bead=STEEL, branches=(STEEL, Bead(4.86e-3, materials["parylene"]))
            ),
            "beads of branch 2 have diameter 0.00486 m, must be .* 0.00476 m: others would overlap",
        ),
        (lambda: y_guide(bead=STEEL, law=3), "law 3 is not a function"),
        (lambda: y_guide(bead=STEEL, law=power(1e9, 1.5)).site("stem 2", 1), "part 'stem 2'"),
    ],
)
def test_bad_input_is_refused_with_its_bound(make, words):
    with pytest.raises(TensegrityError, match=words):
        make()


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda run: sensor_force(run, [99_999]), "site 99999 must be below"),
        (lambda run: sensor_force(run, [-1]), "site -1 must be at least 0"),
        (lambda run: overlaps(run, "x"), "part 'x' is not one of striker, stem 1"),
        (lambda run: overlaps(run, "striker"), "part 'striker' has no contact"),
        (lambda run: speed(run, "stem 1", (3, 3)), "must be two different beads"),
        (lambda run: speed(run, "stem 1", (3,)), "must be two different beads"),
        (lambda run: speed(run, "stem 1", 3), "must be two different beads"),
    ],
)
def test_readings_that_make_no_sense_are_refused(fig2, read, words):
    with pytest.raises(TensegrityError, match=words):
        read(fig2)


@pytest.mark.parametrize("make", [y_guide, diamond_guide])
def test_the_striker_starts_exactly_in_contact(make):
    """Of another diameter than the beads, so that a radius mistaken for another would show."""
    for striker in (light(0.3), Striker(HEAVY, 0.3), Striker(Bead(2e-3, STEEL.material), 0.3)):
        guide = make(bead=STEEL, striker=striker)
        (bond,) = contacts_of(guide).of_site(0)
        assert guide.bonds[bond].tolist() == [0, guide.site("stem 1", 1)]
        behind = guide.positions[1] - guide.positions[0]
        assert behind == pytest.approx([(striker.bead.diameter + STEEL.diameter) / 2, 0], rel=1e-12)
        state = guide.start()
        assert guide.overlaps(state.u)[bond] == 0
        assert not state.u.any()
        assert guide.contact_forces(state.u).max() == 0


def test_a_layout_with_a_bead_outside_is_refused_by_the_guide():
    layout = y_layout(4, 4, math.pi / 6, STEEL.diameter)
    moved = layout.positions.copy()
    moved[1, 1] += 1e-6
    beads = {part: STEEL for part in layout.parts}
    with pytest.raises(TensegrityError, match="bead 2 of stem 1 is outside its guide"):
        Guide(replace(layout, positions=moved), beads, materials["ptfe"])


def test_a_misspelled_keyword_of_a_builder_is_named():
    builders = {
        chain: [[STEEL] * 3], y_guide: [3, 3], diamond_guide: [3, 3], fcc_pack: [2, 2],
        hexagonal_pack: [2, 2], pack: [[(0.0, 0.0)], STEEL],
    }  # fmt: skip
    for build, given in builders.items():
        bead = {} if build in (chain, pack) else {"bead": STEEL}
        with pytest.raises(TypeError, match=rf"^{build.__name__}\(\) .*gravty.*mean 'gravity'"):
            build(*given, **bead, gravty=9.81)
        assert "[m/s^2]" in build.__doc__
        assert "surroundings" not in build.__doc__
    with pytest.raises(TypeError, match="friction"):
        chain([STEEL] * 3, friction=(0.2, 0.01))
