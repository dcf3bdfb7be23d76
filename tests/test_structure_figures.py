"""The pictures of structures: what they say of the tower and of deployment."""

import numpy as np
import pytest
from scipy.optimize import brentq

from figures import (
    structures_beam,
    structures_chain,
    structures_columns,
    structures_deployment,
    structures_front,
    structures_geiger,
    structures_landing,
    structures_lattices,
    structures_plates,
    structures_robot,
    structures_struck,
)
from tensegrity import (
    EquilibriumError,
    Prism,
    Structure,
    bands,
    catalogue,
    decay,
    equilibrium,
    equilibrium_path,
    held,
    plates,
)

pytestmark = pytest.mark.unchanged()


def test_prism_and_column_are_drawn_in_from_nearly_flat_to_the_reference():
    reference = structures_deployment.REFERENCE
    for count in structures_deployment.COUNTS:
        path = structures_deployment.deployed(count)
        top = path.positions[:, -1, 2]
        assert top[-1] == pytest.approx(count * reference.height, rel=0.01)  # less by its weight
        assert top[0] < 0.17 * top[-1]
        drawn = path.tensions[:, structures_deployment.cross_strings(count)]
        assert (drawn[-1] > 100 * drawn[0]).all()
        assert path.stable_load.all()
        assert not path.slack.any()
        assert path.work[-1] > 0


def test_no_shape_of_a_heavier_prism_lies_below_the_fold():
    path = structures_deployment.paid_out()
    (fold,) = path.events
    assert fold.kind == "fold"
    reference = structures_deployment.REFERENCE
    s = reference.structure()
    loads = structures_deployment.weights(s, structures_deployment.HEAVY)
    height = path.positions[fold.row, -1, 2]
    for share, stands in ((0.998, True), (1.001, False)):  # of the control at the fold
        lengths = s.natural_lengths.copy()
        lengths[3:6] *= 1 + (structures_deployment.LONG - 1) * share * fold.control
        above = s.at(path.positions[fold.row - 2], natural_lengths=lengths)
        found = equilibrium(above, loads, structures_deployment.GROUND)
        assert (found.positions[-1, 2] > 0.9 * height) == stands


def test_unloaded_prism_of_long_cross_strings_has_no_shape_to_start_from():
    s = structures_deployment.REFERENCE.structure()
    lengths = s.natural_lengths.copy()
    lengths[3:6] *= structures_deployment.LONG
    with pytest.raises(EquilibriumError, match="all members without stress"):
        s.at(s.positions, natural_lengths=lengths).relaxed()


def pair(rise):
    """Two bars from held feet to an apex that is pushed down; without stress."""
    s = Structure([[-1, 0], [1, 0], [0, rise]], bars=[(0, 2), (1, 2)], k_bar=10.0)
    return equilibrium_path(s, supports=held([0, 1]), loads={2: (0, -1)}, branch="stable",
                            max_shortening=2.2 * rise)  # fmt: skip


def cross(height, branch):
    """A planar X of width 1 on smooth ground, its upper nodes loaded and free."""
    s = catalogue.snelson_x(1.0, height, prestrain=0.1, k_bar=10.0)
    loads = {node: (0, -0.5) for node in (2, 3)}
    return equilibrium_path(s, supports=plates([0, 1]), loads=loads, branch=branch,
                            max_shortening=0.85 * height)  # fmt: skip


def test_steep_pair_of_bars_leaves_its_symmetric_path_and_joins_it_again_below():
    """Sideways stiffness vanishes where the bars' natural length is l^3/y^2, above and below."""
    path = pair(3.0)
    above, below = (e.shortening for e in path.events if e.kind == "bifurcation")
    height = brentq(lambda y: np.sqrt(10) * y**2 - (1 + y**2) ** 1.5, 2, 3)
    assert above == pytest.approx(3 - height, rel=1e-9)
    assert below == pytest.approx(3 + height, rel=1e-6)
    leans = np.abs(path.positions[:, 2, 0]) > 1e-3
    apart = (path.shortening > above + 1e-3) & (path.shortening < below - 1e-3)
    assert leans[apart].all()
    assert not leans[(path.shortening < above) | (path.shortening > below + 1e-2)].any()
    assert path.stable_height.all()


def test_tall_cross_leans_on_its_stable_branch_and_a_square_one_does_not():
    for height, leans in ((1.0, False), (2.0, True)):
        paths = [cross(height, branch) for branch in ("stable", "symmetric")]
        stable, symmetric = (p[p.events[0].row + 1 : p.events[0].row + 9] for p in paths)
        tilt = np.abs(np.diff(stable.positions[:, 2:, 1], axis=1))
        assert (tilt > 1e-3).all() == leans
        assert symmetric.stable_height.all() != leans
        if not leans:
            assert paths[0].load == pytest.approx(paths[1].load, rel=1e-12)


def test_column_of_a_slender_prism_with_shared_triangles_is_not_its_chain():
    prism = Prism(1.0, 1.5, 0.02, 1.0, **structures_columns.STIFFNESS)
    limit = 0.999 * structures_columns.largest_of_chain(prism)
    lost = [
        [structures_columns.lost(prism, count, *kind, limit) for count in (1, 3)]
        for kind in (*structures_columns.KINDS.values(), (True, True))
    ]
    shared, guided, between, both = lost
    assert shared[1] < shared[0] / 10
    assert guided[1] < limit / 5
    assert np.isnan(guided[0])
    assert between[1] == pytest.approx(between[0], rel=1e-9)
    assert between[0] == pytest.approx(shared[0], rel=1e-9)  # one unit has nothing between
    assert np.isnan(both).all()


def test_prestress_tunes_lattices():
    """B5 to B7: phases of octahedra, the closing of a gap, and gaps of resonators."""
    assert structures_lattices.closing() == pytest.approx(0.01767419461945183, rel=1e-11)
    wanted = {0.0: (2.0790326396943, 2.2016794020491), 0.04: (1.9782522297378, 2.1570548549155)}
    for preload, edges in wanted.items():
        assert structures_lattices.edges(preload) == pytest.approx(edges, rel=1e-12)
    assert (structures_lattices.speeds(-1e-6) < 1e-7).all()  # the root of round-off
    jumped = structures_lattices.speeds(1e-4)
    assert jumped == pytest.approx([0.0089923060311474, 0.19846990191276895], rel=1e-8)
    before, after = structures_lattices.speeds(0.05013), structures_lattices.speeds(0.050131)
    assert before[1] > before[0]  # shear is faster
    assert after[1] < after[0] < before[0]
    for q in structures_lattices.SHOWN:
        own = structures_lattices.ranges(q)
        found = own[1, 1], own[2, 0]
        assert found == pytest.approx(structures_lattices.exact(q), rel=1e-12)


@pytest.mark.parametrize("density", structures_beam.DENSITIES)
def test_a_beam_goes_where_its_spectrum_says(density):
    """B8: of the carrier, and of all waves of the packet; other window, 60 x 60 cells as well."""
    wanted = {0.0: (-0.232676, 0.692), 0.2: (-12.253786, -11.076), 0.4: (-20.851141, -19.955)}
    plate = structures_beam.plate(density)
    centre = structures_beam.carrier(plate)
    alone = bands(plate, [centre], velocities=True).velocities[0, 0]
    expected = structures_beam.velocity(plate, centre)
    assert structures_beam.angle(alone) == pytest.approx(wanted[density][0], abs=1e-6)
    assert structures_beam.angle(expected) == pytest.approx(wanted[density][1], abs=0.01)
    if density == 0.2:
        run, _ = structures_beam.followed(density)
        path = structures_beam.centres(run)
        found, _ = structures_beam.angles(run, expected)
        assert found == pytest.approx(structures_beam.angle(expected), abs=0.01)
        length = np.linalg.norm(path[-1] - path[0])
        assert length == pytest.approx(structures_beam.TRAVEL, rel=1e-3)
        assert run.energy_error < 1e-12


@pytest.mark.slow
def test_a_beam_turns_where_the_prestress_changes_on_its_way():
    """A slow change keeps the action of each wave; a fast one excites the upper branch."""
    run, (before, after) = structures_beam.turned()
    legs = structures_beam.LEGS
    off = []
    for velocity, rows in zip((before, after), legs, strict=True):
        found, expected = structures_beam.angles(run, velocity, rows)
        off.append(abs(found - expected))
    assert max(off) < 0.05
    soft, firm = (structures_beam.plate(q) for q in structures_beam.CHANGED)
    energies_kept = structures_beam.velocity(firm, structures_beam.carrier(soft))
    assert abs(found - structures_beam.angle(energies_kept)) > 3 * off[1]
    fast, _ = structures_beam.turned(structures_beam.RAMP / 5)
    there, _ = structures_beam.angles(fast, after, legs[1])
    assert abs(there - expected) > 10 * off[1]


@pytest.mark.parametrize("frequency", [1.4, 1.7])
def test_a_shaken_lattice_of_resonators_transmits_by_its_decay(frequency):
    found = structures_struck.amplitudes(frequency)
    first, last = structures_struck.FITTED
    rate = -np.polyfit(np.arange(first, last), np.log(found[first:last]), 1)[0]
    computed = np.abs(decay(structures_struck.resonators(), [frequency]).imag).min()
    assert rate == pytest.approx(computed, rel=2e-3)


@pytest.mark.slow
def test_slack_strings_lower_the_force_behind_a_blow():
    loose, rigid = (structures_struck.struck(kind, 0.03) for kind in structures_struck.KINDS)
    assert loose["slack"] > 0.05
    assert rigid["slack"] == 0
    assert loose["force [N]"] < 0.6 * rigid["force [N]"]
    assert rigid["energy error"] < 1e-11
    assert loose["energy error"] < 1e-9


@pytest.mark.slow
def test_energy_of_struck_octahedra_is_kept_where_slackening_is_corrected():
    """To the fourth order of the step, without corrections to the second; at most once 1e-8."""
    picture = structures_struck
    steps = 2 * picture.STEP, picture.STEP
    lost = {
        method: [
            picture.struck(picture.KINDS[0], picture.BLOWS[-1], step, method)["energy error"]
            for step in steps
        ]
        for method in ("corrected6", "rkn6")
    }
    coarse, fine = lost["corrected6"]
    assert fine < 1e-9
    assert coarse / fine == pytest.approx(16, rel=0.4)
    assert min(lost["rkn6"]) > 1e-7
    assert lost["rkn6"][0] / lost["rkn6"][1] == pytest.approx(4, rel=0.4)


def test_optic_waves_run_ahead_of_the_sound_that_moves_struck_octahedra():
    picture = structures_front
    _, along = picture.group(400)
    fastest, sound = along.max(), picture.sound_speed()
    lattice = picture.lattice()
    anywhere = np.random.default_rng(1).uniform(-np.pi, np.pi, (1000, 3))
    others = bands(lattice, anywhere, velocities=True).velocities @ picture.normal(lattice)[0]
    assert np.nanmax(np.abs(others)) < fastest
    assert fastest > 1.3 * sound
    t, far = np.arange(0.0, 500.0, 0.5), [24, 48, 96]
    u, v = picture.summed(t, 500)
    way = np.diff(far) * picture.normal(lattice)[1]
    slow = way / np.diff(picture.arrivals(t, u[:, far], picture.left() / 2))
    head = way / np.diff(picture.arrivals(t, v[:, far], picture.SMALL))
    assert slow == pytest.approx(sound, rel=0.02)
    assert abs(slow[1] - sound) < abs(slow[0] - sound)
    assert head == pytest.approx(fastest, rel=0.05)
    assert (head > fastest).all()


@pytest.mark.slow
def test_a_run_of_struck_octahedra_is_the_sum_of_their_waves_and_harder_blows_are_no_faster():
    picture, when, off = structures_front, [], []
    for speed in picture.BLOWS:
        t, u, run = picture.struck(speed)
        exact, _ = picture.summed(t, 64)
        when.append(picture.arrivals(t, u, 0.05 * picture.left()))
        off.append(np.abs(u - exact[:, picture.NEAR]).max() / picture.left())
        assert run.energy_error < 1e-8
    assert off[0] < 0.04  # felt from the border
    assert off[1] > 0.1
    assert (when[1][1:] > when[0][1:]).all()


def test_the_chain_of_condensed_prisms_is_the_limit_of_long_waves():
    """B3: 1 % off at 41 units a wave, the top of the axial branch far below the chain's."""
    assert structures_chain.exact_until() == pytest.approx(0.153126, abs=1e-6)
    column = structures_chain.PRISM.column(periodic=True)
    w, part = structures_chain.waves(column, np.array([1.17475]))
    top = w[part > structures_chain.LEAST].min()  # elsewhere an optic branch is more axial
    assert top == pytest.approx(0.556568144829, abs=1e-9)
    assert structures_chain.axial(column, 0.5) == pytest.approx(0.3773877998, abs=1e-9)
    below = structures_chain.axial(column, 0.05) / structures_chain.chain([0.05])[0] - 1
    assert below == pytest.approx(-0.428271 * 0.05**2, rel=0.02)
    one = structures_chain.PRISM.column(chirality="same", periodic=True)
    assert structures_chain.axial(one, 0.5) == pytest.approx(0.9773606921, abs=1e-9)


def test_waves_of_plates_are_those_of_nodes_where_they_are_long():
    """B3 at a phase of .5 from unit to unit: slow and fast waves of one hand, axial of both."""
    slow, fast = structures_plates.plates([0.5])[0]
    assert slow == pytest.approx(0.1809753845, rel=1.4e-4)
    assert fast == pytest.approx(0.9773606921, rel=1.03e-2)
    _, axial = structures_plates.plates([0.5], "alternate")[0]
    assert axial == pytest.approx(0.3773877998, rel=2.8e-3)
    chain = structures_chain.chain([0.5])[0]
    assert abs(chain / 0.3773877998 - 1) > 0.1
    for hand in structures_plates.HANDS:
        ratio = structures_plates.errors(hand, 20) / structures_plates.errors(hand, 40)
        assert (ratio > 3.4).all()


def test_extension_and_twist_travel_together_in_a_column_of_one_hand():
    """The wave is faster than both sounds, and after 140 units the same, the better the finer."""
    wave, state = structures_plates.permanent()
    assert wave.residual < 1e-14
    fast = 1.368504482822 / structures_plates.PRISM.height  # of the column of nodes
    assert wave.speed == pytest.approx(structures_plates.RATIO * fast, rel=1e-8)
    coarse, fine = (structures_plates.travelled(tol, wave.speed, state)[1:] for tol in (1e-5, 1e-8))
    assert (np.array(fine) < np.array(coarse) / 5).all()
    assert fine[0] < 1e-8
    assert fine[1] < 1e-9


def test_the_wave_of_the_chain_decays_among_alternating_plates():
    shares = [structures_plates.shed(1.0, tol)[1] for tol in (1e-5, 1e-7)]
    assert shares[0] == pytest.approx(shares[1], abs=1e-5)
    assert 0.3 < shares[1][-1] < 0.7
    assert (np.diff(shares[1]) < 0).all()


def test_a_higher_fall_presses_less_where_fewer_nodes_press_at_once(monkeypatch):
    picture = structures_landing
    low, high = (picture.peaks(height) for height in (1.5, 1.8))
    assert high["floor [N]"] < 0.8 * low["floor [N]"]
    assert high["nodes at once"] < low["nodes at once"]
    assert high["node [N]"] > 1.05 * low["node [N]"]
    assert high["bar [N]"] > low["bar [N]"] > picture.buckling()
    assert max(low["energy error"], high["energy error"]) < 1e-5
    monkeypatch.setattr(picture, "DT", picture.DT / 2)
    finer = picture.peaks(1.5)
    for name in ("floor [N]", "node [N]", "bar [N]"):
        assert finer[name] == pytest.approx(low[name], rel=1e-3)


def test_a_robot_gains_the_work_of_its_winches_above_one_place():
    picture = structures_robot
    s, wound = picture.robot()
    run = picture.moved(0.5, 1 / 2048, 512)
    assert (len(wound), run.work[-1] > 40) == (16, True)
    assert run.energy - run.energy[0] == pytest.approx(run.work, abs=2e-4)
    middle = picture.centre(s, run)
    assert np.abs(middle - middle[0])[:, :2].max() < 1e-14
    floor = run.scene.wall_load(run.u).sum(axis=1)
    assert floor.max() > 5 * 9.81 * s.weighing_mass.sum()
    assert (floor[len(floor) // 2 :] == 0).any()


@pytest.mark.parametrize("sectors", [5, 8, 12])
def test_the_pull_of_one_cable_fixes_the_geiger_dome_and_stiffens_it(sectors):
    s, supports, groups = structures_geiger.dome(sectors)
    exact = structures_geiger.closed(sectors)
    assert len(s.self_stress(supports).states) == 1
    for chosen in (0, 2, 5, 10):  # any member fixes all
        tight = s.prestressed(tension={groups[chosen][0]: 50 * exact[chosen]}, supports=supports)
        for group, force in zip(groups, exact, strict=True):
            assert tight.tensions[list(group)] == pytest.approx(50 * force, rel=1e-9)
    assert tight.is_stable(supports)
    assert len(s.mechanisms(supports)) > 0


def test_the_picture_of_the_geiger_dome_says_what_it_computed():
    tables = structures_geiger.data()
    of, counts = tables["groups"], tables["counts"]
    assert sum(of["members"]) == len(tables["members"]["force"]) == 81
    assert np.max(of["spread"]) < 1e-9
    assert np.array(of["computed"]) == pytest.approx(np.array(of["closed form"]), rel=1e-11)
    assert (counts["states"], counts["of symmetry"], counts["mechanisms"]) == ([1], [1], [22])
    assert counts["least stiffness over hoop"][0] == pytest.approx(0.11590413200610157, rel=1e-12)
