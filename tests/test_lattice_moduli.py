"""Moduli of lattices: closed forms, reference numbers, symmetries, and the slopes of bands."""

import math

import numpy as np
import pytest
from lattices import lattice, values

from tensegrity import EquilibriumError, Lattice, TensegrityError, bands, moduli

S = math.sqrt(3) / 2
STATES = ("3-column-alternate", "3-column-same", "4-strip", "4-xplate", "5-octahedra-1.0-0.1",
          "6-resonator-0.1")  # fmt: skip


def voigt(c):
    """C11, C12, C66 (C44 in space)."""
    return [c[0, 0, 0, 0], c[0, 0, 1, 1], c[0, 1, 0, 1]]


def close(found, wanted, part=1e-9):
    assert np.abs(np.subtract(found, wanted)).max() <= part * np.abs(wanted).max()


def triangular(stretch=1.0):
    members = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (-1, 1))]
    vectors = stretch * np.array([[1, 0], [0.5, S]])
    return Lattice([(0, 0)], vectors, strings=members, natural_lengths=[1.0] * 3)


def test_plane_lattices_have_their_textbook_moduli():  # B2
    m = moduli(triangular())
    close(voigt(m.tangent), np.array([3, 1, 1]) * math.sqrt(3) / 4, 1e-13)
    for direction in ([1, 0], [0.3, -2]):
        close(m.speeds(direction) ** 2, [3 / 8, 9 / 8], 1e-13)
    bond = 1 / math.sqrt(3)
    honeycomb = Lattice([(0, 0), (0, bond)], [(1, 0), (0.5, S)], k_bar=1,
                        bars=[(0, 1), (1, 0, (0, 1)), (1, 0, (-1, 1))])  # fmt: skip
    close(voigt(moduli(honeycomb).tangent), np.array([1, 1, 0]) * math.sqrt(3) / 6, 1e-13)
    x = [(0, 0), (0.5, 0), (0.25, S / 2)]
    pairs = [(0, 1), (0, 2), (1, 2), (1, 0, (1, 0)), (2, 0, (0, 1)), (2, 1, (-1, 1))]
    kagome = Lattice(x, [(1, 0), (0.5, S)], pairs, k_bar=1)
    close(voigt(moduli(kagome).tangent), np.array([3, 1, 1]) * math.sqrt(3) / 8, 1e-13)
    square = Lattice([(0, 0)], [(1, 0), (0, 1)], [(0, 0, (1, 0)), (0, 0, (0, 1)),
                     (0, 0, (1, 1)), (0, 0, (1, -1))], k_bar=[1, 1, 0.3, 0.3])  # fmt: skip
    close(voigt(moduli(square).tangent), [1.3, 0.3, 0.3], 1e-13)


def test_stress_enters_the_moduli_of_a_stretched_lattice():  # B2
    m, case = moduli(triangular(1.1)), values("11-triangular")
    a = m.tangent
    found = [a[0, 0, 0, 0], a[0, 0, 1, 1], a[0, 1, 0, 1], a[0, 1, 1, 0], m.stress[0, 0]]
    close(found, [case[k] for k in ("A1111", "A1122", "A1212", "A1221", "sigma")], 1e-12)


@pytest.mark.parametrize("name", ["3-column-alternate", "3-column-same"])
def test_columns_have_axial_coupled_and_torsional_moduli(name):  # B3
    m, case = moduli(lattice(name)), values(name)
    close([m.axial, m.coupling, m.torsional], [case["EA"], case["coupling"], case["GJ"]])
    close(m.speeds([0, 0, 1]), [0, 0, *case["speeds"]])
    condensed = m.axial - m.coupling**2 / m.torsional
    assert condensed == pytest.approx(case["K_h0"] * 0.7, rel=1e-9)


def test_x_modules_have_their_moduli():  # B4
    m = moduli(lattice("4-strip"))
    assert m.axial == pytest.approx(values("4-strip")["EA"], rel=1e-12)
    close(m.speeds([1, 0]), [0, values("4-strip")["speed"]], 1e-12)
    assert m.tangent[0, 0, 0, 0] == pytest.approx(m.axial, rel=1e-12)
    c11, _, c12, c66 = values("4-xplate")["C"]
    close(voigt(moduli(lattice("4-xplate")).stiffness), [c11, c12, c66], 1e-12)


@pytest.mark.parametrize("name", ["5-octahedra-1.0-0.1", "5-octahedra-1.0-0.01"])
def test_shear_waves_of_octahedra_are_faster_than_longitudinal_ones(name):  # B5
    m, case = moduli(lattice(name)), values(name)
    close(voigt(m.tangent), [case["C11"], case["C12"], case["C44"]])
    for direction in ([1, 0, 0], [1, 1, 0], [1, 1, 1]):
        close(m.speeds(direction), case["speeds" + "".join(map(str, direction))])
    assert m.density == pytest.approx(12)
    slow, *fast = m.speeds([1, 0, 0])
    assert slow < min(fast)


def test_plate_of_octahedra():  # B5
    m = moduli(lattice("5-plate"))
    for direction in ([1, 0, 0], [1, 1, 0]):
        wanted = values("5-plate")["speeds" + "".join(map(str, direction[:2])) + "0"]
        close(m.speeds(direction), [0, *wanted], 1e-8)


def test_modulus_of_octahedra_under_compression():  # B12
    strain, _, axial, lateral, _, modulus = values("12-octahedra")["rows"][0]
    state = lattice("5-octahedra-1.0-0.1").equilibrium(np.diag([1, 1, 1 - strain]))
    m = moduli(state)
    assert m.tangent[2, 2, 2, 2] == pytest.approx(modulus, rel=1e-8)
    turned = m.tangent[0, 2, 0, 2] - m.tangent[2, 0, 2, 0]
    assert turned == pytest.approx(m.stress[2, 2] - m.stress[0, 0], rel=1e-8)
    assert m.stress[2, 2] == pytest.approx(axial, rel=1e-8)
    assert m.stress[0, 0] * (1 - strain) == pytest.approx(lateral, rel=1e-8)


@pytest.mark.parametrize("name", STATES)
def test_speeds_are_slopes_of_bands_and_stiffness_is_symmetric(name):
    of = lattice(name)
    strain = np.zeros((of.dim, of.dim))
    strain[-1, -1] = strain[0, 0] = 0.01
    of = of.equilibrium(np.eye(of.dim) + strain)
    m = moduli(of)
    n = of.vectors.sum(axis=0)
    n /= np.linalg.norm(n)
    c, h = m.speeds(n), 1e-3
    w = bands(of, [of.vectors @ n * h]).frequencies[0, : len(c)]
    assert np.abs(np.sort(w / h) - c).max() < 1e-4 * c.max()
    if len(of.vectors) == of.dim:
        stiff = m.stiffness
        for other in ("jikl", "ijlk", "klij"):
            close(np.einsum(f"ijkl->{other}", stiff), stiff, 1e-11)
        acoustic = np.einsum("ijkl,j,l->ik", m.tangent, n, n) / m.density
        close(np.sqrt(np.linalg.eigvalsh(acoustic)), c, 1e-9)


@pytest.mark.parametrize("factor", [1e-300, 1e300])
def test_speeds_along_a_direction_do_not_depend_on_its_length(factor):
    m = moduli(lattice("4-strip"))
    np.testing.assert_allclose(m.speeds([factor, 0]), m.speeds([1, 0]), rtol=1e-15)


def test_bad_moduli_are_refused():
    m = moduli(lattice("4-strip"))
    for direction, words in (
        ([0, 0], "length 0"),
        ([1], "shape"),
        ([0, 1], "leaves the vectors' span"),
    ):
        with pytest.raises(TensegrityError, match=words):
            m.speeds(direction)
    with pytest.raises(EquilibriumError, match="not in equilibrium"):
        moduli(lattice("4-strip").at([[0, 0], [0, 1.1]]))
    with pytest.raises(TensegrityError, match="frequency"):
        moduli(lattice("4-strip"), -1)
