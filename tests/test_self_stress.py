"""Self-stress, mechanisms and prestress on supports: counts, forces of joints in closed form, and
whether a state stiffens its mechanisms.

Shapes and numbers of the parametrized references: counts by singular values and by rank at 40
digits or in rationals, forces by equilibrium of joints.
"""

from itertools import chain, pairwise

import numpy as np
import pytest
from structures import Frame, turned

from tensegrity import (
    EquilibriumError,
    Lattice,
    Structure,
    TensegrityError,
    equilibrium,
    held,
    plates,
)


def ring(n, radius, z, turn=0.0):
    angles = 2 * np.pi * (np.arange(n) + turn) / n
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(n, z)])


def rope(dim, bars=False):
    """Three pieces in a line between two held ends."""
    places = np.pad(np.array([[0.0], [1.0], [2.5], [3.0]]), [(0, 0), (0, dim - 1)])
    kind = "bars" if bars else "strings"
    return Structure(places, **{kind: [(0, 1), (1, 2), (2, 3)]}), held([0, 3]), None


def dome(n, levy):
    """A cable dome of two hoops and n sectors on a held ring: Geiger's, with its ridges in radial
    planes, or Levy's, in triangles.  Also the groups of symmetry."""
    half = 0.5 if levy else 0.0
    nodes = np.concatenate([
        ring(n, 20, 0), ring(n, 12, 2, half), ring(n, 12, -2.5, half), ring(n, 5, 3.2),
        ring(n, 5, 0.1), [[0, 0, 4], [0, 0, 1]],
    ])  # fmt: skip
    edge, top, low, inner, base = (range(k * n, (k + 1) * n) for k in range(5))
    crown, foot = 5 * n, 5 * n + 1

    def out(a, b):  # from the edge to the first hoop
        pairs = list(zip(a, b, strict=True))
        return pairs + [(a[(k + 1) % n], b[k]) for k in range(n)] if levy else pairs

    def on(a, b):  # from the first hoop to the second
        pairs = list(zip(a, b, strict=True))
        return pairs + [(a[k - 1], b[k]) for k in range(n)] if levy else pairs

    def hoop(a):
        return [(a[k], a[(k + 1) % n]) for k in range(n)]

    kinds = [
        list(zip(top, low, strict=True)), list(zip(inner, base, strict=True)), [(crown, foot)],
        out(edge, top), on(top, inner), [(k, crown) for k in inner],
        out(edge, low), on(top, base), [(k, foot) for k in inner], hoop(low), hoop(base),
    ]  # fmt: skip
    ends = np.cumsum([0, *map(len, kinds)])
    groups = [range(a, b) for a, b in pairwise(ends)]
    bars, strings = (list(chain(*some)) for some in (kinds[:3], kinds[3:]))
    return Structure(nodes, bars=bars, strings=strings), held(edge), groups


def wheel(n):
    """A spoke wheel, a hub of two nodes and n spokes to each, held at three places of the rim."""
    nodes = np.concatenate([ring(n, 5, 0), [[0, 0, 1], [0, 0, -1]]])
    rim = [(k, (k + 1) % n) for k in range(n)]
    spokes = [(k, hub) for hub in (n, n + 1) for k in range(n)]
    supports = held([0]) + held([n // 3], axes=[1, 2]) + held([2 * n // 3], axes=[2])
    groups = [[0], *(range(k * n + 1, (k + 1) * n + 1) for k in range(3))]
    return Structure(nodes, bars=[(n, n + 1), *rim], strings=spokes), supports, groups


def net(m, height=0.15):
    """A net on a saddle, m by m squares, its border held."""
    x, y = np.meshgrid(np.arange(m + 1.0) - m / 2, np.arange(m + 1.0) - m / 2, indexing="ij")
    inside = np.zeros((m + 1, m + 1), bool)
    inside[1:-1, 1:-1] = True
    number = np.arange((m + 1) ** 2).reshape(m + 1, m + 1)
    pairs = [
        (int(a), int(b))
        for a, b in [*zip(number[:-1].ravel(), number[1:].ravel(), strict=True),
                     *zip(number[:, :-1].ravel(), number[:, 1:].ravel(), strict=True)]
        if inside.ravel()[a] or inside.ravel()[b]
    ]  # fmt: skip
    used = sorted({k for pair in pairs for k in pair})
    nodes = np.column_stack([x.ravel(), y.ravel(), height * (x**2 - y**2).ravel()])[used]
    strings = [(used.index(a), used.index(b)) for a, b in pairs]
    border = [k for k, name in enumerate(used) if not inside.ravel()[name]]
    return Structure(nodes, strings=strings), held(border), None


def mast():
    """Guyed at 4 m and 9 m, by three stays each to the same anchors."""
    nodes = [(0, 0, 0), (0, 0, 4), (0, 0, 9), *ring(3, 5, 0).tolist()]
    stays = [(top, anchor) for top in (1, 2) for anchor in (3, 4, 5)]
    return Structure(nodes, bars=[(0, 1), (1, 2)], strings=stays), held([0, 3, 4, 5]), [
        [0], [1], [2, 3, 4], [5, 6, 7]]  # fmt: skip


GEIGER = [-0.4942994334715747, -0.20774243471247833, -1.1375052425145447, 2.0380487748862746,
          1.229508428039413, 0.8999791400010494, 1.6571936798143998, 0.7930594913417108,
          0.3530531969810081, 2.0666666666666673, 1.0]  # fmt: skip
LEVY = [-0.7402644599638264, -0.23891958401689045, -1.137505242514541, 1.8921851807542094,
        0.7683702674466321, 0.8999791400010445, 1.5299518546842688, 0.4940457162299352,
        0.35305319698100707, 2.5060557834557144, 1.0]  # fmt: skip
STAY, TOP = 41**0.5, 106**0.5  # lengths of the stays
REFERENCES = {  # nodes, members, states, mechanisms
    "tight rope in the plane": (lambda: rope(2), (4, 3, 1, 2)),
    "tight rope in space": (lambda: rope(3), (4, 3, 1, 4)),
    "Geiger dome": (lambda: dome(8, False), (42, 81, 1, 22)),
    "Levy dome": (lambda: dome(8, True), (42, 113, 11, 0)),
    "spoke wheel": (lambda: wheel(12), (14, 37, 1, 0)),
    "hypar net": (lambda: net(6), (45, 60, 1, 16)),
    "guyed mast": (mast, (6, 8, 2, 0)),
}
TWINS = {
    "domes": [lambda n=n, levy=levy: dome(n, levy) for n in (6, 10) for levy in (False, True)],
    "wheels and nets": [lambda: wheel(9), lambda: wheel(15), lambda: net(4), lambda: net(5)],
}


def counts(s, supports):
    """Of states and of mechanisms, after the check that ties them."""
    states, mechanisms = len(s.self_stress(supports).states), len(s.mechanisms(supports))
    freedom = s.freedom(supports)
    motions, rigid = freedom.motions.shape[1], freedom.rigid.shape[1]
    assert states - mechanisms == len(s.ends) - motions + rigid
    return states, mechanisms


def unbalanced(s, supports, tensions):
    """Largest force on a free coordinate, by summing those of members node by node, over them."""
    total = np.zeros_like(s.positions)
    for (i, j), tension in zip(s.ends, tensions, strict=True):
        pull = (
            tension
            * (s.positions[j] - s.positions[i])
            / np.linalg.norm(s.positions[j] - s.positions[i])
        )
        total[i] += pull
        total[j] -= pull
    for node, axes in supports.holds:
        total[node, list(range(s.dim) if axes is None else axes)] = 0
    return np.abs(total).max() / np.abs(tensions).max()


def group_tensions(s, supports, groups):
    """Of the one state with the symmetry of the groups, the last group having 1."""
    stress = s.self_stress(supports, groups=groups)
    assert len(stress.states) == 1
    tensions = stress.feasible * s.lengths
    for group in groups:
        assert tensions[list(group)] == pytest.approx(tensions[group[0]], rel=1e-12)
    assert unbalanced(s, supports, tensions) < 1e-13
    return np.array([tensions[group[0]] for group in groups]) / tensions[groups[-1][0]]


@pytest.mark.parametrize("name", REFERENCES)
def test_states_and_mechanisms_on_supports_have_the_reference_counts(name):
    make, (nodes, members, states, mechanisms) = REFERENCES[name]
    s, supports, _ = make()
    assert (s.nodes, len(s.ends)) == (nodes, members)
    assert counts(s, supports) == (states, mechanisms)


@pytest.mark.parametrize("name", REFERENCES)
def test_coordinates_rounded_to_five_digits_keep_the_counts(name):
    make, (*_, states, mechanisms) = REFERENCES[name]
    s, supports, _ = make()
    rounded = s.at(s.positions.round(5), natural_lengths=None)
    assert counts(rounded, supports) == (states, mechanisms)
    motions = s.mechanisms(supports)
    assert np.einsum("ani,bni->ab", motions, motions) == pytest.approx(np.eye(mechanisms))


@pytest.mark.parametrize("make", [make for row in TWINS.values() for make in row])
def test_other_domes_wheels_and_nets_balance_and_count_alike(make):
    s, supports, groups = make()
    states, mechanisms = counts(s, supports)
    assert states >= 1
    stress = s.self_stress(supports, groups=groups)
    assert unbalanced(s, supports, stress.feasible * s.lengths) < 1e-13
    least = stress.mechanism_stiffness.min(initial=1.0)
    assert len(stress.mechanism_stiffness) == mechanisms
    assert least > 0
    tight = s.prestressed(stress.feasible * 1e-3, supports=supports)
    assert tight.is_stable(supports)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("bars", [False, True])
def test_a_rope_in_tension_stiffens_its_mechanisms_and_one_in_compression_does_not(dim, bars):
    """Of unit tension 4/3 and 3, in each direction across; a rope that pushes has a state, too."""
    s, supports, _ = rope(dim, bars)
    stress = s.self_stress(supports)
    tension = stress.feasible * s.lengths
    assert tension == pytest.approx(tension[0], rel=1e-14)
    tied = s.self_stress(supports, groups=[[0, 1, 2]])  # tensions, not force densities
    assert tied.feasible == pytest.approx(stress.feasible, rel=1e-13)
    wanted = np.repeat([4 / 3, 3.0], dim - 1)
    assert np.sort(stress.mechanism_stiffness / tension[0]) == pytest.approx(wanted, rel=1e-14)
    verb = "does not stiffen" if bars else "stiffens"
    assert f"the feasible state {verb} the mechanisms" in " ".join(str(stress).split())
    given = -0.02 if bars else 0.02
    pulled = s.prestressed(tension={1: given}, supports=supports)
    assert pulled.tensions == pytest.approx(given, rel=1e-12)
    assert pulled.is_stable(supports) != bars


def test_geiger_dome_has_the_tensions_of_its_joints_and_stiffens_22_mechanisms():
    s, supports, groups = dome(8, False)
    assert group_tensions(s, supports, groups) == pytest.approx(GEIGER, abs=4e-15)
    stress = s.self_stress(supports)
    hoop = stress.feasible[-1] * s.lengths[-1]
    assert stress.mechanism_stiffness.min() / hoop == pytest.approx(0.11590413200610157, rel=1e-12)
    text = "the feasible state stiffens the mechanisms: 22 of stiffness"
    assert text in " ".join(str(stress).split())


@pytest.mark.parametrize("n", [6, 12])
def test_geiger_domes_differ_by_hoops_and_the_crown_post_alone(n):
    """In a radial plane all forces are alike; a hoop carries a radial force over 2 sin(pi/n), and
    the post of the crown that of n ridges."""
    found = group_tensions(*dome(n, False))
    found, wanted = (x / np.sin(np.pi / m) for x, m in ((found, n), (np.array(GEIGER), 8)))
    wanted[2] *= n / 8
    wanted[9:] *= np.sin(np.pi / 8) / np.sin(np.pi / n)
    assert found == pytest.approx(wanted, rel=1e-13)


def test_levy_dome_has_eleven_states_and_one_of_its_symmetry():
    s, supports, groups = dome(8, True)
    assert group_tensions(s, supports, groups) == pytest.approx(LEVY, abs=1e-14)
    assert "no mechanisms" in str(s.self_stress(supports))
    tight = s.prestressed(tension={112: 0.01}, supports=supports, groups=groups)
    assert [tight.tensions[g[0]] for g in groups] == pytest.approx(0.01 * np.array(LEVY), rel=1e-9)
    with pytest.raises(TensegrityError, match="tension of 1 members, must be of 11"):
        s.prestressed(tension={112: 0.01}, supports=supports)


@pytest.mark.parametrize("n", [9, 12, 18])
def test_a_spoke_wheel_presses_hub_and_rim_as_in_closed_form(n):
    """Hub -n/L, rim -(2 5/L)/(2 sin(pi/n)) for spokes of 1 and length L."""
    length = 26**0.5
    wanted = [-n / length, -5 / length / np.sin(np.pi / n), 1, 1]
    assert group_tensions(*wheel(n)) == pytest.approx(wanted, rel=1e-13)


def rank(matrix, prime=2**31 - 1):
    """Rank of a matrix of integers, by elimination modulo a prime: exact."""
    rows, done = [[int(x) % prime for x in row] for row in matrix], 0
    for column in range(len(rows[0])):
        at = next((k for k in range(done, len(rows)) if rows[k][column]), None)
        if at is None:
            continue
        rows[done], rows[at] = rows[at], rows[done]
        inverse = pow(rows[done][column], -1, prime)
        for k in range(done + 1, len(rows)):
            factor = rows[k][column] * inverse % prime
            if factor:
                rows[k] = [
                    (a - factor * b) % prime for a, b in zip(rows[k], rows[done], strict=True)
                ]
        done += 1
    return done


@pytest.mark.parametrize("m", [4, 6])
def test_hypar_nets_carry_equal_force_densities_and_count_as_in_whole_numbers(m):
    s, supports, _ = net(m)
    stress = s.self_stress(supports)
    assert stress.feasible == pytest.approx(1, rel=1e-13)
    whole = np.rint(s.positions * [2, 2, 80]).astype(int)  # scaling an axis keeps the rank
    assert whole / [2, 2, 80] == pytest.approx(s.positions, abs=1e-15)
    matrix = np.zeros((s.nodes, 3, len(s.ends)), dtype=int)
    for k, (i, j) in enumerate(s.ends):
        matrix[i, :, k], matrix[j, :, k] = whole[i] - whole[j], whole[j] - whole[i]
    free = np.setdiff1d(np.arange(s.nodes), [node for node, _ in supports.holds])
    exact = rank(matrix[free].reshape(-1, len(s.ends)))
    assert counts(s, supports) == (len(s.ends) - exact, 3 * len(free) - exact)
    if m == 6:
        assert stress.mechanism_stiffness.min() == pytest.approx(1.684616419300982, rel=1e-12)


def test_a_guyed_mast_has_a_state_for_each_level_of_stays():
    """Of upper stays 1: the mast carries -3 9/L2; of lower ones -3 4/L1 below them."""
    s, supports, groups = mast()
    assert len(s.self_stress(supports, groups=groups).states) == 2
    for lower, upper in ((0.002, 0.003), (0.001, 0.004)):
        tight = s.prestressed(tension={2: lower, 5: upper}, supports=supports, groups=groups)
        above = -27 / TOP * upper
        wanted = [above - 12 / STAY * lower, above, *[lower] * 3, *[upper] * 3]
        assert tight.tensions == pytest.approx(wanted, rel=1e-11)
        assert np.abs(equilibrium(tight, supports=supports).displacements).max() < 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_states_on_supports_are_the_same_in_any_frame(seed):
    rng = np.random.default_rng(seed)
    s, supports, groups = (dome(5, False), net(4), mast())[seed % 3]
    frame = Frame.of(s, rng)
    there = frame.structure(s)
    moved = held(frame.nodes([node for node, _ in supports.holds]).tolist())
    assert counts(there, moved) == counts(s, supports)
    here, other = (x.self_stress(y, groups=groups) for x, y in ((s, supports), (there, moved)))
    assert other.feasible == pytest.approx(here.feasible, rel=1e-9)
    assert other.mechanism_stiffness == pytest.approx(here.mechanism_stiffness, rel=1e-9)


def cross_with_a_cable():
    """Two bars in a square of strings, two of which are one cable over a node: one mechanism."""
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    return Structure(corners, bars=[(0, 2), (1, 3)], strings=[(0, 1), (1, 2)], cables=[(2, 3, 0)])


@pytest.mark.parametrize("make", [lambda: dome(6, False), lambda: net(4), lambda: rope(3),
                                  lambda: (cross_with_a_cable(), None, None)])  # fmt: skip
def test_mechanism_stiffness_is_that_of_the_tangent_under_that_prestress(make):
    s, supports, groups = make()
    stress, motions = s.self_stress(supports, groups=groups), s.mechanisms(supports)
    tight = s.prestressed(1e-2 * stress.feasible, supports=supports)
    flat = motions.reshape(len(motions), -1)
    found = np.linalg.eigvalsh(flat @ (tight.stiffness() @ flat.T))
    assert len(motions)
    assert 1e-2 * stress.mechanism_stiffness == pytest.approx(found, rel=1e-9, abs=1e-12)


def test_plates_take_what_pushes_on_them():
    """A cross in the plane between two plates that nothing but its diagonals presses on."""
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    s = Structure(corners, bars=[(0, 2), (1, 3)], strings=[(0, 1), (2, 3)])
    assert counts(s, plates([0, 1]) + held([2, 3], axes=[1]))[0] == 1
    assert counts(s, plates([0, 1], [2, 3]))[0] == 0  # the upper one is free to rise
    assert counts(s, None)[0] == 0


@pytest.mark.parametrize("off", [1e-3, 1e-5])
def test_a_measured_net_has_a_near_form_on_its_supports(off):
    rng = np.random.default_rng(5)
    s, supports, _ = net(4)
    measured = s.at(s.positions + off * rng.normal(size=s.positions.shape), natural_lengths=None)
    stress = measured.self_stress(supports)
    assert not len(stress.states)
    with pytest.raises(EquilibriumError, match=r"give the supports, or see Structure.nearest_form"):
        _ = stress.feasible
    assert len(measured.self_stress(supports, tolerance=10 * stress.gap).states) == 1
    near = measured.nearest_form(supports)
    assert len(near.self_stress(supports).states) == 1
    fixed = [node for node, _ in supports.holds]
    assert np.array_equal(near.positions[fixed], measured.positions[fixed])
    assert 0 < np.abs(near.positions - measured.positions).max() < 20 * off


def test_nothing_that_is_all_held_or_free_is_special():
    s = rope(2)[0]
    everything = held([0, 1, 2, 3])
    assert counts(s, everything) == (3, 0)
    assert len(s.self_stress(everything, groups=[[0, 1, 2]]).states) == 1
    across = held([0, 3]) + held([1, 2], axes=[0])  # nothing but round-off along the members
    assert counts(s, across) == (3, 2)
    assert len(s.self_stress(across, groups=[[0, 1, 2]]).states) == 1
    spin = turned(np.random.default_rng(1), 3)
    straight = rope(3)[0]
    assert counts(straight.at(straight.positions @ spin), None) == (0, 4)


def test_a_lattice_says_whether_its_state_stiffens_its_mechanisms():
    """A square grid of tight strings: each line may swing across, with stiffness 4 q to 8 q."""
    grid = Lattice([(0, 0), (1, 0)], [(2, 0), (0, 1)], strings=[
        (0, 1, (0, 0)), (1, 0, (1, 0)), (0, 0, (0, 1)), (1, 1, (0, 1))])  # fmt: skip
    stress = grid.self_stress()
    assert len(grid.mechanisms()) == 1
    assert stress.mechanism_stiffness == pytest.approx(4 * stress.feasible[0], rel=1e-12)
    assert "stiffens the mechanism: 1 of stiffness" in " ".join(str(stress).split())
    assert len(stress.states) == 3
    tight = grid.prestressed(tension={0: 0.1, 2: 0.2, 3: 0.2})
    assert tight.tensions == pytest.approx([0.1, 0.1, 0.2, 0.2], rel=1e-12)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda s: s.self_stress(held([9])), "node 9 must be below 4"),
        (lambda s: s.self_stress(groups=[[0, 1], [1]]), "member 1 is in two groups"),
        (lambda s: s.self_stress(groups=[[0, 3]]), "member 3 must be"),
        (lambda s: s.self_stress(groups=3), "groups 3 must be a sequence"),
        (lambda s: s.self_stress(tolerance=1.0), "tolerance 1 must be below 1"),
        (lambda s: s.self_stress("held"), "made by held"),
        (lambda s: s.prestressed(tension={}, supports=held([0, 3])), "must be a dict {member"),
        (lambda s: s.prestressed(tension={0: np.nan}, supports=held([0, 3])), "tension of string"),
        (
            lambda s: s.prestressed(tension={0: -1.0}, supports=held([0, 3])),
            "tension -1 N of string . must be at least 0: strings do not push",
        ),
        (
            lambda s: s.prestressed(tension={0: 1e3}, supports=held([0, 3])),
            "tension 1000 N of string . must be below its stiffness times its length, ",
        ),
        (lambda s: s.prestressed(tension={0: 1.0}), "no self-stress"),
        (lambda s: s.prestressed([1, 1, 1], supports=held([0, 3])), "are no self-stress"),
        (lambda s: s.prestressed(tension={0: 1}, prestrain={0: 1}), "give one of force_densities"),
    ],
)
def test_what_is_no_prestress_on_supports_is_refused(wrong, words):
    with pytest.raises(TensegrityError, match=words):
        wrong(rope(2)[0])
