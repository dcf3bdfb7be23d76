"""Lattices at given frequencies, their stability, and those of the catalogue.

Numbers of `lattices.json` come from a program of its own.
"""

import itertools
import math

import numpy as np
import pytest
from lattices import lattice, values
from scipy.optimize import brentq

from tensegrity import (
    EquilibriumError,
    Lattice,
    Prism,
    TensegrityError,
    bands,
    catalogue,
    decay,
    effective_mass,
    moduli,
)

PRISM = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)


def row(*q):
    """A straight row of nodes; `q` of the members to the first, second .. neighbour."""
    members = [(0, 0, n + 1) for n in range(len(q))]
    return Lattice([(0, 0)], [(1, 0)], members, k_bar=10).prestressed(q)


@pytest.mark.parametrize("w", ["3.0", "5.0"])
def test_waves_of_the_strip_decay_from_cell_to_cell(w):  # B14
    found = decay(lattice("4-strip"), [float(w)])[0]
    wanted = np.array(values("14-strip")[w])
    assert np.abs(np.sort(np.abs(found.imag)) - wanted).max() < 1e-11 * wanted.max()


def test_waves_of_the_column_decay_from_cell_to_cell():  # B14
    found = np.abs(decay(lattice("3-column-alternate"), [6.5])[0].imag)
    wanted = np.array(values("14-column")["decay"])
    assert len(found) == 18  # twice the rank of the coupling
    assert np.abs(found[: len(wanted)] - wanted).max() < 1e-11 * wanted.max()


def test_decay_in_the_gap_of_a_diatomic_chain():  # B1
    k, m = (1.3, 0.4), (0.7, 2.0)
    pairs = [(0, 1), (1, 0, 1)]
    chain = Lattice([(0, 0), (1, 0)], [(2, 0)], pairs, k_bar=k, mass=m)
    found = decay(chain, [1.0, 1.2])
    assert (
        np.abs(np.abs(found.imag) - np.array([[1.35497433749296], [1.59431459949461]])).max()
        < 1e-13
    )
    assert np.allclose(np.abs(found.real), math.pi, atol=1e-12)
    cosine = (2 * k[0] * k[1] - sum(k) * sum(m) + m[0] * m[1]) / (2 * k[0] * k[1])  # at w = 1
    assert np.abs(np.cos(found[0]) - cosine).max() < 1e-13


@pytest.mark.parametrize(
    ("of", "axis", "across"),
    [(lattice("4-strip"), 0, []), (lattice("6-resonator-0.1"), 1, [0.7]), (row(3.5, -2, 1), 0, [])],
)
def test_waves_that_travel_have_the_phases_of_bands(of, axis, across):
    """What `bands` finds at a real phase `decay` finds at that frequency, also where members lead
    beyond the next cell; and waves that decay solve the same equations, in pairs."""
    phases = np.insert(np.array(across), axis, 0.9)
    for w in bands(of, [phases]).frequencies[0]:
        found = decay(of, [w], axis, across)[0]
        assert np.abs(found - 0.9).min() < 1e-7
        pairs = np.abs(np.exp(1j * found)[:, None] - np.exp(1j * found.conj()))
        assert (pairs.min(axis=0) < 1e-6 * np.abs(np.exp(1j * found))).all()


def test_a_node_whose_own_stiffness_its_inertia_cancels():
    """Own stiffness 2 less w^2 is 0, or round-off, at w = sqrt(2): the phase is pi/2."""
    chain = Lattice([(0, 0)], [(1, 0)], [(0, 0, 1)], k_bar=1)
    found = decay(chain, [math.sqrt(2), 2**0.5 * (1 - 1e-15), 1.4142])
    assert np.allclose(np.abs(found[:2].real), math.pi / 2, atol=1e-14)
    assert (found.imag == 0).all()


def test_waves_that_end_within_their_cell_decay_without_bound():
    """Pairs of nodes of neighbouring cells that nothing else joins pass nothing on."""
    chain = Lattice([(0, 0), (0.3, 0)], [(1, 0)], [(0, 1, 1)], k_bar=1)
    found = decay(chain, [0.5, 3.0])
    assert found.shape == (2, 2)
    assert (found.real == 0).all()
    assert (np.abs(found.imag) == np.inf).all()


@pytest.mark.parametrize("size", [1e-6, 2.0, 1e6])
def test_decay_does_not_depend_on_the_size_of_the_cell(size):
    """Octahedra pass few of the waves that their coupling allows; the others are not invented."""
    one = np.abs(decay(catalogue.octahedra(), [0.7])[0].imag)
    two = np.abs(decay(catalogue.octahedra(width=size), [0.7])[0].imag)
    finite = np.isfinite(one)
    assert np.array_equal(finite, np.isfinite(two))
    assert np.sum(~finite) % 2 == 0
    assert np.abs(one[finite] - two[finite]).max() < 1e-8
    assert np.abs(one[finite][::2] - one[finite][1::2]).max() < 1e-8  # in pairs


@pytest.mark.parametrize("q", [0.1, 0.4])
def test_resonators_have_their_gap_and_effective_mass(q):  # B6
    of, own = catalogue.resonators(1.0, q, 20, 5, 1, (1, 2)), values(f"6-resonator-{q}")
    w = math.sqrt(2 * (1 + q) / 2)
    assert np.allclose(own["gap"], [w, w * math.sqrt(3)], rtol=1e-14)
    each = np.linspace(-math.pi, math.pi, 25)
    found = bands(of, list(itertools.product(each, each))).gaps
    assert np.abs(found - own["gap"]).max(axis=1).min() < 1e-12
    m = effective_mass(of, [0], [0.0, 1.1 * w, 0.6 * w])
    wanted = [3.0, own["effective_mass_1p1"], own["effective_mass_0p6"]]
    assert np.abs(m - np.multiply.outer(wanted, np.eye(2))).max() < 1e-12
    inside = decay(of, np.linspace(1.001 * w, 0.999 * own["gap"][1], 9), 0, 0.4)
    assert (np.abs(inside.imag) > 1e-3).all()


def test_effective_mass_of_a_mass_in_a_mass():  # B6
    k2, m2 = 0.565062766562273, 0.5
    chain = Lattice(
        [(0, 0), (0.5, 0)], [(1, 0)], [(0, 0, 1), (0, 1)], k_bar=[2.0, k2], mass=[1, m2]
    )
    w2 = math.sqrt(k2 / m2)
    assert w2 == pytest.approx(1.06307362544865, rel=1e-14)
    m = effective_mass(chain, [0], [1.02 * w2])[0]
    assert m[0, 0] == pytest.approx(-11.3762376237624, rel=1e-12)
    assert m[1, 1] == pytest.approx(1.0)  # nothing carries the inner mass across
    assert (effective_mass(chain, [0, 1], [0.3]) == 1.5 * np.eye(2)).all()
    with pytest.raises(TensegrityError, match=r"frequency 1\.06307362545 rad/s is a resonance"):
        effective_mass(chain, [0], [w2])


def test_effective_mass_is_the_force_that_moves_the_frame():
    """-w^2 m u from the dynamic stiffness at phase 0, node by node."""
    of, w = lattice("5-octahedra-1.0-0.1"), 0.37
    frame, dim = [0, 5, 7], 3
    blocks = of.members.blocks(of.positions)
    k = np.zeros((of.nodes, dim, of.nodes, dim))
    for (i, j), b in zip(of.ends, blocks, strict=True):
        for x, y, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            k[x, :, y, :] += sign * b
    k = k.reshape(of.nodes * dim, -1) - w**2 * np.diag(np.repeat(of.mass, dim))
    moved = np.repeat(np.isin(np.arange(of.nodes), frame), dim)
    inner = np.linalg.solve(k[np.ix_(~moved, ~moved)], k[np.ix_(~moved, moved)])
    whole = k[np.ix_(moved, moved)] - k[np.ix_(moved, ~moved)] @ inner
    t = np.kron(np.ones((len(frame), 1)), np.eye(dim))
    assert np.allclose(effective_mass(of, frame, [w])[0], -t.T @ whole @ t / w**2, rtol=1e-11)


def test_a_line_loses_stability_at_a_finite_wavelength():  # B13
    """w^2 = 2x(q1 + 1 - 8x + 4x^2), x = 1 - cos kappa, for q2 = -2, q3 = 1: critical at q1 = 3."""
    for q1 in (3.5, 3.0001, 2.9999, 2.8):
        found = row(q1, -2, 1).stability()
        phase = float(found.wavenumber[0])
        x = 1 - math.cos(phase)
        closed = 2 * x * (q1 + 1 - 8 * x + 4 * x**2) / phase**2
        assert found.wave == pytest.approx(closed, rel=1e-6, abs=1e-12)
        at = np.linspace(0.05, math.pi, 20001)
        x = 1 - np.cos(at)
        assert found.wave == pytest.approx(
            (2 * x * (q1 + 1 - 8 * x + 4 * x**2) / at**2).min(), abs=1e-7
        )
        assert found.long == pytest.approx(q1 + 1)
        assert found.strain > 0
        assert found.kind == ("stable" if q1 > 3 else "wave")
        assert found.stable == (q1 > 3)
    critical = brentq(lambda q1: row(q1, -2, 1).stability().wave, 2.5, 3.5, xtol=1e-10)
    assert critical == pytest.approx(3, abs=1e-8)
    assert float(row(3.0, -2, 1).stability().wavenumber[0]) == pytest.approx(math.pi / 2, abs=1e-5)


def test_compressed_triangles_lose_all_transverse_waves_at_once():  # B2
    """Their stretch is then 3/4 exactly, where q = -1/3 = (s - 1)/s."""

    def at(s):
        return catalogue.triangular(k_bar=1.0).equilibrium(s * np.eye(2)).stability()

    assert brentq(lambda s: at(s).long, 0.7, 0.8, xtol=1e-12) == pytest.approx(0.75, abs=1e-9)
    assert at(0.7500001).stable
    assert at(0.7499999).kind == "long wave, wave, strain"


def test_long_waves_of_compressed_octahedra_go_first():  # B13
    start = catalogue.octahedra(1.0, 0.1, 20)

    def state(e):
        return start.equilibrium(np.diag([1, 1, 1 - e]))

    before, after = state(0.1054), state(0.1074)  # the first loss is between
    each = 2 * np.pi * np.arange(6) / 6
    grid = [q for q in itertools.product(each, each, each) if any(q)]
    assert (bands(after, grid).frequencies[:, 0] > 0).all()  # a grid still sees stable waves only
    found = after.stability()
    assert found.long < 0 < before.stability().long
    speeds = moduli(after).speeds(found.direction)
    assert -(speeds[0] ** 2) == pytest.approx(found.long, rel=1e-9)
    off = np.array([[1e-2, 0, 0], [0, 1e-2, 0], [0, 0, 1e-2]])
    for step in (*off, *-off):  # nothing slower nearby
        assert moduli(after).speeds(found.direction + step)[0] >= speeds[0] - 1e-9


def test_a_compressed_column_buckles_as_a_whole():
    column = PRISM.column(periodic=True)
    assert column.stability().stable
    pressed = column.equilibrium(np.diag([1, 1, 0.99]))
    assert pressed.stress[2, 2] < 0
    assert "long wave" in pressed.stability().kind
    assert "long waves:" in str(pressed.stability())
    pulled = column.equilibrium(np.diag([1, 1, 1.01])).stability()
    tension = column.equilibrium(np.diag([1, 1, 1.01])).stress[2, 2]
    density = moduli(column.equilibrium(np.diag([1, 1, 1.01]))).density
    assert pulled.long == pytest.approx(tension / density, rel=1e-9)  # a string: c^2 = N/mu


def test_stiffness_against_uniform_strain_under_pressure():
    """The bulk modulus -V dp/dV and the shear modulus at a pressure, from differences."""
    tri = catalogue.triangular(k_bar=1.0)

    def stress(f):
        moved = tri.equilibrium(f)
        return moved.stress * moved.size / abs(np.linalg.det(moved.vectors))

    s, h = 0.9, 1e-5
    found = tri.equilibrium(s * np.eye(2)).stability().strain
    pure = np.array([[1, 0], [0, -1.0]])
    slope = (stress(s * (np.eye(2) + h * pure)) - stress(s * (np.eye(2) - h * pure))) / (2 * h)
    shear = slope[0, 0]  # dsigma = 2 mu de, both normalised
    volume = (stress(s * (1 + h) * np.eye(2)) - stress(s * (1 - h) * np.eye(2))) / (2 * h)
    assert found == pytest.approx(min(shear, volume[0, 0]), rel=1e-7)


@pytest.mark.parametrize(
    ("made", "name"),
    [
        (catalogue.x_strip(k_bar=10), "4-strip"), (catalogue.x_plate(k_bar=10), "4-xplate"),
        (catalogue.octahedra(1.0, 0.1, 20), "5-octahedra-1.0-0.1"),
        pytest.param(catalogue.octahedra(1.0, 0.01, 20), "5-octahedra-1.0-0.01",
                     marks=pytest.mark.slow),
        (catalogue.octahedra(1.0, 0.1, 20, layers=1), "5-plate"),
        (catalogue.resonators(1.0, 0.1, 20, 5, 1, (1, 2)), "6-resonator-0.1"),
        (PRISM.column(periodic=True), "3-column-alternate"),
        (PRISM.column(chirality="same", periodic=True), "3-column-same"),
    ],
)  # fmt: skip
def test_lattices_of_the_catalogue_are_those_of_the_reference(made, name):
    q = np.array([[0.3, 0.3, 0.3], [1.1, -0.4, 0.7], [2.5, 3.0, 0.2]])[:, : len(made.vectors)]
    own = lattice(name)
    assert (made.nodes, made.bars, made.strings) == (own.nodes, own.bars, own.strings)
    wanted = bands(own, q).frequencies
    assert np.abs(bands(made, q).frequencies - wanted).max() < 1e-10 * wanted.max()
    assert np.abs(made.stress).max() < 1e-13
    assert made.stability().stable


@pytest.mark.parametrize("name", ["octahedra", "x_strip", "resonators", "kagome", "honeycomb"])
def test_lattices_of_the_catalogue_scale(name):
    """Twice the size, the same members: frequencies stay."""
    size = {"octahedra": "width", "x_strip": "width"}.get(name, "side")
    other = {"height": 2.0} if name == "x_strip" else {}
    made = getattr(catalogue, name)
    q = np.array([[0.3, 1.2, -0.5]])[:, : len(made().vectors)]
    one, two = bands(made(), q).frequencies, bands(made(**{size: 2.0}, **other), q).frequencies
    assert np.abs(one - two).max() < 1e-12 * one.max()


def test_plane_lattices_of_the_catalogue_have_their_textbook_spectra():  # B2
    third = 2 * math.pi / 3
    corner = bands(catalogue.triangular(k_bar=1.0), [[third, -third]]).frequencies[0] ** 2
    assert np.allclose(corner, 4.5, rtol=1e-13)
    w = bands(catalogue.honeycomb(k_bar=1.0), [[1.1, 0.4]]).frequencies[0] ** 2
    assert np.allclose(w, [0, 0.151019032248, 2.848980967752, 3], atol=1e-11)
    w = bands(catalogue.kagome(k_bar=1.0), [[math.pi, 0]]).frequencies[0] ** 2
    assert np.allclose(w, [0, 1, 3 - math.sqrt(3), 2, 3, 3 + math.sqrt(3)], atol=1e-12)
    w = bands(catalogue.square(k_bar=1.0, k_diagonal=0.3), [[math.pi, math.pi]]).frequencies[0] ** 2
    assert np.allclose(w, 4, rtol=1e-13)


@pytest.mark.parametrize("sides", [3, 4, 5, 6])
def test_columns_of_one_hand_repeat(sides):
    """The cell is in equilibrium, and no shorter one repeats."""
    prism = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0, sides)
    column = prism.column(chirality="same", periodic=True)
    units = column.nodes // sides
    assert units == 4 // math.gcd(4, sides + 2)
    column.refuse_unbalanced()
    twice = prism.column(2 * units, "same", periodic=True)
    q = np.array([[0.8]])
    folded = bands(column, np.array([[0.4], [0.4 + math.pi]])).frequencies.ravel()
    assert np.allclose(np.sort(folded), bands(twice, q).frequencies[0], atol=1e-7)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: decay(row(1.0), 1.0), "frequencies have shape"),
        (lambda: decay(row(1.0), [-1.0]), "frequency -1 rad/s must be >= 0"),
        (lambda: decay(row(1.0), [math.nan]), "frequencies"),
        (lambda: decay(row(1.0), [1.0], 1), "axis 1"),
        (lambda: decay(catalogue.square(), [1.0], 0, [0.1, 0.2]), "wavenumbers"),
        (lambda: effective_mass(row(1.0), [], [1.0]), "frame"),
        (lambda: effective_mass(row(1.0), [0, 0], [1.0]), "distinct nodes"),
        (lambda: effective_mass(row(1.0), [1], [1.0]), "node 1 must be below 1"),
        (lambda: effective_mass(row(1.0), [0], [math.inf]), "frequencies"),
        (lambda: PRISM.column(3, periodic=True), "count 3 must be a multiple of 2"),
        (lambda: PRISM.column(2, "same", periodic=True), "count 2 must be a multiple of 4"),
        (lambda: PRISM.column(plates=True, periodic=True), "no plates"),
    ],
)  # fmt: skip
def test_bad_input_is_refused(call, words):
    with pytest.raises(TensegrityError, match=words):
        call()


def test_states_that_are_no_equilibrium_are_refused():
    moved = catalogue.x_strip().at([(0, 0), (0, 1.05)])
    for call in (
        lambda: decay(moved, [1.0]), lambda: effective_mass(moved, [0], [1.0]), moved.stability,
    ):  # fmt: skip
        with pytest.raises(EquilibriumError, match="not in equilibrium"):
            call()
    unstable = row(2.8, -2, 1).repeated(4)
    with pytest.raises(EquilibriumError, match="grow at"):
        effective_mass(row(-3.0).repeated(2), [0], [1.0])
    assert np.isfinite(decay(unstable, [1.0])).all()
