"""Waves of lattices: closed forms, reference numbers, and properties that need no numbers.

Numbers of `lattices.json` come from a program of its own, partly of 16 digits by mpmath.
"""

import math

import numpy as np
import pytest
import sympy as sp
from lattices import lattice, values

from tensegrity import (
    EquilibriumError,
    Lattice,
    Potential,
    TensegrityError,
    bands,
    catalogue,
    decay,
    dispersion,
    effective_mass,
    moduli,
)

CELLS = ("3-column-alternate", "3-column-same", "4-strip", "4-xplate", "5-octahedra-1.0-0.1",
         "6-resonator-0.1")  # fmt: skip
S = math.sqrt(3) / 2


def spectrum(of, *points):
    """w^2 at each point."""
    w = bands(of, np.array(points, float)).frequencies
    return np.sign(w) * w**2


def close(found, wanted, part=1e-9):
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= part * np.abs(wanted).max(), found - wanted


def triangular(stretch=1.0):
    members = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (-1, 1))]
    vectors = stretch * np.array([[1, 0], [0.5, S]])
    return Lattice([(0, 0)], vectors, strings=members, natural_lengths=[1.0] * 3)


def row(q=(0.1,)):
    """A straight row of single nodes; `q` of the members to the first, second .. neighbour."""
    members = [(0, 0, n + 1) for n in range(len(q))]
    return Lattice([(0, 0)], [(1, 0)], members, k_bar=10).prestressed(q)


def test_axial_waves_of_a_straight_row_are_those_of_the_chain():  # B1
    r, q = sp.Symbol("r"), np.array([0.3, 1.7, math.pi])
    chain = dispersion([Potential(k * r**2 / 2, r) for k in (1.3, 0.4)], [0.7, 2.0], q)
    found = bands(
        Lattice([(0, 0), (1, 0)], [(2, 0)], [(0, 1), (1, 0, 1)], k_bar=[1.3, 0.4], mass=[0.7, 2]),
        q[:, None],
    )
    close(found.frequencies[:, 2:], chain, 1e-14)
    assert (found.frequencies[:, :2] == 0).all()  # nothing resists transverse motion
    close(chain[2], [0.736977868082, 1.65391506750775], 1e-12)
    s = np.sqrt(1.3 / 0.7)
    one = Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)], k_string=1.3, mass=0.7)
    found = bands(one, q[:, None], velocities=True)
    close(found.frequencies[:, 1], 2 * s * np.sin(q / 2), 1e-14)
    close(found.velocities[:, 1, 0], s * np.cos(q / 2), 1e-14)


def test_plane_lattices_have_their_textbook_spectra():  # B2
    third = 2 * math.pi / 3
    close(spectrum(triangular(), [math.pi, 0], [third, -third]), [[2, 6], [4.5, 4.5]], 1e-14)
    s, q = 1.1, 0.1 / 1.1
    close(spectrum(triangular(s), [math.pi, 0], [third, -third]),
          [[2 + 6 * q, 6 + 2 * q], [4.5 * (1 + q)] * 2], 1e-14)  # fmt: skip
    bond = 1 / math.sqrt(3)
    honeycomb = Lattice([(0, 0), (0, bond)], [(1, 0), (0.5, S)], k_bar=1,
                        bars=[(0, 1), (1, 0, (0, 1)), (1, 0, (-1, 1))])  # fmt: skip
    close(spectrum(honeycomb, [0, 0], [math.pi, 0], [third, -third], [1.1, 0.4]),
          [[0, 0, 3, 3], [0, 1, 2, 3], [0, 1.5, 1.5, 3],
           [0, 0.151019032248, 2.848980967752, 3]], 1e-12)  # fmt: skip
    x = [(0, 0), (0.5, 0), (0.25, S / 2)]
    pairs = [(0, 1), (0, 2), (1, 2), (1, 0, (1, 0)), (2, 0, (0, 1)), (2, 1, (-1, 1))]
    kagome = Lattice(x, [(1, 0), (0.5, S)], pairs, k_bar=1)
    root = math.sqrt(3)
    w = spectrum(kagome, [0, 0], [math.pi, 0], [third, -third])
    low, high = (9 - 3 * 5**0.5) / 4, (9 + 3 * 5**0.5) / 4
    wanted = [[0, 0, 0, 3, 3, 6], [0, 1, 3 - root, 2, 3, 3 + root]]
    close(w, [*wanted, [low, low, 1.5, 1.5, high, high]], 1e-14)
    assert len(kagome.mechanisms()) == 1
    square = Lattice([(0, 0)], [(1, 0), (0, 1)], [(0, 0, (1, 0)), (0, 0, (0, 1)),
                     (0, 0, (1, 1)), (0, 0, (1, -1))], k_bar=[1, 1, 0.3, 0.3])  # fmt: skip
    close(spectrum(square, [math.pi, 0], [math.pi, math.pi]), [[1.2, 5.2], [4, 4]], 1e-14)


@pytest.mark.parametrize("name", CELLS[:2])
def test_columns_of_prisms_have_the_frequencies_of_mpmath(name):  # B3
    given = values(name)["frequencies"]
    for phase, w in given.items():
        close(bands(lattice(name), [[float(phase)]]).frequencies[0, : len(w)], w)


def test_columns_of_prisms_have_full_gaps():  # B3
    q = np.linspace(0, math.pi, 2001)[:, None]
    for name, top in (("alternate", 7.580942646036), ("same", 8.273390909301)):
        gaps = bands(lattice(f"3-column-{name}"), q).gaps
        nearest = gaps[np.abs(gaps[:, 0] - 5.5059).argmin()]
        close(nearest, [5.505898503301, top], 1e-8)


@pytest.mark.parametrize("name", ["4-strip", "4-xplate"])
def test_x_modules_have_their_frequencies_and_group_velocities(name):  # B4
    for point, w in values(name)["w"].items():
        found = bands(lattice(name), [np.atleast_1d(eval(point))], velocities=True)
        close(found.frequencies[0], w, 1e-13)
        wanted = np.array(values(name)["velocity"][point])
        close(found.velocities[0, :, : wanted[0].size].reshape(wanted.shape), wanted, 1e-12)


def test_strip_of_x_modules_has_a_gap_and_bends_softly():  # B4
    strip = lattice("4-strip")
    gaps = bands(strip, np.linspace(0, math.pi, 2001)[:, None]).gaps
    close(gaps[0], [2.088931871468, 4.492417854766], 1e-6)
    assert bands(strip, [[0.01]]).frequencies[0, 0] / 1e-4 == pytest.approx(0.52223277, rel=1e-4)


def test_plate_of_x_modules_folds_along_its_lines():  # B4
    flat = lattice("4-xplate")
    space = Lattice(
        [(0, 0, 0)], [(1, 0, 0), (0, 1, 0)], k_bar=10, k_string=2,
        bars=[(0, 0, (1, 1)), (0, 0, (1, -1))], strings=[(0, 0, (1, 0)), (0, 0, (0, 1))],
        natural_lengths=flat.natural_lengths,
    )  # fmt: skip
    for point, w in values("4-xplate")["out_of_plane"].items():
        close(bands(space, [eval(point)]).frequencies[0, 0], w, 1e-12)
    assert (bands(space, [[0, 0.7], [1.3, 0]]).frequencies[:, 0] == 0).all()


def test_octahedra_have_their_frequencies():  # B5
    for name in ("5-octahedra-1.0-0.1", "5-octahedra-1.0-0.01"):
        w = bands(lattice(name), [[math.pi, math.pi, 0], [0.5, 0.2, -0.3]]).frequencies
        close(w[:, :6], [values(name)["w_X"], values(name)["w_g"]])
    w = bands(lattice("5-plate"), [[0.4, 0.4], [0, 0]]).frequencies
    close(w[0, :4], values("5-plate")["w"])
    assert np.sum(w[1] == 0) == values("5-plate")["zero"]


@pytest.mark.parametrize("name", ["1.0-1.0", "1.0-0.25"])
def test_waves_of_a_net_steer_by_force_densities(name):  # B8
    case = values(f"8-net-{name}-0.8")
    q = [float(x) for x in name.split("-")]
    net = Lattice([(0, 0, 0)], [(1, 0, 0), (0, 1, 0)], strings=[(0, 0, (1, 0)), (0, 0, (0, 1))],
                  k_string=10).prestressed(q)  # fmt: skip
    found = bands(net, [case["kappa"]], velocities=True)
    assert found.frequencies[0, 0] == pytest.approx(0.8, rel=1e-12)
    close(found.velocities[0, 0], case["velocity"], 1e-12)


@pytest.mark.parametrize("q", [0.0, 0.2, 0.4])
def test_waves_of_an_x_plate_steer_by_prestress(q):  # B8
    case = values(f"8-xplate-{q}-1.2-0")
    plate = Lattice([(0, 0)], [(1, 0), (0, 1)], k_bar=1.5, k_string=2,
                    bars=[(0, 0, (1, 1)), (0, 0, (1, -1))],
                    strings=[(0, 0, (1, 0)), (0, 0, (0, 1))])  # fmt: skip
    found = bands(plate.prestressed([-q, -q, 2 * q, 2 * q]), [case["kappa"]], velocities=True)
    v = found.velocities[0, 0]
    close(v, case["velocity"])
    assert math.degrees(math.atan2(v[1], v[0])) == pytest.approx(case["angle"], abs=1e-7)


def test_long_waves_of_strings_keep_their_digits():  # B8
    net = Lattice([(0, 0, 0)], [(1, 0, 0), (0, 1, 0)], k_string=1e3,
                  strings=[(0, 0, (1, 0)), (0, 0, (0, 1))]).prestressed([1.0, 0.325])  # fmt: skip
    q = np.array([[1e-6, 2e-6], [1e-7, 0]])
    exact = np.sqrt(4 * (np.sin(q / 2) ** 2 @ [1.0, 0.325]))
    close(bands(net, q).frequencies[:, 0], exact, 1e-10)


def test_members_may_lead_beyond_the_next_cell():  # B13
    given = lattice("13-line")
    close(spectrum(given, [1.3])[0], values("13-line")["w2_1p3"], 1e-13)
    close(spectrum(row((3, -2, 1)), [math.pi / 2])[0, :1] + 1, [1], 1e-12)
    w = bands(row((2.8, -2, 1)), [[math.pi / 2]]).frequencies[0, 0]
    assert w == pytest.approx(-math.sqrt(0.4), rel=1e-12)  # a rate of growth


# properties


@pytest.mark.parametrize("name", CELLS)
def test_velocities_are_differences_and_opposite_waves_are_equal(name):
    of, rng = lattice(name), np.random.default_rng(4)
    q, h = rng.uniform(0.3, 2.8, len(of.vectors)), 1e-5
    found = bands(of, [q, -q], velocities=True, shapes=True)
    w, v = found.frequencies[0], found.velocities[0]
    close(found.frequencies[1], w, 1e-12)
    for a, step in enumerate(h * np.eye(len(q))):
        high, low = bands(of, [q + step, q - step]).frequencies
        slope = (high - low) / (2 * h)
        rate = np.linalg.lstsq(of.vectors.T, v.T, rcond=None)[0][a]
        distinct = np.gradient(w) > 1e-3  # a crossing has no derivative of the ordered branches
        assert np.abs(slope - rate)[distinct].max() < 1e-6 * np.abs(v).max()
    u = found.shapes[0]
    gram = np.einsum("anx,bnx,n->ab", u.conj(), u, of.mass)
    close(gram, np.eye(len(w)), 1e-10)


def test_velocities_of_equal_frequencies_are_those_of_the_branches():
    column = lattice("3-column-alternate")
    q = np.array([[1.0]])
    v = bands(column, q, velocities=True).velocities[0, :2, 2]
    high, low = bands(column, [[1 + 1e-5], [1 - 1e-5]]).frequencies[:, :2]
    close(v, (high - low) / 2e-5 * 1.4, 1e-6)


@pytest.mark.parametrize("phase", [2e-3, 0.02, 0.05])
def test_velocities_of_long_waves_are_those_of_the_moduli(phase):
    """Their frequencies are close to each other beside the highest one, but not equal."""
    lattice_ = catalogue.octahedra(k_bar=20.0, prestrain=0.01)
    normal = np.cross(*lattice_.vectors[:2])
    normal *= np.sign(normal @ lattice_.vectors[2]) / np.linalg.norm(normal)
    found = bands(lattice_, [[0.0, 0.0, phase]], velocities=True).velocities[0, :3]
    speeds = moduli(lattice_).speeds(normal)
    assert found @ normal == pytest.approx(speeds, rel=2.5 * phase**2 + 1e-5)


def test_velocities_where_folded_branches_cross():
    """At phase pi of two cells waves of pi/2 and -pi/2 have one frequency and opposite speeds."""
    strip = lattice("4-strip")
    v = bands(strip, [[math.pi / 2], [-math.pi / 2]], velocities=True).velocities[:, :, 0]
    found = bands(strip.repeated(2), [[math.pi]], velocities=True).velocities[0, :, 0]
    close(np.sort(found.reshape(-1, 2), axis=1), np.sort(v.T, axis=1), 1e-9)


@pytest.mark.parametrize(("name", "counts"), [("4-strip", 3), ("4-xplate", (2, 3)),
                                          ("3-column-alternate", 2)])  # fmt: skip
def test_bands_of_a_larger_cell_are_folded(name, counts):
    of = lattice(name)
    many, q = np.atleast_1d(counts), np.array([0.4, 0.9])[: len(of.vectors)]
    folded = [(q + 2 * math.pi * np.array(n)) / many for n in np.ndindex(*many)]
    w = np.sort(bands(of, folded).frequencies.ravel())
    close(bands(of.repeated(counts), [q]).frequencies[0], w, 1e-12)


@pytest.mark.parametrize("name", CELLS)
def test_waves_depend_neither_on_the_cell_chosen_nor_on_the_frame(name):
    of = lattice(name)
    q = np.full((1, len(of.vectors)), 0.7)
    w = bands(of, q).frequencies
    x, offsets, node = of.positions.copy(), of.offsets.copy(), of.ends == 0
    x[0] += of.vectors[0]
    offsets[:, 0] += node[:, 0].astype(int) - node[:, 1]
    members = [(i, j, tuple(o)) for (i, j), o in zip(of.ends, offsets, strict=True)]
    moved = of.at(x, bars=members[: of.bars], strings=members[of.bars :])
    close(bands(moved, q).frequencies, w, 1e-12)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(of.dim, of.dim)))[0]
    close(bands(of.at(of.positions @ turn, of.vectors @ turn), q).frequencies, w, 1e-12)


def test_bad_waves_are_refused():
    strip = lattice("4-strip")
    with pytest.raises(TensegrityError, match="wavenumbers"):
        bands(strip, [0.1])
    with pytest.raises(TensegrityError, match="wavenumbers"):
        bands(strip, [[math.nan]])
    with pytest.raises(TensegrityError, match="gaps from 1 wavenumbers"):
        _ = bands(strip, [[0.1]]).gaps
    with pytest.raises(EquilibriumError, match="not in equilibrium"):
        bands(strip.at([[0, 0], [0, 1.1]]), [[0.1]])
    assert np.isnan(bands(strip, [[0.0]], velocities=True).velocities[0, :2]).all()


def test_lowest_branches_of_a_large_cell_are_those_of_all_branches():
    cell = catalogue.octahedra(k_bar=20.0).repeated((2, 2, 2))
    q = np.array([[0.3, 0.2, -0.1], [0.0, 0.0, 0.0]])
    whole, low = bands(cell, q, shapes=True), bands(cell, q, shapes=True, count=12)
    assert low.frequencies.shape == (2, 12)
    assert low.velocities is None
    close(low.frequencies, whole.frequencies[:, :12], 1e-11)
    for point in range(2):
        u = low.shapes[point].reshape(12, -1)
        all_of = whole.shapes[point][whole.frequencies[point] < 1.001 * low.frequencies[point, -1]]
        others = all_of.reshape(len(all_of), -1)
        assert np.abs(u.conj() @ u.T - np.eye(12)).max() < 1e-10  # masses are 1
        inside = u @ others.conj().T @ others
        assert np.abs(inside - u).max() < 1e-7
    small = bands(triangular(1.1), [[0.3, 0.2]], count=1).frequencies
    close(small, bands(triangular(1.1), [[0.3, 0.2]]).frequencies[:, :1])


def test_a_cell_of_2000_nodes_has_the_folded_bands():
    counts = np.array([50, 40])
    phases = np.array([0.3, 0.2])
    low = bands(triangular().repeated(counts.tolist()), [phases], count=12).frequencies[0]
    each = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 2)
    folded = np.sort(
        bands(triangular(), (phases + 2 * math.pi * each) / counts).frequencies.ravel()
    )
    close(low, folded[:12], 1e-10)


def test_a_bad_number_of_branches_is_refused():
    for wrong in (0, 3, 1.5, True, "all"):
        with pytest.raises(TensegrityError, match="count"):
            bands(triangular(), [[0.1, 0.2]], count=wrong)
    with pytest.raises(TensegrityError, match="velocities require all branches"):
        bands(triangular(), [[0.1, 0.2]], velocities=True, count=1)


def test_more_points_than_take_minutes_are_refused_before_any_work():
    many, few = 10**8, np.broadcast_to(np.zeros(2), (10**8, 2))
    for call in (
        lambda: bands(triangular(), few), lambda: bands(triangular(), few, count=2),
        lambda: decay(triangular(), np.broadcast_to(1.0, many)),
        lambda: effective_mass(triangular(), [0], np.broadcast_to(1.0, many)),
    ):  # fmt: skip
        with pytest.raises(
            TensegrityError, match=r"100000000 .* GB of memory, must be at most 0.8"
        ):
            call()
    with pytest.raises(TensegrityError, match="bands at 20000 wavenumbers"):
        bands(triangular().repeated((15, 15)), few[:20000], shapes=True)
    with pytest.raises(
        TensegrityError, match=r"waves of 12800 coordinates would take .* GB of memory"
    ):
        bands(triangular().repeated((80, 80)), [[0.1, 0.2]])


def test_numbers_that_leave_the_range_of_floats_are_refused():
    far = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (2, 1))]
    with pytest.raises(TensegrityError, match=r"wavenumbers reach 1e\+308 rad"):
        bands(Lattice([(0, 0)], np.eye(2), far), [[1e308, 0]])
    with pytest.raises(TensegrityError, match="at least 1 point"):
        bands(triangular(), np.zeros((0, 2)))
    for other in ({"k_bar": 1e308}, {"k_bar": 1e-300}, {"mass": 1e-308}):
        cell = Lattice([(0, 0)], np.eye(2), far, **({"k_bar": 1.0} | other))
        for call in (
            lambda cell=cell: bands(cell, [[0.1, 0.2]]), lambda cell=cell: moduli(cell),
            lambda cell=cell: decay(cell, [1.0]), lambda cell=cell: cell.stability(),
            lambda cell=cell: effective_mass(cell, [0], [1.0]),
        ):  # fmt: skip
            with pytest.raises(TensegrityError, match="of a lattice must be above 1e-60"):
                call()
