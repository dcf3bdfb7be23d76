"""What is a number wherever one is asked for, and what is none."""

import math
import tracemalloc
import warnings
from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from scenes import with_memory

import tensegrity
from granular import Bead, Striker, chain, diamond_guide, materials, y_guide
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    Force,
    Network,
    PowerLaw,
    Prism,
    Record,
    State,
    TensegrityError,
    check,
    sech2,
    simulate,
)


@pytest.mark.parametrize(
    "given",
    [2, 2.0, np.float32(2), np.float64(2), np.longdouble(2), np.int64(2), np.uint8(2),
     np.array(2), np.array(2.0, dtype=np.float32), Fraction(2), sp.Integer(2), 2 * sp.pi / sp.pi],
)  # fmt: skip
def test_real_numbers_of_any_kind_are_plain_floats(given):
    value = check.number("mass", given)
    assert type(value) is float
    assert value == 2


def test_constants_of_sympy_are_numbers_and_its_symbols_are_not():
    assert check.number("angle", sp.pi / 4) == math.pi / 4
    for bad in (sp.Symbol("x", real=True), sp.I, sp.true):
        with pytest.raises(TensegrityError, match=r"angle .* is not a number"):
            check.number("angle", bad)


class Text(str):
    """A kind of text of one's own."""


NO_NUMBERS = [
    None, "1.5", Text("1.5"), b"1", True, np.True_, np.array(True), np.array("1.5"), 1j,
    np.complex128(1), Decimal("1.5"), [1.0], (1.0,), np.array([1.0]), {}, {1.0}, object(), float,
]  # fmt: skip


@pytest.mark.parametrize(
    "bad", NO_NUMBERS, ids=lambda x: "object()" if type(x) is object else repr(x)
)
def test_what_is_no_number_is_told_so(bad):
    with pytest.raises(TensegrityError, match=r"mass .* is not a number"):
        check.number("mass", bad)
    with pytest.raises(TensegrityError, match=r"sites .* is not a whole number"):
        check.whole("sites", bad, least=0)


@pytest.mark.parametrize(
    "huge",
    [10**400, -(10**400), 10**5000, Fraction(10**400)],
    ids=("huge", "low", "beyond printing", "fraction"),
)
def test_numbers_beyond_every_float_are_refused_in_a_line(huge):
    with pytest.raises(TensegrityError, match=r"mass must be within 1\.79769e\+308") as caught:
        check.number("mass", huge)
    assert len(str(caught.value)) < 200


def test_whole_numbers_beyond_every_count_are_refused():
    assert check.whole("sites", np.array(3), least=2) == 3
    assert type(check.whole("sites", np.int8(3), least=2)) is int
    for huge in (10**400, 10**5000, 2**63):
        with pytest.raises(TensegrityError, match="sites must be at most"):
            check.whole("sites", huge, least=2)
    with pytest.raises(TensegrityError, match=r"sites .* must be at least 2"):
        check.whole("sites", -(10**5000), least=2)


def test_long_values_are_shown_short():
    with pytest.raises(TensegrityError) as caught:
        check.number("mass", list(range(1000)))
    assert len(str(caught.value)) < 200


STEEL = materials["steel"]


def test_beads_whose_mass_is_no_number_are_refused():
    with pytest.raises(TensegrityError, match="mass inf kg is not finite"):
        Bead(1e200, STEEL)


SPRING = PowerLaw(1.0, 1.5, preload=0.1)
ELASTIC = Prism(1.0, 0.7, 0.01, 1.0, 10.0, 100.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Chain(SPRING, 10**12), r"a run of 1000000000000 sites would take 1\.76e\+05"),
        (lambda: Ensemble(Chain(SPRING, 3), 10**12), "a run of 3 sites in 10+ scenes would take"),
        (lambda: y_guide(10**9, bead=Bead(0.005, STEEL)), "a guide with a stem of 10+ and"),
        (lambda: diamond_guide(5, 10**9 + 1, bead=Bead(0.005, STEEL)), "branches of 10+1 beads"),
        (lambda: chain(Many()), "a chain of 10+ beads would take"),
        (lambda: ELASTIC.column(10**12), "a column of 10+ prisms would take"),
    ],
)
def test_what_no_memory_holds_is_refused_before_it_is_taken(make, words):
    tracemalloc.start()
    try:
        with pytest.raises(TensegrityError, match=rf"{words}.* GB of memory, .* GB are free"):
            make()
        assert tracemalloc.get_traced_memory()[1] < 1e7
    finally:
        tracemalloc.stop()


class Many(Sequence):
    """More beads than there are."""

    def __len__(self):
        return 10**12

    def __getitem__(self, number):
        return Bead(0.005, STEEL)


def test_a_chain_is_refused_by_what_its_run_takes(monkeypatch):
    """The figure said is not less than what a run takes, and not twice as much."""
    sites = 50_000

    def run(sites):
        start = State(np.zeros(sites), np.r_[0.01, np.zeros(sites - 1)])
        simulate(Chain(SPRING, sites), start, 0.1, dt=0.1, record=Record(sites=[0]))

    run(3)  # what is made once, such as the kernel
    tracemalloc.start()
    run(sites)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    with_memory(monkeypatch, 0.9 * taken)
    with pytest.raises(TensegrityError, match="would take"):
        Chain(SPRING, sites)
    with_memory(monkeypatch, 2 * taken)
    Chain(SPRING, sites)


@pytest.mark.parametrize(
    ("asked", "at"), [(check.number, 3.0), (check.number, 3), (check.whole, 3)]
)
def test_an_upper_bound_is_no_value_itself(asked, at):
    assert asked("site", at - 1, least=0, below=3) == 2
    with pytest.raises(TensegrityError, match=r"site 3 must be below 3$"):
        asked("site", at, least=0, below=3)


def test_a_prism_where_a_potential_is_wanted_is_told_what_gives_one():
    prism = tensegrity.Prism(1.0, 0.7, 0.01, 1.0)
    calls = [
        lambda: tensegrity.Chain(prism, 4),
        lambda: tensegrity.Chain([prism] * 3, 4),
        lambda: tensegrity.dispersion(prism, 1.0, [0.1]),
        lambda: tensegrity.Network([[0, 0], [1, 0]], [(0, 1)], [prism]),
    ]
    for call in calls:
        with pytest.raises(TensegrityError, match=r"Potential.*: give prism\.potential\(\)$"):
            call()
    with pytest.raises(TensegrityError, match=r"give structure\.network\(\)"):
        check.kind("network", tensegrity.Structure([[0, 0], [1, 0]], [(0, 1)]), tensegrity.Network)


def test_a_bead_of_metres_and_a_striker_of_km_per_second_are_warned_about_once():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        beads = [Bead(5.25, STEEL) for _ in range(3)]
        Bead(5.25e-3, STEEL)
        strikers = [Striker(Bead(5.25e-3, STEEL), 1e3) for _ in range(2)]
        Striker(Bead(5.25e-3, STEEL), 10.0)
    assert len(beads) + len(strikers) == 5
    big, fast = caught
    assert "diameter 5.25 m, 5250 mm" in str(big.message)
    assert "5.25 mm are 0.00525 m" in str(big.message)
    assert "5.25 mm at 1000 m/s" in str(fast.message)
    assert big.filename == fast.filename == __file__


HIDDEN = np.ma.MaskedArray([0.1, 0.2, 0.3], mask=[False, True, False])
MASKED = [
    lambda: Damping(bond=HIDDEN), lambda: Damping(ground=[HIDDEN, HIDDEN]),
    lambda: Chain(SPRING, 3, mass=HIDDEN), lambda: State(HIDDEN, np.zeros(3)),
    lambda: Chain(SPRING, 3).energy(State(np.zeros(3), HIDDEN)), lambda: SPRING.tension(HIDDEN),
    lambda: Force(sp.Symbol("v")).values(0.0, HIDDEN), lambda: sech2(SPRING, 1.1, HIDDEN),
    lambda: Network(np.eye(3), [(0, 1), (1, 2), (2, 0)], SPRING, lengths=HIDDEN),
    lambda: Network(np.ma.MaskedArray(np.eye(3), mask=np.eye(3)), [(0, 1)], SPRING),
    lambda: Drive(force=(np.arange(3.0), HIDDEN)), lambda: check.rows("u", HIDDEN, (3,)),
    lambda: Chain(SPRING, 3).site_energy(State(np.ma.masked_all(3), np.zeros(3))),
    lambda: chain([Bead(1e-3, STEEL)] * 4, striker=Striker(Bead(1e-3, STEEL), 1.0),
                  gaps=np.ma.MaskedArray(np.zeros(4), mask=np.ones(4))),
]  # fmt: skip


@pytest.mark.parametrize("given", MASKED)
def test_masked_entries_are_refused_by_name(given):
    with pytest.raises(TensegrityError, match=r"masked at index \d"):
        given()


def test_a_mask_of_nothing_changes_nothing():
    plain = np.ma.MaskedArray([0.1, 0.2, 0.3], mask=np.zeros(3, bool))
    assert type(check.floats("x", plain)) is np.ndarray
    np.testing.assert_array_equal(SPRING.tension(plain), SPRING.tension(plain.data))


@pytest.mark.parametrize("asked", [check.number, lambda *a: check.whole(*a, least=0)])
def test_a_span_of_time_is_no_number(asked):
    for span in (np.timedelta64(3), np.timedelta64(3, "s"), np.array(np.timedelta64(3))):
        with pytest.raises(TensegrityError, match=r"duration .* is not a"):
            asked("duration", span)
    chain = Chain(SPRING, 3)
    with pytest.raises(TensegrityError, match=r"t_end .* is not a number"):
        simulate(chain, chain.at_rest({0: 0.1}), np.timedelta64(3, "s"))
