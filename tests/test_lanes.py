"""Contacts side by side: roots, laws, lists, threads, and forces that are opposite to the bit."""

import ctypes
import shutil
from functools import cache

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from networks import patch, pushed

from tensegrity import Chain, Network, PowerLaw, Prism, State, Wall, simulate
from tensegrity.engine import driven, native, simd
from tensegrity.engine.bonds import GROUP, PAIR
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.layout import TILE, slices
from tensegrity.engine.methods import METHODS
from tensegrity.engine.native import joined, library
from tensegrity.engine.pieces import BoundParts
from tensegrity.scenes.dynamics import dynamics

WITHOUT = ["", "-mno-avx512f", "-mno-avx"]  # what a processor may lack


@cache
def built(forms, flag):
    """The compiled text of functions of one argument, all in one library."""
    parts = ["prelude.c", "#define DIM 1", "simd.c"]
    for k, form in enumerate(forms):
        parts.append(
            simd.text(made(form), f"made{k}", "const pack *x, pack *y", [["x[g]"]], [["y[g]"]])
        )
        parts.append(
            f"void call{k}(integer n, const real *x, real *y)\n{{\n    pack a, b;\n"
            "    for (integer i = 0; i < n; i += WIDE) {\n        a = load(x + i);\n"
            f"        made{k}(1, &a, &b);\n        store(y + i, b);\n    }}\n}}\n"
        )
    return library(joined(parts), [flag] if flag else [])


def packed(forms, number, flag=""):
    """One of some functions of one argument as compiled text does it, over an array (n, 8)."""
    found = built(tuple(forms), flag)[f"call{number}"]
    found.argtypes, found.restype = [ctypes.c_longlong, ctypes.c_void_p, ctypes.c_void_p], None

    def apply(x):
        x = np.ascontiguousarray(x)
        y = np.empty_like(x)
        found(x.size, x.ctypes.data, y.ctypes.data)
        return y

    return apply


def made(form):
    x = ca.SX.sym("x")
    return ca.Function("f", [x], [form(x)])


ROOTS = [  # as they are compiled, in extended precision, and the units that they may be off
    (ca.sqrt, np.sqrt, 1),
    (lambda x: 1 / ca.sqrt(x), lambda x: 1 / np.sqrt(x), 1.5),
    (lambda x: 3 / x, lambda x: 3 / x, 1),
    (lambda x: x**1.5, lambda x: x * np.sqrt(x), 2),
    (lambda x: x**0.25, lambda x: np.sqrt(np.sqrt(x)), 2),
]


@pytest.mark.needs_extended
@pytest.mark.parametrize("flag", WITHOUT)
@pytest.mark.parametrize("number", range(len(ROOTS)))
def test_roots_and_quotients_are_exact_to_a_unit_or_two(number, flag):
    _, exact, most = ROOTS[number]
    random = np.random.default_rng(1)
    x = np.concatenate([random.uniform(0.25, 4, 80_000), 10.0 ** random.uniform(-99, 99, 80_000)])
    want = exact(x.astype(np.longdouble))
    error = np.abs(packed([form for form, *_ in ROOTS], number, flag)(x) - want)
    assert np.max(error / np.spacing(np.abs(want).astype(float))) < most


@pytest.mark.parametrize("flag", WITHOUT)
def test_the_root_of_nothing_is_nothing_and_below_there_is_none(flag):
    x = np.array([0.0, -1.0, 1e-320, 4.0, -0.0, 0.0, 1.0, 4.0])
    y = packed([form for form, *_ in ROOTS], 0, flag)(x)
    np.testing.assert_array_equal(y[[0, 3, 4]], [0, 2, 0])
    assert np.isnan(y[1])
    assert y[2] == pytest.approx(np.sqrt(1e-320), rel=1e-12)


FORMS = [
    lambda x: ca.if_else(x < 0.5, ca.sin(x), ca.exp(-x)) + ca.fmax(x, 1) * ca.fmin(x, 2),
    lambda x: ca.fabs(x - 1) ** 3 + ca.sign(x - 1) + ca.logic_not(x > 1) + x**0.3,
    lambda x: ca.if_else(ca.logic_and(x > 0.3, x <= 2), ca.log(x), ca.atan2(x, 2)) / (x * x + 1),
    lambda x: (
        ca.if_else(-ca.sin(x) > 0, x, 0) - ca.if_else(x <= 1, x, 0) + ca.fmax(1e-100, -x) ** 1.5
    ),
    lambda x: ca.if_else(ca.logic_or(x == 1, x != x), 5, ca.sqrt(x) / ca.sqrt(x + 1)) / x + 2 / x,
]


@pytest.mark.parametrize("flag", WITHOUT[::2])
@pytest.mark.parametrize("number", range(len(FORMS)))
def test_every_operation_does_what_casadi_does(number, flag):
    function = made(FORMS[number])
    x = np.concatenate([np.linspace(0.1, 4, 31), [1.0]])
    want = np.array(function(x.reshape(1, -1))).ravel()
    found = packed(FORMS, number, flag)(x)
    np.testing.assert_allclose(found, want, rtol=1e-14, atol=1e-15)


def box(side=9, seed=0):
    """A shaken cubic pile between two walls, of several tiles, some bonds of other strength."""
    random = np.random.default_rng(seed)
    cells = np.indices((side,) * 3).reshape(3, -1).T
    far = (cells[:, None] - cells[None]).astype(float)
    first, second = np.nonzero(np.triu((far**2).sum(axis=2) <= 2, 1))
    order = random.permutation(len(first))
    turned = random.random(len(first)) < 0.5
    bonds = np.stack([first, second], axis=1)
    bonds[turned] = bonds[turned, ::-1]
    springs = [PowerLaw(k, 1.5) for k in (1.0, 2.0, 3.0)]
    given = [springs[k] for k in random.integers(0, 3, len(first))]
    walls = [Wall((0, 0, -0.5), (0, 0, 1)), Wall((-0.5, 0, 0), (1, 0, 0))]
    touching = [
        (s, k) for k, axis in enumerate((2, 0)) for s in np.flatnonzero(cells[:, axis] == 0)
    ]
    return Network(
        cells + 0.01 * random.random(cells.shape), bonds[order], given, mass=1.0, walls=walls,
        wall_contacts=touching, wall_spring=PowerLaw(0.3, 1.5), radius=0.5, loads=0.01 * cells,
    )  # fmt: skip


def far():
    """A patch whose first and last site are joined: a late tile takes from an early one."""
    network = patch(30)
    bonds = np.concatenate([network.bonds, [(0, network.sites - 1)]])
    return Network(network.positions, bonds, network.springs[0], mass=1.0)


def lists(network):
    """Number, slice, lane, other row and kind of each entry of the lists that counts, in turn."""
    bonds = dynamics(network).loop_bonds
    found, contacts = slices(bonds), bonds.contacts
    group, lane = np.divmod(np.flatnonzero(found.counts), GROUP)
    row = np.searchsorted(found.begin, group, side="right") - 1
    number = bonds.runs.source[found.contact[found.counts]]
    ends = np.sort([found.site[row, lane], found.other[found.counts]], axis=0)
    first, second = contacts.first[number], contacts.second[number]
    np.testing.assert_array_equal(ends, np.sort([first, second], axis=0))
    return number, row, lane, found.other[found.counts], contacts.kind[number]


@pytest.mark.parametrize("make", [box, lambda: patch(23), far])
def test_lists_have_every_contact_once(make):
    network = make()
    assert slices(dynamics(network).loop_bonds).tiles == -(-network.sites // TILE) > 2
    assert sorted(lists(network)[0]) == list(range(len(network.springs)))


@pytest.mark.parametrize("make", [box, lambda: patch(23), far])
def test_lower_lanes_of_a_slice_come_first_at_each_other_site(make):
    """Else the order would depend on how many contacts a lane has before."""
    _, row, lane, other, kind = lists(make())
    last = {}
    for here, k, where in np.stack([row, other, lane], axis=1)[kind == PAIR].tolist():
        assert last.get((here, k), 0) <= where
        last[here, k] = where
    assert len(last) < np.sum(kind == PAIR)


@pytest.mark.parametrize("flag", WITHOUT)
def test_listed_contacts_that_do_not_touch_change_no_bit(flag, monkeypatch):
    """Neither by their places in the lists nor by longer slices: some sites have many."""
    monkeypatch.setenv("CC", f"{shutil.which('cc') or shutil.which('gcc')} {flag}")
    random = np.random.default_rng(7)
    cells = np.indices((9,) * 3).reshape(3, -1).T
    places = 0.95 * cells + 0.01 * random.random(cells.shape)
    far = np.linalg.norm(places[:, None] - places, axis=2) + 9 * np.eye(len(places))
    velocity = 0.05 * random.standard_normal(places.shape)
    touch, reach = far < 1, random.choice([1.0, 1.6, 3.0], len(places), p=[0.5, 0.4, 0.1])
    walls = [Wall((0, 0, -0.49), (0, 0, 1)), Wall((-0.49, 0, 0), (1, 0, 0))]
    at_walls = [(s, k) for s, cell in enumerate(cells) for k in (0, 1) if cell[2 - 2 * k] == 0]
    others = [(s, k) for k in (0, 1) for s in range(0, len(places), 2 - k)]
    found = []
    for listed, contacts in (
        (touch, at_walls),
        (touch | (far < reach), sorted({*at_walls, *others})),
    ):
        network = Network(
            places, np.argwhere(np.triu(listed | listed.T)), PowerLaw(1.0, 1.5), lengths=1.0,
            radius=0.5, walls=walls, wall_contacts=contacts, wall_spring=PowerLaw(1.0, 1.5),
        )  # fmt: skip
        bonds = dynamics(network).loop_bonds
        u, v = dynamics(network).arrays(State(0 * velocity, velocity))
        bound = Bound(Compiled.of(bonds), u, v, bonds, METHODS["verlet"], 0.01)
        bound.advance(30)
        found.append((u, v))
    assert len(network.bonds) > 1.5 * np.sum(np.triu(touch))
    assert np.max(np.diff(slices(bonds).begin)) > 24  # more than find room at once
    assert bound.range.min() < -0.1 < 0.05 < bound.range.max()
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one, two)


def sums(network, u):
    """Forces on all sites and on the walls, one contact at a time."""
    x, force = network.positions + u, network.loads.copy()
    on_walls = np.zeros((len(network.walls), network.dim))
    pairs = len(network.bonds)
    apart = np.diff(x[network.bonds], axis=1)[:, 0]
    distance = np.linalg.norm(apart, axis=1)
    each = zip(network.springs, distance - network.lengths, strict=False)
    pull = np.array([s.tension(r) for s, r in each])[:, None] * apart / distance[:, None]
    np.add.at(force, network.bonds[:, 0], pull)
    np.subtract.at(force, network.bonds[:, 1], pull)
    for (site, k), spring in zip(network.wall_contacts, network.springs[pairs:], strict=True):
        wall = network.walls[k]
        height = (x[site] - wall.point) @ wall.normal
        push = spring.tension(height - network.radius[site]) * wall.normal
        force[site] -= push
        on_walls[k] += push
    return force, on_walls


@pytest.mark.parametrize("make", [box, lambda: patch(23), far])
def test_forces_are_the_sums_over_all_contacts(make):
    network, dt = make(), 1e-10
    bonds = dynamics(network).loop_bonds
    moved = 0.02 * np.random.default_rng(4).standard_normal(network.shape)
    u, v = dynamics(network).arrays(State(moved, np.zeros(network.shape)))
    Bound(Compiled.of(bonds), u, v, bonds, METHODS["verlet"], dt).advance(1)
    force, on_walls = sums(network, moved)
    want = np.concatenate([force / network.mass[:, None], on_walls])
    found = v[: len(want)] / dt
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-9 * np.abs(force).max())


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("make", [box, lambda: patch(30), lambda: patch(18, dim=2), far])
def test_threads_give_the_bits_of_one(make, count):
    network = make()
    velocity = 0.1 * np.random.default_rng(2).standard_normal(network.shape)
    found = []
    for kind in (Bound, BoundParts):
        u, v = dynamics(network).arrays(State(np.zeros(network.shape), velocity))
        bonds = dynamics(network).loop_bonds
        given = Compiled.of(bonds), u, v, bonds, METHODS["verlet"], 0.05
        bound = kind(*given, *([count] if kind is BoundParts else []))
        for steps in (1, 40):
            bound.advance(steps)
        found.append((u, v, bound.range, bound.travel))
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one, two)
    assert np.abs(found[0][0]).max() > 0.05


@pytest.mark.parametrize(("dim", "flag"), [(1, ""), (2, ""), *((3, flag) for flag in WITHOUT)])
def test_two_that_push_each_other_get_opposite_velocities_to_the_last_bit(dim, flag, monkeypatch):
    """Each pair alone, from rest, of whatever direction and wherever in the list."""
    monkeypatch.setenv("CC", f"{shutil.which('cc') or shutil.which('gcc')} {flag}")
    random, count = np.random.default_rng(dim), 301  # the last sites are fewer than a group
    one = 10.0 * np.arange(count)[:, None] + random.random((count, dim))
    two = one + random.standard_normal((count, dim))
    positions, order = np.concatenate([one, two]), random.permutation(2 * count)
    where = np.argsort(order)
    bonds = np.stack([where[:count], where[count:]], axis=1)
    apart = np.linalg.norm(two - one, axis=1)
    network = Network(positions[order], bonds, PowerLaw(1.0, 1.5), lengths=1.05 * apart)
    u, v = dynamics(network).arrays(network.at_rest())
    loop = Compiled.of(dynamics(network).loop_bonds)
    Bound(loop, u, v, dynamics(network).loop_bonds, METHODS["rkn6"], 0.1).advance(50)
    assert np.abs(v).max() > 0.01
    np.testing.assert_array_equal(v[where[:count]], -v[where[count:]])


@pytest.mark.parametrize("flag", WITHOUT[1:])
def test_processors_agree(flag, monkeypatch):
    network = patch(12, spring=Prism(1.0, 1.0, 0.2, 1.0, 10.0, 100.0).potential())
    state, found = pushed(network), []
    for given in ("", flag):
        monkeypatch.setenv("CC", f"{shutil.which('cc') or shutil.which('gcc')} {given}")
        u, v = dynamics(network).arrays(state)
        bonds = dynamics(network).loop_bonds
        bound = Bound(Compiled.of(bonds), u, v, bonds, METHODS["rkn6"], 0.1)
        bound.advance(40)
        found.append((u, v, bound.range))
    for one, two in zip(*found, strict=True):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-13 * np.abs(two).max())


def test_springs_that_change_find_room_for_a_block_of_narrow_packs(monkeypatch):
    tune = {"prestrain": 0.02 + 0.001 * sp.Symbol("t")}
    chain = Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), 70, tune=tune)
    state = chain.at_rest({0: 0.01, 50: -0.01})
    wide = simulate(chain, state, 1.0, dt=0.02)
    monkeypatch.setattr(native, "NATIVE", "-O3")
    monkeypatch.setattr(native, "WIDE", ())
    monkeypatch.setattr(driven, "compiled", Compiled)
    narrow = simulate(chain, state, 1.0, dt=0.02)
    np.testing.assert_allclose(narrow.u, wide.u, atol=1e-14)
    np.testing.assert_allclose(narrow.work, wide.work, atol=1e-17)
