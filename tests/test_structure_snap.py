"""Where a path of a structure goes on, and where it snaps: the octahedron at any prestrain.

Numbers with many digits are references from independent codes.  The energy here is written anew,
and minimised by SciPy over the 18 to 36 coordinates that a shortening leaves.
"""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import minimize
from structures import icosahedron, upright

from tensegrity import Structure, equilibrium, equilibrium_path, held, plates

LOW, UP = (0, 4, 8), (3, 7, 11)
PLATES = plates(LOW, UP)
WINDOW = 0.01045  # prestrain at which strings return within 1e-8 m of the pitchfork


def pairs(s):
    """The four pairs of opposite triangles of strings."""
    strings = {tuple(sorted(e)) for e in s.ends[s.bars :].tolist()}
    triangles = [t for t in combinations(range(12), 3) if {*combinations(t, 2)} <= strings]
    centre = {t: s.positions[list(t)].mean(axis=0) for t in triangles}
    return [(t, o) for t, o in combinations(triangles, 2) if np.allclose(centre[t], -centre[o])]


def how(kind, low, up):
    """Supports, and loads where no plate moves."""
    if kind == "plates":
        return {"supports": plates(low, up)}
    return {"supports": held(low) + (held(up, axes=(0, 1)) if kind == "guided" else held([])),
            "loads": {node: (0, 0, -1 / 3) for node in up}}  # fmt: skip


def octahedron(prestrain, kind="plates", pair=0):
    """It, and what it is followed with."""
    s = icosahedron(prestrain)
    low, up = pairs(s)[pair]
    return upright(s, (low, up)), how(kind, low, up)


def kinds(path):
    return [e.kind for e in path.events]


@pytest.fixture(scope="module")
def soft():
    return octahedron(0.01)[0]


def test_octahedron_of_low_prestrain_carries_the_reference_loads_beyond_its_pitchfork(soft):
    found = [equilibrium_path(soft, supports=PLATES, max_shortening=d) for d in (0.5, 0.9, 1.0)]
    wanted = [0.215884647407, 0.300049966721, 0.308082725197]
    assert [path.load[-1] for path in found] == pytest.approx(wanted, rel=2e-12)
    assert [path.slack[-1].sum() for path in found] == [3, 3, 3]
    assert all(path.stable_height.all() for path in found)


def test_octahedron_of_low_prestrain_slackens_once_and_three_strings_return_next_to_its_pitchfork(
    soft,
):
    path = equilibrium_path(soft, supports=PLATES, max_shortening=1.0)
    slack, pitchfork, back = path.events
    assert kinds(path) == ["slack", "bifurcation", "slack"]
    for event, at in ((slack, (0.385954757437, 0.175474764319)),
                      (pitchfork, (0.389500749022, 0.176836145223))):  # fmt: skip
        assert (event.shortening, event.load) == pytest.approx(at, rel=1e-11)
    assert 0 < back.shortening - pitchfork.shortening < 2e-6
    assert "taut again" in back.note
    x = path.shortening
    assert (path.slack[(x > slack.shortening) & (x < back.shortening)].sum(axis=1) == 6).all()


CASES = [(p, kind) for p in (0.003, 0.01, WINDOW, 0.03, 0.3) for kind in ("plates", "held")]


@pytest.mark.parametrize(("prestrain", "kind"), CASES)
def test_paths_on_all_four_pairs_of_triangles_are_one_path_without_a_snap(prestrain, kind):
    found = []
    for pair in range(4):
        s, given = octahedron(prestrain, kind, pair)
        path = equilibrium_path(s, max_shortening=1.1, **given)
        assert path.end == "the requested shortening is reached"
        assert path.stable_height.all()
        places = [e.shortening for e in path.events]
        assert (np.diff(places) > 1e-10).all()
        found.append((kinds(path), places, path.load[-1], path.slack[-1].sum()))
    for other in found[1:]:
        assert other[0] == found[0][0]
        assert other[1] == pytest.approx(found[0][1], rel=1e-9)
        assert other[2:] == pytest.approx(found[0][2:], rel=1e-12)


class Energy:
    """Of members at given shortening, in an orthonormal basis of what is left to move."""

    def __init__(self, path, supports, loads=None):
        s, count = path.structure, path.structure.nodes
        unit, force = np.eye(3 * count).reshape(count, 3, -1), np.zeros((count, 3))
        for node in supports.upper:
            force[node, 2] = -1 / len(supports.upper)
        for node, load in (loads or {}).items():
            force[node] = load
        fixed = [unit[n, a] for n, axes in supports.holds for a in (axes or range(3))]
        fixed += [unit[n, 2] for n in supports.lower]
        fixed += [unit[n, 2] - unit[supports.upper[0], 2] for n in supports.upper[1:]]
        if not supports.holds:  # the plates are smooth: sliding and turning in them
            slide = np.tile(np.eye(3)[:2, None], (1, count, 1)).reshape(2, -1)
            turn = np.cross([0, 0, 1], s.positions).reshape(1, -1)
            fixed += [*slide, *turn]
        self.force = force / np.sum(force**2)
        self.basis = np.linalg.svd([*fixed, force.ravel()])[2][len(fixed) + 1 :].T
        self.i, self.j = s.ends.T
        self.stiffness, self.natural = s.stiffnesses, s.natural_lengths
        self.string = np.arange(len(s.ends)) >= s.bars

    def __call__(self, x):
        apart = x[self.j] - x[self.i]
        length = np.linalg.norm(apart, axis=1)
        stretch = length - self.natural
        stretch = np.where(self.string, np.maximum(stretch, 0), stretch)
        pull = (self.stiffness * stretch / length)[:, None] * apart
        gradient = np.zeros_like(x)
        np.add.at(gradient, self.j, pull)
        np.subtract.at(gradient, self.i, pull)
        return np.sum(self.stiffness * stretch**2) / 2, self.basis.T @ gradient.ravel()

    def relaxed(self, x, amplitude, rng):
        """Energy and positions of the minimum from a perturbed start."""

        def at(c):
            return x + (self.basis @ c).reshape(x.shape)

        c = amplitude * rng.standard_normal(self.basis.shape[1])
        for _ in range(3):
            found = minimize(lambda c: self(at(c)), c, jac=True, method="BFGS",
                             options={"gtol": 1e-12, "maxiter": 4000})  # fmt: skip
            c = found.x
        return found.fun, at(c)

    def softest(self, x):
        """The lowest stiffness, by differences of the gradient [N/m]."""
        moves = 1e-6 * self.basis.T.reshape(-1, *x.shape)
        rows = [(self(x + move)[1] - self(x - move)[1]) / 2e-6 for move in moves]
        return np.linalg.eigvalsh(rows)[0]


@pytest.mark.parametrize(
    "prestrain",
    [0.003, WINDOW, *(pytest.param(x, marks=pytest.mark.slow) for x in (0.01, 0.1))],
)
@pytest.mark.parametrize("kind", ["plates", "held", "guided"])
def test_minima_next_to_each_state_are_the_next_state_of_the_path(prestrain, kind):
    """Also beyond each event, and whatever the path has made of it."""
    s, given = octahedron(prestrain, kind)
    path = equilibrium_path(s, max_shortening=1.1, **given)
    assert path.shortening[-1] == pytest.approx(1.1)
    energy, rng = Energy(path, **given), np.random.default_rng(0)
    assert 18 <= energy.basis.shape[1] <= 36
    for row in range(path.events[0].row - 1, len(path) - 1):
        further = path.shortening[row + 1] - path.shortening[row]
        wanted, _ = energy(path.positions[row + 1])
        start = path.positions[row] + further * energy.force
        found, _ = energy.relaxed(start, (1e-4, 3e-3)[row % 2], rng)
        assert -1e-11 < found - wanted < 1e-8


@pytest.mark.parametrize(
    ("prestrain", "kind", "words"),
    [
        (0.2, "held", "leaves this change of active set"),
        (0.01, "guided", "leaves this bifurcation"),
    ],
)
def test_a_structure_snaps_only_where_no_minimum_beyond_comes_near(prestrain, kind, words):
    s, given = octahedron(prestrain, kind)
    path = equilibrium_path(s, **given)
    assert path.end == f"no stable branch {words}: the structure snaps"
    assert path.stable_height.all()
    energy, rng, last = Energy(path, **given), np.random.default_rng(0), path.positions[-1]
    for beyond in (1e-4, 1e-6):
        away = []
        for amplitude in (1e-3, 1e-2, 3e-2):
            _, x = energy.relaxed(last + beyond * energy.force, amplitude, rng)
            if energy.softest(x) > 0:
                away.append(np.abs(x - last).max())
        assert min(away) > 0.05


def test_two_modes_are_lost_where_their_stiffness_vanishes():
    """Though a third one, nearly as soft, comes between on the way."""
    s, given = octahedron(0.1, "guided")
    path = equilibrium_path(s, **given)
    lost, basis = path.events[-1], Energy(path, **given).basis
    assert (lost.kind, lost.note) == ("bifurcation", "2 modes at once")
    tangent = s.at(path.positions[-1]).members.tangent(path.positions[-1])
    values = np.linalg.eigvalsh(basis.T @ (tangent @ basis))
    assert np.abs(values[:2]).max() < 1e-8
    assert values[2] > 1e-4


@pytest.mark.parametrize("half", [1e-3, 0.3])
def test_a_string_is_taut_again_however_soon_after_it_went_slack(half):
    """Its node passes the other end at a distance of 1 m; it is slack within `half` of that."""
    s = Structure([[0, 0], [-1, 1], [-3, 1]], strings=[(0, 1)], bars=[(1, 2)], k_bar=1.0,
                  natural_lengths=[2.0, np.hypot(1, half)], k_string=3.0)  # fmt: skip
    rail = held([0, 2]) + held([1], axes=[1])
    s = equilibrium(s, supports=rail).structure
    path = equilibrium_path(s, supports=rail, loads={1: (1.0, 0)}, max_shortening=2.0)
    assert [e.note for e in path.events] == ["string 1 slack", "string 1 taut again"]
    places = [s.positions[1, 0] + e.shortening for e in path.events]
    assert places == pytest.approx([-half, half], abs=1e-9)
    x = path.positions[-1, 1, 0]
    length = np.hypot(x, 1)
    pull = 3 * (length - np.hypot(1, half)) * x / length
    assert path.load[-1] == pytest.approx(pull + (x + 3 - 2), rel=1e-12)


def test_a_path_that_turns_back_ends_at_the_same_shortening_in_the_other_sense():
    """A truss that one spring pushes and the other, which is loaded, holds back."""
    nodes = [[-1, 0], [1, 0], [0, 0.5], [0, 2], [0, 3]]
    s = Structure(nodes, bars=[(0, 2), (1, 2), (2, 3), (2, 4)], k_bar=[10, 10, 0.3, 0.1],
                  natural_lengths=[1.25**0.5] * 2 + [1.5, 6.0])  # fmt: skip
    line = held([0, 1, 4]) + held([2, 3], axes=[0])
    s = equilibrium(s, supports=line + held([3])).structure
    path = equilibrium_path(s, supports=line, loads={3: (0, -1.0)}, max_shortening=1.5)
    assert kinds(path) == ["fold", "turn"]
    assert path.shortening[-1] == pytest.approx(-1.5, abs=1e-14)
    assert path.end == "the requested shortening is reached in the opposite sense"


def test_a_path_without_load_has_no_fold():
    """A string is drawn up from below two held ends, slack at first."""
    nodes = [[-1, 0], [0, 1.1], [1, 0], [0, -1], [0.1, 0.05], [0.3, 0.2], [-0.3, 2], [0.4, 2],
             [0.1, 2.3]]  # fmt: skip
    strings = [(0, 4), (1, 4), (2, 5), (3, 5), (4, 5), (5, 6), (4, 7), (6, 8), (7, 8)]
    s = Structure(nodes, strings=strings, k_string=[2, 1.7, 1.3, 1.1, 2, 2, 2, 3, 2],
                  natural_lengths=[0.8, 0.9, 0.5, 0.9, 0.2, 2.4, 2.5, 0.3, 0.25])  # fmt: skip
    ground = held([0, 1, 2, 3])
    s = equilibrium(s, supports=ground + held([6, 7])).structure
    rails = ground + plates([], [6, 7]) + held([6, 7], axes=[0])
    loads = {6: (0, 0.3), 7: (0, 0.7), 8: (0, 0.4)}
    path = equilibrium_path(s, supports=rails, loads=loads, max_shortening=0.6)
    assert np.abs(path.load[:3]).max() < 1e-15
    assert path.load[-1] > 0.1
    assert "fold" not in kinds(path)


@pytest.mark.parametrize("bars", [3, 4, 5, 6])
def test_an_apex_on_a_ring_of_bars_gives_way_sideways_and_snaps_on_three(bars):
    """Two modes at once: on three bars the energy has a cubic term, on five and more it hardly
    depends on the direction at first."""
    angle = 2 * np.pi * np.arange(bars) / bars
    base = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    s = Structure([*base, [0, 0, 3.0]], bars=[(n, bars) for n in range(bars)], k_bar=10.0)
    given = {"supports": held(range(bars)), "loads": {bars: (0, 0, -1.0)}}
    path = equilibrium_path(s, max_shortening=2.0, **given)
    assert kinds(path) == ["bifurcation"]
    assert ("snaps" in path.end) == (bars == 3)
    assert path.stable_height.all()
    energy, rng = Energy(path, **given), np.random.default_rng(0)
    if bars == 3:
        beyond = path.positions[-1] + 1e-6 * energy.force
        apexes = [energy.relaxed(beyond, 0.03, rng)[1][-1] for _ in range(6)]
        assert min(np.linalg.norm(x - beyond[-1]) for x in apexes) > 0.1
        return
    lowest = min(energy.relaxed(path.positions[-1], 1.0, rng)[0] for _ in range(5))
    assert energy(path.positions[-1])[0] == pytest.approx(lowest, abs=1e-9)
