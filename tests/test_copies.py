"""What a user holds can be copied, pickled and sent from another process, and stays the same."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
import sympy as sp
from networks import fork, patch, pushed

import granular
from tensegrity import (
    Chain,
    ContactError,
    Ensemble,
    LockingError,
    Network,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    Record,
    StabilityError,
    Wall,
    equilibrium_path,
    errors,
    simulate,
    solitary_wave,
)
from tensegrity.branches.continuation import ContinuationError
from tensegrity.prisms.fold_curve import limit_load
from tensegrity.readonly import ReadOnly

RIGID = Prism(1.0, 0.7, 0.01, 1.0)
SOFT = Prism(1.0, 0.5, 0.4, 1.0, k_base=2.0, k_bar=20.0)
R, K = sp.symbols("r k")
LAW = granular.power(1e9, 1.4)
STEEL = granular.Bead(9.5e-3, granular.materials["steel"])


def run_of_prisms(tol=None):
    chain = Chain(RIGID.potential(), 12, ends=("free", "fixed"))
    return simulate(chain, chain.at_rest({0: 0.01}), 3.0, tol=tol)


def locking():
    chain = Chain(RIGID.potential(), 4)
    with pytest.raises(LockingError) as failure:
        simulate(chain, chain.at_rest({0: 3.0}), 5.0, dt=1e-3)
    return failure.value


def meeting():
    network = Network([[0.0, 0.0], [3.0, 0.0]], [], PowerLaw(1.0, 1.5), radius=0.5)
    with pytest.raises(ContactError) as failure:
        simulate(network, network.at_rest({0: [1.0, 0.0]}), 20.0, dt=1e-2)
    return failure.value


def unstable():
    chain = Chain(PowerLaw(1.0, 3.0), 10)
    with pytest.raises(StabilityError) as failure:
        simulate(chain, chain.at_rest({0: 4.0}), 20.0, dt=0.4)
    return failure.value


def not_followed():
    failure = ContinuationError("the step fell below 1e-10")
    failure.branch = limit_load(SOFT, 0.41)
    return failure


THINGS = {
    "prism": lambda: SOFT,
    "rigid potential": lambda: RIGID.potential(0.001),
    "elastic potential": lambda: SOFT.potential(0.01),
    "rigid bases": lambda: Prism(1.0, 0.7, 0.01, 1.0, k_bar=100.0).potential(),
    "power law": lambda: PowerLaw(2.0, 1.5, 0.3, 1.0),
    "own potential": lambda: Potential(K * (sp.exp(-R) + R - 1), R, {K: 2.0}, 1.5, (-1.0, 3.0)),
    "polynomial": lambda: Polynomial(RIGID.potential(), -0.02, 0.01, 1e-10),
    "path": lambda: equilibrium_path(SOFT, max_height=0.52),
    "rigid path": lambda: equilibrium_path(RIGID),
    "slice": lambda: equilibrium_path(SOFT)[3:],
    "event": lambda: equilibrium_path(SOFT).events[0],
    "limit load": lambda: limit_load(SOFT, 0.41),
    "chain": lambda: Chain([RIGID.potential(), SOFT.potential(0.01)] * 4, 9),
    "ensemble": lambda: Ensemble(Chain(RIGID.potential(), 5), 3),
    "network": fork,
    "wall": lambda: Wall([0.0, 1.0], [0.0, 2.0]),
    "state": lambda: pushed(patch()),
    "record": lambda: Record(every=2, sites=[0, 1]),
    "run": run_of_prisms,
    "polynomial run": lambda: run_of_prisms(tol=1e-6),
    "network run": lambda: simulate(patch(), pushed(patch()), 0.5),
    "wave": lambda: solitary_wave(RIGID.potential(), speed_ratio=1.1),
    "bead": lambda: STEEL,
    "materials": lambda: granular.materials,
    "contact": lambda: granular.Contact(1e9, 1.5),
    "bead chain": lambda: granular.chain([STEEL] * 5, striker=granular.Striker(STEEL, 0.5)),
    "own contacts": lambda: granular.chain([STEEL] * 5, law=LAW),
    "guide": lambda: granular.y_guide(4, 5, bead=STEEL, striker=granular.Striker(STEEL, 0.5)),
    "guide of own contacts": lambda: granular.y_guide(4, 5, bead=STEEL, law=LAW),
    "locking": locking,
    "meeting": meeting,
    "unstable": unstable,
    "not followed": not_followed,
}
WAYS = {"pickle": lambda x: pickle.loads(pickle.dumps(x)), "copy": copy.copy,
        "deepcopy": copy.deepcopy}  # fmt: skip


def same(one, other):
    """Whether two things are equal all through, as far as anything in them tells."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=True)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, BaseException) and not same(one.args, other.args):
        return False
    if type(one).__eq__ is not object.__eq__ and not (is_dataclass(one) and holds_arrays(one)):
        return one == other
    if isinstance(one, ReadOnly):  # what was computed from it is not taken along
        return same(one.__getstate__(), other.__getstate__())
    return same(getattr(one, "__dict__", {}), getattr(other, "__dict__", {}))


def holds_arrays(one):
    return any(isinstance(getattr(one, f.name), np.ndarray) for f in fields(one))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", THINGS)
def test_copies_are_the_same(name, way):
    one = THINGS[name]()
    other = WAYS[way](one)
    assert same(one, other)
    assert repr(one) == repr(other)
    assert str(one) == str(other)


def test_copies_of_a_path_answer_as_the_path_does():
    path = equilibrium_path(SOFT)
    for way in WAYS.values():
        other = way(path)
        assert other.events == path.events
        assert other.events[0].load == path.events[0].load
        assert (other[3:].load == path.load[3:]).all()
        with pytest.raises(AttributeError, match="event has no 'weight', only height, twist"):
            other.events[0].weight  # noqa: B018


def test_copies_of_what_compares_are_equal_and_hash_alike():
    for name in ("prism", "rigid potential", "elastic potential", "own potential", "polynomial",
                 "power law", "bead", "contact"):  # fmt: skip
        one = THINGS[name]()
        hash(one)
        for way in WAYS.values():
            assert way(one) == one
            assert hash(way(one)) == hash(one)


@pytest.mark.parametrize("name", ["locking", "meeting", "unstable"])
def test_errors_take_their_run_along(name):
    failure = THINGS[name]()
    other = pickle.loads(pickle.dumps(failure))
    assert failure.run is not None
    assert same(other.run, failure.run)


@pytest.mark.parametrize(
    "kind", [x for x in vars(errors).values() if isinstance(x, type) and issubclass(x, Exception)]
)
def test_errors_of_any_kind_travel(kind):
    other = pickle.loads(pickle.dumps(kind("height 0.3 m is below 0.4 m")))
    assert (type(other), other.args) == (kind, ("height 0.3 m is below 0.4 m",))


def test_results_come_from_other_processes():
    """Started afresh, so that nothing but the pickled bytes can be shared."""
    names = ["path", "wave", "run", "elastic potential", "rigid potential", "own potential"]
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = dict(zip(names, pool.map(made_elsewhere, names), strict=True))
    for name, other in found.items():
        here = THINGS[name]()
        if name == "run":
            assert (other.u == here.u).all()
            assert other.scene.springs == here.scene.springs
            continue
        assert same(other, here)
        if isinstance(here, Potential):
            assert {here: 1}[other]  # strings hash differently there
            assert hash(other) == hash(here)


def made_elsewhere(name):
    thing = THINGS[name]()
    return {thing: thing}[thing] if isinstance(thing, Potential) else thing
