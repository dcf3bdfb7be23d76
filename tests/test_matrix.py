"""Lattices in a matrix: closed forms, reference numbers of a program of its own, limits, orders.

Three levels, each the check of the next: a sheath about a chain, a matrix that is bonded
everywhere, and finite elements around rigid patches.
"""

import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegrity import (
    EquilibriumError,
    Lattice,
    Matrix,
    Prism,
    TensegrityError,
    bands,
    catalogue,
    decay,
    dispersion,
    effective_mass,
    moduli,
    sheath,
)
from tensegrity.lattices.mesh import Body

skfem = pytest.importorskip("skfem")

BARS, STRINGS = [(0, 0, (1, 1)), (0, 0, (1, -1))], [(0, 0, (1, 0)), (0, 0, (0, 1))]
RESTS = np.array([math.sqrt(2), math.sqrt(2), 1, 1])
PATH = np.pi * np.array([(0, 0), (0.5, 0), (1, 0), (0.5, 1), (1, 1), (0.5, 0.5)])
HARD = Matrix(3.0, 0.3, 0.5, radius=0.2)


def net(q=0.0, vectors=((1, 0), (0, 1)), **other):
    """One node of 1 kg, bars of force density -q and strings of 2q, whose stiffnesses are dT/dL."""
    k = np.array([1.5, 1.5, 2, 2])
    rest = RESTS * (1 - np.array([-q, -q, 2 * q, 2 * q]) / k)
    values = {"k_bar": 1.5, "k_string": 2.0, "natural_lengths": rest}
    return Lattice([(0, 0)], vectors, BARS, STRINGS, **(values | other))


def stretched(q):
    """The same before the release: strings of tension 2q, bars without."""
    return net(natural_lengths=RESTS - np.array([0, 0, q, q]))


def resonator(s, radius, n=8, modulus=2.0):
    """A mass of 1 on strings of transverse stiffness s in a disc of .5 that a matrix of density .5
    holds, out of the plane."""
    cell = Lattice([(0, 0)] * 2, np.eye(2), strings=[(0, 1)], k_string=s, natural_lengths=[0.0],
                   mass=[0.5, 1.0])  # fmt: skip
    return cell.embedded(Matrix(modulus, 0.0, 0.5, radius={0: radius}, antiplane=True), mesh=n)


def isotropic(matrix, dim):
    """C_ijkl by Lame's constants."""
    one = np.eye(dim)
    whole = matrix.shear * np.einsum("ik,jl->ijkl", one, one)
    whole = whole + matrix.shear * np.einsum("il,jk->ijkl", one, one)
    nu = matrix.poisson
    return whole + matrix.modulus * nu / ((1 + nu) * (1 - 2 * nu)) * np.einsum("ij,kl", one, one)


def edges(lattice):
    w = bands(lattice, PATH, count=3).frequencies
    return w[:, 0].max(), w[:, 1].min()


# a chain in a sheath


def test_a_sheath_cuts_off_long_waves_whatever_the_prestrain():
    """Cut-offs to the digits that agree with the prism's stiffness, which is held to 14 digits."""
    cases = {0.01: 0.73142182, 0.05: 1.35429278, 0.1: 1.73927728, 0.2: 2.13684320}
    for p, top in cases.items():
        prism = Prism(1, 0.7, p, 1, 5, 50)
        ground = sheath(prism, G=0.05, outer=1, radius=0.6)
        assert ground.stiffness(0.0) == pytest.approx(0.430502064735944, rel=1e-14)
        low, high = dispersion(prism.potential(), 3.0, [0, np.pi], ground=ground)[:, 0]
        assert low == pytest.approx(0.37881484691774514, rel=1e-14)
        assert high == pytest.approx(top, rel=4e-7)
        if p == 0.1:
            closed = math.sqrt((0.430502064735944 + 4 * 2.16118835845707) / 3)
            assert high == pytest.approx(closed, rel=1e-13)
    wide = sheath(prism, G=0.05, outer=1)  # the circumradius by default
    assert wide.stiffness(0.0) == sheath(prism, 0.05, 1, prism.circumradius).stiffness(0.0)


# bonded everywhere

SPEEDS = {  # (modulus, q): along x; None: along 45 degrees at modulus 1
    (1, 0.0): (1.109001829, 2.205009970), (1, 0.2): (1.167569437, 2.174565619),
    (1, 0.4): (1.223336309, 2.143688946), (10, 0.4): (1.888257726, 5.230107359),
    (None, 0.0): (0.946864153, 2.279342515), (None, 0.2): (0.873623712, 2.308405431),
    (None, 0.4): (0.793652983, 2.337106965),
}  # fmt: skip


@pytest.mark.parametrize(("modulus", "q"), SPEEDS)
def test_tangents_and_densities_of_lattice_and_matrix_add(modulus, q):
    found = moduli(net(q).embedded(Matrix(modulus or 1, 0.45, 0.5)))
    assert found.speeds([1, 0] if modulus else [1, 1]) == pytest.approx(
        SPEEDS[modulus, q], abs=6e-10
    )
    assert found.density == 1.5


@pytest.mark.parametrize(
    ("q", "slow", "fast"),
    [(0, 1.224744871, 1.870828693), (0.2, 1.303840481, 1.816590212),
     (0.4, 1.378404875, 1.760681686)],
)  # fmt: skip
def test_without_a_matrix_speeds_are_those_of_the_lattice(q, slow, fast):
    light = net(q).embedded(Matrix(1e-12, 0.45, 0.0))
    assert moduli(light).speeds([1, 0]) == pytest.approx([slow, fast], abs=6e-10)
    assert moduli(light).speeds([1, 0]) == pytest.approx(moduli(net(q)).speeds([1, 0]), rel=1e-11)


def test_prestress_tunes_a_slow_wave_by_12_5_10_3_and_4_0_percent():
    def tuned(modulus):
        slow = [moduli(net(q).embedded(Matrix(modulus, 0.45, 0.5))).speeds([1, 0])[0]
                for q in (0, 0.4)]  # fmt: skip
        return 100 * (slow[1] / slow[0] - 1)

    assert np.round([tuned(m) for m in (1e-12, 1, 10)], 1).tolist() == [12.5, 10.3, 4.0]


@settings(max_examples=20, deadline=None)
@given(
    st.floats(0, 0.4), st.floats(0.01, 30), st.floats(-0.5, 0.49), st.floats(0, 3), st.floats(0, 7)
)
def test_speeds_of_any_bonded_lattice_are_christoffel_s(q, modulus, poisson, density, angle):
    """By the members' own sums, k - q on e e^T and q on the normals, and Lame's constants."""
    n = np.array([math.cos(angle), math.sin(angle)])
    d, k = np.array([(1, 1), (1, -1), (1, 0), (0, 1)]), np.array([1.5, 1.5, 2, 2])
    f, e = np.array([-q, -q, 2 * q, 2 * q]), d / RESTS[:, None]
    along = (d @ n) ** 2
    tensor = np.einsum("m,mi,mj->ij", (k - f) * along, e, e) + f @ along * np.eye(2)
    shear = modulus / (2 * (1 + poisson))
    lame = modulus * poisson / ((1 + poisson) * (1 - 2 * poisson))
    tensor += (lame + shear) * np.outer(n, n) + shear * np.eye(2)
    wanted = np.sqrt(np.linalg.eigvalsh(tensor) / (1 + density))
    found = moduli(net(q).embedded(Matrix(modulus, poisson, density))).speeds(n)
    assert found == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(
    ("modulus", "strain", "stress"),
    [(0.1, -0.0703030303, -0.0484848485), (1, -0.0336231884, -0.2318840580),
     (10, -0.00540792541, -0.3729603730), (1e6, -5.8e-8, -0.4)],
)  # fmt: skip
def test_released_strings_shorten_the_matrix(modulus, strain, stress):
    cast = stretched(0.2).embedded(Matrix(modulus, 0.45, 0.5), cast="released")
    assert cast.strain == pytest.approx(strain * np.eye(2), rel=1e-8, abs=1e-12)
    assert cast.matrix_stress == pytest.approx(stress * np.eye(2), rel=1e-6, abs=1e-12)
    c = moduli(net()).stiffness + isotropic(Matrix(modulus, 0.45, 0.5), 2)
    closed = -0.4 / (c[0, 0, 0, 0] + c[0, 0, 1, 1])
    assert cast.strain[0, 0] == pytest.approx(closed, rel=1e-12)
    assert np.abs(cast.stress).max() < 1e-15
    tensions = np.array([0, 0, 0.4, 0.4]) + np.array([1.5, 1.5, 2, 2]) * closed * RESTS
    assert cast.lattice.tensions == pytest.approx(tensions, rel=1e-9)


def test_a_string_that_slackens_in_the_release_is_refused():
    slack = net(natural_lengths=RESTS - np.array([0.3, 0.3, 0.01, 0.01]))
    with pytest.raises(EquilibriumError, match=r"string 2 would slacken .* from 0.02 to -"):
        slack.embedded(Matrix(0.1, 0.45, 0.5), cast="released")
    weak = net(natural_lengths=RESTS - np.array([0, 0, 0.2, 0.2]), buckling=0.05)
    with pytest.raises(EquilibriumError, match=r"bar 0 would slacken or buckle"):
        weak.embedded(Matrix(0.1, 0.45, 0.5), cast="released")


def test_a_matrix_bonded_everywhere_has_no_short_waves():
    bonded = net().embedded(Matrix(1, 0.3, 1))
    for call in (lambda: bands(bonded, [[0, 0.1]]), lambda: decay(bonded, [1.0])):
        with pytest.raises(TensegrityError, match="bonded everywhere has moduli only"):
            call()
    found = bonded.stability()
    assert found.wave == np.inf
    assert found.long == pytest.approx(moduli(bonded).speeds([1, 1])[0] ** 2, rel=1e-3)


# finite elements


def held_stiffness(mesh, inner, outer):
    """Stiffness over shear modulus of one rigid part of a mesh against another one that is held."""
    patch, n = np.where(inner, 0, np.where(outer, 1, -1)), mesh.nvertices
    body = Body(
        Matrix(2.0, 0.0, 1.0, antiplane=True), np.zeros((2, 2)), np.eye(2), {0: 1.0, 1: 1.0}, mesh,
        patch, np.arange(n), np.zeros((n, 2), int),
    )  # fmt: skip
    from scipy.sparse.linalg import spsolve

    k = (body.alike.T @ body.elastic @ body.alike).tocsc()
    pull = k[2:, [0]].toarray().ravel()
    return k[0, 0] - pull @ spsolve(k[2:, 2:], pull)


def test_a_rigid_disc_in_a_held_circle_converges_by_order_two():
    errors = []
    for n in (4, 8, 16, 32):
        turn, r = np.arange(4 * n) * np.pi / (2 * n), 0.1 ** (1 - np.arange(n + 1) / n)
        x = np.stack([np.outer(np.cos(turn), r), np.outer(np.sin(turn), r)]).reshape(2, -1)
        at = np.arange(x.shape[1]).reshape(4 * n, n + 1)
        cells = np.stack(
            [at[:, :-1], at[:, 1:], np.roll(at, -1, 0)[:, 1:], np.roll(at, -1, 0)[:, :-1]]
        )
        mesh, far = skfem.MeshQuad(x, cells.reshape(4, -1)), np.hypot(*x)
        errors.append(
            held_stiffness(mesh, far < 0.101, far > 0.999) * math.log(10) / (2 * np.pi) - 1
        )
    assert errors == pytest.approx([4.087e-2, 1.014e-2, 2.531e-3, 6.324e-4], rel=5e-4)
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(
        [2.011, 2.003, 2.001], abs=1e-3
    )


def test_a_node_at_a_single_vertex_has_no_limit_and_is_refused():
    found = []
    for n in (8, 16, 32, 64):
        line = np.linspace(-0.5, 0.5, n + 1)
        mesh = skfem.MeshQuad.init_tensor(line, line)
        far = np.abs(mesh.p).max(axis=0)
        found.append(held_stiffness(mesh, far < 1e-9, far > 0.5 - 1e-9))
    assert found == pytest.approx([1.728584700, 1.453404554, 1.252878164, 1.100798751], abs=6e-10)
    grown = np.diff(1 / np.array(found))
    assert grown == pytest.approx([0.10953, 0.11012, 0.11027], abs=6e-6)
    assert np.abs(grown - math.log(2) / (2 * np.pi)).max() < 1e-3
    with pytest.raises(TensegrityError, match=r"radius .* missing .* single vertex has no limit"):
        net().embedded(Matrix(1, 0.3, 1), mesh=4)


@pytest.mark.parametrize(
    ("s", "low", "high"),
    [(0.4, 0.61279, 0.90578), (0.8, 0.83970, 1.27589), (1.6, 1.11625, 1.78937)],
)
def test_a_soft_matrix_lowers_the_edges_of_a_resonator_s_gap(s, low, high):
    assert edges(resonator(s, 0.2)) == pytest.approx([low, high], rel=1e-3)
    for radius in (0.2, 0.25):
        mass = 0.5 + 0.5 * (1 - np.pi * radius**2)
        closed = [math.sqrt(s), math.sqrt(s * (1 + 1 / mass))]
        assert edges(resonator(s, radius, 4, 2e6)) == pytest.approx(closed, rel=2e-3)
    cast = resonator(s, 0.2)
    assert bands(cast, PATH, count=3).gaps[0] == pytest.approx([low, high], rel=1e-3)
    inside = effective_mass(cast, [0], [(low + high) / 2])[0, 0, 0]
    assert inside < 0
    assert effective_mass(cast, [0], [0.0])[0, 0, 0] == pytest.approx(cast.density, rel=1e-12)


def test_rigid_discs_stiffen_a_matrix_as_rayleigh_says():
    """Square array of discs of share f (Rayleigh 1892; Perrins, McKenzie & McPhedran 1979)."""
    cell, f = net(k_bar=1e-12, k_string=1e-12), np.pi * 0.3**2
    closed = 1 + 2 * f / (1 - f - 0.305827 * f**4 / (1 - 1.402958 * f**8) - 0.013362 * f**8)
    errors = [
        moduli(cell.embedded(Matrix(2, 0, 1, radius=0.3, antiplane=True), mesh=n)).tangent[
            0, 0, 0, 0
        ]
        - closed
        for n in (4, 8, 16)
    ]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2], abs=0.15)
    assert abs(errors[-1]) < 1e-3 * closed


def test_bands_and_moduli_converge_by_order_two():
    found = []
    for n in (6, 12, 24):
        cast = net(0.2).embedded(HARD, mesh=n)
        w = bands(cast, [[1.0, 0.4]], count=1).frequencies[0]
        found.append([*w, *moduli(cast).speeds([1, 0.3])])
    first, second = np.abs(np.diff(found, axis=0))
    wave, slow, fast = np.log2(first / second)
    assert [wave, slow] == pytest.approx([2.0, 2.0], abs=0.15)
    assert fast == pytest.approx(2.0, abs=0.15)


def test_long_waves_are_those_of_moduli_also_under_stress():
    for cast in (
        net(0.2).embedded(HARD, mesh=4),
        stretched(0.2).embedded(HARD, cast="released", mesh=4),
    ):
        for n in ([1.0, 0.0], [0.6, 0.8]):
            w = bands(cast, [1e-3 * np.array(n)], count=2).frequencies[0]
            assert moduli(cast).speeds(n) == pytest.approx(1e3 * w, rel=1e-6)
    assert np.abs(cast.stress).max() < 1e-14
    assert cast.lattice.tensions[2] < 0.4


def test_small_patches_leave_the_matrix_that_is_bonded_everywhere():
    for cast, of in (("prestressed", net(0.2)), ("released", stretched(0.2))):
        wanted = of.embedded(Matrix(3.0, 0.3, 0.5), cast=cast)
        errors = []
        for a in (0.1, 0.05):
            found = of.embedded(Matrix(3.0, 0.3, 0.5, radius=a), cast=cast, mesh=10)
            errors.append(moduli(found).tangent[0, 0, 0, 0] - moduli(wanted).tangent[0, 0, 0, 0])
        assert 3 < errors[0] / errors[1] < 5  # like the area of the patches
        assert found.strain == pytest.approx(wanted.strain, rel=0.02, abs=1e-12)


def test_a_soft_light_matrix_changes_bands_in_proportion():
    q, parts = [[0.5, 0.3]], []
    own = bands(net(0.2), q).frequencies[0]
    for modulus in (1e-4, 1e-6):
        cast = net(0.2).embedded(Matrix(modulus, 0.3, 1e-3 * modulus, radius=0.2), mesh=3)
        w = bands(cast, q).frequencies[0]
        parts.append([np.abs(w - x).min() / modulus for x in own])
    assert min(parts[0]) > 0.01
    assert parts[0] == pytest.approx(parts[1], rel=0.01)


def test_a_stiff_matrix_holds_its_nodes_and_moves_as_one_body():
    cast = resonator(0.8, 0.2, 4, 2e6)
    w = bands(cast, [[0, 0], [1.0, 0.4]], count=3).frequencies
    assert w[1, 0] == pytest.approx(math.sqrt(0.8), rel=1e-5)
    mass = cast.density - 1.0
    assert w[0, 0] == 0
    assert w[0, 1] == pytest.approx(math.sqrt(0.8 * (1 + 1 / mass)), rel=1e-5)
    held = [bands(resonator(0.8, 0.2, 4, m), [[1.0, 0.4]]).frequencies[0, 1] for m in (2e4, 2e6)]
    assert held[1] / held[0] == pytest.approx(10, rel=1e-3)


def test_a_larger_cell_and_a_turned_one_have_the_same_waves():
    one, q = net(0.2).embedded(HARD, mesh=4), np.array([[0.7, 0.4]])
    pair = net(0.2).repeated((2, 1)).embedded(HARD, mesh=4)
    halves = [bands(one, [[0.35 + turn, 0.4]]).frequencies[0] for turn in (0, np.pi)]
    wanted = np.sort(np.concatenate(halves))[:6]
    assert bands(pair, q, count=6).frequencies[0] == pytest.approx(wanted, rel=1e-9)
    assert moduli(pair).tangent == pytest.approx(moduli(one).tangent, rel=1e-9, abs=1e-9)
    turn = np.array([(0.8, -0.6), (0.6, 0.8)])
    moved = net(0.2).at([(0.3, 0.1)], turn.T).embedded(HARD, mesh=4)
    assert bands(moved, q).frequencies == pytest.approx(bands(one, q).frequencies, rel=1e-9)
    assert moduli(moved).speeds(turn @ [1, 0.2]) == pytest.approx(
        moduli(one).speeds([1, 0.2]), rel=1e-9
    )


def test_sparse_waves_are_the_dense_ones():
    cast, q = net(0.2).embedded(HARD, mesh=8), [[0.5, -1.2], [0, 0], [3.0, 0.4]]
    size = len(cast.body.coordinates[0])
    assert size > 450
    few = bands(cast, q, count=5, shapes=True)
    every = bands(cast, q)
    assert few.frequencies == pytest.approx(every.frequencies[:, :5], rel=1e-8, abs=1e-6)
    assert few.shapes.shape == (3, 5, size, 1)


def test_decay_follows_the_bands_and_fades_in_a_gap():
    cast = net(0.2).embedded(HARD, mesh=3)
    w = bands(cast, [[0.5, 0.3]]).frequencies[0, :3]
    for row in decay(cast, w, axis=0, wavenumbers=0.3):
        assert np.abs(row[row.imag == 0] - 0.5).min() < 1e-9
    low, high = edges(resonator(0.8, 0.2, 4))
    found = decay(resonator(0.8, 0.2, 4), [0.9 * low, (low + high) / 2])
    assert np.abs(found[0].imag).min() == 0
    assert np.abs(found[1].imag).min() > 0.1


def test_loss_factors_are_slopes_of_frequencies():
    """By the rate at which a band follows the modulus: d ln w^2/d ln E (Rayleigh's quotient)."""
    q, step = [[0.5, 0.3]], 1e-5

    def w(modulus):
        lossy = Matrix(modulus, 0.3, 0.5, loss=0.1, radius=0.2)
        return bands(net(0.2).embedded(lossy, mesh=3), q, count=4)

    rate = np.log(w(3 + 3 * step).frequencies / w(3 - 3 * step).frequencies) / step
    assert w(3.0).losses == pytest.approx(0.1 * rate, rel=1e-6)
    assert bands(net(0.2).embedded(HARD, mesh=3), q).losses is None


def test_a_matrix_postpones_buckling():
    """A lattice without diagonals buckles under the slightest load; the matrix carries it."""
    square = Lattice([(0, 0)], np.eye(2), STRINGS, k_bar=1.0)
    assert not square.equilibrium(np.diag([0.97, 0.97])).stability().stable
    cast = square.embedded(Matrix(0.2, 0.3, 0.5, radius=0.2), mesh=2)
    assert cast.strained(np.diag([-0.03, -0.03])).stability().stable
    assert not cast.strained(np.diag([-0.1, -0.1])).stability().stable


@pytest.mark.parametrize("shape", ["wedges", "tetrahedra"])
def test_in_space_long_waves_are_those_of_moduli(shape):
    cell = Lattice([(0, 0, 0)], np.eye(3), strings=[(0, 0, tuple(o)) for o in np.eye(3, dtype=int)])
    mesh = 2
    if shape == "tetrahedra":
        line = np.linspace(-0.5, 0.5, 7)
        mesh = skfem.MeshTet.init_tensor(line, line, line)
    cast = cell.embedded(Matrix(3.0, 0.3, 0.5, radius=0.3), mesh=mesh)
    w = bands(cast, [[1e-3, 0, 0]], count=3).frequencies[0]
    assert moduli(cast).speeds([1, 0, 0]) == pytest.approx(1e3 * w, rel=1e-6)


def test_rigid_rotations_and_strains_of_elements_are_exact():
    """Without patches of any size a uniform strain is exact: only the patch deviates from it."""
    cell = Lattice([(0, 0, 0)], np.eye(3), strings=[(0, 0, tuple(o)) for o in np.eye(3, dtype=int)])
    cast = cell.embedded(Matrix(3.0, 0.3, 0.5, radius=0.3), mesh=2)
    body, rng = cast.body, np.random.default_rng(1)
    e = rng.normal(size=(3, 3))
    x = body.mesh.p.T
    energy = (x @ e.T).ravel() @ (body.elastic @ (x @ e.T).ravel())
    strain = (e + e.T) / 2
    closed = np.einsum("ijkl,ij,kl", isotropic(Matrix(3.0, 0.3, 0.5), 3), strain, strain)
    assert energy == pytest.approx(closed * body.volume, rel=1e-12)
    turn = (x @ (e - e.T).T).ravel()
    assert np.abs(body.elastic @ turn).max() < 1e-12


# meshes from files, and refusals


def test_a_mesh_from_a_file_is_the_same_mesh(tmp_path):
    meshio = pytest.importorskip("meshio")
    cast = net(0.2).embedded(HARD, mesh=4)
    path = tmp_path / "cell.vtu"
    mesh = cast.body.mesh
    meshio.Mesh(np.pad(mesh.p.T, ((0, 0), (0, 1))), [("quad", mesh.t.T)]).write(path)
    read, q = net(0.2).embedded(HARD, mesh=path), [[0.5, 0.3]]
    assert bands(read, q).frequencies == pytest.approx(bands(cast, q).frequencies, rel=1e-12)
    line = np.linspace(-0.5, 0.5, 41)
    whole = skfem.MeshQuad.init_tensor(line, line)  # with elements inside the disc
    w = [bands(net(0.2).embedded(HARD, mesh=of), q, count=2).frequencies for of in (whole, 12)]
    assert w[0] == pytest.approx(w[1], rel=0.03)


def test_meshes_that_do_not_fit_are_refused(tmp_path):
    line = np.linspace(-0.5, 0.5, 9)
    even = skfem.MeshQuad.init_tensor(line, line)
    p = even.p.copy()
    p[1, (p[0] == 0.5) & (np.abs(p[1]) < 0.4)] += 0.03  # on one side only
    for mesh, words in (
        (skfem.MeshQuad(p, even.t), "mesh is not periodic: 16 facets"),
        (even.scaled(0.9), "mesh is not periodic"),
        (skfem.MeshTet(), "mesh has 3 dimensions, must have 2"),
        (skfem.MeshQuad.init_tensor(line[::4], line[::4]), "is below an element of the mesh: 1 v"),
        (tmp_path / "none.msh", "cannot be read"),
        (0, "mesh 0 must be at least 1"),
        ("", "mesh"),
        (1, "below an element: with mesh 1 it must be at least 0.353553 m"),
    ):
        with pytest.raises(TensegrityError, match=words):
            net().embedded(HARD, mesh=mesh)


def test_wrong_matrices_are_refused_by_name():
    row = Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)])
    octahedra = catalogue.octahedra(k_bar=20)
    out = Matrix(1, 0.3, 1, antiplane=True)
    pair = Lattice([(0, 0), (0.5, 0)], np.eye(2), [(0, 1), (1, 0, (1, 0)), *BARS], k_bar=1.0)
    for call, words in (
        (lambda: Matrix(1, 0.5, 1), "poisson 0.5 must be below 0.5 in plane strain"),
        (lambda: Matrix(1, 0.51, 1), "poisson 0.51"),
        (lambda: Matrix(1, 0.3, 1, radius=0.0), "radius 0 m must be above 0"),
        (lambda: Matrix(1, 0.3, 1, radius={0: -1.0}), "radius -1 m"),
        (lambda: net().embedded(Matrix(1, 0.3, 1, radius=0.5), mesh=4),
         "radius 0.5 m of node 0 must be below half its distance 1 m from node 0"),
        (lambda: pair.embedded(Matrix(1, 0.3, 1, radius={0: 0.1, 1: 0.26}), mesh=4),
         "radius 0.26 m of node 1 must be below half its distance 0.5 m from node 0"),
        (lambda: net().embedded(Matrix(1, 0.3, 1, radius={3: 0.1}), mesh=4), "node of radius 3"),
        (lambda: Matrix(1, 0.3, 1, radius={}), "radius {} of the matrix must name 1 node"),
        (lambda: net().embedded(Matrix(1, 0.3, 1, radius=0.1)), "mesh is missing beside `radius`"),
        (lambda: net().embedded(Matrix(1, 0.3, 0, radius=0.1), mesh=4), "density 0 kg/m"),
        (lambda: row.embedded(Matrix(1, 0.3, 1)), "1 lattice vectors in 2 dimensions"),
        (lambda: octahedra.embedded(out), "antiplane True is of plane lattices"),
        (lambda: net().embedded(out, cast="released"), "cast 'released' strains the plane"),
        (lambda: net().embedded(out).strained(np.eye(2)), "antiplane True must be False"),
        (lambda: net().embedded(Matrix(1, 0.3, 1)).strained([[0, 1], [0, 0]]), "must be symmetric"),
        (lambda: sheath(Prism(1, 0.7, 0.1, 1), 1, 0.5), "outer 0.5 m must be above the rad"),
    ):  # fmt: skip
        with pytest.raises(TensegrityError, match=words):
            call()
    uneven = pair.at([(0, 0), (0.6, 0)], natural_lengths=pair.lengths)
    with pytest.raises(EquilibriumError, match="not in equilibrium"):
        uneven.embedded(Matrix(1, 0.3, 1))


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "skfem", None)
    with pytest.raises(TensegrityError, match=r"needs skfem, .* this package with \[matrix\]"):
        net().embedded(HARD, mesh=3)


def test_it_prints_and_draws_itself():
    cast = stretched(0.2).embedded(HARD, cast="released", mesh=3)
    assert "61 coordinates a cell" in str(cast)
    assert "mean stress of the matrix -" in str(cast)
    assert "bonded everywhere" in str(net().embedded(Matrix(1, 0.3, 1)))
    drawn = cast.plot()
    assert len(drawn.patches) == 1
    assert len(drawn.collections) == 3  # bars, strings, mesh
