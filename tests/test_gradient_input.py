"""What has no gradient is refused, and the reason said, before any work."""

import numpy as np
import pytest
import sympy as sp

from tensegrity import (
    Chain,
    Network,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    State,
    TensegrityError,
    gradient,
)
from tensegrity import objective as o

SPRING = Prism(1.0, 0.7, 0.01, 1.0).potential()
CHAIN = Chain(SPRING, 4, ends=("free", "fixed"))
GOOD = {"objective": o.displacement(1), "scene": CHAIN, "state": CHAIN.at_rest({0: 0.01}),
        "t_end": 2.0, "dt": 0.1}  # fmt: skip


def refused(match, **other):
    with pytest.raises(TensegrityError, match=match) as caught:
        gradient(**GOOD | other)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("match", "other"),
    [
        ("cannot be inverted", {"method": "rk4"}),
        ("cannot be inverted", {"method": "midpoint"}),
        ("more than kicks and drifts", {"method": "corrected6"}),
        ("dt", {"dt": None}),
        ("bond 3 must be below 3", {"objective": o.load(bond=3)}),
        ("site 4 must be below 4", {"objective": o.peak(o.displacement(4))}),
        ("wall 1 must be below 1", {"objective": o.load(wall=1)}),
        ("axis 1 must be below 1", {"objective": o.velocity(0, axis=1)}),
        ("site 9 must be below 4", {"objective": o.energy([1, 9])}),
        ("never passes 5 m", {"objective": o.arrival(2, 5.0)}),
        ("needs 3 s, the run ends at 2", {"objective": o.p_norm(o.load(bond=0), 8, over=(1, 3))}),
        ("needs 7 s", {"objective": o.misfit(o.displacement(1), [1, 7], [0, 0])}),
        ("no step of 0.1 s", {"objective": o.p_norm(o.load(bond=0), 8, over=(1.02, 1.04))}),
        ("by it are always computed, as the attribute mass", {"wanted": ("mass",)}),
        ("wanted 'stroke' is not one of prestrain", {"wanted": ("stroke",)}),
        ("wanted 'prestrain' must be a sequence", {"wanted": "prestrain"}),
        ("checkpoints 0 must be", {"checkpoints": 0}),
        ("empty sequence", {"objective": []}),
        ("objective 3", {"objective": 3}),
        ("scene 1 is not a scene", {"scene": 1}),
        ("value of a function", {"objective": o.of([o.load(bond=0)], lambda t, y: (np.nan, y))}),
        ("has shape", {"objective": o.of([o.load(bond=0)], lambda t, y: (1.0, [1.0]))}),
        ("must give", {"objective": o.of([o.load(bond=0)], lambda t, y: 1.0)}),
        (
            "must be finite",
            {"objective": o.of([o.load(bond=0)], lambda t, y: (1.0, np.full(y.shape, np.inf)))},
        ),
    ],
)
def test_what_has_no_gradient_is_refused_with_the_reason(match, other):
    refused(match, **other)


@pytest.mark.parametrize(
    ("match", "spring"),
    [
        ("is a fit of another spring", Polynomial(SPRING, -0.02, 0.02, 1e-6)),
        ("exponent 0.5", PowerLaw(1.0, 0.5, 0.1)),
    ],
)
def test_springs_without_derivatives_are_refused(match, spring):
    chain = Chain(spring, 4)
    refused(match, scene=chain, state=chain.at_rest({0: 1e-3}))


def test_contacts_that_come_and_go_are_refused():
    law = PowerLaw(1.0, 1.5)
    net = Network([[0.0, 0.0], [3.0, 0.0]], [], (), radius=1.0, contacts="follow", law=law)
    state = State(np.zeros((2, 2)), np.array([[0.1, 0.0], [0.0, 0.0]]))
    refused("detected during a run", scene=net, state=state, objective=o.displacement(0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: o.load(),
        lambda: o.load(bond=1, wall=1),
        lambda: o.energy([]),
        lambda: o.energy([1, 1]),
        lambda: o.p_norm(o.load(bond=0), 8, over=(2, 1)),
        lambda: o.misfit(o.displacement(1), [0.0, 1.0], [np.nan, 0.0]),
        lambda: o.misfit(o.displacement(1), [0.0, np.nan], [0.0, 0.0]),
        lambda: o.misfit(o.displacement(1), [1.0, 0.0], [0.0, 0.0]),
        lambda: o.misfit(o.displacement(1), [1.0], [0.0, 0.0]),
        lambda: o.of([], lambda t, y: (0.0, y)),
        lambda: o.of(o.load(bond=0), lambda t, y: (0.0, y)),
        lambda: o.of([o.load(bond=0)], None),
    ],
)
def test_objectives_that_make_no_sense_are_refused(make):
    with pytest.raises(TensegrityError):
        make()


def test_a_name_that_nothing_has_or_that_was_not_wanted():
    found = gradient(**GOOD, wanted=("k_cross",))
    for name in ("prestrain", "diameter", 3):
        with pytest.raises(TensegrityError):
            found.by(name)
    for name in ("mass", "u", "v", "shift"):
        with pytest.raises(TensegrityError, match=f"attribute .{name}$"):
            found.by(name)


def test_a_law_without_preload_has_no_derivative_by_it():
    """The overlap at rest is a root of the preload."""
    chain = Chain(PowerLaw(1.0, 1.5), 3)
    found = gradient(o.displacement(1), chain, chain.at_rest({0: 0.1}), 1.0, dt=0.05)
    with pytest.raises(TensegrityError, match="this gradient has stiffness"):
        found.by("preload")


def test_symbols_of_an_own_energy_are_names():
    r, k, b = sp.symbols("r k b")
    spring = Potential(k * r**2 / 2 + b * r**4, r, {k: 1.0, b: 0.5})
    chain = Chain([spring, SPRING], 3)
    found = gradient(o.displacement(2), chain, chain.at_rest({0: 0.1}), 3.0, dt=0.05)
    assert found.by("b")[0] != 0
    assert found.by("b")[1] == 0
    assert found.by("prestrain")[0] == 0
    assert "b" in str(found)
