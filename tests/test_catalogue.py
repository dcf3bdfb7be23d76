"""The catalogue: equilibrium, stability, and the ratios that the literature prints."""

import doctest
from collections import Counter

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize
from scipy.spatial.distance import pdist

from tensegrity import EquilibriumError, TensegrityError, catalogue, held
from tensegrity.catalogue import cells, solids

SOLIDS = ("tetrahedron", "cube", "octahedron", "dodecahedron", "icosahedron")
GOLDEN = (1 + 5**0.5) / 2
KNOWN = {  # structure: (bars, strings, states of self-stress, mechanisms)
    "snelson_x()": (2, 4, 1, 0),
    "snelson_x(2.0, 0.5)": (2, 4, 1, 0),
    "prism()": (3, 9, 1, 1),
    "prism(6, 1.0, 0.4)": (6, 18, 1, 7),
    "column()": (15, 33, 5, 5),
    "column(3, 4)": (12, 28, 3, 5),
    "expandable_octahedron()": (6, 24, 1, 1),
    "truncated_tetrahedron()": (6, 18, 1, 7),
    "geodesic('cube')": (12, 36, 1, 19),
    "geodesic('octahedron')": (12, 36, 1, 19),
    "geodesic('dodecahedron')": (30, 90, 1, 55),
    "geodesic('icosahedron')": (30, 90, 1, 55),
    "geodesic('icosahedron', ratio=0.5)": (30, 90, 1, 55),
    "geodesic('cube', 'diamond')": (12, 48, 1, 7),
    "geodesic('octahedron', 'diamond', ratio=1.5)": (12, 48, 1, 7),
    "geodesic('dodecahedron', 'diamond')": (30, 120, 1, 25),
    "geodesic('icosahedron', 'diamond')": (30, 120, 1, 25),
    "tower()": (6, 24, 1, 1),
    "tower(3, 0.5, 2.0, 2.7)": (9, 39, 1, 1),
    "tower(8)": (24, 114, 1, 1),
    "plate(1, 1)": (4, 12, 1, 3),
    "plate(2, 3)": (24, 65, 9, 1),
    "plate()": (36, 96, 19, 1),
    "dome()": (17, 56, 2, 1),
    "dome(5, 0)": (6, 10, 1, 0),
    "dome(5, 2, 3.0, 1.0, 1.5)": (16, 60, 1, 0),
    "dome(12, 3)": (49, 204, 2, 1),
}


@pytest.mark.parametrize("call", KNOWN)
def test_structure_is_in_equilibrium_and_stable_with_all_strings_taut(call):
    s = eval(f"catalogue.{call}")
    force = np.abs(s.tensions).max()
    assert np.abs(s.members.gradient(s.positions)).max() < 1e-12 * force
    assert (s.tensions[s.is_string] > 0).all()
    assert (s.tensions[~s.is_string] < 0).all()
    assert (s.lengths / s.natural_lengths)[s.is_string].max() == pytest.approx(1.1, rel=1e-12)
    ring = held(np.flatnonzero(s.positions[:, 2] == 0)) if "dome" in call else None
    assert s.modes(1, ring).eigenvalues[0] > 1e-4
    found = (s.bars, s.strings, len(s.self_stress().states), len(s.mechanisms()))
    assert found == KNOWN[call]
    assert s.dim * s.nodes - (3 if s.dim == 2 else 6) == s.bars + s.strings - found[2] + found[3]


@pytest.mark.parametrize("size", [(1.0, 1.0), (2.0, 0.3)])
def test_force_densities_of_the_x_are_opposite_and_equal(size):
    q = catalogue.snelson_x(*size).densities
    assert q / q[-1] == pytest.approx([-1, -1, 1, 1, 1, 1], rel=1e-13)


@pytest.mark.parametrize("sides", [3, 4, 5, 8])
def test_prism_has_the_twist_and_the_force_densities_of_connelly_and_terrell(sides):
    """1995: twist pi/2 - pi/n from bar to cross string; cross over base 2 sin(pi/n)."""
    s = catalogue.prism(sides, k_string=3.0)
    bar, cross, base = s.densities[[0, sides, 2 * sides]]
    assert cross == pytest.approx(-bar, rel=1e-12)
    assert cross / base == pytest.approx(2 * np.sin(np.pi / sides), rel=1e-12)
    foot, end, other = s.positions[[0, s.ends[0, 1], s.ends[sides, 1]], :2]
    assert foot[1] == 0  # azimuths count from the foot
    turns = [np.arctan2(x[1], x[0]) % (2 * np.pi) for x in (end, other)]
    assert turns[0] == pytest.approx(np.pi / 2 + np.pi / sides, rel=1e-12)
    assert turns[1] == pytest.approx(np.pi / 2 - np.pi / sides, rel=1e-12)


def test_expandable_octahedron_has_the_ratios_of_tibert_and_pellegrino():
    """2003: parallel struts at half of their length, strings of sqrt(3/8), struts -3/2 as dense."""
    s = catalogue.expandable_octahedron(strut=0.3)
    middles = s.positions[s.ends[:6]].mean(axis=1)
    along = s.positions[s.ends[:6, 1]] - s.positions[s.ends[:6, 0]]
    separations = [
        np.linalg.norm(middles[i] - middles[j])
        for i in range(6)
        for j in range(i)
        if np.linalg.norm(np.cross(along[i], along[j])) < 1e-12
    ]
    assert separations == pytest.approx([0.15] * 3, rel=1e-12)
    assert s.lengths[6:] == pytest.approx(0.3 * np.sqrt(3 / 8), rel=1e-12)
    assert s.densities[:6] / s.densities[6] == pytest.approx(-1.5, rel=1e-12)
    assert s.lengths[0] / s.lengths[6] == pytest.approx(1.632993, abs=1e-6)


def test_truncated_tetrahedron_has_the_longest_struts_that_strings_of_length_1_allow(rng):
    """The ratio 2.2507 of Tibert & Pellegrino 2003, by non-linear programming as in Pellegrino
    1986, from a shape that is off."""
    s = catalogue.truncated_tetrahedron(strut=1.0)
    length = s.lengths[0] / s.lengths[6:]
    assert length == pytest.approx(2.2507, abs=5e-5)
    assert np.ptp(length) < 1e-12

    def squares(x, members):
        first, second = x.reshape(-1, 3)[s.ends[members].T]
        return np.sum((first - second) ** 2, axis=1)

    start = (length[0] * s.positions + 0.05 * rng.normal(size=(12, 3))).ravel()
    rules = [
        {"type": "eq", "fun": lambda x: squares(x, slice(6, None)) - 1},
        {"type": "eq", "fun": lambda x: np.diff(squares(x, slice(6)))},
    ]
    found = minimize(
        lambda x: -squares(x, slice(1))[0],
        start,
        method="SLSQP",
        constraints=rules,
        options={"ftol": 1e-13, "maxiter": 500},
    )
    assert np.sqrt(-found.fun) == pytest.approx(length[0], rel=1e-7)


@pytest.mark.parametrize("ratio", [0.4, 1.0, 2.0])
def test_force_densities_of_the_truncated_tetrahedron_obey_their_determinant(ratio):
    """With the rotations of the tetrahedron as matrices of whole numbers, by SymPy."""
    turn, half = sp.Matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), sp.diag(-1, -1, 1)
    one, bar = sp.eye(3), turn * half * turn.T
    x, y, z = sp.symbols("x y z")
    forces = x * (2 * one - turn - turn.T) + y * (one - half) + z * (one - bar)
    relation = sp.lambdify((x, y, z), sp.expand(forces.det()))
    s = catalogue.geodesic("tetrahedron", ratio=ratio)
    triangle, edge, strut = s.densities[[6, -1, 0]] / s.densities[6]
    assert abs(relation(triangle, edge, strut)) < 1e-10
    assert abs(relation(triangle, edge, 1.01 * strut)) > 1e-3
    assert s.lengths[6] / s.lengths[-1] == pytest.approx(ratio, rel=1e-12)


def test_sphere_of_30_bars_has_ratios_of_the_golden_section():
    """Strings of one length and one force density, as eigenvectors in Q(sqrt 5) say."""
    s = catalogue.geodesic("icosahedron", strut=2.0)
    assert s.lengths[:30] == pytest.approx(2, rel=1e-12)
    assert s.lengths[0] / s.lengths[30:] == pytest.approx(np.sqrt(1 + GOLDEN**4), rel=1e-12)
    assert s.densities[30:] / s.densities[30] == pytest.approx(1, rel=1e-12)
    assert s.densities[:30] / s.densities[30] == pytest.approx(-(GOLDEN**-2), rel=1e-12)


def test_diamonds_of_dual_solids_are_one_and_that_of_the_tetrahedron_is_the_octahedron():
    for one, other in (("cube", "octahedron"), ("dodecahedron", "icosahedron")):
        first, second = (catalogue.geodesic(solid, "diamond") for solid in (one, other))
        far = [np.sort(pdist(s.positions)) for s in (first, second)]
        assert far[0] == pytest.approx(far[1], abs=1e-12)
    far = np.sort(pdist(catalogue.geodesic("tetrahedron", "diamond").positions))
    octahedron = catalogue.expandable_octahedron()
    assert np.sort(pdist(octahedron.positions)) == pytest.approx(far, abs=1e-12)


@pytest.mark.parametrize("solid", SOLIDS)
@pytest.mark.parametrize(("pattern", "strings"), [("zigzag", 3), ("diamond", 4)])
def test_geodesics_are_nets_of_polygons_with_a_bar_at_each_node(solid, pattern, strings):
    s = catalogue.geodesic(solid, pattern)
    corner = {"octahedron": 4, "icosahedron": 5}.get(solid, 3)
    assert set(Counter(s.ends[: s.bars].ravel().tolist()).values()) == {1}
    assert set(Counter(s.ends[s.bars :].ravel().tolist()).values()) == {strings}
    assert np.ptp(np.linalg.norm(s.positions, axis=1)) < 1e-12
    height = s.positions[:, 2]
    assert np.ptp(height[:corner]) < 1e-12
    assert (height[corner:] > height[0] + 1e-3).all()
    lowest = {tuple(sorted(e)) for e in s.ends[s.bars :].tolist() if max(e) < corner}
    assert len(lowest) == corner


def test_overlap_of_a_tower_of_two_stages_is_the_root_of_its_determinant():
    """Nodes on a cylinder in exact numbers, forces of the orbits on a foot and on a head."""
    s = catalogue.tower(2)
    e, c, d = sp.symbols("overlap cosine sine")  # of the twist
    levels = [(0, 0, 0), (1, 0, 1), (1, 1, 1 - e), (0, 1, 2 - e)]  # twists, sixths of a turn

    def node(number):
        twists, sixths, height = levels[number // 3]
        angle = sp.pi / 3 * (sixths + 2 * (number % 3))
        x, y = sp.cos(angle), sp.sin(angle)
        return sp.Matrix([c * x - d * y, d * x + c * y, height] if twists else [x, y, height])

    kinds = np.split(np.arange(30), 5)
    forces = [
        [
            sum(
                (
                    node(int(j if i == at else i)) - node(at)
                    for i, j in s.ends[kind]
                    if at in (i, j)
                ),
                sp.zeros(3, 1),
            )
            for kind in kinds
        ]
        for at in (0, 3)
    ]
    rows = sp.Matrix.vstack(*(sp.Matrix.hstack(*columns) for columns in forces))
    rows.row_del(1)  # turning the whole leaves this one dependent on the others
    twist = sp.Symbol("twist")
    wanted = 2 * sp.cos(twist - sp.pi / 3) * (1 - e + e**2) + e * (2 - e)
    found = rows.det().subs({c: sp.cos(twist), d: sp.sin(twist)}) / wanted
    values = [sp.N(found.subs({twist: t, e: x})) for t, x in ((2.7, 0.2), (2.9, 0.4), (3.0, 0.9))]
    assert np.array(values, dtype=float) == pytest.approx(float(values[0]), rel=1e-12)
    for t in (2.65, 2.8, 11 * np.pi / 12, 3.1):
        x = 2 - catalogue.tower(2, height=1.0, twist=t).positions[-1, 2]
        left = 2 * np.cos(t - np.pi / 3) * (1 - x + x**2) + x * (2 - x)
        assert abs(left) < 1e-13
        assert 0 < x < 0.5


def test_overlap_of_a_tower_does_not_depend_on_its_sizes():
    for stages in (2, 5):
        found = []
        for radius, height in ((1.0, 1.0), (0.2, 3.0)):
            s = catalogue.tower(stages, radius, height)
            found.append((stages - s.positions[-1, 2] / height) / (stages - 1))
            assert np.linalg.norm(s.positions[:, :2], axis=1) == pytest.approx(radius, rel=1e-12)
            bars = np.ptp(s.positions[s.ends[: s.bars], 2], axis=1)
            assert bars == pytest.approx(height, rel=1e-12)
        assert found[0] == pytest.approx(found[1], rel=1e-11)


def test_force_densities_of_a_plate_are_sums_of_those_of_its_prisms():
    """Each prism: lower over upper as the squares of the radii, cross 2 sin(pi/4) of their mean."""
    s = catalogue.plate(2, 3, side=0.7, height=0.2)
    q = s.densities / s.densities[24]
    upper, rim = 1, 1 / 2
    cross = 2 * np.sin(np.pi / 4) * np.sqrt(upper * rim)
    wanted = np.repeat([-cross, cross, upper, rim, 2 * rim], [24, 24, 24, 10, 7])
    assert q == pytest.approx(wanted * q[48], rel=1e-12)


def test_forces_of_a_dome_balance_joint_by_joint():
    """Height of the middle, post there, hoop: each from the joint before it."""
    n, radius, rise, post = 7, 2.0, 0.6, 0.8
    q = catalogue.dome(n, 1, radius, rise, post).densities
    sizes = [n, n, 1, 2 * n, 2 * n, n, n, n]
    ring, posts, middle, ridge, diagonal, hoop, top, low = np.split(q, np.cumsum(sizes)[:-1])
    inner, head = radius / 2, 0.75 * rise
    turn = np.cos(np.pi / n)
    assert n * top[0] * (rise - head) == pytest.approx(-middle[0] * post, rel=1e-11)
    assert n * low[0] * (head - rise + post) == pytest.approx(-middle[0] * post, rel=1e-11)
    outward = 2 * ridge[0] * (radius * turn - inner)
    assert outward == pytest.approx((top[0] + low[0]) * inner, rel=1e-11)
    foot = 2 * diagonal[0] * (radius * turn - inner)
    assert foot == pytest.approx(2 * hoop[0] * inner * (1 - np.cos(2 * np.pi / n)), rel=1e-11)
    assert 2 * diagonal[0] * (post - head) == pytest.approx(-posts[0] * post, rel=1e-11)
    inward = 2 * (ridge[0] + diagonal[0]) * (radius - inner * turn)
    assert inward == pytest.approx(-2 * ring[0] * radius * (1 - np.cos(2 * np.pi / n)), rel=1e-11)


def test_stiffness_mass_and_size_are_those_that_were_given():
    one = catalogue.geodesic("cube", k_bar=20.0, k_string=2.0, mass=0.5)
    other = catalogue.geodesic("cube", strut=3.0, k_bar=20.0, k_string=2.0, mass=0.5)
    assert other.tensions == pytest.approx(3 * one.tensions, rel=1e-12)
    assert (one.stiffnesses[:12] == 20).all()
    assert (one.stiffnesses[12:] == 2).all()
    assert (one.mass == 0.5).all()
    stiff = np.where(np.arange(24) < 4, 3.0, 1.0)
    s = catalogue.expandable_octahedron(k_string=stiff, prestrain=0.05)
    prestrain = (s.lengths / s.natural_lengths - 1)[6:]
    assert prestrain.max() == pytest.approx(0.05, rel=1e-12)
    assert np.ptp(s.densities[6:]) < 1e-15
    assert not catalogue.tower(prestrain=0.0).tensions.any()
    assert catalogue.prism(5, prestrain=0.02).natural_lengths[5:10] == pytest.approx(
        catalogue.prism(5).lengths[5:10] / 1.02, rel=1e-12
    )


@pytest.mark.parametrize("name", sorted({*catalogue.__all__} - {"twin_strings"}))  # a Potential
def test_unless_given_sizes_are_1_m_and_the_rest_is_as_of_a_structure(name):
    s = getattr(catalogue, name)()
    shared = {"column", "x_strip", "octahedra"}  # some strings of two units, of twice the stiffness
    own = {"square": {50.0}, "x_plate": {2.0}} | {key: {1.0, 2.0} for key in shared}
    assert set(s.stiffnesses.tolist()) == {100.0} | own.get(name, {1.0} if s.strings else set())
    assert set(s.mass.tolist()) == {1.0}
    size = {
        "kagome": s.lengths[0],
        "octahedra": s.span / np.sqrt(2) if name == "octahedra" else 0,
        "x_plate": s.lengths[2],
        "x_strip": s.lengths[2],
        "column": np.ptp(s.positions[:, -1]) / 5,
        "prism": np.ptp(s.positions[:, -1]),
        "snelson_x": s.lengths[2],
        "plate": s.lengths[-1],
        "dome": np.abs(s.positions[:, 0]).max(),
        "tower": np.linalg.norm(s.positions[0, :2]),
    }
    assert size.get(name, s.lengths[0]) == pytest.approx(1, rel=1e-12)
    if name in ("column", "prism"):
        assert s.lengths[-1] == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: catalogue.geodesic("cube", ratio=1e5), "ratio 100000 must be within 0.00"),
        (lambda: catalogue.tower(twist=2.62), "2 stages have no self-stress at any overlap"),
        (lambda: catalogue.dome(3), "bars must push, strings pull"),
        (lambda: catalogue.dome(rise=0.1, post=0.05), "strings pull"),
    ],
)
def test_what_has_no_self_stress_or_no_size_is_refused(call, words):
    with pytest.raises(TensegrityError, match=words):
        call()
    assert issubclass(EquilibriumError, TensegrityError)


@pytest.mark.parametrize("module", [cells, solids])
def test_examples_of_the_catalogue_give_what_they_say(module):
    failed, tried = doctest.testmod(module)
    assert failed == 0
    assert tried > 4
