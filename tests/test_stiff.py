"""Structures of steel: stiffnesses, lengths and strains of laboratories and of practice, in SI.

Equilibria are compared with closed forms, or refined in extended precision by formulas of this
file.
"""

import numpy as np
import pytest
from scipy.optimize import brentq
from structures import stiff_state
from test_self_stress import dome

from tensegrity import (
    EquilibriumError,
    Structure,
    catalogue,
    equilibrium,
    equilibrium_path,
    held,
)

EPS = np.finfo(float).eps


def forces_and_stiffness(s, x, kind):
    """Member forces on the nodes and tangent, from their definition, in a precision."""
    first, second = s.ends.T
    d = x[second] - x[first]
    lengths = np.sqrt(np.sum(d**2, axis=1))
    along, k = d / lengths[:, None], s.stiffnesses.astype(kind)
    tension = k * (lengths - s.natural_lengths.astype(kind))
    slack = s.is_string & (tension < 0)
    tension, k = np.where(slack, 0, tension), np.where(slack, 0, k)
    pull, matrix = np.zeros(x.shape, kind), np.zeros((x.size, x.size))
    np.add.at(pull, first, tension[:, None] * along)
    np.add.at(pull, second, -tension[:, None] * along)
    for m, (i, j) in enumerate(s.ends):
        outer = np.outer(along[m], along[m])
        block = k[m] * outer + tension[m] / lengths[m] * (np.eye(s.dim) - outer)
        spread = np.zeros(s.nodes)
        spread[[i, j]] = 1, -1
        matrix += np.kron(np.outer(spread, spread), block.astype(float))
    return pull, matrix, tension


def error_of(state):
    """The distance from the equilibrium refined in extended precision, and the largest error of a
    tension, over what round-off of coordinates explains; and whether the equilibrium is stable."""
    s, fixed = state.structure, [n for n, _ in state.supports.holds]
    free = np.repeat(~np.isin(np.arange(s.nodes), fixed), s.dim)
    x = s.positions.astype(np.longdouble)
    for _ in range(4):
        pull, matrix, tension = forces_and_stiffness(s, x, np.longdouble)
        left = (state.loads + pull).ravel()[free]
        inner = matrix[np.ix_(free, free)]
        x.ravel()[free] += np.linalg.lstsq(inner, left.astype(float), rcond=1e-15)[0]
    softest = np.linalg.eigvalsh(inner)[0]
    noise = EPS * s.stiffnesses.max() * np.abs(s.positions).max()
    moved = np.abs(x - s.positions).max() * softest / noise
    loose = s.is_string & (s.tensions <= 10 * noise)  # of whose stiffness round-off decides
    off = float(np.abs(tension - s.tensions).max() / noise)
    return float(moved), off, bool(softest > 0 or loose.any())


def refused_or_wrong(count):
    """Seeds of random stiff states that are refused, and of those that err by more than a few
    times what round-off explains."""
    refused, wrong = [], []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        try:
            state = equilibrium(*stiff_state(rng, far=(0.0, 30.0)[seed % 2]))
        except EquilibriumError:
            refused.append(seed)
            continue
        moved, off, stable = error_of(state)
        if moved > 3 or off > 10 or not stable:
            wrong.append(seed)
    print(f"of {count} stiff states {len(refused)} are refused, {len(wrong)} are wrong")
    return refused, wrong


def test_no_stiff_state_is_refused_and_each_is_right_to_round_off():
    assert refused_or_wrong(200) == ([], [])


@pytest.mark.slow
def test_of_5000_stiff_states_none_is_refused():
    assert refused_or_wrong(5000) == ([], [])


@pytest.mark.parametrize("step", [30, pytest.param(10, marks=pytest.mark.slow)])
def test_a_cable_of_two_pieces_carries_every_load(step):
    """In closed form: 2 T y/l = load, T = k (l - .999), l^2 = 1 + y^2."""
    s = Structure([(0, 0), (1, 0), (2, 0)], strings=[(0, 1), (1, 2)], k_string=5e6,
                  natural_lengths=[0.999] * 2)  # fmt: skip
    for load in np.arange(float(step), 2001, step):
        state = equilibrium(s, {1: (0, -load)}, held([0, 2]))

        def over(y, load=load):
            length = np.hypot(1, y)
            return 2 * 5e6 * (length - 0.999) * y / length - load

        sag = brentq(over, 0, 0.5, xtol=1e-16)
        assert -state.positions[1, 1] == pytest.approx(sag, rel=1e-10)
        assert state.tensions == pytest.approx(5e6 * (np.hypot(1, sag) - 0.999), rel=1e-11)


@pytest.mark.parametrize("load", [40.0, 50.0])
def test_two_bars_at_45_degrees_carry(load):
    s = Structure([(-1, 0), (1, 0), (0, 1)], bars=[(0, 2), (1, 2)], k_bar=2e7)
    state = equilibrium(s, {2: (0, -load)}, held([0, 1]))
    lift = -2 * state.tensions * state.positions[2, 1] / state.structure.lengths
    assert lift == pytest.approx(load, rel=1e-9)
    assert state.stable


AREA, DENSITY = np.pi * 0.005**2, 7850
EA, WEIGHT = 200e9 * AREA, 9.81 * DENSITY * AREA * 2


def hanging(pieces, shape, ea=EA, dim=2):
    """A cable of 2 m between ends 1.6 m apart, its weight at the inner nodes."""
    part = np.arange(pieces + 1) / pieces
    noise = np.random.default_rng(pieces).normal(size=pieces + 1) * np.minimum(part, 1 - part)
    y = {"V": -1.2 * np.minimum(part, 1 - part), "straight": 0 * part,
         "above": 0.3 * np.sin(np.pi * part), "random": noise}[shape]  # fmt: skip
    x = np.column_stack([1.6 * part, *[0 * part] * (dim - 2), y])
    s = Structure(x, strings=[(n, n + 1) for n in range(pieces)], k_string=ea * pieces / 2,
                  natural_lengths=[2 / pieces] * pieces)  # fmt: skip
    load = (*[0.0] * (dim - 1), -WEIGHT / pieces)
    return equilibrium(s, {n: load for n in range(1, pieces)}, held([0, pieces]))


def chain(pieces, ea=EA):
    """Tensions and positions in closed form: one horizontal force, slopes from sums of weights."""
    vertical = WEIGHT / pieces * (np.arange(pieces) - (pieces - 1) / 2)

    def parts(horizontal):
        tension = np.hypot(horizontal, vertical)
        return tension, 2 / pieces * (1 / tension + 1 / ea)

    horizontal = brentq(lambda h: np.sum(h * parts(h)[1]) - 1.6, 0.01 * WEIGHT, 100 * WEIGHT,
                        xtol=1e-15)  # fmt: skip
    tension, each = parts(horizontal)
    ways = np.column_stack([horizontal * each, vertical * each])
    return tension, np.concatenate([np.zeros((1, 2)), np.cumsum(ways, axis=0)])


@pytest.mark.parametrize("pieces", [20, 30, 50, 70, 100, 150, 200])
def test_a_steel_cable_hangs_as_the_chain_in_closed_form(pieces):
    state = hanging(pieces, "V")
    tension, places = chain(pieces)
    assert np.abs(state.positions - places).max() < 1e-9
    assert state.tensions == pytest.approx(tension, rel=1e-6)  # 1e-16 of a length over its strain
    assert state.stable


@pytest.mark.parametrize("shape", ["V", "straight", "above", "random"])
@pytest.mark.parametrize("ea", [1e-3 * EA, EA, 1e3 * EA])
def test_cables_of_any_stiffness_hang_from_any_start(shape, ea):
    """48 chains: the closed form to 1e-9 m."""
    for pieces, dim in ((20, 2), (50, 3), (100, 2), (200, 3)):
        state = hanging(pieces, shape, ea, dim)
        assert np.abs(state.positions[:, [0, -1]] - chain(pieces, ea)[1]).max() < 1e-9
        assert state.stable or ea > EA  # where the sway is round-off beside EA


def random_net(rng):
    """A net of steel strings, slack or tight, on a border, at corners, along two edges or anywhere;
    with loads that hang or are random; from a start that is flat, above or random."""
    m, n = (int(k) for k in rng.integers(3, 10, 2))
    number = np.arange(m * n).reshape(m, n)
    pairs = [*zip(number[:-1].ravel(), number[1:].ravel(), strict=True),
             *zip(number[:, :-1].ravel(), number[:, 1:].ravel(), strict=True)]  # fmt: skip
    rim = np.ones((m, n), dtype=bool)
    rim[1:-1, 1:-1] = False
    some = rng.choice(m * n, max(4, m * n // 3), replace=False)
    fixed = (number[rim], number[[0, 0, -1, -1], [0, -1, 0, -1]], number[[0, -1]].ravel(), some)[
        rng.integers(4)
    ]
    x = np.column_stack([number.ravel() // n, number.ravel() % n, np.zeros(m * n)]).astype(float)
    lengths = rng.uniform(*((1.0, 1.3), (0.9, 1.3), (1.05, 1.1))[rng.integers(3)], len(pairs))
    loads = (np.tile([0, 0, -1.0], (m * n, 1)), rng.normal(size=(m * n, 3)))[rng.integers(2)]
    start = x + (0 * x, 0.3 * rng.normal(size=x.shape), [0, 0, 1.0] + 0 * x)[rng.integers(3)]
    start[fixed] = x[fixed]
    s = Structure(start, strings=[(int(i), int(j)) for i, j in pairs], natural_lengths=lengths,
                  k_string=10 ** rng.uniform(3, 7) / lengths)  # fmt: skip
    free = sorted(set(range(m * n)) - set(fixed.tolist()))
    return s, {k: tuple(loads[k]) for k in free}, held(sorted(set(fixed.tolist())))


@pytest.mark.parametrize("seeds", [range(40), pytest.param(range(40, 200), marks=pytest.mark.slow)])
def test_of_200_random_nets_of_steel_none_is_refused(seeds):
    """The energy of strings is convex: forces that balance are those of its minimum."""
    for seed in seeds:
        s, loads, supports = random_net(np.random.default_rng(seed))
        state = equilibrium(s, loads, supports)
        left = state.reactions[list(loads)]
        size = max(np.abs(state.tensions).max(), 1.0)
        allowed = 1e-10 * size + 1e-14 * s.stiffnesses.max() * 100
        assert np.abs(left).max() < allowed, seed
        assert state.stable, seed


@pytest.mark.parametrize("seed", range(3))
def test_a_net_settles_where_newtons_method_in_positions_ends(seed):
    """Where EA is moderate that finds the state, too: from the state itself, moved a little."""
    s, loads, supports = random_net(np.random.default_rng(seed))
    s = s.at(s.positions, k_string=300 / s.natural_lengths)
    state = equilibrium(s, loads, supports)
    moved = s.at(state.positions * (1 + 1e-3 * np.sign(state.positions)))
    fixed = [node for node, _ in supports.holds]
    at = moved.positions.copy()
    at[fixed] = s.positions[fixed]
    again = equilibrium(s.at(at), loads, supports)
    assert again.positions == pytest.approx(state.positions, abs=1e-9)


@pytest.mark.parametrize(("n", "load"), [(6, 10.0), (8, 8.0)])
def test_a_prestressed_dome_is_not_softened(n, load):
    """A load under which it is stable, at once, by degrees, and from a start
    where some strings are slack, leads to one state."""
    s, supports, groups = dome(n, False)
    s = s.at(s.positions, k_bar=1e6, k_string=1e5)
    tight = s.prestressed(tension={len(s.ends) - 1: 50.0}, supports=supports, groups=groups)
    top, last = range(3 * n, 4 * n), tight
    for part in np.linspace(0.1, 1, 10):
        loads = {k: (0.0, 0.0, -load * part) for k in top}
        state = equilibrium(tight.at(last.positions), loads, supports)
        last = state.structure
    moved = tight.positions + 1e-3 * np.random.default_rng(n).normal(size=tight.positions.shape)
    moved[:n] = tight.positions[:n]
    assert tight.at(moved).slack.any()
    for start in (tight, tight.at(moved)):
        at_once = equilibrium(start, loads, supports)
        assert at_once.positions == pytest.approx(state.positions, abs=1e-9)
        assert not at_once.slack.any()


@pytest.mark.parametrize("pieces", [2, 3, 8, 20, 40])
def test_a_straight_line_without_stress_sags_into_the_chain(pieces):
    x = np.column_stack([np.linspace(0, 1, pieces + 1), np.zeros(pieces + 1)])
    s = Structure(x, strings=[(n, n + 1) for n in range(pieces)], k_string=1e3 * pieces)
    state = equilibrium(s, {n: (0, -1 / pieces) for n in range(1, pieces)}, held([0, pieces]))
    rise = state.tensions[:, None] * np.diff(state.positions, axis=0)
    rise = rise / state.structure.lengths[:, None]
    assert np.ptp(rise[:, 0]) < 1e-9
    assert np.diff(rise[:, 1]) == pytest.approx(1 / pieces, abs=1e-9)
    assert state.stable


DOME = [(0, 0, 3.2346), (4.92125, 8.5239, 2.4472), (-4.92125, 8.5239, 2.4472),
        (-9.8425, 0, 2.4472), (-4.92125, -8.5239, 2.4472), (4.92125, -8.5239, 2.4472),
        (9.8425, 0, 2.4472), (0, 19.685, 0), (-17.0472, 9.8425, 0), (-17.0472, -9.8425, 0),
        (0, -19.685, 0), (17.0472, -9.8425, 0), (17.0472, 9.8425, 0)]  # fmt: skip
LINKS = [(0, n) for n in range(1, 7)] + [
    (5, 11), (6, 11), (6, 12), (1, 12), (1, 7), (2, 7), (2, 8), (3, 8), (3, 9), (4, 9), (4, 10),
    (5, 10), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 1)]  # fmt: skip


def test_dome_of_levy_and_spillers():
    """Section 2.4.2, in inches and pounds: the linear deflection; the limit load of the path."""
    s = Structure(DOME, bars=LINKS)
    s = s.at(s.positions, k_bar=3e7 * 0.0155 / s.lengths)
    supports, free = held(range(7, 13)), slice(0, 21)
    loads = np.zeros(21)
    loads[2] = -220.46
    moved = np.linalg.solve(s.stiffness().toarray()[free, free], loads)
    assert moved[2] == pytest.approx(-0.20641184, rel=2e-5)
    path = equilibrium_path(s, supports=supports, loads={0: (0, 0, -1.0)}, branch="symmetric",
                            max_load=1000.0, max_shortening=1.5)  # fmt: skip
    fold = next(event for event in path.events if event.kind == "fold")
    assert fold.load == pytest.approx(146.77795099591, rel=1e-9)
    below = equilibrium(s, {0: (0, 0, -140.0)}, supports)
    assert below.stable
    beyond = equilibrium(s, {0: (0, 0, -150.0)}, supports)  # snapped through
    assert beyond.stable
    assert beyond.positions[0, 2] < s.positions[1, 2]


def afnor():
    """Guide de validation, AFNOR 1990; the skew support is a long and stiff bar across it."""
    nodes = [(0, 0), (0, 4), (5, 0), (10, 4), (15, 0), (20, 4), (25, 0), (30, 4), (35, 0),
             (20, -4), (35 + 500, -1000 * 0.75**0.5)]  # fmt: skip
    thin = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8)]
    thick = [(1, 3), (3, 5), (5, 7), (0, 2), (2, 4), (4, 9), (9, 6), (6, 8), (9, 5)]
    s = Structure(nodes, bars=[*thin, *thick, (8, 10)])
    area = np.repeat([1.41e-3, 2 * 1.41e-3, 5e4], [len(thin), len(thick), 1])
    return s.at(s.positions, k_bar=2.1e11 * area / s.lengths)


LOADS = {3: (0, -150e3), 7: (0, -100e3)}


def test_afnor_truss_under_its_combination_of_loads():
    """Forces of 250 kN, settlements of the supports and 150 K of heat; linear: -0.016177 m."""
    s = afnor()
    supports = held([0, 10]) + held([9], axes=[1])
    assert equilibrium(s, LOADS, supports).stable
    warm = np.append(np.full(17, 1 + 150e-5), 1.0)
    x = s.positions.copy()
    x[0, 1] -= 0.02
    x[9, 1] -= 0.03
    x[10] += 0.015 * np.array([0.5, -(0.75**0.5)])
    there = s.at(x, natural_lengths=s.lengths * warm)
    state = equilibrium(there, LOADS, supports)
    assert state.stable
    assert state.positions[6, 1] - s.positions[6, 1] == pytest.approx(-0.016188, abs=2e-6)


def test_loads_that_come_out_of_balance_as_a_free_structure_deforms_turn_it():
    s = catalogue.tower(2, k_bar=1e3, k_string=50.0)
    far = s.positions[9] - s.positions[0]
    pull = 0.1 * far / np.linalg.norm(far)
    state = equilibrium(s, {0: tuple(-pull), 9: tuple(pull)})
    assert np.abs(state.reactions).max() < 1e-9


@pytest.mark.parametrize("k", [100.0, 5e6])
@pytest.mark.parametrize("off", [1e-3, 1e-5, 1e-7, 1e-9])
def test_bars_next_to_their_unstable_line_leave_it(k, off):
    """Where the fall of the energy is below its round-off at first."""
    s = Structure([(0, 0), (1, off), (2, 0)], bars=[(0, 1), (1, 2)], k_bar=k,
                  natural_lengths=[1.001] * 2)  # fmt: skip
    state = equilibrium(s, None, held([0, 2]))
    assert state.positions[1, 1] == pytest.approx(np.sqrt(1.001**2 - 1), rel=1e-9)
    assert state.stable
    assert not equilibrium(s.at([(0, 0), (1, 0), (2, 0)]), None, held([0, 2])).stable


def test_domes_under_prestress_stay_those_of_their_prestress():
    """Softer strings would lose it."""
    s = catalogue.dome(6, 1, prestrain=1e-3, k_bar=5e6, k_string=5e5)
    for load in (1.0, 40.0):
        state = equilibrium(s, {n: (0, 0, -load) for n in range(6, 12)}, held(range(6)))
        path = equilibrium_path(s, supports=held(range(6)), max_load=6 * load,
                                loads={n: (0, 0, -1.0) for n in range(6, 12)})  # fmt: skip
        assert state.stable
        assert path.end == "the requested load is reached"
        assert state.positions == pytest.approx(path.positions[-1], abs=1e-9)
