"""Statics of structures: self-stress, mechanisms, tangent, equilibria with slack strings.

Numbers with many digits are references from independent codes.
"""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from structures import cross, icosahedron, upright

from tensegrity import (
    EquilibriumError,
    Prism,
    Structure,
    TensegrityError,
    equilibrium,
    held,
    plates,
)
from tensegrity.structures.supports import rigid_motions


@pytest.fixture(scope="module")
def ball():
    return icosahedron()


def test_icosahedron_has_one_self_stress_and_one_mechanism(ball):
    stress = ball.self_stress()
    assert stress.states.shape == (1, 30)
    assert (stress.states[0, 6:] > 0).all()
    assert ball.mechanisms().shape == (1, 12, 3)
    q = stress.feasible
    assert np.allclose(q[:6] / q[6], -1.5, rtol=1e-13)
    assert np.allclose(q[6:], q[6], rtol=1e-13)
    assert np.mean(np.abs(q)) == pytest.approx(1, rel=1e-12)


def test_mechanisms_stretch_nothing_and_are_not_rigid(ball):
    (motion,) = ball.mechanisms()
    step = 1e-6
    longer = ball.at(ball.positions + step * motion).lengths - ball.lengths
    assert np.abs(longer).max() < 10 * step**2
    assert np.abs(motion.sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(ball.positions, motion).sum(axis=0)).max() < 1e-11


def test_tangent_of_icosahedron_has_the_reference_eigenvalues(ball):
    found = ball.modes(8).eigenvalues
    wanted = [0.363473298133617, *[0.417521854301] * 3, *[0.618876833957] * 3, 1.0]
    assert found == pytest.approx(wanted, rel=1e-11)
    assert ball.is_stable()


@pytest.mark.parametrize(
    ("dim", "wanted"), [(2, [1.8181818181818181]), (3, [0.36363636363636365, 1.8181818181818181])]
)
def test_planar_cross_is_asked_for_its_dimension(dim, wanted):
    s = cross(dim)
    assert s.modes(len(wanted)).eigenvalues == pytest.approx(wanted, rel=1e-12)
    assert len(s.mechanisms()) == dim - 2


def test_tangent_is_the_second_difference_of_the_energy(ball, rng):
    x = ball.positions + 0.2 * rng.normal(size=ball.positions.shape)
    matrix = ball.at(x).stiffness()
    assert abs(matrix - matrix.T).max() < 1e-13 * abs(matrix).max()
    energy = ball.members.energy
    for motion in rng.normal(size=(4, 12, 3)):
        d = 1e-4 * motion / np.linalg.norm(motion)
        second = (energy(x + d) - 2 * energy(x) + energy(x - d)) / 1e-8
        assert second == pytest.approx(motion.ravel() @ (matrix @ motion.ravel())
                                       / np.sum(motion**2), rel=1e-5)  # fmt: skip


def test_prestressed_shape_is_in_equilibrium_and_one_without_stress_is_not_stable(ball):
    assert np.abs(ball.members.gradient(ball.positions)).max() < 1e-12
    loose = icosahedron(prestrain=None)
    assert not loose.tensions.any()
    assert not loose.slack.any()
    assert not loose.is_stable()


def test_frequencies_weigh_each_node_by_its_mass(ball):
    heavy = ball.at(ball.positions, mass=np.arange(1.0, 13.0))
    modes = heavy.modes(5)
    weights = np.repeat(heavy.mass, 3)
    for frequency, shape in zip(modes.frequencies, modes.shapes, strict=True):
        v = shape.ravel()
        assert np.linalg.norm(heavy.stiffness() @ v - frequency**2 * weights * v) < 1e-12
        assert np.sqrt(np.sum(shape**2, axis=1)).max() == pytest.approx(1)
    assert modes.eigenvalues == pytest.approx(ball.modes(5).eigenvalues, rel=1e-12)


@pytest.mark.parametrize(
    "supports", [None, held([0, 1], axes=[1]) + held([5]), plates([0, 4], [3, 7], (1, -2, 0.5))]
)
def test_modes_on_supports_are_those_of_the_permitted_motions(ball, supports):
    """Of the generalised problem on a basis of them, without the rigid ones of stiffness 0."""
    heavy = ball.at(ball.positions, mass=np.geomspace(1.0, 50.0, 12))
    freedom, mass = heavy.freedom(supports), np.repeat(heavy.mass, 3)
    basis = freedom.motions.toarray()
    weights = basis.T @ (mass[:, None] * basis)
    squares = eigh(basis.T @ heavy.stiffness() @ basis, weights, eigvals_only=True)
    wanted = np.sqrt(squares[freedom.rigid.shape[1] :][:6])
    assert heavy.modes(6, supports).frequencies == pytest.approx(wanted, rel=1e-11)


def test_large_structures_have_the_modes_of_their_stiffness():
    """Where few of many are sought, by a sparse method: free, and held."""
    tower = Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0).column(200)
    wanted = np.linalg.eigvalsh(tower.stiffness().toarray())
    found = tower.modes(6).eigenvalues
    assert found[found > 0] == pytest.approx(wanted[6:12], rel=1e-6)
    free = np.arange(9, 3 * len(tower.positions))
    wanted = np.linalg.eigvalsh(tower.stiffness().toarray()[np.ix_(free, free)])
    assert tower.modes(3, held([0, 1, 2])).eigenvalues == pytest.approx(wanted[:3], rel=1e-6)


def test_modes_of_the_unstable_come_first(ball):
    pushed = ball.at(ball.positions, natural_lengths=ball.lengths * 1.1)  # bars push
    wanted = np.linalg.eigvalsh(pushed.stiffness().toarray())
    assert wanted[1] < 0
    assert pushed.modes(2).eigenvalues == pytest.approx(wanted[:2], rel=1e-9)


def test_tower_of_3003_nodes_bends_as_a_beam():
    """Free beams: eigenvalues as the fourth powers of the roots of cosh x cos x = 1, in pairs."""
    s = Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0).column(1000)
    modes = s.modes(6)
    roots = [brentq(lambda x: np.cosh(x) * np.cos(x) - 1, a, a + 2) for a in (4, 7, 10)]
    wanted = np.repeat((np.array(roots) / roots[0]) ** 4, 2)
    assert modes.eigenvalues / modes.eigenvalues[0] == pytest.approx(wanted, rel=1e-3)
    stiffness, shapes = s.stiffness(), modes.shapes.reshape(6, -1)
    for value, shape in zip(modes.eigenvalues, shapes, strict=True):
        assert np.abs(stiffness @ shape - value * shape).max() < 1e-13 * abs(stiffness).max()
    assert np.abs(shapes @ rigid_motions(s.positions)).max() < 1e-6


def test_relaxed_shape_is_that_of_its_natural_lengths(ball, rng):
    moved = ball.at(ball.positions + 0.1 * rng.normal(size=ball.positions.shape))
    found = moved.relaxed()
    assert np.allclose(found.lengths, ball.lengths, rtol=1e-12)
    assert not found.slack.any()


def test_loads_may_leave_strings_slack_and_forces_balance_then(ball):
    s = upright(ball)
    state = equilibrium(s, {n: (0, 0, -0.5) for n in (3, 7, 11)}, plates([0, 4, 8]))
    assert state.slack.any()
    assert state.stable
    assert np.abs(state.reactions.sum(axis=0) - [0, 0, 1.5]).max() < 1e-11
    assert np.abs(state.reactions[[1, 2, 3, 5, 6, 7, 9, 10, 11]]).max() < 1e-11
    assert (state.tensions[6:] >= 0).all()
    assert not state.tensions[state.slack].any()


def test_equilibria_without_supports_need_loads_in_balance(ball):
    pulled = {0: (0, 0.1, 0), 3: (0, -0.1, 0), 1: (0, 0, 0)}
    with pytest.raises(EquilibriumError, match=r"net force \(0, 0, 0\) N, net moment"):
        equilibrium(ball, pulled)
    with pytest.raises(EquilibriumError, match=r"translation.*net force \(0, 0, -0.1\) N"):
        equilibrium(ball, {0: (0, 0, -0.1)})
    far = ball.positions[2] - ball.positions[0]
    state = equilibrium(ball, {0: tuple(-0.1 * far), 2: tuple(0.1 * far)})
    assert state.stable


def test_sliding_between_smooth_plates_is_no_error(ball):
    s = upright(ball)
    state = equilibrium(s, {n: (0, 0, -0.1) for n in (3, 7, 11)}, plates([0, 4, 8], [3, 7, 11]))
    heights = state.positions[:, 2]
    assert np.ptp(heights[[0, 4, 8]]) < 1e-14
    assert np.ptp(heights[[3, 7, 11]]) < 1e-14


def test_prestress_by_strings_and_by_force_densities_agree(ball):
    q = ball.densities
    loose = icosahedron(prestrain=None)
    same = loose.prestressed(force_densities=q)
    assert np.allclose(same.natural_lengths, ball.natural_lengths, rtol=1e-14)
    assert np.allclose(same.tensions, ball.tensions, rtol=1e-11)
    assert (ball.lengths / ball.natural_lengths)[6:] == pytest.approx(1.1, rel=1e-13)


@pytest.mark.parametrize("off", [1e-2, 1e-3, 1e-6])
def test_measured_shape_has_no_self_stress_but_a_near_form_has(off, rng):
    turn = 5 * np.pi / 6 + off
    angles = 2 * np.pi / 3 * np.arange(3)
    nodes = np.array([(np.cos(a), np.sin(a), 0) for a in angles]
                     + [(np.cos(a + turn), np.sin(a + turn), 1.3) for a in angles])  # fmt: skip
    s = Structure(
        nodes,
        bars=[(i, 3 + i) for i in range(3)],
        strings=[(i, 3 + (i + 2) % 3) for i in range(3)]
        + [(level + i, level + (i + 1) % 3) for level in (0, 3) for i in range(3)],
    )
    stress = s.self_stress()
    assert len(stress.states) == 0
    assert stress.gap == pytest.approx(0.35 * off, rel=0.2)
    with pytest.raises(EquilibriumError, match="smallest singular value"):
        _ = stress.feasible
    with pytest.raises(EquilibriumError, match="smallest singular value"):
        s.prestressed(prestrain={3: 0.1})
    near = s.nearest_form()
    assert len(near.self_stress().states) == 1
    moved = np.linalg.norm(near.positions - nodes)
    assert 0 < moved < 2 * off
    for _ in range(20):  # no other form nearby is nearer
        again = s.at(nodes + 0.5 * off * rng.normal(size=nodes.shape), natural_lengths=None)
        other = again.nearest_form()
        assert np.linalg.norm(other.positions - nodes) >= moved * (1 - 1e-6)


def test_two_states_of_self_stress_need_two_prestrains():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1.0]]
    strings = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4), (0, 2)]
    s = Structure(square, bars=[(1, 3)], strings=strings)
    count = len(s.self_stress().states)
    with pytest.raises(TensegrityError, match=f"must be of {count}"):
        s.prestressed(prestrain={m: 0.1 for m in range(1, 2 + count)})


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_plates_have_the_direction_of_their_normal_however_long_it_is(size, ball):
    both = (plates([0, 4, 8], [3, 7, 11], normal=(0, x, x)) for x in (1.0, size))
    one, other = (equilibrium(ball, {3: (0.1, 0, 0), 7: (-0.1, 0, 0)}, s) for s in both)
    assert np.array_equal(one.positions, other.positions)


NODES = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"bars": [(0, 1)], "strings": [(1, 2)], "k_bar": 1.0, "EA_bar": 1.0},
            "k_bar and EA_bar are both given",
        ),
        ({"bars": [(0, 1)], "strings": [(1, 2)], "EA_string": -1.0}, "EA_string -1 N must be fin"),
        ({"bars": [(0, 1), (1, 2)], "EA_bar": [1.0]}, "EA_bar has shape"),
        (
            {"bars": [(0, 1), (1, 2)], "EA_bar": 1e-300, "natural_lengths": [1e300] * 2},
            "has EA 1e-300 N",
        ),
        ({"bars": [(0, 1)]}, "node 2 is in no member"),
        ({"bars": [(0, 1), (1, 1)], "strings": [(1, 2)]}, "joins node 1 to itself"),
        ({"bars": [(0, 3)]}, "node 3 of a bar must be below 3"),
        ({"bars": [(0, 1, 2)]}, "must join two nodes"),
        ({"bars": [(0, 1)], "strings": [(1, 2)], "k_string": 0.0}, "k_string 0 N/m must be finite"),
        ({"bars": [(0, 1)], "strings": [(1, 2)], "k_bar": [1.0, 2.0]}, "k_bar has shape"),
        ({"positions": [[0, 0], [1, 0, 0]], "bars": [(0, 1)]}, "not made of numbers"),
        ({"positions": [[0.0], [1.0]], "bars": [(0, 1)]}, "must be \\(nodes, 2\\) or 3"),
        ({"positions": [[0, 0], [0, 0], [1, 0]], "bars": [(0, 1), (1, 2)]}, "length 0 m"),
        (
            {"positions": [[0, 0], [1e200, 0]], "bars": [(0, 1)]},
            "length inf m, must be above 0 and",
        ),
        ({"bars": [(0, 1), (1, 2)], "platforms": [[0], []]}, "platform 1 has 0 nodes"),
        ({"bars": [(0, 1), (1, 2)], "natural_lengths": [1.0]}, "natural length has shape"),
        ({"bars": [(0, 1), (1, 2)], "natural_lengths": [1.0, -1.0]}, "natural length -1 m"),
        ({"bars": [(0, 1), (1, 2)], "mass": [1.0, 1.0, 0.0]}, "mass 0 kg"),
    ],
)
def test_what_is_no_structure_is_refused(given, words):
    with pytest.raises(TensegrityError, match=words):
        Structure(**({"positions": NODES} | given))


def test_supports_and_numbers_that_do_not_exist_are_refused(ball):
    for wrong, words in (
        (lambda: ball.modes(2, held([12])), "node 12 must be below 12"),
        (lambda: held([0, 0]), "held node 0 is given twice"),
        (lambda: plates([0, 1], [1, 2]), "node 1 is on both plates"),
        (lambda: plates([0], [1], normal=(0, 0, 0)), "vector other than 0"),
        (lambda: ball.modes(2, "held"), "made by held"),
        (lambda: ball.prestressed(prestrain={0: 0.1}), "strings are numbered from 6 to 29"),
        (lambda: ball.prestressed(), "give one of force_densities, prestrain"),
        (lambda: ball.prestressed(force_densities=np.ones(30)), "are no self-stress"),
        (lambda: ball.prestressed(prestrain={6: 0.1, 7: 0.1}), "must be of 1"),
        (lambda: ball.prestressed(prestrain={6: -0.1}), "strings do not push"),
        (lambda: ball.prestressed(force_densities=-ball.densities), "strings do not push"),
        (lambda: equilibrium(ball, {12: (0, 0, 1)}), "loaded node 12"),
    ):
        with pytest.raises(TensegrityError, match=words):
            wrong()


@pytest.mark.parametrize(
    ("supports", "platforms"),
    [
        (held([0, 1], axes=[1]) + held([5]), ()),
        (plates([0, 4, 8], [3, 7, 11]), ()),
        (plates([0, 4, 8], [3, 7], normal=(1, -2, 0.5)) + held([0]), ()),
        (held([0, 4]), ([1, 2, 3, 5], [6, 7])),
    ],
)
def test_motions_that_supports_and_platforms_leave_are_orthonormal(supports, platforms):
    motions = supports.motions(12, 3, platforms).toarray()
    assert motions.T @ motions == pytest.approx(np.eye(motions.shape[1]), abs=1e-14)
    by_node = motions.reshape(12, 3, -1)
    assert not by_node[[n for n, axes in supports.holds if axes is None]].any()
    across = by_node.transpose(0, 2, 1) @ supports.direction(3)
    for group in (*platforms, supports.upper or [11]):
        assert np.ptp(across[list(group)], axis=0).max() < 1e-15
    assert np.abs(across[list(supports.lower)]).max(initial=0) < 1e-15


def test_motions_without_stiffness_have_frequencies_that_are_zero_not_round_off():
    found = icosahedron(prestrain=None).modes(3)
    assert found.frequencies[0] == found.eigenvalues[0] == 0
    assert (found.frequencies[1:] > 0.1).all()


def test_natural_lengths_that_leave_all_slack_are_refused(ball):
    longer = ball.at(ball.positions, natural_lengths=np.where(ball.is_string, 3.0, 4.0))
    with pytest.raises(EquilibriumError, match="all members without stress"):
        longer.relaxed()


def test_bars_alone_that_push_out_of_a_plane_are_unstable():
    s = Structure([[0, 0], [1, 0.2], [2, 0]], bars=[(0, 1), (1, 2)])
    supports = held([0, 2])
    assert s.is_stable(supports)
    state = equilibrium(s, {1: (0, -1.0)}, supports)
    assert state.stable
    assert not s.at([[0, 0], [1, 1e-9], [2, 0]]).is_stable(supports)
