"""Modes of scenes and bands of periodic chains, against closed forms."""

import math

import numpy as np
import pytest
import sympy as sp

from granular import Bead, materials
from granular import chain as bead_chain
from tensegrity import (
    Chain,
    Ensemble,
    EquilibriumError,
    Network,
    Potential,
    PowerLaw,
    Prism,
    State,
    TensegrityError,
    dispersion,
    modes,
)

R, K = sp.symbols("r k")
Q = np.linspace(-math.pi, math.pi, 101)


def linear(stiffness):
    return Potential(K * R**2 / 2, R, {K: stiffness}, length=1.0)


def test_monatomic_chain_has_the_sine_of_half_the_wavenumber():
    w = dispersion(linear(3.0), 0.7, Q)
    assert w.shape == (101, 1)
    np.testing.assert_allclose(w[:, 0], 2 * math.sqrt(3 / 0.7) * abs(np.sin(Q / 2)), atol=1e-12)


@pytest.fixture(scope="module")
def secular():
    """Coefficients in w^2 of the determinant of a cell of two springs and two masses."""
    k1, k2, m1, m2, q, square = sp.symbols("k1 k2 m1 m2 q w2", positive=True)
    u1, u2 = sp.symbols("u1 u2")
    forward, back = u1 * sp.exp(sp.I * q), u2 * sp.exp(-sp.I * q)  # the next u1, the last u2
    rows = [
        m1 * square * u1 + k1 * (u2 - u1) - k2 * (u1 - back),
        m2 * square * u2 + k2 * (forward - u2) - k1 * (u2 - u1),
    ]
    matrix = sp.Matrix([[sp.diff(row, x) for x in (u1, u2)] for row in rows])
    return sp.lambdify((k1, k2, m1, m2, q), sp.Poly(sp.expand(matrix.det()), square).all_coeffs())


def test_cells_of_two_have_the_roots_of_their_determinant(secular):
    for case in ((1.0, 1.0, 1.0, 2.5), (1.0, 3.0, 1.0, 1.0), (0.4, 2.0, 0.3, 5.0)):
        found = dispersion([linear(k) for k in case[:2]], case[2:], Q)
        assert found.shape == (101, 2)
        a, b, c = (np.real(x) * np.ones(101) for x in secular(*case, Q))
        upper = (abs(b) + np.sqrt(b**2 - 4 * a * c)) / (2 * a)
        there = abs(Q) > 0.3  # c loses its digits towards 0
        lower = c / a / upper
        np.testing.assert_allclose(found[:, 1], np.sqrt(upper), atol=1e-12)
        np.testing.assert_allclose(found[there, 0], np.sqrt(lower[there]), atol=1e-12)


def test_diatomic_chain_obeys_the_reference_form():
    m1, m2, k = 1.0, 2.5, 1.3
    w2 = dispersion([linear(k)] * 2, [m1, m2], Q) ** 2
    form = 1 - (m1 + m2) * w2 / k + m1 * m2 * w2**2 / (2 * k**2)
    np.testing.assert_allclose(form, np.cos(Q)[:, None] * np.ones(2), atol=1e-12)
    edges = dispersion(linear(k), [m1, m2], [math.pi])[0]
    np.testing.assert_allclose(edges, [math.sqrt(2 * k / m2), math.sqrt(2 * k / m1)], rtol=1e-14)


def test_long_waves_keep_their_digits():
    q = np.array([0.0, 1e-9, 1e-6])
    w = dispersion(linear(1.0), [1.0, 1.0], q)
    np.testing.assert_allclose(w[:, 0], 2 * np.sin(q / 4), atol=1e-15)


def test_precompressed_hertz_chain_is_cut_off_where_the_reference_says():
    spring = PowerLaw(1.0, 1.5, preload=0.1)
    assert dispersion(spring, 1.0, [math.pi])[0, 0] == pytest.approx(1.668817934997, abs=1e-12)
    beads = bead_chain([Bead(0.005, materials["steel"])] * 400, preload=10.0)
    top = modes(beads, count=400).frequencies[-1]
    limit = dispersion(beads.springs[5], beads.mass[5], [math.pi])[0, 0]
    assert top == pytest.approx(limit * math.cos(math.pi / 800), rel=1e-12)


def test_a_prism_s_mode_has_its_axial_stiffness():
    prism = Prism(1.0, 0.7, 0.01, 2.0)
    found = modes(Chain(prism.potential(), 2, 0.5))
    assert len(found) == 2
    assert found.frequencies[0] == 0
    expected = math.sqrt(2 * prism.axial_stiffness() / 0.5)
    assert found.frequencies[1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("sites", [40, 900])  # the whole matrix, and a sparse search
@pytest.mark.parametrize("ends", [("free", "free"), ("fixed", "free"), ("fixed", "fixed")])
def test_finite_chains_have_the_sines_of_their_ends(sites, ends):
    found = modes(Chain(linear(2.0), sites, 0.5, ends), count=12)
    number = np.arange(12)
    held = ends.count("fixed")
    phase = {
        0: number * math.pi / sites,
        1: (2 * number + 1) * math.pi / (2 * sites - 1),
        2: (number + 1) * math.pi / (sites - 1),
    }[held]
    expected = 2 * math.sqrt(2.0 / 0.5) * np.sin(phase / 2)
    np.testing.assert_allclose(found.frequencies, expected, atol=1e-12)
    gram = (found.shapes * 0.5) @ found.shapes.T
    np.testing.assert_allclose(gram, np.eye(12), atol=1e-9)
    if held == 2:
        assert not found.shapes[:, [0, -1]].any()
        shape = np.sin(math.pi * np.arange(sites) / (sites - 1))
        np.testing.assert_allclose(found.shapes[0] / found.shapes[0].max(), shape / shape.max(),
                                   atol=1e-9)  # fmt: skip


@pytest.mark.parametrize("sites", [40, 900])  # the whole matrix, and a sparse search
def test_the_largest_entry_of_a_shape_is_above_zero(sites):
    rng = np.random.default_rng(5)
    springs = [linear(k) for k in rng.uniform(1, 3, sites - 1)]
    for scene in (
        Chain(springs, sites, rng.uniform(0.5, 2, sites)),
        Network(np.arange(2.0 * sites).reshape(-1, 2) + rng.random((sites, 2)),
                [(j, j + 1) for j in range(sites - 1)], springs),
    ):  # fmt: skip
        shapes = modes(scene, count=12).shapes.reshape(12, -1)
        assert (shapes.max(axis=1) == np.abs(shapes).max(axis=1)).all()


def test_the_slowest_wave_of_a_long_chain_is_not_taken_for_rigid_motion():
    found = modes(Chain(linear(1.0), 50_000), count=2).frequencies
    assert found == pytest.approx([0, 2 * math.sin(math.pi / 100_000)], rel=1e-6)


def test_modes_about_a_compressed_state_are_those_of_its_stiffness():
    """Between held ends each spring is as long as any other; one site moved is no equilibrium."""
    toda = Potential(sp.exp(-R) + R - 1, R, length=1.0)
    places, bonds = 0.9 * np.arange(20.0)[:, None], [(j, j + 1) for j in range(19)]
    squeezed = Network(places, bonds, toda, lengths=1.0, held=[0, 19])
    found = modes(squeezed, count=3)
    stiffness = math.exp(0.1)
    phase = np.arange(1, 4) * math.pi / 19
    np.testing.assert_allclose(
        found.frequencies, 2 * math.sqrt(stiffness) * np.sin(phase / 2), rtol=1e-12
    )
    u = np.zeros((20, 1))
    u[7] = 0.01
    with pytest.raises(EquilibriumError, match=r"unbalanced force 0\.0\d+ N"):
        modes(squeezed, State(u, 0 * u))


def test_what_is_no_equilibrium_or_unstable_is_refused():
    barrier = Potential(R**4 / 4 - R**2 / 2, R, length=1.0)
    for sites in (5, 900):
        with pytest.raises(EquilibriumError, match="unstable"):
            modes(Chain(barrier, sites))
    chain = Chain(barrier, 2)
    about = State([0.0, 1.0], [0.0, 0.0])
    assert modes(chain, about).frequencies[1] == pytest.approx(2.0, rel=1e-12)
    with pytest.raises(EquilibriumError, match=r"velocity 0\.1 m/s"):
        modes(chain, State([0.0, 1.0], [0.1, 0.0]))
    with pytest.raises(TensegrityError, match="Ensemble"):
        modes(Ensemble(chain, 2))
    with pytest.raises(TensegrityError, match="stiffness -1 N/m of spring 0"):
        dispersion(barrier, 1.0, [0.1])
    with pytest.raises(TensegrityError, match="2 springs and 3 masses"):
        dispersion([linear(1.0)] * 2, [1.0] * 3, [0.1])
