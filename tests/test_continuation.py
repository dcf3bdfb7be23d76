"""Arc-length continuation on branches known in closed form."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from tensegrity import Prism, Problem, TensegrityError, equilibrium_path, trace
from tensegrity.branches.continuation import INITIAL_ROWS, ContinuationError, Settings
from tensegrity.branches.folds import fold_problem, fold_start
from tensegrity.branches.problem import Branch


def planar(residual, **extra):
    """A problem in v and the parameter, with one number p."""
    z, p = ca.SX.sym("z", 2), ca.SX.sym("p")
    v, parameter = ca.vertsplit(z)
    expressions = {
        key: {name: f(v, parameter, p) for name, f in given.items()} for key, given in extra.items()
    }
    symbols = {"v": v, "parameter": parameter}
    return Problem(symbols, residual(v, parameter, p), p=p, **expressions)


CIRCLE = planar(
    lambda v, c, p: v**2 + c**2 - p,
    events={"half": lambda v, c, p: c - 0.5 + 0 * v, "below": lambda v, c, p: v + 0.9},
)
EXACT = 4e-16


def circle(radius=1.0, **settings):
    return trace(CIRCLE, [radius, 0.0], [radius**2], Settings(**settings), 1, ("below",))


def test_fold_of_a_circle_is_located_to_round_off():
    (fold,) = (e for e in circle().events if e.kind == "fold")
    assert abs(fold.parameter - 1) <= EXACT
    assert abs(fold.v) <= EXACT


def test_user_events_are_roots_to_round_off_and_come_in_order():
    branch = circle()
    assert [e.kind for e in branch.events] == ["half", "fold", "half", "below"]
    for event in branch.events:
        if event.kind == "half":
            assert abs(event.parameter - 0.5) <= EXACT
            assert abs(abs(event.v) - np.sqrt(0.75)) <= EXACT
    assert abs(branch.v[-1] + 0.9) <= EXACT


def test_every_row_solves_the_equations():
    branch = circle()
    assert branch.residual.max() <= 1e-12
    assert np.abs(branch.v**2 + branch.parameter**2 - 1).max() <= 1e-14


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_interpolation_error_is_what_was_asked_for(tolerance):
    branch = circle(tolerance=tolerance, turn=1.0)
    tangent = branch.tangent * np.cosh(np.arcsinh(branch.z))
    worst = 0.0
    for i in range(len(branch) - 1):
        length = branch.arc[i + 1] - branch.arc[i]
        u = np.linspace(0, 1, 11)[:, None]
        w = 1 - u
        z = np.arcsinh(branch.z[i : i + 2])
        cubic = w * w * (1 + 2 * u) * z[0] + u * u * (1 + 2 * w) * z[1]
        slopes = tangent[i : i + 2] / np.cosh(z)
        cubic = np.sinh(cubic + length * u * w * (w * slopes[0] - u * slopes[1]))
        worst = max(worst, np.abs(np.hypot(*cubic.T) - 1).max())
    assert 0.05 * tolerance <= worst <= 1.5 * tolerance


def test_rows_grow_like_the_fourth_root_of_the_tolerance():
    tolerances = 10.0 ** np.arange(-6, -13, -1)
    rows = [len(circle(tolerance=t, first=1e-3)) for t in tolerances]
    order = -np.polyfit(np.log(tolerances), np.log(rows), 1)[0]
    assert 0.2 <= order <= 0.27


def test_arc_length_is_that_of_the_curve_to_fourth_order():
    """A small circle, on which asinh is the identity to 1e-8."""
    radius = 1e-4
    problem = planar(
        lambda v, c, p: (v**2 + c**2) / p - 1, events={"end": lambda v, c, p: v + 0 * c}
    )
    settings = Settings(first=1e-6, largest=1e-5, tolerance=1)
    branch = trace(problem, [radius, 0.0], [radius**2], settings, 1, ("end",))
    assert branch.arc[-1] == pytest.approx(np.pi / 2 * radius, rel=2e-6)


@pytest.mark.parametrize("turn", [0.05, 0.2])
def test_tangents_of_neighbouring_rows_turn_no_more_than_asked(turn):
    tangents = circle(tolerance=1e3, turn=turn).tangent
    angles = np.arccos(np.clip((tangents[1:] * tangents[:-1]).sum(axis=1), -1, 1))
    assert 0.5 * turn < angles.max() <= turn * (1 + 1e-9)


def test_start_on_a_fold_is_an_event_there_and_no_hindrance():
    branch = trace(CIRCLE, [0.0, 1.0], [1.0], direction=-1, stop=("below",))
    assert branch.events[0].kind == "fold"
    assert branch.events[0].row == 0
    assert [e.kind for e in branch.events].count("fold") == 1
    assert branch.residual.max() <= 1e-12


SCENES = {
    "circle": lambda: circle(),
    "fine circle": lambda: circle(tolerance=1e-11),
    "many rows": lambda: circle(largest=2e-3),
    "start on a fold": lambda: trace(CIRCLE, [0.0, 1.0], [1.0], direction=-1, stop=("below",)),
    "start near it": lambda: trace(CIRCLE, [1.1, 0.1], [1.0], direction=1, stop=("below",)),
    "a soft prism": lambda: equilibrium_path(Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)),
    "into tension": lambda: equilibrium_path(Prism(1.0, 0.7, 0.1, 1.0, 2.0, 20.0), max_height=0.8),
    "without prestrain": lambda: equilibrium_path(Prism(1.0, 0.7, 0.0, 1.0, 2.0, 20.0)),
    "rigid bases": lambda: equilibrium_path(Prism(1.0, 0.3, 0.1, 1.0, k_bar=20.0)),
    "a pitchfork": lambda: trace(
        planar(
            lambda v, c, p: v**3 - c * v + 0 * p, events={"end": lambda v, c, p: c - 1 + 0 * v}
        ),
        [0.0, -1.0], [0.0], direction=1, stop=("end",),
    ),
}  # fmt: skip


def followed():
    """What comes out of all scenes: rows, events, and what failures say."""
    found = {}
    for name, scene in SCENES.items():
        branch = scene()
        events = [(e.kind, e.row, list(e.at.values())) for e in branch.events]
        found[name] = branch.end, [column.tolist() for column in branch.columns.values()], events
    for settings in ({"points": 5}, {"first": 0.05, "smallest": 0.04, "tolerance": 1e-9}):
        with pytest.raises(ContinuationError) as failure:
            circle(**settings)
        found[str(settings)] = str(failure.value), [[len(failure.value.branch)]], []
    return found


def test_a_start_beside_the_branch_meets_the_nearest_point_of_it():
    """On a helix of three unknowns: two equations, least-norm steps."""
    x, y, turn = (ca.SX.sym(name) for name in ("x", "y", "turn"))
    helix = Problem(
        {"x": x, "y": y, "turn": turn}, [x - ca.cos(turn), y - ca.sin(turn)],
        events={"end": turn - 3},
    )  # fmt: skip
    branch = trace(helix, [0.98, 0.23, 0.2], stop=("end",))
    scaled = [np.arcsinh(branch.z[0]), np.arcsinh([0.98, 0.23, 0.2])]
    along = branch.tangent[0]
    assert branch.residual[0] <= 1e-15
    assert abs(np.dot(scaled[0] - scaled[1], along)) <= 1e-3 * np.linalg.norm(scaled[0] - scaled[1])
    np.testing.assert_allclose(branch.x, np.cos(branch.turn), atol=1e-14)


def test_a_branch_outgrows_the_room_for_its_rows():
    branch = circle(largest=1e-3, first=1e-3)
    assert len(branch) > 4 * INITIAL_ROWS
    assert np.abs(branch.v**2 + branch.parameter**2 - 1).max() <= 1e-14
    assert [e.kind for e in branch.events] == ["half", "fold", "half", "below"]


def test_both_directions_meet_the_mirror_image():
    up, down = (trace(CIRCLE, [1.0, 0.0], [1.0], direction=d, stop=("below",)) for d in (1, -1))
    assert up.parameter[1] > 0 > down.parameter[1]
    assert np.allclose(up.v[-1], down.v[-1], atol=1e-15)
    assert np.allclose(up.parameter[-1], -down.parameter[-1], atol=1e-15)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-6])
def test_unfolded_pitchfork_never_jumps_to_the_other_branch(gap, tolerance):
    problem = planar(
        lambda v, c, p: v**3 - c * v - p, events={"end": lambda v, c, p: c - 1 + 0 * v}
    )
    branch = trace(problem, [0.0, -1.0], [gap], Settings(tolerance=tolerance), 1, ("end",))
    assert (branch.v > 0).all()
    assert abs(branch.v[-1] - max(np.roots([1, 0, -1, -gap]).real)) < 1e-9


def test_pitchfork_is_a_bifurcation_and_is_passed_straight():
    problem = planar(
        lambda v, c, p: v**3 - c * v + 0 * p, events={"end": lambda v, c, p: c - 1 + 0 * v}
    )
    branch = trace(problem, [0.0, -1.0], [0.0], direction=1, stop=("end",))
    (event,) = (e for e in branch.events if e.kind == "bifurcation")
    assert abs(event.parameter) < 1e-12
    assert np.abs(branch.v).max() == 0


def test_smallest_step_too_coarse_fails_with_the_last_good_point():
    problem = planar(
        lambda v, c, p: v**3 - c * v - p, events={"end": lambda v, c, p: c - 1 + 0 * v}
    )
    with pytest.raises(ContinuationError, match="last good point v ") as failure:
        trace(problem, [0.0, -1.0], [1e-4], Settings(first=0.05, smallest=0.04), 1, ("end",))
    branch = failure.value.branch
    assert isinstance(branch, Branch)
    assert branch.residual.max() <= 1e-12
    assert branch.parameter[-1] < 0.1


def test_end_that_is_never_reached_fails_and_keeps_the_rows():
    with pytest.raises(ContinuationError, match="50 rows do not reach an end") as failure:
        trace(CIRCLE, [0.5, 0.0], [0.25], Settings(points=50), 1, ("below",))
    assert len(failure.value.branch) == 50


def test_start_far_from_any_solution_is_refused():
    problem = planar(lambda v, c, p: v**2 + c**2 + 1 + 0 * p)
    with pytest.raises(ContinuationError, match="no solution near the start"):
        trace(problem, [1.0, 1.0], [0.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"start": [1.0]}, "1 start values and 1 parameters"),
        ({"start": [np.nan, 0.0]}, "not finite"),
        ({"direction": 0}, "direction 0"),
        ({"stop": ("nowhere",)}, "stop 'nowhere' is not among"),
    ],
)
def test_bad_input_is_refused_by_name(arguments, message):
    given = {"start": [1.0, 0.0], "parameters": [1.0]} | arguments
    with pytest.raises(TensegrityError, match=message):
        trace(CIRCLE, **given)


@pytest.mark.parametrize("name", ["tolerance", "residual", "first", "smallest", "turn"])
def test_settings_must_be_positive(name):
    with pytest.raises(TensegrityError, match=r"0 must be above 0"):
        Settings(**{name: 0.0})


# --- the inclined two-bar truss (half span 1, rise 0.5, bars of natural length L0) -------------

RISE = 0.5
NATURAL = np.hypot(1, RISE)


def truss(stiffness=1.0):
    """Apex height w under load P, pushed through a spring whose far end moves by `end`; its
    compliance is the one number."""
    z, p = ca.SX.sym("z", 3), ca.SX.sym("p")
    w, load, end = ca.vertsplit(z)
    length = ca.sqrt(1 + w**2)
    balance = 2 * stiffness * (NATURAL - length) * w / length - load
    reach = RISE - w + p * load - end
    return Problem(
        {"apex": w, "load": load, "end": end},
        [balance, reach],
        p=p,
        scale=(1.0, stiffness, 1.0),
        size=ca.vertcat(stiffness, 1.0),
        events={"through": w + RISE},
        folds={"fold": load, "turn": end},
    )


@pytest.mark.parametrize("stiffness", [1e-4, 1.0, 1e8])
def test_two_bar_truss_snaps_through_at_the_closed_form_load(stiffness):
    branch = trace(truss(stiffness), [RISE, 0, 0], [0.0], direction=1, stop=("through",))
    folds = [e for e in branch.events if e.kind == "fold"]
    length = np.cbrt(NATURAL)  # dP/dw = 0 where L^3 = L0
    apex = np.sqrt(length**2 - 1)
    limit = 2 * stiffness * (NATURAL - length) * apex / length
    assert len(folds) == 2
    for fold, sign in zip(folds, (1, -1), strict=True):
        assert abs(fold.apex - sign * apex) <= 1e-14
        assert abs(fold.load - sign * limit) <= 1e-13 * stiffness
    length = np.hypot(1, branch.apex)
    exact = 2 * stiffness * (NATURAL - length) * branch.apex / length
    assert np.abs(branch.load - exact).max() <= 1e-14 * stiffness


def test_truss_behind_a_soft_spring_snaps_back_where_the_closed_form_says():
    spring = 0.15
    branch = trace(truss(), [RISE, 0, 0], [1 / spring], direction=1, stop=("through",))
    turns = [e for e in branch.events if e.kind == "turn"]
    # d(end)/dw = 0: -1 + P'/spring = 0, with P' = 2 (L0/L^3 - 1)
    length = np.cbrt(NATURAL / (1 + spring / 2))
    apex = np.sqrt(length**2 - 1)
    assert len(turns) == 2
    assert np.allclose([e.apex for e in turns], [apex, -apex], rtol=1e-14)
    assert (np.diff(branch.columns["end"]) < 0).any()


def test_stiff_spring_does_not_snap_back():
    branch = trace(truss(), [RISE, 0, 0], [1 / 0.3], direction=1, stop=("through",))
    assert not [e for e in branch.events if e.kind == "turn"]


def test_fold_continued_in_a_second_parameter_draws_the_cusp():
    v, force, p = (ca.SX.sym(name) for name in ("v", "force", "p"))
    problem = Problem({"v": v, "force": force}, v**3 - p * v - force, p=p, events={"over": v - 1})
    first = trace(problem, [-1.0, 0.0], [1.0], direction=1, stop=("fold", "over"))
    start = fold_start(problem, first.events[-1], [1.0], 0)
    curve = replace(fold_problem(problem, "fold", 0), folds=None)
    branch = trace(curve, start, [2.0], direction=-1, stop=("end",))
    assert np.allclose(branch.force**2, 4 / 27 * branch.free**3, atol=1e-13)
    (cusp,) = (e for e in branch.events if e.kind == "fold")
    assert max(abs(cusp.v), abs(cusp.force), abs(cusp.free)) < 1e-12
    assert branch.free[-1] == pytest.approx(2, rel=1e-14)
    assert branch.force[0] * branch.force[-1] < 0  # both sides of the cusp


def test_root_passed_twice_within_one_step_is_found_on_both_sides_of_the_fold():
    below = 1e-9
    problem = planar(
        lambda v, c, p: v**2 + c**2 - p,
        events={"near": lambda v, c, p: c - (1 - below) + 0 * v, "end": lambda v, c, p: v + 0.9},
    )
    branch = trace(problem, [1.0, 0.0], [1.0], direction=1, stop=("end",))
    assert [e.kind for e in branch.events] == ["near", "fold", "near", "end"]
    exact = np.sqrt(1 - (1 - below) ** 2)
    assert np.allclose([branch.events[0].v, branch.events[2].v], [exact, -exact], rtol=1e-7)


def test_loose_tolerance_does_not_step_across_a_bend():
    """Beyond the bend the branch runs as before, so only the corrector's long way tells."""
    width = 0.01
    problem = planar(
        lambda v, c, p: v - 0.05 * (1 + ca.tanh((c - 1) / width)),
        events={"end": lambda v, c, p: c - 3 + 0 * v},
    )
    loose = Settings(tolerance=1e6, first=0.1, largest=0.1)
    branch = trace(problem, [0.0, 0.0], [0.0], loose, direction=1, stop=("end",))
    assert (np.abs(branch.parameter - 1) < width).sum() > 5


@pytest.mark.parametrize("step", np.linspace(0.2, 0.5, 13))
def test_events_lie_between_the_rows_that_they_are_told_to(step):
    """Newton's method, started near a peak of the event function, runs off to other roots."""
    problem = planar(
        lambda v, c, p: v,
        events={
            "wave": lambda v, c, p: ca.sin(10 * c) + 0.3 + 0 * v,
            "end": lambda v, c, p: c - 6 + 0 * v,
        },
    )
    even = Settings(first=step, largest=step)
    branch = trace(problem, [0.0, 0.0], [0.0], even, direction=1, stop=("end",))
    waves = [e for e in branch.events if e.kind == "wave"]
    assert waves
    for event in waves:
        low, high = branch.parameter[event.row : event.row + 2]
        assert low - 1e-12 <= event.parameter <= high + 1e-12
        assert abs(np.sin(10 * event.parameter) + 0.3) < 1e-13


# --- the table -------------------------------------------------------------------------------


def test_branch_indexes_and_slices_like_a_table():
    branch = circle()
    assert branch[3] == {"v": branch.v[3], "parameter": branch.parameter[3]}
    part = branch[2:8:2]
    assert len(part) == 3
    assert (part.v == branch.v[2:8:2]).all()
    assert (part.z == branch.z[2:8:2]).all()
    assert {e.kind for e in branch[:1].events} <= {"half"}
    assert len(list(branch)) == len(branch)
    with pytest.raises(AttributeError, match="no column 'w'"):
        branch.w  # noqa: B018


def test_events_of_a_slice_count_its_own_rows():
    branch = circle()
    for start, step in ((5, 1), (4, 2)):
        part = branch[start::step]
        assert part.events
        for event in part.events:
            (whole,) = (e for e in branch.events if e.at == event.at)
            assert start + step * event.row == whole.row
            assert part.v[event.row] == branch.v[whole.row]


def test_branch_prints_its_events_and_end():
    story = str(circle())
    assert "fold: v " in story
    assert story.endswith("ends: below")


def test_a_part_of_a_branch_says_whether_its_end_was_cut_off():
    branch = circle()
    assert branch[:-1].end == "end of the slice"
    assert branch[3:].end == branch[::-1].end == branch.end == "below"


def test_branch_writes_csv_that_reads_back_exactly(tmp_path):
    branch = circle()
    branch.to_csv(tmp_path / "b.csv")
    back = np.genfromtxt(tmp_path / "b.csv", delimiter=",", names=True)
    assert (back["v"] == branch.v).all()
    assert (back["parameter"] == branch.parameter).all()


def test_branch_plots_itself_with_its_events():
    import matplotlib

    matplotlib.use("Agg")
    axes = circle().plot(x="parameter", y="v")
    assert axes.get_xlabel() == "parameter"
    assert {t.get_text() for t in axes.get_legend().get_texts()} == {"half", "fold", "below"}
