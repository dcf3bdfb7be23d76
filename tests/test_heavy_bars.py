"""Bars with mass: modes of structures and waves of lattices, against published and closed forms."""

import numpy as np
import pytest
import scipy.linalg
from heavy import dense_mass, dense_tangent
from hypothesis import given, settings
from hypothesis import strategies as st

from derivations import member
from figures.structures_mass import PUBLISHED, lumped, tower
from tensegrity import (
    Lattice,
    Prism,
    Structure,
    TensegrityError,
    bands,
    catalogue,
    decay,
    effective_mass,
    held,
    moduli,
    plates,
)


def heavy(structure, bar_mass=1.0, string_mass=None, mass=0.0):
    given = {"bar_mass": bar_mass, "string_mass": string_mass, "mass": mass}
    return structure.at(structure.positions, **given)


def by_dense(structure, fixed=()):
    """Frequencies by dense matrices of another derivation, of all coordinates but fixed ones."""
    dim = structure.dim
    free = np.ones(structure.positions.shape, dtype=bool)
    free[list(fixed)] = False
    some = np.ix_(free.ravel(), free.ravel())
    matrices = dense_tangent(structure), np.kron(dense_mass(structure), np.eye(dim))
    squares = scipy.linalg.eigh(*(m[some] for m in matrices), eigvals_only=True)
    return np.sign(squares) * np.sqrt(np.abs(squares))


def test_the_shares_of_a_members_mass_are_those_of_its_kinetic_energy():
    bar = Structure([(0, 0), (1, 0)], [(0, 1)], bar_mass=2.0)
    exact = np.array(member.inertia().subs(member.mass, 2), dtype=float)
    assert bar.mass_matrix().toarray()[::2, ::2] == pytest.approx(exact, rel=1e-15)
    assert bar.mass_matrix().toarray()[1::2, 1::2] == pytest.approx(exact, rel=1e-15)


def test_tower_of_tsgfem_has_its_published_frequencies():
    of = tower().modes(18, held([0, 1, 2]))
    assert of.frequencies / (2 * np.pi) == pytest.approx(PUBLISHED, rel=5e-11)


def test_lumped_masses_lower_the_frequencies_of_the_tower_by_7_to_31_percent():
    supports = held([0, 1, 2])
    exact, low = (s.modes(12, supports).frequencies for s in (tower(), lumped(tower())))
    loss = 1 - low / exact
    assert 0.05 < loss.min() < 0.08
    assert 0.29 < loss.max() < 0.32


OCTAHEDRON = catalogue.expandable_octahedron(strut=1.0, prestrain=0.05, k_bar=100.0)


@pytest.mark.parametrize(
    ("structure", "lowest", "highest"),
    [
        (OCTAHEDRON, [0.6171409980, *[1.1655801026] * 3, *[1.3308840967] * 3], 34.90395111811),
        (Prism(1.0, 1.0, 0.1, 1.0, 1.0, 100.0).structure(),
         [0.8002651106, 1.5664777518, 1.5664777518], 34.872114854318),
        (catalogue.geodesic("icosahedron", prestrain=0.1, k_bar=100.0),
         [*[0.2831153801] * 5, *[0.3829977826] * 3], 34.767960699074),
    ],
    ids=["octahedron", "prism", "sphere"],
)  # fmt: skip
def test_catalogue_with_bars_of_1_kg_has_the_reference_frequencies(structure, lowest, highest):
    s = heavy(structure)
    found = s.modes(3 * s.nodes).frequencies
    assert found[: len(lowest)] == pytest.approx(lowest, rel=2e-10)
    assert found[-1] == pytest.approx(highest, rel=1e-12)


def test_two_bars_in_line_have_the_squares_0_3_and_12_over_k_m():
    two = Structure([(0, 0), (1, 0), (2, 0)], [(0, 1), (1, 2)], k_bar=400.0, bar_mass=3.0)
    found = two.modes(3, held([0, 1, 2], axes=[1])).frequencies ** 2
    assert found == pytest.approx([3 * 400 / 3, 12 * 400 / 3], rel=1e-13)  # without the rigid one


@pytest.mark.parametrize("string_mass", [None, 0.1])
@pytest.mark.parametrize(
    "structure",
    [
        Prism(1.0, 0.8, 0.1, 1.0, 3.0, 60.0, sides=4).structure(),
        catalogue.dome(prestrain=0.05),
        catalogue.truncated_tetrahedron(prestrain=0.1),
        catalogue.snelson_x(prestrain=0.1, k_bar=10.0),
    ],
    ids=["four bars", "dome", "truncated", "cross"],
)
def test_other_structures_have_the_frequencies_of_dense_matrices(structure, string_mass):
    rng = np.random.default_rng(3)
    s = heavy(structure, rng.uniform(0.5, 2.0, structure.bars), string_mass, 0.3)
    rigid = 3 if s.dim == 2 else 6
    exact = np.sort(by_dense(s))
    found = s.modes(s.positions.size).frequencies
    zero = np.abs(exact) < 1e-5 * exact[-1]
    assert zero.sum() >= rigid
    assert len(found) == exact.size - rigid
    assert np.sort(found)[-(~zero).sum() :] == pytest.approx(exact[~zero], rel=1e-9)
    assert s.mass_matrix().toarray() == pytest.approx(np.kron(dense_mass(s), np.eye(s.dim)))


def test_modes_of_supported_and_guided_structures_have_unit_modal_mass_and_satisfy_k_x_is_w2_m_x():
    s = heavy(Prism(1.0, 0.8, 0.1, 1.0, 3.0, 60.0).structure(), 2.0, 0.2, 0.1)
    for supports in (held([0, 1, 2]), plates([0, 1, 2], [3, 4, 5]), held([0], axes=[2])):
        found = s.modes(4, supports)
        motions = supports.motions(s.nodes, 3)
        left = motions.T @ (s.stiffness() @ found.shapes.reshape(4, -1).T)
        right = motions.T @ (s.mass_matrix() @ found.shapes.reshape(4, -1).T) * found.frequencies**2
        assert left == pytest.approx(right, abs=1e-10 * np.abs(left).max())
    exact = by_dense(s, fixed=(0, 1, 2))
    assert s.modes(9, held([0, 1, 2])).frequencies == pytest.approx(exact, rel=1e-10)


def test_large_structures_have_the_frequencies_of_dense_matrices():
    s = strip().tile(120)
    assert s.positions.size > 450
    exact = by_dense(s, fixed=(0, 1, 238, 239))
    found = s.modes(5, held([0, 1, 238, 239])).frequencies
    assert found == pytest.approx(exact[:5], rel=1e-7)


SCALES = st.tuples(
    st.floats(1e3, 1e8), st.floats(1e-5, 1e2), st.floats(1e-6, 1e3), st.integers(0, 10**6)
)


@given(SCALES)
@settings(max_examples=20, deadline=None)
def test_frequencies_do_not_depend_on_frame_units_and_numbering(scales):
    ea, length, mass, seed = scales
    rng = np.random.default_rng(seed)
    s = heavy(OCTAHEDRON, rng.uniform(0.5, 2.0, 6), rng.uniform(0.01, 0.1, 24), 0.05)
    plain = s.modes(10).frequencies
    turn, order = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.permutation(s.nodes)
    place = np.argsort(order)
    k = ea / length
    other = Structure(
        (length * s.positions @ turn.T + rng.normal(size=3) * length)[order],
        place[s.ends[: s.bars]][:, ::-1], place[s.ends[s.bars :]],
        k_bar=k * s.stiffnesses[: s.bars], k_string=k * s.stiffnesses[s.bars :],
        natural_lengths=length * s.natural_lengths, mass=mass * s.mass[order],
        bar_mass=mass * s.member_mass[: s.bars], string_mass=mass * s.member_mass[s.bars :],
    )  # fmt: skip
    found = other.modes(10).frequencies / np.sqrt(k / mass)
    assert found == pytest.approx(plain, rel=1e-8)


@given(SCALES)
@settings(max_examples=20, deadline=None)
def test_bars_without_mass_in_the_limit_have_the_lumped_frequencies(scales):
    ea, length, mass, seed = scales
    rng = np.random.default_rng(seed)
    s = OCTAHEDRON.at(length * OCTAHEDRON.positions, k_bar=ea / length, k_string=ea / length / 50,
                      natural_lengths=length * OCTAHEDRON.natural_lengths,
                      mass=mass * rng.uniform(0.5, 2.0, 12))  # fmt: skip
    light = s.at(s.positions, bar_mass=1e-12 * mass, string_mass=1e-13 * mass)
    plain = s.modes(10).frequencies
    assert light.modes(10).frequencies == pytest.approx(plain, rel=1e-9)
    assert lumped(s).modes(10).frequencies == pytest.approx(plain, rel=0)


# lattices


def strip(mass=0.2, bar_mass=1.0, string_mass=None):
    """X modules of the guide's page on lattices."""
    q = 0.1 / 1.1
    x = Lattice([(0, 0), (0, 1)], [(1, 0)], bars=[(0, 1, 1), (1, 0, 1)],
                strings=[(0, 0, 1), (1, 1, 1), (0, 1)], k_bar=10, k_string=[1, 1, 2],
                mass=mass, bar_mass=bar_mass, string_mass=string_mass)  # fmt: skip
    return x.prestressed([-q, -q, q, q, 2 * q])


def test_waves_of_a_chain_of_bars_are_those_of_the_closed_form():
    k, m, m0, pull, length = 7.0, 1.3, 0.4, 0.25, 1.5
    chain = Lattice([(0, 0)], [(length, 0)], bars=[(0, 0, 1)], k_bar=k, mass=m0, bar_mass=m,
                    natural_lengths=[length - pull / k])  # fmt: skip
    q = np.array([0.3, 1.1, 2.0, np.pi])
    squares = 2 * (1 - np.cos(q)) / (m0 + m * (2 + np.cos(q)) / 3)
    found = bands(chain, q[:, None], velocities=True, shapes=True)
    exact = np.sqrt(squares[:, None] * [pull / length, k])
    assert found.frequencies == pytest.approx(exact, rel=1e-14)
    assert found.frequencies[1] == pytest.approx([0.3528098528730603, 2.286469172313731], rel=1e-14)
    modal = (m0 + m * (2 + np.cos(q)) / 3)[:, None] * np.sum(np.abs(found.shapes) ** 2, axis=(2, 3))
    assert modal == pytest.approx(1.0)
    h = 1e-5
    above, below = (bands(chain, q[:3, None] + x).frequencies for x in (h, -h))
    assert found.velocities[:3, :, 0] == pytest.approx((above - below) / (2 * h) * length, rel=1e-8)
    phases = decay(chain, exact[:3, 1])
    assert np.abs(phases - q[:3, None]).min(axis=1) == pytest.approx(0.0, abs=1e-7)


def test_waves_of_bars_and_strings_in_turn_are_those_of_the_quadratic():
    kb, ks, m = 50.0, 1.0, 2.0
    chain = Lattice([(0, 0), (1, 0)], [(2, 0)], bars=[(0, 1)], strings=[(1, 0, 1)], k_bar=kb,
                    k_string=ks, bar_mass=m)  # fmt: skip
    for q in (0.3, 1.1, 2.0, np.pi):
        linear = -(2 * m / 3 * (kb + ks) + m / 3 * (kb + ks * np.cos(q)))
        exact = np.sqrt(np.sort(np.roots([m**2 / 12, linear, 2 * kb * ks * (1 - np.cos(q))])))
        found = bands(chain, [[q]]).frequencies[0, -2:]
        assert found == pytest.approx(exact, rel=1e-11)
        phases = decay(chain, exact[:1])[0]
        assert np.sort(phases.real)[[0, -1]] == pytest.approx([-q, q], abs=1e-7)
    assert bands(chain, [[1.1]]).frequencies[0, -2:] == pytest.approx(
        [0.733867354131, 17.446163788908], rel=1e-11
    )
    stiffness = 1 / (1 / kb + 1 / ks)  # in series
    assert moduli(chain).density == pytest.approx(m / 2)
    assert moduli(chain).speeds([1, 0])[-1] == pytest.approx(2 * np.sqrt(stiffness / m))
    x = (kb + ks + m / 6) / (kb + ks - m / 3)  # motion of the other end at 1 rad/s
    inertia = effective_mass(chain, [0], [0.0, 1.0])[:, 0, 0]
    assert inertia == pytest.approx([m, m / 2 * (1 + x)], rel=1e-12)
    assert effective_mass(chain, [0, 1], [0.0, 1.0])[:, 0, 0] == pytest.approx(m)


def test_strip_of_x_modules_has_the_reference_bands():
    exact = [0.388645596939, 1.090811880214, 5.428616683765, 5.791596580837]
    assert bands(strip(), [[0.9]]).frequencies[0] == pytest.approx(exact, rel=1e-11)


@pytest.mark.parametrize("string_mass", [None, 0.3])
def test_larger_cells_and_decay_describe_the_same_waves(string_mass):
    cell = strip(string_mass=string_mass)
    single = bands(cell, [[0.9], [0.9 + np.pi]]).frequencies
    double = bands(cell.repeated(2), [[1.8]]).frequencies[0]
    assert double == pytest.approx(np.sort(single.ravel()), rel=1e-12)
    for w in single[0]:
        phases = decay(cell, [w])[0]
        assert np.abs(phases - 0.9).min() < 1e-7
        again = decay(cell.repeated(2), [w])[0]
        assert np.abs(again - 1.8).min() < 1e-7
    long = bands(cell, [[1e-4]]).frequencies[0] / 1e-4
    assert long[1] == pytest.approx(moduli(cell).speeds([1, 0])[1], rel=1e-6)
    assert cell.stability().stable


def test_long_waves_of_a_column_turn_and_stretch_with_the_inertia_of_its_bars():
    column = catalogue.column(2, prestrain=0.1, k_bar=100.0, periodic=True)
    for bar_mass, string_mass in ((2.0, None), (1.0, 0.4)):
        cell = heavy(column, bar_mass, string_mass, 0.1)
        speeds = np.sort(moduli(cell).speeds(cell.vectors[0]))
        q = 2e-3
        found = bands(cell, [[q]]).frequencies[0, :4] / (q / cell.size)
        assert found[2:] == pytest.approx(speeds[2:], rel=1e-4)


def test_lowest_waves_of_large_cells_are_those_of_all():
    cell = strip().repeated(120)
    assert cell.positions.size > 450
    few = bands(cell, [[0.7]], count=6, shapes=True)
    single = [bands(strip(), [[(0.7 + 2 * np.pi * n) / 120]]).frequencies[0] for n in range(120)]
    assert few.frequencies[0] == pytest.approx(np.sort(np.ravel(single))[:6], abs=1e-9)


def test_slow_waves_of_heavy_strings_keep_their_digits():
    row = Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)], string_mass=2.0).prestressed([0.1])
    for q in (1e-6, 1e-9):
        exact = np.sqrt(2 * (1 - np.cos(q)) if q > 1e-5 else q**2)
        found = bands(row, [[q]]).frequencies[0]
        assert found == pytest.approx(exact * np.sqrt([0.1 / 2, 1 / 2]), rel=1e-10)


def test_waves_of_bars_in_two_directions_do_not_depend_on_frame_and_units():
    plain = catalogue.triangular(k_bar=3.0)
    cell = plain.at(plain.positions, bar_mass=[1.0, 2.0, 0.5], mass=0.0)
    q = [[0.4, 1.1], [2.0, -0.3]]
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(2, 2)))[0]
    other = cell.at(1e-3 * cell.positions @ turn.T, 1e-3 * cell.vectors @ turn.T,
                    natural_lengths=1e-3 * cell.natural_lengths, bar_mass=1e3 * cell.member_mass,
                    mass=0.0, k_bar=3e7)  # fmt: skip
    found = bands(other, q).frequencies / np.sqrt(1e4)
    assert found == pytest.approx(bands(cell, q).frequencies, rel=1e-11)
    assert moduli(cell).density == pytest.approx(3.5 / cell.size)


# bad input, and what is said


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"bar_mass": -1.0}, "bar_mass -1 kg must be finite and at least 0"),
        ({"string_mass": [1.0, np.nan]}, "string_mass has shape"),
        ({"bar_mass": np.inf}, "bar_mass inf kg must be finite"),
        ({"mass": 0.0}, "mass 0 kg must be finite and above 0"),
        ({"mass": -1.0, "bar_mass": 1.0}, "mass -1 kg must be finite and at least 0"),
    ],
)
def test_wrong_masses_are_refused_by_name(given, words):
    with pytest.raises(TensegrityError, match=words):
        Structure([(0, 0), (1, 0), (2, 0)], [(0, 1)], [(1, 2)], **given)


def test_nodes_without_mass_may_be_held_but_not_move():
    s = Structure([(0, 0), (1, 0), (2, 0)], [(0, 1)], [(1, 2)], bar_mass=1.0)
    with pytest.raises(TensegrityError, match="node 2 moves and has mass 0 kg"):
        s.modes(1)
    assert s.modes(1, held([0, 2]) + held([1], axes=[1])).frequencies > 0
    with pytest.raises(TensegrityError, match="site 2 has mass 0 kg"):
        s.network()
    assert s.network(held=[2]).bond_mass.tolist() == [1.0, 0.0]
    with pytest.raises(TensegrityError, match="node 1 moves and has mass 0 kg"):
        Lattice([(0, 0), (0, 1)], [(1, 0)], [(0, 0, 1)], [(0, 1)], bar_mass=1.0)


def test_prints_say_where_masses_are():
    light = "members have none: a bar turns as two point masses"
    assert light in str(OCTAHEDRON)
    assert "0 kg at the nodes, 6 kg along bars, 0 kg along strings" in str(heavy(OCTAHEDRON))
    assert heavy(OCTAHEDRON, 2.0, 0.5).weighing_mass.sum() == pytest.approx(12 + 12)
    tiled = strip(string_mass=0.3).tile(3)
    assert tiled.member_mass.tolist() == [1.0] * 4 + [0.3] * 7
