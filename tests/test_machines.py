"""Answers do not depend on processors, their vectors or the number of threads.

What a processor may lack is left out of the kernels by $CC; threads are those of
$TENSEGRITY_THREADS.
"""

import math
import multiprocessing
import os
import warnings

import numpy as np
import pytest
import sympy as sp
from extended import lacking
from networks import patch, pushed
from oracle import stepped
from scenes import prism_chain

from tensegrity import (
    Chain,
    Network,
    Potential,
    PowerLaw,
    Prism,
    State,
    TensegrityError,
    Wall,
    simulate,
)

WITHOUT = ["", "-mno-avx512f", "-mno-avx"]
LONG = 70_001  # sites of a chain that threads share
R = sp.Symbol("r", positive=True)
HALF, QUARTER = sp.Rational(1, 2), sp.Rational(1, 4)


ROOTS = {  # in extended precision, and the units of round-off that they may be off
    "root": (sp.sqrt(R), np.sqrt, 1),
    "inverse root": (1 / sp.sqrt(R), lambda x: 1 / np.sqrt(x), 1.5),
    "quotient": (3 / R, lambda x: 3 / x, 1),
    "power 3/2": (R ** (3 * HALF), lambda x: x * np.sqrt(x), 2),
    "fourth root": (R**QUARTER, lambda x: np.sqrt(np.sqrt(x)), 2),
}


@pytest.mark.needs_extended
@pytest.mark.parametrize("flag", WITHOUT)
@pytest.mark.parametrize("name", ROOTS)
def test_roots_and_quotients_are_exact_to_a_unit_or_two(monkeypatch, name, flag):
    lacking(monkeypatch, flag)
    form, exact, most = ROOTS[name]
    random = np.random.default_rng(1)
    x = np.concatenate([random.uniform(0.25, 4, 80_000), 10.0 ** random.uniform(-99, 99, 80_000)])
    want = exact(x.astype(np.longdouble))
    error = np.abs(Potential(form, R, domain=(-1.0, math.inf)).energy(x) - want)
    assert np.max(error / np.spacing(np.abs(want).astype(float))) < most


FORMS = [
    sp.Piecewise((sp.sin(R), R < HALF), (sp.exp(-R), True)) + sp.Max(R, 1) * sp.Min(R, 2),
    sp.Abs(R - 1) ** 3 + R ** sp.Rational(3, 10) + sp.sign(R - 1),
    sp.Piecewise((sp.log(R), R > QUARTER), (sp.atan2(R, 2), True)) / (R * R + 1),
    sp.Piecewise((5, R >= 3), (sp.sqrt(R) / sp.sqrt(R + 1), True)) / R + 2 / R,
]


@pytest.mark.parametrize("flag", WITHOUT[::2])
@pytest.mark.parametrize("number", range(len(FORMS)))
def test_every_operation_of_a_law_is_that_of_sympy(monkeypatch, number, flag):
    lacking(monkeypatch, flag)
    x = np.concatenate([np.linspace(0.1, 4, 31), [1.0]])
    want = [float(FORMS[number].subs(R, sp.Float(y, 30))) for y in x]
    found = Potential(FORMS[number], R, domain=(-1.0, 10.0)).energy(x)
    np.testing.assert_allclose(found, want, rtol=1e-14, atol=1e-15)


def box(side=9, seed=0):
    """A shaken cubic pile between two walls, some bonds of other strength."""
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
    """A patch whose first and last site are joined."""
    network = patch(30)
    bonds = np.concatenate([network.bonds, [(0, network.sites - 1)]])
    return Network(network.positions, bonds, network.springs[0], mass=1.0)


@pytest.mark.parametrize("make", [box, lambda: patch(23), far])
def test_large_networks_move_by_the_sums_over_all_contacts(make):
    network = make()
    state = network.at_rest(
        dict(enumerate(0.05 * np.random.default_rng(4).standard_normal(network.shape)))
    )
    run = simulate(network, state, 0.2, dt=0.1, method="verlet")
    plain = stepped(network, state, "verlet", 0.1, 2)
    for found, wanted in ((run.final.u, plain.u), (run.final.v, plain.v)):
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(found, wanted[: network.sites], rtol=0, atol=1e-13 * scale)


@pytest.mark.parametrize("flag", WITHOUT)
def test_listed_contacts_that_do_not_touch_change_no_bit(flag, monkeypatch):
    lacking(monkeypatch, flag)
    random = np.random.default_rng(7)
    places = 0.95 * np.indices((9,) * 3).reshape(3, -1).T
    places = places + 0.01 * random.random(places.shape)
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 9 * np.eye(len(places))
    state = State(0 * places, 0.05 * random.standard_normal(places.shape))
    touch, reach = apart < 1, random.choice([1.0, 1.6, 3.0], len(places), p=[0.5, 0.4, 0.1])
    runs = []
    for listed in (touch, touch | (apart < reach)):
        bonds = np.argwhere(np.triu(listed | listed.T))
        network = Network(places, bonds, PowerLaw(1.0, 1.5), lengths=1.0, radius=0.5)
        runs.append(simulate(network, state, 0.3, dt=0.01, method="verlet"))
    assert len(network.bonds) > 1.5 * np.sum(np.triu(touch))
    assert runs[0].elongation_range[0, 0] < -0.05
    assert runs[1].elongation_range[0, 1] > 0.05
    np.testing.assert_array_equal(runs[0].u, runs[1].u)
    np.testing.assert_array_equal(runs[0].v, runs[1].v)


@pytest.mark.parametrize(("dim", "flag"), [(1, ""), (2, ""), *((3, flag) for flag in WITHOUT)])
def test_two_that_push_each_other_get_opposite_velocities_to_the_last_bit(dim, flag, monkeypatch):
    """Each pair alone, from rest, of whatever direction and wherever in the list."""
    lacking(monkeypatch, flag)
    random, count = np.random.default_rng(dim), 301  # the last sites are fewer than a group
    one = 10.0 * np.arange(count)[:, None] + random.random((count, dim))
    two = one + random.standard_normal((count, dim))
    positions, order = np.concatenate([one, two]), random.permutation(2 * count)
    where = np.argsort(order)
    bonds = np.stack([where[:count], where[count:]], axis=1)
    apart = np.linalg.norm(two - one, axis=1)
    network = Network(positions[order], bonds, PowerLaw(1.0, 1.5), lengths=1.05 * apart)
    v = simulate(network, network.at_rest(), 5.0, dt=0.1, method="rkn6").final.v
    assert np.abs(v).max() > 0.01
    np.testing.assert_array_equal(v[where[:count]], -v[where[count:]])


def changing():
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential()
    chain = Chain(spring.over_time(prestrain=0.02 + 0.001 * sp.Symbol("t")), 70)
    return chain, chain.at_rest({0: 0.01, 50: -0.01})


def elastic():
    network = patch(12, spring=Prism(1.0, 1.0, 0.2, 1.0, 10.0, 100.0).potential())
    return network, pushed(network)


def graded():
    """Each bond has constants of its own."""
    chain = Chain([Prism(1.0, 0.8, p, 1.0).potential() for p in np.linspace(0.02, 0.1, 69)], 70)
    return chain, chain.at_rest({0: 0.01, 50: -0.01})


@pytest.mark.parametrize(("flag", "make"), [
    pytest.param(flag, make, marks=[pytest.mark.slow] * (make is elastic and flag != WITHOUT[-1]))
    for flag in WITHOUT[1:] for make in (changing, elastic, graded)
])  # fmt: skip
def test_processors_agree(flag, make, monkeypatch):
    runs = []
    for given in ("", flag):
        lacking(monkeypatch, given)
        scene, state = make()  # a scene keeps its kernel
        runs.append(simulate(scene, state, 4.0, dt=0.1, method="rkn6"))
    for name in ("u", "v", "elongation_range"):
        one, two = (getattr(run, name) for run in runs)
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-13 * np.abs(two).max())


# threads


def uniform():
    return prism_chain(LONG)


def mixed():
    """Segments shorter and longer than what a thread takes, none a multiple of a block."""
    prism, hertz = Prism(1.0, 0.8, 0.05, 1.0), PowerLaw(2.0, 1.5, preload=0.1)
    springs = [prism.potential()] * 25011 + [hertz] * 33 + [prism.potential(0.05)] * 40001
    return Chain(springs + [hertz] * (LONG - 1 - len(springs)), LONG, ends=("free", "fixed"))


def large():
    """More contacts of a network than one thread takes."""
    shift = np.array([[1, 0], [0.5, np.sqrt(0.75)]])
    cells = np.array([(a, b) for b in range(90) for a in range(90)])
    place = {tuple(cell): k for k, cell in enumerate(cells.tolist())}
    steps = (1, 0), (0, 1), (-1, 1)
    bonds = [(k, place[a + x, b + y]) for (a, b), k in place.items() for x, y in steps
             if (a + x, b + y) in place]  # fmt: skip
    return Network(cells @ shift, bonds, PowerLaw(1.0, 1.5, preload=0.3, length=1.0))


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one processor is one thread")
@pytest.mark.parametrize("method", [pytest.param("verlet", marks=pytest.mark.slow), "rkn6"])
@pytest.mark.parametrize("make", [uniform, mixed, large])
def test_threads_give_the_bits_of_one(make, method, monkeypatch):
    """So close to the limit that what is wrong at a cut travels a site a stage without fading."""
    scene, runs = make(), []
    u, v = 1e-5 * np.random.default_rng(5).standard_normal((2, *scene.shape))
    u[list(scene.held)] = v[list(scene.held)] = 0
    limit = {"verlet": 2.0, "rkn6": 3.1414}[method]
    stiffest = max(float(s.stiffness(0.0)) for s in set(scene.springs))
    dt = (0.95 if make is not large else 0.5) * limit / (2 * math.sqrt(stiffest))
    for threads in ("1", "2"):
        monkeypatch.setenv("TENSEGRITY_THREADS", threads)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            runs.append(simulate(scene, State(u, v), 130 * dt, dt=dt, method=method))
    for name in ("u", "v", "elongation_range", "energy"):
        one, two = (getattr(run, name) for run in runs)
        assert one.tobytes() == two.tobytes()


def final(chain):
    return simulate(chain, chain.at_rest({0: 0.03}), 1.0, dt=0.1).final.v.tobytes()


@pytest.mark.parametrize("given", ["", " 1 ", "001"])
def test_threads_are_those_asked_for(monkeypatch, given):
    monkeypatch.setenv("TENSEGRITY_THREADS", given)
    assert final(uniform())


@pytest.mark.parametrize("given", ["20000", "9" * 5000])
def test_more_threads_than_processors_are_not_taken(monkeypatch, given):
    monkeypatch.setenv("TENSEGRITY_THREADS", given)
    with pytest.warns(
        RuntimeWarning, match="exceeds the number of available processors: .* threads are"
    ):
        final(uniform())


@pytest.mark.parametrize("given", ["²", "٣", "0", "-1", "1.5", "many"])
def test_what_is_no_number_of_threads_is_refused(monkeypatch, given):
    monkeypatch.setenv("TENSEGRITY_THREADS", given)
    with pytest.raises(TensegrityError, match=r"TENSEGRITY_THREADS .* must be a whole number"):
        final(uniform())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    """A forked process has the parent's pool but not its threads: it must not wait for them."""
    monkeypatch.setenv("TENSEGRITY_THREADS", "")
    chain = uniform()
    here = final(chain)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(final, (chain,)).get(timeout=60) == here
