"""The pictures of structures: what they say of the tower and of deployment."""

import numpy as np
import pytest
from scipy.optimize import brentq

from figures import (
    structures_beam,
    structures_chain,
    structures_columns,
    structures_deployment,
    structures_gap,
    structures_lattices,
    structures_planes,
    structures_plates,
    structures_struck,
    structures_tower,
    structures_waves,
)
from tensegrity import (
    EquilibriumError,
    Prism,
    State,
    bands,
    decay,
    dispersion,
    equilibrium,
    modes,
    simulate,
)


def test_tower_found_from_natural_lengths_is_stable_with_all_strings_taut():
    s = structures_tower.tower()
    assert s.is_stable()
    assert not s.slack.any()
    assert np.abs(s.members.gradient(s.positions)).max() < 1e-12
    assert len(s.self_stress().states) == 1
    assert np.ptp(s.positions[list(structures_tower.LOWER), 2]) < 1e-12
    assert np.ptp(s.positions[list(structures_tower.UPPER), 2]) < 1e-10


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


def test_steep_pair_of_bars_leaves_its_symmetric_path_and_joins_it_again_below():
    """Sideways stiffness vanishes where the bars' natural length is l^3/y^2, above and below."""
    path = structures_planes.path_of("pair", 3.0, "stable")
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
        paths = [structures_planes.path_of("X", height, b) for b in structures_planes.BRANCHES]
        stable, symmetric = (p[p.events[0].row + 1 : p.events[0].row + 9] for p in paths)
        tilt = np.abs(np.diff(stable.positions[:, 2:, 1], axis=1))
        assert (tilt > 1e-3).all() == leans
        assert symmetric.stable_height.all() != leans
        if not leans:
            assert paths[0].load == pytest.approx(paths[1].load, rel=1e-12)


def test_chain_is_enough_for_a_blow_of_ten_units():
    prism = Prism(1.0, 1.0, 0.1, **structures_waves.STIFFNESS)
    times, line, space = structures_waves.struck(prism, structures_waves.BLOWS[0], 10)
    one, other = (structures_waves.peak(times, x) for x in (line, space))
    assert one[0] == pytest.approx(1, abs=0.01)  # a small wide wave goes at the speed of sound
    assert other[0] == pytest.approx(one[0], rel=0.14)
    assert other[1] == pytest.approx(one[1], rel=0.06)


@pytest.mark.slow
def test_chain_is_not_enough_for_a_sudden_blow():
    """All cases of the picture."""
    tables = structures_waves.data()
    table = {name: np.array(values) for name, values in tables["map"].items()}
    peaks = table["column_peak"] / table["chain_peak"]
    speeds = table["column_speed"] / table["chain_speed"]
    wide, sudden = table["width"] == 10, table["width"] == 1
    assert np.abs(peaks[wide] - 1).max() < 0.06
    assert np.abs(speeds[wide] - 1).max() < 0.14
    assert peaks[sudden].min() > 0.42
    assert peaks[sudden].max() < 0.78
    assert len(structures_waves.table(tables)) == len(peaks) == 18
    ahead = np.array([tables["trace_1"][name] for name in ("chain", "column")])
    early = np.array(tables["trace_1"]["time"]) < structures_waves.FAR - 4
    before, turning = np.abs(ahead[:, early]).max(axis=1)
    assert turning > 3 * before  # turning motions run ahead of the compression


def test_column_of_a_slender_prism_with_shared_triangles_is_not_its_chain():
    prism = Prism(1.0, 1.5, 0.02, 1.0, **structures_columns.STIFFNESS)
    limit = 0.999 * structures_columns.largest_of_chain(prism)
    lost = [
        [structures_columns.lost(prism, count, *kind, limit) for count in (1, 3)]
        for kind in structures_columns.KINDS.values()
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


def test_prestress_that_changes_in_a_run_turns_its_beam():
    """A sudden change is two runs, one after the other; a slow one keeps the beam's branch."""
    picture = structures_beam
    off = []
    for ramp in (0.4, 0.2):
        run, _ = picture.turned(ramp)
        half = picture.ROWS // 2
        firm = picture.plate(picture.SWITCHED[1]).network((picture.SITES,) * 2)
        middle = State(run.u[half - 1], run.v[half - 1])
        soft = picture.plate(picture.SWITCHED[0]).network((picture.SITES,) * 2)
        step = run.t[half] - run.t[half - 1]
        there = simulate(soft, middle, step, tol=1e-7).final
        end = simulate(firm, there, run.t[-1] - run.t[half], tol=1e-7).final
        off.append(np.abs(run.final.u - end.u).max() / np.abs(end.u).max())
    assert off[1] < off[0] / 2
    assert off[1] < 6e-3
    turned = []
    for ramp in (picture.RAMP, picture.RAMP / 2):
        run, velocities = picture.turned(ramp)
        rows = half + picture.APART, picture.ROWS - 1
        found, expected = picture.angles(run, velocities[1], rows)
        turned.append(abs(found - expected))
    assert turned[0] < turned[1] < 1.5
    assert turned[0] < 0.6


@pytest.mark.parametrize("frequency", [1.4, 1.7])
def test_a_shaken_lattice_of_resonators_transmits_by_its_decay(frequency):
    found = structures_struck.amplitudes(frequency)
    first, last = structures_struck.FITTED
    rate = -np.polyfit(np.arange(first, last), np.log(found[first:last]), 1)[0]
    computed = np.abs(decay(structures_struck.resonators(), [frequency]).imag).min()
    assert rate == pytest.approx(computed, rel=2e-3)


def test_slack_strings_lower_the_force_behind_a_blow():
    loose, rigid = (structures_struck.struck(kind, 0.03) for kind in structures_struck.KINDS)
    assert loose["slack"] > 0.05
    assert rigid["slack"] == 0
    assert loose["force [N]"] < 0.6 * rigid["force [N]"]
    assert rigid["energy error"] < 1e-11
    assert loose["energy error"] < 1e-6


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
    """The wave keeps its form in a run, the better the finer it is."""
    wave, state = structures_plates.permanent()
    assert wave.residual < 1e-14
    speed = wave.speed
    assert speed * structures_plates.PRISM.height > 1.09 * 1.368504482822
    column = structures_plates.PRISM.column(200, "same", plates=structures_plates.PLATES)
    shift = state.u[0] - state.u[-1]
    assert column.momentum(state) == pytest.approx(3.0 * speed * shift, rel=1e-10)
    found = [structures_plates.travelled(tol, speed, state)[1:] for tol in (1e-5, 1e-8)]
    assert found[0][0] < 5e-8
    assert found[1][0] < 3e-9
    assert max(behind for _, behind in found) < 1e-9


def test_the_wave_of_the_chain_decays_among_alternating_plates():
    shares = [structures_plates.shed(1.0, tol)[1] for tol in (1e-5, 1e-7)]
    assert shares[0] == pytest.approx(shares[1], abs=1e-5)
    assert 0.3 < shares[1][-1] < 0.7
    assert (np.diff(shares[1]) < 0).all()


@pytest.mark.parametrize("name", structures_gap.EDGES)
def test_edges_of_the_gap_rise_with_amplitude_as_quadrature_says(name):
    moving = structures_gap.EDGES[name]
    chain, shape = structures_gap.row(moving)
    x, w, residual = structures_gap.followed(chain, shape, np.array([0.002, 0.008, 0.02]))
    exact = structures_gap.by_quadrature(structures_gap.MASSES[moving], x)
    assert w == pytest.approx(exact, rel=1e-8)
    assert residual.max() < 1e-10
    edge = dispersion(structures_gap.SPRING, structures_gap.MASSES, [np.pi])[0, 1 - moving]
    assert w[0] == pytest.approx(edge, rel=2e-3)
    assert w[2] > 1.02 * edge


def test_the_vibration_of_a_defect_rises_with_the_square_of_a_small_amplitude():
    chain, shape = structures_gap.with_defect()
    x, w, _ = structures_gap.followed(chain, shape, np.array([0.002, 0.004]))
    low, high = dispersion(structures_gap.SPRING, structures_gap.MASSES, [np.pi])[0]
    assert low < w[0] < w[1] < high
    start = modes(chain, count=chain.sites).frequencies
    rest = start[np.abs(start - w[0]).argmin()]
    rises = (w - rest) / x**2
    assert rises[1] == pytest.approx(rises[0], rel=0.05)
