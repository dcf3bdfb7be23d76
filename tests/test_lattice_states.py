"""Lattices: counts of self-stress and mechanisms, states under macroscopic strain, cut-outs."""

import math
import pickle

import numpy as np
import pytest
from lattices import CASES, lattice, values

from tensegrity import EquilibriumError, Lattice, TensegrityError, bands, catalogue, moduli

SQUARE = {"positions": [(0, 0)], "vectors": [(1, 0), (0, 1)]}
COUNTS = {  # self-stress and mechanisms, without and with macroscopic strain
    "3-column-alternate": (4, 4, 0, 1),
    "3-column-same": (7, 6, 3, 3),
    "4-strip": (3, 2, 0, 0),
    "5-octahedra-1.0-0.1": (8, 5, 5, 8),
}


@pytest.mark.parametrize("name", COUNTS)
def test_self_stress_and_mechanisms_have_the_counts_of_the_matrices(name):
    of = lattice(name)
    states = [len(of.self_stress(strain=s).states) for s in (False, True)]
    motions = [len(of.mechanisms(strain=s)) for s in (False, True)]
    assert (*states, *motions) == COUNTS[name]
    d, m = len(of.vectors), len(of.ends)
    trivial = of.rigid_motions().shape[1]
    assert trivial == {(1, 3): 4, (1, 2): 2, (3, 3): 3}[d, of.dim]
    assert of.nodes * of.dim - m == motions[0] + trivial - states[0]
    whole = of.dim + of.dim * (of.dim - 1) // 2
    assert (of.nodes + d) * of.dim - m == motions[1] + whole - states[1]


@pytest.mark.parametrize("name", COUNTS)
def test_waves_of_no_phase_that_need_no_force_are_rigid(name):
    of = lattice(name)
    zero = np.sum(bands(of, np.zeros((1, len(of.vectors)))).frequencies == 0)
    assert zero == of.rigid_motions().shape[1]


def test_stress_free_self_stress_leaves_no_macroscopic_stress():
    of = lattice("5-octahedra-1.0-0.1")
    states = of.self_stress(strain=True).states
    d = of.members.separations(of.positions)[0]
    for q in states:
        assert np.abs((q[:, None] * d).T @ of.shift).max() < 1e-12
        assert of.self_stress(strain=False).states @ q @ (
            of.self_stress(strain=False).states @ q
        ) == pytest.approx(1)
    assert np.abs(of.stress).max() < 1e-14


def test_gradient_and_hessian_are_derivatives_of_the_energy():
    of = lattice("4-strip").equilibrium(np.diag([1.04, 1]))
    rows, h = np.vstack([of.positions, of.vectors]), 1e-5

    def energy(x):
        moved = of.at(x[:2], x[2:])
        return moved.members.energy(moved.positions)

    steps = h * np.eye(rows.size).reshape(-1, *rows.shape)
    second = [[(energy(rows + a + b) - energy(rows + a - b) - energy(rows - a + b)
                + energy(rows - a - b)) / (4 * h * h) for b in steps] for a in steps]  # fmt: skip
    assert np.abs(of.hessian() - second).max() < 1e-4
    slope = [(energy(rows + a) - energy(rows - a)) / (2 * h) for a in steps[4:]]
    assert np.allclose(np.outer(slope, of.vectors[0]) / of.size, of.stress, atol=1e-9)


def test_strip_of_x_modules_under_stretch():  # B12
    for stretch, force, height, *tensions in values("12-strip")["rows"]:
        of = lattice("4-strip").equilibrium(np.diag([stretch, 1.0]))
        assert of.stress[0, 0] == pytest.approx(force, rel=1e-11)
        assert np.ptp(of.positions[:, 1]) == pytest.approx(height, rel=1e-11)
        found = of.tensions[[2, 3, 4, 0, 1]]
        assert np.allclose(found, tensions, atol=1e-12)
        assert of.slack.tolist() == [False] * 2 + [stretch < 0.909] * 2 + [False]


def test_columns_under_strain_have_the_force_of_the_condensed_prism():  # B12
    column = lattice("3-column-alternate")
    for stretch, force in ((0.97, -0.0472467257141), (0.94, -0.1002588394675),
                           (1.03, 0.0448604116629)):  # fmt: skip
        state = column.equilibrium(np.diag([1, 1, stretch]))
        assert state.stress[2, 2] == pytest.approx(force, rel=1e-10)


@pytest.mark.parametrize("row", values("12-octahedra")["rows"])
def test_octahedra_under_compression(row):  # B12
    strain, load, axial, lateral, buckled, modulus = row
    start = lattice("5-octahedra-1.0-0.1", buckling=load)
    state = start.equilibrium(np.diag([1, 1, 1 - strain]))
    nominal = np.diag(state.stress) * [1 - strain, 1 - strain, 1]
    assert np.allclose(nominal, [lateral, lateral, axial], rtol=1e-8)
    assert state.buckled.sum() == buckled
    assert moduli(state).tangent[2, 2, 2, 2] == pytest.approx(modulus, rel=1e-7)


@pytest.mark.parametrize("row", values("5-phases")["rows"])
def test_phases_of_octahedra_against_prestrain(row):  # B5
    """Strings shortened by 1/(1 + mu), at free lattice vectors: bars buckle from mu_c on."""
    mu, scale, buckled, c11, c12, c44, *speeds = row
    made = catalogue.octahedra(1.0, 0.0, 20).at
    start = catalogue.octahedra(1.0, 0.0, 20)
    lengths = np.where(start.is_string, start.lengths / (1 + mu), start.lengths)
    state = made(start.positions * scale, start.vectors * scale, natural_lengths=lengths,
                 buckling=0.02).equilibrium()  # fmt: skip
    assert np.allclose(state.lengths / start.lengths, scale, rtol=1e-10)
    assert (state.buckled == (~state.is_string & buckled)).all()
    found = moduli(state)
    a = found.tangent
    wanted = [c11, c12, c44]
    close = np.array([a[0, 0, 0, 0], a[0, 0, 1, 1], a[0, 1, 0, 1]])
    assert np.allclose(close, wanted, rtol=1e-7)
    c = found.speeds([1, 0, 0])
    assert np.allclose(np.sort(c), np.sort([*speeds, speeds[1]]), rtol=1e-7)
    assert (mu > values("5-phases")["mu_critical"]) == buckled


def test_energy_of_buckled_bars_has_the_forces_as_derivatives():
    """On both sides of the load, with and without stiffness beyond it."""
    for plateau in (0.0, 0.3):
        for height in (0.999, 0.95):
            of = lattice("4-strip", buckling=0.2, plateau=plateau).at([(0, 0), (0, height)])
            x, h = of.positions, 1e-6
            for n, k in ((0, 0), (1, 1)):
                step = np.zeros_like(x)
                step[n, k] = h
                slope = (of.members.energy(x + step) - of.members.energy(x - step)) / (2 * h)
                assert of.members.gradient(x)[n, k] == pytest.approx(slope, abs=1e-8)
            second = np.zeros((4, 4))
            for n in range(4):
                step = np.zeros(4)
                step[n] = h
                step = step.reshape(2, 2)
                each = [of.members.gradient(x + s * step).ravel() for s in (1, -1)]
                second[:, n] = (each[0] - each[1]) / (2 * h)
            assert np.abs(of.hessian()[:4, :4] - second).max() < 1e-7
            assert of.buckled.sum() == (2 if height == 0.95 else 0)


def test_bars_that_buckle_are_refused_where_they_cannot():
    strip = lattice("4-strip", buckling=0.1)
    with pytest.raises(EquilibriumError, match=r"below its buckling load 0\.1 N"):
        strip.prestressed([-0.1, -0.1, 0.1, 0.1, 0.2])
    assert strip.repeated(3).buckled.shape == (15,)
    assert strip.tile(2).buckling.tolist() == [0.1] * strip.tile(2).bars
    for wrong in ({"buckling": 0.0}, {"buckling": [1.0]}, {"plateau": 1.0}, {"plateau": -0.1}):
        with pytest.raises(TensegrityError, match=next(iter(wrong))):
            lattice("4-strip", **wrong)


def test_free_vectors_find_the_stress_free_cell():
    strip = lattice("4-strip")
    found = strip.at(strip.positions, [[1.05, 0.02]]).equilibrium()
    assert np.linalg.norm(found.vectors) == pytest.approx(1, rel=1e-10)
    assert np.abs(found.stress).max() < 1e-12
    slack = Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)], natural_lengths=[1.1])
    with pytest.raises(EquilibriumError, match="without stress"):
        slack.equilibrium()


def test_four_cells_cut_out_of_the_strip():  # B15
    cut, case = lattice("4-strip").tile(4), values("15-tile")
    assert (cut.nodes, len(cut.ends)) == (case["nodes"], case["members"])
    assert np.abs(cut.members.gradient(cut.positions)).max() == pytest.approx(case["force_before"])
    rest = cut.relaxed()
    assert np.ptp(rest.positions[:, 0]) == pytest.approx(case["length"], rel=1e-10)
    assert rest.members.energy(rest.positions) == pytest.approx(case["energy"], rel=1e-10)
    assert np.allclose(rest.modes(6).frequencies, case["frequencies"], rtol=1e-9)


def test_repeated_lattice_is_the_same_lattice():
    of = lattice("5-octahedra-1.0-0.1")
    twice = of.repeated((2, 1, 1))
    assert (twice.nodes, len(twice.ends)) == (2 * of.nodes, 2 * len(of.ends))
    assert np.allclose(np.sort(twice.tensions)[::2], np.sort(of.tensions), atol=1e-12)
    assert np.abs(twice.members.gradient(twice.positions)).max() < 1e-13
    assert np.allclose(twice.stress, of.stress, atol=1e-14)
    assert len(twice.tile((1, 1, 1)).ends) < len(twice.ends)


def test_lattices_survive_a_pickle_and_cannot_be_changed():
    of = lattice("4-strip")
    assert repr(pickle.loads(pickle.dumps(of))) == repr(of)
    with pytest.raises(AttributeError, match="cannot be changed"):
        of.vectors = [[2, 0]]


@pytest.mark.parametrize(("given", "words"), [
    ({"vectors": [(1, 0), (2, 0)]}, "dependent"),
    ({"vectors": [(1, 0, 0)]}, r"\(d, 2\)"),
    ({"vectors": [(1, 0), (0, 1), (1, 1)]}, "shape"),
    ({"vectors": [(math.nan, 0)]}, "finite"),
    ({"bars": [(0, 0, 1)]}, "2 integers"),
    ({"bars": [(0, 0, (1, 0.5))]}, "whole number"),
    ({"bars": [(0, 0, (0, 0))]}, "to itself"),
    ({"bars": [(0, 0)]}, "to itself"),
    ({"bars": [(0, 1, (1, 0))]}, "node of a bar 1"),
    ({"bars": [0]}, "each"),
    ({"bars": [(0,)]}, r"\(0,\)"),
    ({"bars": [(0, 0, (1, 0)), (0, 0, (-1, 0))]}, "bar 0 and bar 1 both join"),
    ({"bars": [(0, 0, (1, 0))], "strings": [(0, 0, (-1, 0))]}, "bar 0 and string 1"),
    ({"k_bar": 1.0, "EA_bar": 1.0}, "k_bar and EA_bar are both given"),
    ({"EA_bar": -1.0}, "EA_bar"),
    ({"EA_bar": 1.0, "positions": [(0, 0), (0, 0)], "bars": [(0, 1)], "natural_lengths": [0]},
     "EA 1 N over natural length 0 m"),
    ({"bars": []}, "0 bars and strings"),
    ({"positions": [(0, 0), (0.5, 0)]}, "node 1 is in no member"),
    ({"natural_lengths": [-1]}, "natural length"),
    ({"mass": 0}, "mass"),
])  # fmt: skip
def test_what_is_no_lattice_is_refused(given, words):
    with pytest.raises(TensegrityError, match=words):
        Lattice(**(SQUARE | {"bars": [(0, 0, (1, 0))]} | given))


def test_what_is_no_state_is_refused():
    of = lattice("4-strip")
    with pytest.raises(EquilibriumError, match="no self-stress"):
        of.prestressed([0.1, 0.2, 0.1, 0.1, 0.1])
    for gradient, words in (([1.0], "shape"), (np.diag([1, -1]), "determinant")):
        with pytest.raises(TensegrityError, match=words):
            of.equilibrium(gradient)
    for counts in (0, (2, 2), 1.5):
        with pytest.raises(TensegrityError, match="count"):
            of.tile(counts)
    with pytest.raises(TensegrityError, match="strain"):
        of.self_stress(strain=1)
    assert len(CASES) == 22
