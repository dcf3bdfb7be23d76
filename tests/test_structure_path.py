"""Paths of structures: slack corners and both branches, folds, bifurcations, columns, control.

Numbers with many digits are references from independent codes.
"""

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from structures import cross, icosahedron, upright

from tensegrity import (
    EquilibriumError,
    Prism,
    Structure,
    TensegrityError,
    bar_contact,
    control_path,
    equilibrium,
    equilibrium_path,
    held,
    plates,
)
from tensegrity.minimum import least_part
from tensegrity.prisms.contact import distances
from tensegrity.structures.active_set import OutgoingBranch, selected

PLATES = plates([0, 4, 8], [3, 7, 11])
PRISM = Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0)


@pytest.fixture(scope="module")
def ball():
    return upright(icosahedron())


def kinds(path):
    return [e.kind for e in path.events]


def loads_at(s, places, **given):
    found = []
    for place in places:
        path = equilibrium_path(s, supports=PLATES, max_shortening=place, **given)
        assert path.shortening[-1] == pytest.approx(place, abs=1e-14)
        found.append(path.load[-1])
    return found


def test_the_least_part_of_a_matrix_is_its_smallest_singular_value_over_the_largest():
    assert least_part(np.diag([2.0, 4.0, -1.0])) == pytest.approx(0.25, rel=1e-15)


def test_icosahedron_between_plates_carries_the_reference_loads(ball):
    wanted = [0.203822142658, 0.492745851389, 0.764045312023]
    assert loads_at(ball, [0.2, 0.5, 0.8]) == pytest.approx(wanted, rel=3e-12)


def test_six_strings_slacken_at_once_and_the_symmetric_path_has_a_smooth_fold_beyond(ball):
    path = equilibrium_path(ball, supports=PLATES, branch="symmetric", max_shortening=1.2)
    corner, fold = path.events
    assert (corner.kind, fold.kind) == ("slack", "fold")
    assert corner.shortening == pytest.approx(0.860240190805, rel=1e-11)
    assert corner.load == pytest.approx(0.816149126567, rel=1e-11)
    assert fold.shortening == pytest.approx(1.06247834851, rel=1e-10)
    assert fold.load == pytest.approx(0.823797551572, rel=1e-11)
    beyond = path.shortening > corner.shortening
    assert path.slack[beyond].sum(axis=1).tolist() == [6] * beyond.sum()
    assert path.stable_height[~beyond].all()
    assert not path.stable_height[beyond].any()
    (at_one,) = loads_at(ball, [1.0], branch="symmetric")
    assert at_one == pytest.approx(0.823072614079, rel=1e-11)


def test_stable_branch_keeps_three_strings_taut_and_its_load_falls(ball):
    wanted = [0.812905274798, 0.799367099393, 0.778952355776]
    assert loads_at(ball, [0.9, 1.0, 1.1]) == pytest.approx(wanted, rel=3e-12)
    path = equilibrium_path(ball, supports=PLATES, max_shortening=1.1)
    corner = path.events[0]
    beyond = path.shortening > corner.shortening
    assert path.slack[beyond].sum(axis=1).tolist() == [3] * beyond.sum()
    assert path.stable_height.all()
    assert not path.stable_load[beyond].any()
    assert path.load.max() == pytest.approx(corner.load, rel=1e-12)
    slack = ", ".join(map(str, np.flatnonzero(path.slack[-1])))
    assert corner.note == f"strings {slack} slack, 3 of 6 strings at natural length are taut beyond"


def test_rows_of_a_path_are_equilibria_found_without_it(ball):
    path = equilibrium_path(ball, supports=PLATES, max_shortening=0.7)
    row = path[len(path) // 2]
    state = equilibrium(ball, {n: (0, 0, -row["load"] / 3) for n in (3, 7, 11)}, PLATES)
    assert state.stable
    assert state.tensions == pytest.approx(path.tensions[len(path) // 2], abs=1e-9)


def test_path_ends_where_a_middle_node_reaches_a_plate(ball):
    path = equilibrium_path(ball, supports=PLATES)
    assert kinds(path)[-1] == "plate"
    heights = path.positions[-1][:, 2]
    others = np.delete(heights, [0, 4, 8])
    assert np.abs(others).min() < 1e-12


def test_two_strings_of_the_planar_cross_slacken_and_the_load_is_that_of_two_springs():
    s = cross(2)
    path = equilibrium_path(s, supports=plates([0, 1], [2, 3]), max_shortening=0.5)
    slack = path.events[0]
    upright_length = s.natural_lengths[3]
    assert slack.shortening == pytest.approx(1 - upright_length, rel=1e-11)
    row = path[-1]
    height = 1 - row["shortening"]
    width = path.positions[-1][1, 0] - path.positions[-1][0, 0]
    bar = np.hypot(width, height)
    push = 10.0 * (s.natural_lengths[0] - bar)
    assert row["load"] == pytest.approx(2 * push * height / bar, rel=1e-10)
    assert row["tension 2"] == pytest.approx(push * width / bar, rel=1e-10)


def truss(rise):
    """Two bars from the ground to an apex."""
    return Structure([[-1, 0], [1, 0], [0, rise]], bars=[(0, 2), (1, 2)], k_bar=10.0)


def test_shallow_truss_snaps_through_at_the_folds_of_its_closed_form():
    path = equilibrium_path(truss(0.3), supports=held([0, 1]), loads={2: (0, -1.0)},
                            max_shortening=0.6)  # fmt: skip
    folds = [e for e in path.events if e.kind == "fold"]
    rest = np.hypot(1, 0.3)
    height = np.sqrt(rest ** (2 / 3) - 1)  # where d/dy of 2 k (l0/l - 1) y vanishes
    assert [f.shortening for f in folds] == pytest.approx([0.3 - height, 0.3 + height], rel=1e-10)
    y = 0.3 - path.shortening
    assert path.load == pytest.approx(20 * (rest / np.hypot(1, y) - 1) * y, abs=1e-11)


@pytest.mark.parametrize("branch", ["symmetric", "stable"])
def test_steep_truss_leaves_its_symmetric_path_at_the_pitchfork_only_where_asked(branch):
    path = equilibrium_path(truss(3.0), supports=held([0, 1]), loads={2: (0, -1.0)},
                            branch=branch, max_shortening=2.0)  # fmt: skip
    pitchfork = path.events[0]
    y = 3 - pitchfork.shortening
    assert pitchfork.kind == "bifurcation"
    assert np.sqrt(10) * y**2 == pytest.approx((1 + y**2) ** 1.5, rel=1e-12)
    sideways = np.abs(path.positions[-1][2, 0])
    assert (sideways > 0.5) == (branch == "stable")
    assert path.stable_height[-1] == (branch == "stable")


def ends(s, n=3):
    return list(range(n)), list(range(s.nodes - n, s.nodes))


@pytest.mark.parametrize(
    ("prism", "count", "load"),
    [
        (PRISM, 2, 0.28251548),
        (PRISM, 5, 0.0402757702),
        (Prism(1.0, 1.5, 0.02, 1.0, 10.0, 100.0), 1, 1.31479395530),
    ],
)
def test_columns_free_to_tilt_lose_stability_at_the_reference_loads(prism, count, load):
    s = prism.column(count)
    low, up = ends(s)
    path = equilibrium_path(s, supports=plates(low), loads={n: (0, 0, -1 / 3) for n in up},
                            branch="symmetric", max_load=1.1 * load)  # fmt: skip
    (lost,) = path.events
    assert (lost.kind, lost.note) == ("bifurcation", "2 modes at once")
    assert lost.load == pytest.approx(load, rel=2e-8 if count == 2 else 1e-9)


def test_uniform_column_is_the_chain_of_springs_up_to_its_guided_bow():
    s = PRISM.column(5)
    path = equilibrium_path(s, supports=plates(*ends(s)), branch="symmetric", max_load=0.2)
    (lost,) = path.events
    assert lost.load == pytest.approx(0.171078182676, rel=1e-9)
    tension = PRISM.potential().tension(-path.shortening / 5)
    assert np.abs(tension + path.load).max() < 1e-13


@pytest.mark.parametrize("chirality", ["alternate", "same"])
def test_units_on_plates_are_one_spring_each(chirality):
    s = PRISM.column(2, chirality, plates=True)
    low, up = ends(s)
    path = equilibrium_path(s, supports=plates(low, up), branch="symmetric", max_shortening=0.2)
    tension = PRISM.potential().tension(-path.shortening / 2)
    assert np.abs(tension + path.load).max() < 1e-13
    with pytest.raises(TensegrityError, match="statics only"):
        s.network()


def test_structure_of_a_prism_goes_slack_where_the_prism_path_makes_contact():
    s = PRISM.structure()
    path = equilibrium_path(s, supports=plates(*ends(s)), branch="symmetric")
    (contact,) = equilibrium_path(PRISM).events
    assert "contact" in kinds(path)
    assert path.events[-1].shortening == pytest.approx(contact.shortening, rel=1e-11)
    assert path.events[-1].load == pytest.approx(contact.load, rel=1e-10)


@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e9])
def test_paths_are_those_of_the_unit_structure_at_any_size(size, ball):
    small = ball.at(ball.positions * size, natural_lengths=ball.natural_lengths * size)
    path = equilibrium_path(small, supports=PLATES, max_shortening=size)
    assert path.end == "the requested shortening is reached"
    (load,) = loads_at(ball, [1.0])
    assert path.load[-1] / size == pytest.approx(load, rel=1e-12)


def test_a_bar_held_by_slack_strings_alone_is_refused():
    nodes = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1]]
    given = {"bars": [(0, 3)], "strings": [(1, 3), (2, 3)], "natural_lengths": [1.09, 2, 2]}
    s = equilibrium(Structure(nodes, **given), supports=held([0, 1, 2])).structure
    with pytest.raises(EquilibriumError, match="a motion is without stiffness at the start and"):
        equilibrium_path(s, supports=held([0, 1, 2]), loads={3: (0.1, 0.2, -1.0)}, max_load=1.0)


def test_unstressed_prism_whose_mechanism_has_no_stiffness_is_refused():
    s = Prism(1.0, 0.7, 0.0, 1.0, 5.0, 50.0).structure()
    with pytest.raises(EquilibriumError, match="no branch is determined; prestress"):
        equilibrium_path(s, supports=plates(*ends(s)))


def test_unstressed_truss_with_strings_starts_at_a_corner_with_those_taut_that_lengthen():
    nodes = [[-1, 0], [1, 0], [0, 1]]
    s = Structure(nodes, bars=[(0, 2), (1, 2)], strings=[(0, 1)], k_bar=10.0, k_string=1.0)
    path = equilibrium_path(s, supports=plates([0, 1], [2]), max_shortening=0.2)
    assert not path.slack.any()
    assert path.tensions[-1, 2] > 0


def test_table_slices_prints_and_writes(ball, tmp_path):
    path = equilibrium_path(ball, supports=PLATES, max_shortening=0.3)
    part = path[2:5]
    assert part.positions.shape == (3, 12, 3)
    assert part.tensions.shape == part.slack.shape == (3, 30)
    assert "equilibria" in str(path)
    path.to_csv(tmp_path / "path.csv")
    header = (tmp_path / "path.csv").read_text().splitlines()[0]
    assert header.startswith("shortening [m],load [N],stable_load,stable_height,")
    assert header.endswith(",tension of string 28 [N],tension of string 29 [N]")
    assert "tension of bar 5 [N]" in header


def test_bars_of_some_thickness_touch_before_their_axes_meet():
    strong = 2495.05288548
    thin = Prism.from_members(0.13, 0.08, 0.1623, strong / 0.13, strong / 0.08, 7.686e6 / 0.1623)
    path = equilibrium_path(thin)
    touch = bar_contact(path, diameter=8e-3)
    assert touch.load < 2901.509
    assert path.events[-1].load == pytest.approx(2901.509, rel=1e-6)
    s = thin.structure()
    full = equilibrium_path(s, supports=plates(*ends(s)), branch="symmetric")
    assert bar_contact(full, 8e-3).shortening == pytest.approx(touch.shortening, rel=1e-2)
    assert bar_contact(path, 1e-9 * touch.distance) is None or touch.shortening > 0
    finest = bar_contact(path[: touch_row(path, touch)], 8e-3)
    assert finest is None
    with pytest.raises(TensegrityError, match=r"must be a path of equilibria: equilibrium_path\("):
        bar_contact(thin, 8e-3)


@pytest.mark.parametrize("askew", [0.0, 1e-9, 1e-7, 1e-5, 1.0])
def test_distances_of_bars_are_the_least_of_all_points_of_both(askew, rng):
    """Against bounded least squares for the places on both; parallel, nearly so, and not."""
    x = rng.normal(size=(500, 4, 3))
    x[:, 3] = x[:, 2] + (x[:, 1] - x[:, 0]) * rng.normal(size=(500, 1))
    x[:, 3] += askew * rng.normal(size=(500, 3))
    exact = [
        lsq_linear(np.stack([b - a, c - d], axis=1), c - a, (0, 1), "bvls", tol=1e-15).fun
        for a, b, c, d in x
    ]
    np.testing.assert_allclose(
        distances(x, (0, 1, 2, 3)), np.linalg.norm(exact, axis=1), atol=1e-14
    )


def touch_row(path, touch):
    return int(np.searchsorted(path.shortening, touch.shortening))


def test_paths_that_make_no_sense_are_refused(ball):
    for wrong, words in (
        (lambda: equilibrium_path(ball), "needs supports"),
        (lambda: equilibrium_path(ball, supports=PLATES, min_height=0.1), "min_height does not"),
        (lambda: equilibrium_path(ball, supports=PLATES, branch="other"), "must be 'stable' or"),
        (lambda: equilibrium_path(ball, supports=plates([0, 4, 8])), "give loads"),
        (lambda: equilibrium_path(PRISM, supports=PLATES), "supports does not belong"),
        (lambda: equilibrium_path(ball, supports=PLATES, loads={}), "no direction"),
        (lambda: control_path(ball, {}), "must be a dict"),
        (lambda: control_path(ball, {40: 1.0}), "member 40"),
        (lambda: Prism(1.0, 0.7, 0.1, 1.0).column(), "must be finite"),
        (lambda: PRISM.column(chirality="left"), "chirality 'left' must be one of alternate, same"),
    ):
        with pytest.raises(TensegrityError, match=words):
            wrong()
    with pytest.raises(EquilibriumError, match="do work"):
        equilibrium_path(ball, supports=plates([0, 4, 8]), loads={3: (1.0, 0, 0)})


@pytest.mark.parametrize("part", [0.999, 0.9999])
def test_path_ends_on_its_own_branch_where_others_are_near(part):
    """Three units in a row reach their limit load together: uneven states begin next to it."""
    prism = Prism(1.0, 0.5, 0.4, 1.0, 5.0, 50.0)
    limit = part * next(e for e in equilibrium_path(prism).events if e.kind == "fold").load
    s = prism.column(3, plates=True)
    low, up = ends(s)
    path = equilibrium_path(s, supports=plates(low), loads={n: (0, 0, -1 / 3) for n in up},
                            branch="symmetric", max_load=limit)  # fmt: skip
    assert path.load[-1] == pytest.approx(limit, rel=1e-12)
    assert not path.events
    assert path.load == pytest.approx(-prism.potential().tension(-path.shortening / 3), abs=1e-11)


@pytest.mark.parametrize("guided", [False, True])
def test_column_with_plates_between_gives_way_where_one_unit_does(guided):
    prism = Prism(1.0, 1.5, 0.02, 1.0, 10.0, 100.0)
    loads = []
    for count in (1, 3):
        s = prism.column(count, plates=True)
        low, up = ends(s)
        path = equilibrium_path(s, supports=plates(low, up if guided else ()), max_load=1.5,
                                branch="symmetric",
                                loads={n: (0, 0, -1 / 3) for n in up})  # fmt: skip
        loads.append([e.load for e in path.events])
        assert path.load[-1] == pytest.approx(1.5, rel=1e-12)
    assert loads[1] == pytest.approx(loads[0], rel=1e-10)
    assert len(loads[0]) == (0 if guided else 1)


def test_of_several_stable_rays_the_lowest_is_followed():
    """Whatever their order; an unstable one only where there is no other."""

    def ray(slope, stable):
        return OutgoingBranch(np.array([True, False]), 1, slope, stable)

    low, high, unstable = ray(-2.0, True), ray(1.0, True), ray(-5.0, False)
    corner = np.array([0, 1])
    for found in ([low, high, unstable], [unstable, high, low]):
        assert selected(found, "stable", corner) is low
    assert selected([unstable], "stable", corner) is unstable
    assert selected([], "stable", corner) is None


def test_a_smooth_path_takes_few_points():
    """The predictor is of third order: one of second order takes 91."""
    structure = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0).structure(mass=1.0)
    path = equilibrium_path(structure, supports=plates([0, 1, 2], [3, 4, 5]), max_shortening=0.2)
    assert path.shortening[-1] == pytest.approx(0.2, rel=1e-12)
    assert len(path) < 50
