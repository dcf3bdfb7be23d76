"""Moduli, effective mass and decay at a frequency: the choice of the cell, of the frame and of
units does not matter, and masses of very different sizes keep their digits.

Numbers without a closed form come from programs of their own: Cartesian and cylindrical
coordinates, cells of 2, 4 and 8 units, 50 digits.
"""

import math
from contextlib import suppress

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tensegrity import (
    EquilibriumError,
    Lattice,
    Prism,
    TensegrityError,
    bands,
    decay,
    effective_mass,
    moduli,
)

PRISM = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)
FREQUENCIES = (0.0, 0.1, 0.5, 1.0, 1.8)
COLUMNS = {  # axial [N], coupling [N m], torsional [N m^2]
    "alternate": ((1.5128318509, 1.4940047390, 0.9996617491, -1.3790792871, 29.3587789485),
                  (0.0,) * 5,
                  (0.1102214150, 0.1099237461, 0.1027496472, 0.0799524470, 0.0082586928)),
    "same": ((6.8171159693, 6.8156191228, 6.7796399069, 6.6665212912, 6.3223836849),
             (1.6231228498, 1.6227664578, 1.6141999778, 1.5872669741, 1.5053294488),
             (0.4966792364, 0.4965943812, 0.4945547431, 0.4881421231, 0.4686331885)),
}  # fmt: skip
SEEDS = st.integers(0, 2**32 - 1)


def chain(n):
    """Unit masses, springs and spacing, n of them a cell."""
    pairs = [(i, i + 1) if i < n - 1 else (i, 0, 1) for i in range(n)]
    return Lattice([(i, 0) for i in range(n)], [(n, 0)], pairs, k_bar=1)


def of_column(column, w):
    m = moduli(column, w)
    return np.array([m.axial, m.coupling, m.torsional])


@pytest.mark.parametrize("w", [0.5, 1.0, 1.9])
def test_the_dynamic_modulus_of_a_chain_is_that_of_its_springs_in_any_cell(w):
    for n in (1, 2, 4, 8):
        m = moduli(chain(n), w)
        assert m.axial == pytest.approx(1, abs=1e-14)
        assert m.tangent[0, 0, 0, 0] == pytest.approx(1, abs=1e-14)
        assert m.speeds([1, 0])[1] == pytest.approx(1, abs=1e-14)


def test_the_dynamic_modulus_of_a_diatomic_chain_is_its_closed_form():
    (k1, k2), (m1, m2), l1 = (1.0, 2.5), (1.0, 0.4), 0.3
    row = Lattice([(0, 0), (l1, 0)], [(1, 0)], [(0, 1), (1, 0, 1)], k_bar=[k1, k2], mass=[m1, m2])
    for w in (0.0, 0.5, 1.0, 2.0, 100.0):
        l2, mu = 1 - l1, m1 * m2 / (m1 + m2)
        moved = (k1 * l1 - k2 * l2) ** 2 / (k1 + k2 - mu * w**2)
        for of in (row, row.repeated(3)):
            assert moduli(of, w).axial == pytest.approx(k1 * l1**2 + k2 * l2**2 - moved, rel=1e-13)
    with pytest.raises(TensegrityError, match="is a resonance of the nodes within a cell"):
        moduli(row, math.sqrt((k1 + k2) / (m1 * m2 / (m1 + m2))))


@pytest.mark.parametrize("hand", COLUMNS)
def test_dynamic_moduli_of_columns_do_not_depend_on_the_number_of_units(hand):
    for n, w in enumerate(FREQUENCIES):
        wanted = [row[n] for row in COLUMNS[hand]]
        column = PRISM.column(chirality=hand, periodic=True)
        for of in (column, column.repeated(2), column.repeated(4)):
            assert np.abs(of_column(of, w) - wanted).max() < 6e-11


def test_a_column_is_soft_between_its_zero_and_the_pole_of_its_staggered_twist():
    column = PRISM.column(periodic=True)
    pole = 1.644633815511
    assert np.abs(bands(column, [[0.0]]).frequencies - pole).min() < 1e-11
    zero = 0.793622490418
    assert moduli(column, zero + 1e-9).axial < 0 < moduli(column, zero - 1e-9).axial
    assert moduli(column, pole - 1e-9).axial < -1e6 < 1e6 < moduli(column, pole + 1e-9).axial


def test_dynamic_moduli_of_a_plane_lattice_are_those_of_the_doubled_one():
    members = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (1, 1)), (0, 0, (1, -1)),
               (1, 0), (1, 0, (1, 0)), (1, 0, (0, 1)), (1, 0, (1, 1))]  # fmt: skip
    plane = Lattice([(0, 0), (0.3, 0.6)], np.eye(2), members, mass=[1, 2],
                    k_bar=[20, 20, 5, 5, 1, 1, 1, 1])  # fmt: skip
    wanted = {
        0.0: (25.393430656934306, 5.44963503649635, 25.513868613138683, 5.456934306569343),
        0.4: (25.37482967708273, 5.449761748507159, 25.510242309699112, 5.456892596672271),
        0.8: (25.302499012613676, 5.450825328514072, 25.496598509963434, 5.456737001169689),
        1.2: (25.067727738515902, 5.459829681978798, 25.456760424028268, 5.456296113074204),
    }
    for w, (xxxx, xxyy, yyyy, xyxy) in wanted.items():
        for of in (plane, plane.repeated((2, 1)), plane.repeated((1, 3))):
            c = moduli(of, w).tangent
            found = [c[0, 0, 0, 0], c[0, 0, 1, 1], c[1, 1, 1, 1], c[0, 1, 0, 1]]
            assert np.abs(np.subtract(found, (xxxx, xxyy, yyyy, xyxy))).max() < 1e-12


def test_moduli_at_rest_do_not_depend_on_masses():
    """An inner mass of 1e14 kg is not a motion without stiffness."""
    members = [(0, 0, 1), (0, 1), (1, 0, 1)]
    for mass in ([1, 1], [1, 1e14], [1e-9, 1e6]):
        row = Lattice([(0, 0), (0.3, 0)], [(1, 0)], members, k_bar=[3, 1, 2], mass=mass)
        assert moduli(row).axial == pytest.approx(3 + 2 / 3, rel=1e-14)


# effective mass and decay


@pytest.mark.parametrize(
    ("inner", "springs", "w", "wanted"),
    [
        ((1e7, 1e-7), (1, 2), 0.4, -5.250003906252441),
        ((1e-7, 1e7), (3, 1), 0.5, -2.000000843750281),
        ((1e14, 1), (1, 1), 0.9, -0.2345679012345831),
    ],
)
def test_attached_masses_of_any_size_keep_their_digits(inner, springs, w, wanted):
    row = Lattice([(0, 0), (0.3, 0), (0.6, 0)], [(1, 0)], [(0, 1), (1, 2)],
                  k_bar=springs, mass=[1, *inner])  # fmt: skip
    assert effective_mass(row, [0], [w])[0, 0, 0] == pytest.approx(wanted, rel=3e-15)


def in_frame(outer, inner):
    """The chain of the docstring of `effective_mass`, with other masses."""
    members = [(0, 0, 1), (0, 1), (1, 0, 1)]
    return Lattice([(0, 0), (0.5, 0)], [(1, 0)], members, k_bar=[3, 1, 1], mass=[outer, inner])


@pytest.mark.parametrize(
    ("outer", "inner"),
    [(1, 1e14), (1, 1e12), (1e-7, 1e7), (1e7, 1e-7), (1e-9, 1e6), (1e6, 1e-9), (1, 2)],
)
def test_a_mass_in_a_mass_has_its_closed_forms(outer, inner):
    """m = m0 + m1 w0^2/(w0^2 - w^2); the phase follows from eliminating the inner mass."""
    row, w0 = in_frame(outer, inner), math.sqrt(2 / inner)
    w = w0 * np.array([0, 0.5, 0.99, 1.01, 2, 1e3])
    exact = outer + inner / ((1 - w / w0) * (1 + w / w0))
    found = effective_mass(row, [0], w)[:, 0, 0]
    assert np.abs(found / exact - 1).max() < 2e-14
    with pytest.raises(TensegrityError, match="is a resonance"):
        effective_mass(row, [0], [w0])
    for frequency in w[1:]:
        own = mp.mpf(8) - mp.mpf(float(frequency)) ** 2 * outer
        follow = 1 / (2 - mp.mpf(float(frequency)) ** 2 * inner)
        phase = mp.acos((own - 2 * follow) / (6 + 2 * follow))
        for one in decay(row, [frequency])[0]:
            if abs(phase.imag) > 26:
                assert abs(one.imag) == np.inf
                continue
            assert abs(one.real) == pytest.approx(float(abs(phase.real)), abs=1e-6)
            assert abs(one.imag) == pytest.approx(float(abs(phase.imag)), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("kind", ["bars", "strings"])
def test_a_resonator_at_the_place_of_its_bead(kind):
    """A spring of natural length 0 resists alike in all directions, also in a state of stress."""
    big, inner, (m0, m1) = 2.0, 0.565, (1.0, 0.5)
    given = {"bars": [(0, 0, 1)], "strings": [], "k_bar": [big]}
    given[kind] = [*given[kind], (0, 1)]
    given["k_bar" if kind == "bars" else "k_string"] = [big, inner] if kind == "bars" else [inner]
    row = Lattice([(0, 0)] * 2, [(1, 0)], **given, mass=[m0, m1], natural_lengths=[1, 0])
    w = math.sqrt(inner / m1) * np.array([0.3, 1.02, 2.0])
    m = m0 + inner / (inner / m1 - w**2)
    found = effective_mass(row, [0], w)
    assert np.abs(found / m[:, None, None] - np.eye(2)).max() < 1e-12
    phase = np.arccos(1 - m * w**2 / (2 * big) + 0j)
    for one, exact in zip(decay(row, w), phase, strict=True):
        assert np.abs(one[:2] - exact).min() < 1e-7
        assert np.abs(one[:2] + exact).min() < 1e-7
    for of in (row, row.prestressed([0.1, 0.0]), row.equilibrium(np.diag([1.1, 1.0]))):
        still = bands(of, [[0.0]]).frequencies[0]
        assert still == pytest.approx([0, 0, *[math.sqrt(inner * (1 / m0 + 1 / m1))] * 2])
        assert moduli(of, 0.5).axial == pytest.approx(big * of.size, rel=1e-12)
    assert row.densities.tolist() == [0, inner]
    assert len(row.self_stress().states) == 1  # that of the row
    for call, words in (
        (lambda: row.tile(3), "natural length 0 m"), (lambda: row.network(3), "natural length 0 m"),
        (lambda: row.at(row.positions, natural_lengths=None), "natural length 0"),
        (lambda: row.at(row.positions, natural_lengths=[1, -1]), "natural length -1 m"),
    ):  # fmt: skip
        with pytest.raises(TensegrityError, match=words):
            call()


def test_the_octet_truss_has_its_moduli():
    """C11 = rho/6, C12 = C44 = rho/12 of a modulus of 1 and a relative density rho."""
    edge, area = 0.01, 1e-7
    vectors = edge / math.sqrt(2) * np.array([(0, 1, 1), (1, 0, 1), (1, 1, 0)])
    offsets = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -1, 0), (1, 0, -1), (0, 1, -1)]
    octet = Lattice([(0, 0, 0)], vectors, [(0, 0, o) for o in offsets], k_bar=area / edge)
    density = 6 * area * edge / octet.size
    assert octet.lengths == pytest.approx(edge, rel=1e-14)
    for of in (octet, octet.repeated((2, 1, 2))):
        c = moduli(of).stiffness
        found = [c[0, 0, 0, 0], c[0, 0, 1, 1], c[0, 1, 0, 1]]
        assert found == pytest.approx(density * np.array([1 / 6, 1 / 12, 1 / 12]), rel=1e-12)
        compliance = np.linalg.inv([[c[i, i, j, j] for j in range(3)] for i in range(3)])
        assert 1 / compliance[0, 0] == pytest.approx(density / 9, rel=1e-12)
        assert -compliance[0, 1] / compliance[0, 0] == pytest.approx(1 / 3, rel=1e-12)


def test_a_direction_in_which_nothing_carries_a_node_is_not_attached():
    """Bars in a plane carry the inner node in it; across it the frame moves alone."""
    pairs = [(0, 0, 1), (0, 1), (0, 1, -1), (0, 1, 1)]
    x = np.array([(0, 0, 0), (0.2, 0.3, 0.4)])
    row = Lattice(x, [(1, 0, 0)], pairs, k_bar=[3, 1, 5, 2], mass=[1, 2])
    normal = np.array([0, 0.8, -0.6])
    wanted = 3 * np.eye(3) - 2 * np.outer(normal, normal)
    assert np.abs(effective_mass(row, [0], [0.0, 1e-9]) - wanted).max() < 1e-14


# properties, at the scales of laboratories and buildings


def random_lattice(seed):
    """A lattice in any dimension, under a random stress in equilibrium: EA from 1e3 to 1e8 N,
    cells of 1e-5 to 1e2 m, masses from 1e-9 to 1e6 kg."""
    rng = np.random.default_rng(seed)
    dim = int(rng.integers(2, 4))
    d, nodes = int(rng.integers(1, dim + 1)), int(rng.integers(1, 5))
    size, hardest = 10 ** rng.uniform(-5, 2), 10 ** rng.uniform(4, 8)
    x = rng.uniform(0, 1, (nodes, dim))
    vectors = (np.eye(dim) + rng.uniform(-0.2, 0.2, (dim, dim)))[:d]
    every = [(i, j, tuple(o)) for i in range(nodes) for j in range(i, nodes)
             for o in np.stack(np.meshgrid(*[(-1, 0, 1)] * d), -1).reshape(-1, d).tolist()
             if i < j or tuple(o) > (0,) * d]  # fmt: skip
    apart = [np.linalg.norm(x[j] + np.array(o) @ vectors - x[i]) for i, j, o in every]
    members = [every[n] for n in np.flatnonzero(np.array(apart) > 0.1)]
    k = hardest * 10 ** rng.uniform(-1, 0, len(members)) / size
    mass = 10 ** (rng.uniform(-9, 6) + rng.uniform(-1, 1, nodes))
    if rng.integers(2):
        mass = 10 ** rng.uniform(-9, 6, nodes)
    lattice = Lattice(x * size, vectors * size, members, k_bar=k, mass=mass)
    states = lattice.self_stress().states
    if len(states):
        q = rng.normal(size=len(states)) @ states
        lattice = lattice.prestressed(10 ** rng.uniform(-6, -2) * k.min() * q / np.abs(q).max())
    return lattice, rng


def listed(lattice, ends, offsets):
    return [(i, j, tuple(o)) for (i, j), o in zip(ends.tolist(), offsets.tolist(), strict=True)]


def other_choices(lattice, rng):
    """The same lattice in other cells, and in another order of nodes and members."""
    d, x, offsets = len(lattice.vectors), lattice.positions.copy(), lattice.offsets.copy()
    counts = rng.integers(1, 3, d)
    yield lattice.repeated(counts.tolist())
    move = rng.integers(-1, 2, (lattice.nodes, d))
    offsets += move[lattice.ends[:, 0]] - move[lattice.ends[:, 1]]
    yield lattice.at(x + move @ lattice.vectors, bars=listed(lattice, lattice.ends, offsets))
    mixed = np.eye(d, dtype=int) + np.diag(np.ones(d - 1, dtype=int), 1)
    offsets = np.rint(lattice.offsets @ np.linalg.inv(mixed)).astype(int)
    yield lattice.at(x, mixed @ lattice.vectors, bars=listed(lattice, lattice.ends, offsets))
    order, of = rng.permutation(lattice.nodes), rng.permutation(len(lattice.ends))
    members = listed(lattice, np.argsort(order)[lattice.ends[of]], lattice.offsets[of])
    yield lattice.at(
        x[order], bars=members, k_bar=lattice.stiffnesses[of], mass=lattice.mass[order],
        natural_lengths=lattice.natural_lengths[of],
    )  # fmt: skip


def frequency_of(lattice, rng):
    """One in the range of the lattice's own [rad/s]."""
    w = np.sqrt(lattice.stiffnesses.max() / lattice.mass)
    return float(10 ** rng.uniform(np.log10(w.min()) - 1, np.log10(w.max()) + 1))


def size_of(lattice):
    """Stiffness against strain without internal motions [N/m^(d - 1)]."""
    return float(np.sum(lattice.stiffnesses * lattice.lengths**2)) / lattice.size


def invariant_moduli(seed):
    lattice, rng = random_lattice(seed)
    w = frequency_of(lattice, rng) * int(rng.integers(2))
    try:
        m = moduli(lattice, w)
    except EquilibriumError:
        return assume(False)
    scale = size_of(lattice)
    assume(np.abs(m.tangent).max() < 1e3 * scale)  # close to a resonance digits are lost
    whole = [m.axial, m.coupling / lattice.size, m.torsional / lattice.size**2]
    along = lattice.vectors.sum(axis=0)
    for other in other_choices(lattice, rng):
        found = moduli(other, w)
        assert np.abs(found.tangent - m.tangent).max() < 1e-9 * scale
        assert np.abs(found.stress - m.stress).max() < 1e-12 * scale
        assert found.density == pytest.approx(m.density, rel=1e-12)
        if len(lattice.vectors) == 1:
            size = lattice.size
            parts = [found.axial, found.coupling / size, found.torsional / size**2]
            assert np.allclose(parts, whole, rtol=0, atol=1e-9 * scale, equal_nan=True)
        squares = [np.abs(of.speeds(along)) * of.speeds(along) for of in (m, found)]
        largest = max(scale / m.density, np.abs(squares).max())
        assert np.abs(squares[0] - squares[1]).max() < 1e-9 * largest
    turn = np.linalg.qr(rng.normal(size=(lattice.dim, lattice.dim)))[0]
    found = moduli(lattice.at(lattice.positions @ turn, lattice.vectors @ turn), w)
    turned = np.einsum("abcd,ai,bj,ck,dl->ijkl", m.tangent, turn, turn, turn, turn)
    assert np.abs(found.tangent - turned).max() < 1e-9 * scale
    length, mass, time = 10 ** rng.uniform(-3, 3, 3)
    found = moduli(in_units(lattice, length, mass, time), w / time)
    unit = mass * length / time**2 / length ** (len(lattice.vectors) - 1)
    assert np.abs(found.tangent - m.tangent * unit).max() < 1e-9 * scale * unit
    return None


def in_units(lattice, length, mass, time):
    """The lattice with its numbers in other units."""
    return lattice.at(
        lattice.positions * length, lattice.vectors * length, mass=lattice.mass * mass,
        k_bar=lattice.stiffnesses * mass / time**2,
        natural_lengths=lattice.natural_lengths * length,
    )  # fmt: skip


def invariant_mass(seed):
    """Against the definition in 60 digits, in every cell, frame and unit."""
    lattice, rng = random_lattice(seed)
    frame = [0] if lattice.nodes < 3 else [0, 1]
    w = frequency_of(lattice, rng)
    try:
        m = effective_mass(lattice, frame, [w])[0]
    except EquilibriumError:
        return assume(False)
    exact, scale = mass_of(lattice, frame, w)
    assert np.abs(m - exact).max() < 1e-9 * scale
    held = effective_mass(lattice, frame, [0.0])[0]
    assert np.abs(held - held.T).max() < 1e-9 * held.max()
    bounds = lattice.mass[frame].sum(), lattice.mass.sum()
    within, (low, *_, high) = 1e-9 * bounds[1], np.linalg.eigvalsh(held)
    assert bounds[0] - within < low <= high < bounds[1] + within
    order = rng.permutation(lattice.nodes)
    ends = np.argsort(order)[lattice.ends]
    other = lattice.at(lattice.positions[order], bars=listed(lattice, ends, lattice.offsets),
                       mass=lattice.mass[order])  # fmt: skip
    numbers = np.argsort(order)[frame]
    assert np.abs(effective_mass(other, numbers, [w])[0] - m).max() < 1e-9 * scale
    twice = lattice.repeated([2] + [1] * (len(lattice.vectors) - 1))
    numbers = [n + lattice.nodes * c for c in (0, 1) for n in frame]
    with suppress(EquilibriumError):  # bars in compression may have another instability there
        assert np.abs(effective_mass(twice, numbers, [w])[0] - 2 * m).max() < 2e-9 * scale
    turn = np.linalg.qr(rng.normal(size=(lattice.dim, lattice.dim)))[0]
    other = lattice.at(lattice.positions @ turn, lattice.vectors @ turn)
    assert np.abs(effective_mass(other, frame, [w])[0] - turn.T @ m @ turn).max() < 1e-9 * scale
    length, mass, time = 10 ** rng.uniform(-3, 3, 3)
    found = effective_mass(in_units(lattice, length, mass, time), frame, [w / time])[0] / mass
    assert np.abs(found - m).max() < 1e-9 * scale
    return None


def mass_of(lattice, frame, w):
    """-T^T [K_FF - w^2 M_F - K_FI (K_II - w^2 M_I)^-1 K_IF] T/w^2 in 60 digits, and the size of the
    parts of which it consists near a resonance."""
    dim, size = lattice.dim, lattice.positions.size
    blocks = lattice.members.blocks(lattice.positions)
    with mp.workdps(60):
        k = mp.zeros(size)
        for (i, j), block in zip(lattice.ends.tolist(), blocks, strict=True):
            for a in range(dim):
                for b in range(dim):
                    value = mp.mpf(float(block[a, b]))
                    k[dim * i + a, dim * i + b] += value
                    k[dim * j + a, dim * j + b] += value
                    k[dim * i + a, dim * j + b] -= value
                    k[dim * j + a, dim * i + b] -= value
        for n in range(size):
            k[n, n] -= mp.mpf(w) ** 2 * mp.mpf(float(lattice.mass[n // dim]))
        inner = [n for n in range(size) if n // dim not in frame]
        t = mp.matrix(size, dim)
        for n in frame:
            for a in range(dim):
                t[dim * n + a, a] = 1
        force = k * t
        if inner:
            part = mp.matrix([[k[a, b] for b in inner] for a in inner])
            u = mp.inverse(part) * mp.matrix([[-force[a, b] for b in range(dim)] for a in inner])
            for row, a in enumerate(inner):
                for b in range(dim):
                    t[a, b] = u[row, b]
        m = -(k * t) / mp.mpf(w) ** 2
        found = [[float(sum(m[dim * n + a, b] for n in frame)) for b in range(dim)]
                 for a in range(dim)]  # fmt: skip
        moved = max(float(abs(x)) for x in t)
    held = float(lattice.mass[frame].sum())
    return np.array(found), max(held, np.abs(found).max()) * max(moved, 1.0) + held


def invariant_bands(seed):
    lattice, rng = random_lattice(seed)
    d, q = len(lattice.vectors), rng.uniform(-3, 3, len(lattice.vectors))

    def squares(of, *points):
        w = bands(of, np.array(points)).frequencies
        return np.sort((w * np.abs(w)).ravel())

    one = squares(lattice, q)
    close = 1e-11 * np.abs(squares(lattice, q, np.full(d, np.pi))).max()
    counts = rng.integers(1, 3, d)
    folded = [(q + 2 * np.pi * np.array(n)) / counts for n in np.ndindex(*counts)]
    every = squares(lattice, *folded)
    _, moved, mixed, numbered = other_choices(lattice, np.random.default_rng(seed))
    assert np.abs(squares(lattice.repeated(counts.tolist()), q) - every).max() < close
    vectors = np.linalg.lstsq(lattice.vectors.T, mixed.vectors.T, rcond=None)[0].T
    for of, at in ((moved, q), (mixed, vectors @ q), (numbered, q)):
        assert np.abs(squares(of, at) - one).max() < close
    turn = np.linalg.qr(rng.normal(size=(lattice.dim, lattice.dim)))[0]
    turned = lattice.at(lattice.positions @ turn, lattice.vectors @ turn)
    assert np.abs(squares(turned, q) - one).max() < close
    length, mass, time = 10 ** rng.uniform(-3, 3, 3)
    found = squares(in_units(lattice, length, mass, time), q) * time**2
    assert np.abs(found - one).max() < close


PROPERTIES = (invariant_moduli, invariant_mass, invariant_bands)


@pytest.mark.parametrize("holds", PROPERTIES)
def test_nothing_depends_on_cell_frame_units_or_numbering(holds):
    settings(max_examples=12, deadline=None)(given(SEEDS)(holds))()


@pytest.mark.slow
@pytest.mark.parametrize("holds", PROPERTIES)
def test_nothing_depends_on_cell_frame_units_or_numbering_in_1000_lattices(holds):
    count = 0

    def counted(seed):
        nonlocal count
        holds(seed)
        count += 1

    settings(max_examples=1000, deadline=None)(given(SEEDS)(counted))()
    print(f"{holds.__name__}: {count} lattices, none outside its tolerance")
