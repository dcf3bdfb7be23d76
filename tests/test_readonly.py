"""What a scene is built from cannot be changed, neither in place nor by assignment."""

import copy
import dataclasses
import pickle
from math import pi

import numpy as np
import pytest
from networks import fork, patch
from scenes import prism_chain

from granular import Bead, Striker, chain, diamond_guide, materials, power, y_guide
from tensegrity import Chain, Ensemble, Network, PowerLaw, Prism, Wall, simulate

STEEL = Bead(4.76e-3, materials["steel"])
SPRINGS = [PowerLaw(1.0, 1.5, preload=0.1), PowerLaw(2.0, 1.5, preload=0.1)]
SCENES = {
    "chain": lambda: Chain(SPRINGS, 3, mass=[1.0, 2.0, 3.0], ends=("fixed", "free")),
    "ensemble": lambda: Ensemble(prism_chain(5), 3),
    "network": lambda: Network([[0, 0], [1, 0], [0, 1]], [(0, 1), (1, 2)], SPRINGS, held=[2],
                               loads=np.zeros((3, 2))),
    "patch": lambda: patch(3),
    "walls": fork,
    "beads": lambda: chain([STEEL] * 4, striker=Striker(STEEL, 0.5), end=materials["steel"]),
    "guide": lambda: y_guide(3, 3, bead=STEEL, striker=Striker(STEEL, 0.5)),
    "diamond": lambda: diamond_guide(3, 5, pi / 4, bead=STEEL, law=power(1e9, 1.5)),
}  # fmt: skip


@pytest.fixture(params=SCENES)
def scene(request):
    return SCENES[request.param]()


def public(thing):
    """Names and values of what a user can read, what is made anew at each look apart."""
    for name in dir(type(thing)) + list(vars(thing)):
        if not name.startswith("_") and not callable(value := getattr(thing, name)):
            yield name, value


def held_in(name, value, depth=3):
    """Arrays and dicts in a value, with the way to them."""
    if isinstance(value, (np.ndarray, dict)):
        yield name, value
    elif isinstance(value, (tuple, list)):
        for number, part in enumerate(value):
            yield from held_in(f"{name}[{number}]", part, depth)
    elif depth and dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from held_in(f"{name}.{field.name}", getattr(value, field.name), depth - 1)


def kept_things(scene):
    for name, value in public(scene):
        if getattr(scene, name) is value:  # not made at each look
            yield from held_in(name, value)


def assert_fixed(scene):
    found = list(kept_things(scene))
    assert len(found) >= 2 or isinstance(scene, Ensemble)
    for name, thing in found:
        if isinstance(thing, dict):
            with pytest.raises(TypeError, match="cannot be changed"):
                thing["new"] = 1
        else:
            assert not thing.flags.writeable, name


def test_no_public_attribute_can_be_assigned_or_deleted(scene):
    names = {name for name, _ in public(scene)}
    assert ({"scenes"} if isinstance(scene, Ensemble) else {"mass", "springs", "held"}) <= names
    for name in names:
        with pytest.raises(AttributeError, match=f"{name} of .* cannot be changed"):
            setattr(scene, name, getattr(scene, name))
        with pytest.raises(AttributeError):
            delattr(scene, name)


def test_no_array_of_a_scene_can_be_written(scene):
    assert_fixed(scene)


def test_arrays_that_a_scene_was_made_from_stay_the_caller_s():
    mass, positions, radius = np.ones(3), np.array([[0.0, 0], [1, 0], [2, 0]]), np.full(3, 0.1)
    bonds, loads = np.array([[0, 1], [1, 2]]), np.zeros((3, 2))
    line = Chain(SPRINGS, 3, mass=mass)
    net = Network(positions, bonds, SPRINGS, mass=mass, loads=loads, radius=radius)
    point = np.zeros(2)
    wall = Wall(point, (0, 1))
    for given in (mass, positions, radius, bonds, loads, point):
        given[...] = 7  # still writeable, and seen by nobody
    for kept in (line.mass, net.mass, net.positions, net.radius, net.bonds, net.loads, wall.point):
        assert not (kept == 7).any()


def test_copies_and_pickles_are_fixed_too_and_run_the_same(scene):
    start = scene.start() if hasattr(scene, "start") else scene.at_rest()
    t_end = 1e-6 if hasattr(scene, "start") else 0.1
    expected = simulate(scene, start, t_end, method="verlet").final
    for make in (copy.copy, copy.deepcopy, lambda scene: pickle.loads(pickle.dumps(scene))):
        again = make(scene)
        assert_fixed(again)
        found = simulate(again, start, t_end, method="verlet").final
        assert found.u.tobytes() == expected.u.tobytes()
        with pytest.raises(AttributeError):
            again.shape = ()


def test_numbers_of_a_potential_cannot_be_written():
    for spring in (PowerLaw(1.0, 1.5), Prism(1.0, 0.7, 0.01, 1.0).potential(0.01)):
        assert not spring.values.flags.writeable
        for name in ("length", "domain", "parameters"):
            with pytest.raises(AttributeError):
                setattr(spring, name, 1.0)
    with pytest.raises(AttributeError):
        SPRINGS[0].exponent = 2.0


def test_a_scene_of_ones_own_may_add_attributes():
    class Named(Chain):
        def __init__(self, name):
            super().__init__(SPRINGS, 3)
            self.name = name

    named = Named("toy")
    assert named.name == "toy"
    with pytest.raises(AttributeError, match="name of a Named cannot be changed"):
        named.name = "other"
