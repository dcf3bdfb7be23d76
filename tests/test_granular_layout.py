"""Geometry of the branched guides: counts, angles, touching, closing."""

from itertools import pairwise

import numpy as np
import pytest

from granular.layout import diamond_layout, y_layout
from tensegrity import TensegrityError

D = 4.76e-3
THIRTY = np.pi / 6


@pytest.fixture(scope="module")
def half():
    return y_layout(19, 23, THIRTY, D)


@pytest.fixture(scope="module")
def full():
    return diamond_layout(19, 47, THIRTY, D)


def angle(layout, a, b, c):
    """Interior angle at bead b [deg]."""
    p, q = layout.positions[a] - layout.positions[b], layout.positions[c] - layout.positions[b]
    return np.degrees(np.arccos(p @ q / np.linalg.norm(p) / np.linalg.norm(q)))


def test_half_guide_has_65_beads_that_touch_their_neighbours(half):
    half.check()
    assert len(half.positions) == 65
    assert [len(half.parts[p]) for p in ("stem 1", "branch 1", "branch 2")] == [19, 23, 23]
    rows = [half.parts["stem 1"] + half.parts[f"branch {k}"] for k in (1, 2)]
    expected = {tuple(sorted(p)) for row in rows for p in pairwise(row)}
    expected.add((half.parts["branch 1"][0], half.parts["branch 2"][0]))
    assert {tuple(p) for p in half.contacts().tolist()} == expected


def test_full_guide_of_132_beads_closes(full):
    """19 + 2 x 47 + 19: both branches end on the bead that opens stem 2."""
    full.check()
    assert len(full.positions) == 132
    opening = full.parts["stem 2"][0]
    for k in (1, 2):
        row = full.parts["stem 1"] + full.parts[f"branch {k}"] + full.parts["stem 2"]
        steps = np.diff(full.positions[list(row)], axis=0)
        np.testing.assert_allclose(np.linalg.norm(steps, axis=1), D, rtol=1e-12)
    assert abs(full.positions[opening, 1]) < 1e-15
    assert len(full.contacts()) == 18 + 2 * 48 + 18 + 2  # stems, branches, beads side by side


def test_bends_of_the_guide_are_150_and_120_degrees(full):
    stem, branch, exit = (full.parts[p] for p in ("stem 1", "branch 1", "stem 2"))
    assert angle(full, stem[-2], stem[-1], branch[0]) == pytest.approx(150, abs=1e-10)
    assert angle(full, *branch[22:25]) == pytest.approx(120, abs=1e-10)  # the 24th bead
    assert angle(full, branch[-1], exit[0], exit[1]) == pytest.approx(150, abs=1e-10)


@pytest.mark.parametrize("make", [y_layout, diamond_layout])
def test_outer_walls_end_a_diameter_behind_the_last_beads_and_a_quarter_before_the_first(make):
    layout = make(19, 23, THIRTY, D)
    outer = [wall for wall in layout.walls if wall.name in ("upper wall", "lower wall")]
    exits = ["stem 2"] * 2 if "stem 2" in layout.parts else ["branch 1", "branch 2"]
    for side, last in zip(("upper", "lower"), exits, strict=True):
        walls = [wall for wall in outer if wall.name.startswith(side)]
        beads = layout.positions[[layout.parts[last][-1], layout.parts["stem 1"][0]]]
        ends = {"upper": ("start", "end"), "lower": ("end", "start")}[side]
        for bead, beyond, end in zip(beads, (1.0, 0.25), ends, strict=True):
            wall = walls[-1] if beyond == 1 else walls[0]
            outward = wall.along if end == "end" else -wall.along
            place = np.subtract(getattr(wall, end), bead) @ outward
            assert place == pytest.approx(beyond * D, rel=1e-12)


def test_other_counts_do_not_close():
    with pytest.raises(TensegrityError, match="odd"):
        diamond_layout(19, 68, THIRTY, D)


@pytest.mark.parametrize("make", [y_layout, diamond_layout])
def test_guide_is_its_own_mirror_image_to_the_last_bit(make):
    layout = make(19, 23, THIRTY, D)
    one, two = (layout.positions[list(layout.parts[f"branch {k}"])] for k in (1, 2))
    assert np.array_equal(one * [1, -1], two)


def test_walls_touch_every_bead_on_both_sides_but_those_at_the_junction(half, full):
    for layout, free in ((half, {18}), (full, {18, full.parts["stem 2"][0]})):
        bead, wall = layout.wall_contacts().T
        for b in range(len(layout.positions)):
            touched = [w for w in wall[bead == b] if not layout.walls[w].is_bevel]
            assert len(touched) == (0 if b in free else 2), layout.name(b)
            for number in touched:
                away, _ = layout.walls[number].place(layout.positions[b])
                assert away == pytest.approx(D / 2, rel=1e-10)


def test_walls_end_where_they_meet_and_leave_84_um_at_the_junction_bead(half):
    corners = np.array([p for w in half.walls if w.name == "upper wall" for p in (w.start, w.end)])
    distance = np.linalg.norm(corners, axis=1).min()
    assert distance - D / 2 == pytest.approx(D / 2 * (1 / np.cos(np.pi / 12) - 1), rel=1e-9)
    assert 83e-6 < distance - D / 2 < 85e-6


def test_walls_that_run_on_touch_the_junction_bead():
    layout = y_layout(19, 23, THIRTY, D, through=D / 4)
    layout.check()
    assert (layout.wall_contacts()[:, 0] == 18).sum() == 4


def test_gap_moves_the_walls_and_nothing_else(half):
    wide = y_layout(19, 23, THIRTY, D, gap=0.12e-3)
    assert np.array_equal(wide.positions, half.positions)
    assert np.array_equal(wide.wall_contacts(), half.wall_contacts())
    flat = [(b, w) for b, w in wide.wall_contacts() if not wide.walls[w].is_bevel]
    away = [wide.walls[w].place(wide.positions[b])[0] for b, w in flat]
    np.testing.assert_allclose(away, D / 2 + 0.12e-3, rtol=1e-10)


def test_edges_of_the_walls_are_bevelled_towards_the_junction_bead(half, full):
    for layout, count in ((half, 2), (full, 4)):
        listed = [(b, w) for b, w in layout.wall_contacts() if layout.walls[w].is_bevel]
        assert len(listed) == count
        for bead, number in listed:
            bevel, (one, two) = layout.walls[number], layout.walls[number - 2 : number]
            _, along = bevel.place(layout.positions[bead])
            assert along == pytest.approx(bevel.length / 2, rel=1e-9)
            edge = np.add(bevel.start, bevel.end) / 2
            for wall in (one, two):  # both end at the edge
                ends = np.linalg.norm(np.subtract([wall.start, wall.end], edge), axis=1)
                assert ends.min() < 1e-12
            gap = layout.wall_gaps()[layout.wall_contacts().tolist().index([bead, number])]
            assert gap == pytest.approx(D / 2 * (1 / np.cos(np.pi / 12) - 1), rel=1e-9)


@pytest.mark.parametrize("degrees", [5, 20, 30, 45, 75])
def test_beads_of_any_half_angle_neither_overlap_nor_leave_the_guide(degrees):
    layout = y_layout(5, 6, np.radians(degrees), D)
    layout.check()
    steps = np.diff(layout.positions[list(layout.parts["branch 1"])], axis=0)
    np.testing.assert_allclose(np.arctan2(*steps.T[::-1]), np.radians(degrees), rtol=1e-12)


def test_end_walls_stop_the_last_beads(full):
    stopped = full.stopped(["stem 2"])
    stopped.check()
    (extra,) = set(map(tuple, stopped.wall_contacts())) - set(map(tuple, full.wall_contacts()))
    assert extra == (131, len(full.walls))
    np.testing.assert_allclose(stopped.walls[-1].normal, [-1, 0], atol=1e-15)


def test_overlapping_beads_and_beads_outside_are_named(half):
    from dataclasses import replace

    moved = half.positions.copy()
    moved[3, 0] += 1e-5
    with pytest.raises(TensegrityError, match=r"bead 4 of stem 1 and bead 5 .* overlap by 1e-05 m"):
        replace(half, positions=moved).check()
    moved = half.positions.copy()
    moved[3, 1] += 2e-6  # through the upper wall, and a little away from its neighbours
    with pytest.raises(TensegrityError, match=r"bead 4 of stem 1 is outside .*2e-06 m beyond"):
        replace(half, positions=moved).check()


def test_branches_of_a_diamond_that_would_overlap_are_refused():
    with pytest.raises(TensegrityError, match=r"half angle 0\.3 must be at least 0\.5235"):
        diamond_layout(19, 47, 0.3, D)
