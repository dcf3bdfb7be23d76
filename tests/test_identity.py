"""Equal contents have one identity, in any process; others have others, or are refused by name."""

import copy
import datetime
import enum
import json
import math
import operator
import os
import re
import subprocess
import sys
from collections import Counter, OrderedDict, defaultdict, deque, namedtuple
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache, cached_property, lru_cache, partial, wraps
from pathlib import Path
from threading import Lock
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from crafted import identity
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tensegrity import Chain, Drive, Network, Potential, PowerLaw, TensegrityError

LONG = np.arange(3000.0)
SCALE, R, T = 3.0, sp.Symbol("r"), sp.Symbol("t")
Pair = namedtuple("Pair", "one other")


@dataclass(frozen=True)
class Bar:
    length: float
    name: str = "bar"

    @cached_property
    def half(self):
        return self.length / 2


class Colour(enum.Enum):
    RED = 1
    BLUE = 2


class Scaled:
    """A function with a state; `scaled` gives classes with other code."""

    def __init__(self, by):
        self.by = by

    def __call__(self, x):
        return self.by * x


class Slotted:
    __slots__ = ("value",)

    def __init__(self, value):
        self.value = value


def changed(array, place=1500):
    array = array.copy()
    array[place] += 1
    return array


def masked(place):
    return np.ma.masked_array(LONG, place == LONG)


def objects(last):
    many = np.empty(2000, object)
    many[:] = [("x", k) for k in range(2000)]
    many[1000] = last
    return many


def structured(value):
    rows = np.zeros(1500, np.dtype([("k", "i1"), ("x", "f8")], align=True))
    rows.view(np.uint8)[1:8] = np.arange(7) * int(value)  # between the fields
    rows["x"][700] = value
    return rows


def capturing(k):
    return lambda x: k * x


def nested(k):
    def outer(x):
        def inner(y):
            return k * y

        return inner(x)

    return outer


def with_default(k):
    def f(x, k=k, *, by=2):
        return k * x

    return f


def decorated(k):
    def twice(f):
        @wraps(f)
        def g(x):
            return f(f(x))

        return g

    return twice(capturing(k))


def recursive(k):
    def f(n):
        return k if n == 0 else f(n - 1)

    return f


def with_attribute(k):
    def f(x):
        return f.k * x

    f.k = k
    return f


def of_globals(**values):
    """A function of a user's module that uses what is there, also by another function."""
    module = {"__name__": "rig"}
    code = "def helper(x):\n    return K * x\n\n\ndef f(x):\n    return helper(x) + TABLE['a'] * K"
    exec(code, module)
    module.update({"K": 1.0, "TABLE": {"a": 2.0}} | values)
    return module["f"]


def of_code(text, name="f"):
    module = {"__name__": "rig"}
    exec(text, module)
    return module[name]


def class_of(body):
    return of_code(f"class f:\n    k = 1\n    def __call__(self, x):\n        return {body}")


def of_property(body):
    return of_code(f"class f:\n    @property\n    def k(self):\n        return {body}")


def cyclic(value):
    ring = [value]
    ring.append({"ring": ring})
    return ring


def spring(k):
    return Potential(k * R**2 / 2 + R**4, R)


def plate(k, **more):
    return Network([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [(0, 1), (1, 2)], spring(k), **more)


PAIRS = {  # two contents of every kind
    "numbers": (lambda: 1.0, lambda: math.nextafter(1.0, 2)),
    "zeros": (lambda: 0.0, lambda: -0.0),
    "a number that is none": (lambda: float("nan"), lambda: np.inf),
    "kinds of one": (lambda: True, lambda: 1),
    "whole numbers": (lambda: 10**5000, lambda: 10**5000 + 1),
    "complex": (lambda: complex(0.0, 2.0), lambda: complex(-0.0, 2.0)),
    "texts": (lambda: "1", lambda: "\ud800"),
    "bytes": (lambda: b"1", lambda: bytearray(b"1")),
    "numpy scalars": (lambda: np.float32(0.1), lambda: np.float32(0.2)),
    "small integers": (lambda: np.int8(1), lambda: np.int16(1)),
    "long doubles": (
        lambda: np.array([1, 2], np.longdouble) / 3, lambda: np.array([1, 1], np.longdouble) / 3
    ),
    "sequences": (lambda: (1, 2), lambda: [1, 2]),
    "where sequences end": (lambda: [[1], [2, 3]], lambda: [[1, 2], [3]]),
    "no value": (lambda: None, lambda: ()),
    "sets": (lambda: {"a", "b", "c", 1}, lambda: {"a", "b", "d", 1}),
    "frozen sets": (lambda: frozenset("abcdef"), lambda: frozenset("abcdeg")),
    "dicts": (lambda: {"a": 1, "b": 2}, lambda: {"b": 2, "a": 1}),
    "keys and values": (lambda: {"a": "b"}, lambda: {"b": "a"}),
    "other dicts": (lambda: OrderedDict(a=1), lambda: defaultdict(int, a=1)),
    "counts": (lambda: Counter("abca"), lambda: Counter("abcb")),
    "queues": (lambda: deque([1, 2], 3), lambda: deque([1, 2], 4)),
    "ranges": (lambda: range(3), lambda: range(0, 3, 2)),
    "paths": (lambda: Path("a/b"), lambda: Path("a/c")),
    "named tuples": (lambda: Pair(1, 2), lambda: Pair(2, 1)),
    "namespaces": (lambda: SimpleNamespace(a=1), lambda: SimpleNamespace(a=2)),
    "dataclasses": (lambda: Bar(1.0), lambda: Bar(1.0, "strut")),
    "slots": (lambda: Slotted(1), lambda: Slotted(2)),
    "enumerations": (lambda: Colour.RED, lambda: Colour.BLUE),
    "fractions": (lambda: Fraction(1, 3), lambda: Fraction(2, 3)),
    "decimals": (lambda: Decimal("0.10"), lambda: Decimal("0.1")),
    "patterns": (lambda: re.compile("a"), lambda: re.compile("a", re.I)),
    "dates": (lambda: datetime.date(2020, 1, 2), lambda: datetime.date(2020, 1, 3)),
    "zones": (
        lambda: datetime.datetime(2020, 1, 2, tzinfo=datetime.UTC),
        lambda: datetime.datetime(2020, 1, 2),
    ),
    "rings": (lambda: cyclic(1), lambda: cyclic(2)),
    "arrays": (lambda: LONG, lambda: changed(LONG)),
    "shapes": (lambda: LONG.reshape(2, -1), lambda: LONG.reshape(-1, 2)),
    "types": (lambda: LONG.astype("f4"), lambda: LONG.astype(int)),
    "order of bytes": (lambda: LONG.astype(">f8"), lambda: changed(LONG.astype(">f8"))),
    "order in memory": (lambda: np.ones((60, 60), order="F") * LONG[:60], lambda: np.eye(60)),
    "strides": (lambda: LONG[::2], lambda: LONG[::-2]),
    "masks": (lambda: masked(1), lambda: masked(2)),
    "objects": (lambda: objects(None), lambda: objects(0)),
    "fields": (lambda: structured(1), lambda: structured(2)),
    "instants": (lambda: LONG.astype("M8[s]"), lambda: LONG.astype("M8[ms]")),
    "words": (lambda: np.array(["a", "b"]), lambda: np.array(["a", "c"])),
    "generators": (lambda: np.random.default_rng(1), lambda: np.random.default_rng(2)),
    "lambdas": (lambda: capturing(1), lambda: capturing(2)),
    "nested functions": (lambda: nested(1), lambda: nested(2)),
    "defaults": (lambda: with_default(1), lambda: with_default(2)),
    "decorated functions": (lambda: decorated(1), lambda: decorated(2)),
    "recursive functions": (lambda: recursive(1), lambda: recursive(2)),
    "attributes of functions": (lambda: with_attribute(1), lambda: with_attribute(2)),
    "functions kept": (lambda: cache(capturing(1)), lambda: cache(capturing(2))),
    "globals": (lambda: of_globals(), lambda: of_globals(K=2.0)),
    "globals within": (lambda: of_globals(), lambda: of_globals(TABLE={"a": 3.0})),
    "arrays as globals": (lambda: of_globals(K=LONG), lambda: of_globals(K=changed(LONG))),
    "code": (lambda: of_code("f = lambda x: x + 1"), lambda: of_code("f = lambda x: x - 1")),
    "constants": (lambda: of_code("f = lambda x: 0.0"), lambda: of_code("f = lambda x: -0.0")),
    "code within": (
        lambda: of_code("def f():\n return lambda x: x in {'a', 'b', 'c'}"),
        lambda: of_code("def f():\n return lambda x: x in {'a', 'b', 'd'}"),
    ),
    "partials": (lambda: partial(round, ndigits=1), lambda: partial(round, ndigits=2)),
    "partials of closures": (lambda: partial(capturing(1), 1), lambda: partial(capturing(2), 1)),
    "methods": (lambda: Scaled(1.0).__call__, lambda: Scaled(2.0).__call__),
    "callable objects": (lambda: Scaled(1.0), lambda: Scaled(2.0)),
    "properties": (lambda: of_property("1"), lambda: of_property("2")),
    "values of classes": (lambda: of_code("class f:\n k = 1"), lambda: of_code("class f:\n k = 2")),
    "classes": (lambda: class_of("x"), lambda: class_of("2 * x")),
    "objects of classes": (lambda: class_of("x")(), lambda: class_of("2 * x")()),
    "methods of values": (lambda: [1].append, lambda: [2].append),
    "built-in functions": (lambda: abs, lambda: len),
    "library functions": (lambda: np.linalg.norm, lambda: np.linalg.det),
    "ufuncs": (lambda: np.sin, lambda: np.cos),
    "getters": (lambda: operator.itemgetter(1), lambda: operator.itemgetter(2)),
    "modules": (lambda: math, lambda: np),
    "expressions": (lambda: sp.Float("0.1") * R, lambda: sp.Float(math.nextafter(0.1, 1)) * R),
    "dummies": (lambda: sp.Dummy("x") + R, lambda: sp.Dummy("y") + R),
    "potentials": (lambda: spring(0.1), lambda: spring(math.nextafter(0.1, 1))),
    "scenes": (lambda: Chain(spring(2.0), 9), lambda: Chain(spring(2.0), 9, mass=2.0)),
    "networks": (lambda: plate(1.0), lambda: plate(2.0)),
    "changing scenes": (
        lambda: Chain(PowerLaw(1.0, 1.5).over_time(stiffness=1.0 + 0.1 * T), 9),
        lambda: Chain(PowerLaw(1.0, 1.5).over_time(stiffness=1.0 + 0.2 * T), 9),
    ),
    "drives": (
        lambda: Chain(spring(1.0), 9, drive={0: Drive(force=sp.sin(T))}),
        lambda: Chain(spring(1.0), 9, drive={0: Drive(force=sp.cos(T))}),
    ),
}  # fmt: skip


def tables():
    """The same of pandas, where it is there."""
    try:
        import pandas as pd
    except ImportError:
        return {}
    days = pd.date_range("2020-01-01", periods=1500, tz="UTC")
    kinds, other = pd.Categorical(["a", "b"] * 800), ["a", "b"] * 799 + ["b", "b"]
    return {
        "series": (lambda: pd.Series(LONG), lambda: pd.Series(changed(LONG))),
        "names of series": (lambda: pd.Series(LONG, name="x"), lambda: pd.Series(LONG, name="y")),
        "frames": (lambda: pd.DataFrame({"a": LONG}), lambda: pd.DataFrame({"a": changed(LONG)})),
        "columns": (lambda: pd.DataFrame({"a": LONG}), lambda: pd.DataFrame({"b": LONG})),
        "indices": (lambda: pd.Index(LONG), lambda: pd.Index(changed(LONG))),
        "indices of series": (lambda: pd.Series(LONG), lambda: pd.Series(LONG, changed(LONG))),
        "levels": (
            lambda: pd.MultiIndex.from_product([[1, 2], ["a", "b"]]),
            lambda: pd.MultiIndex.from_product([[1, 2], ["a", "c"]]),
        ),
        "categories": (lambda: kinds, lambda: pd.Categorical(other)),
        "days": (lambda: pd.Series(days), lambda: pd.Series(days.shift(1))),
        "text": (lambda: pd.Series(["a"] * 1500), lambda: pd.Series(["a"] * 1499 + ["b"])),
        "gaps": (lambda: pd.array([1, None, 3]), lambda: pd.array([1, 2, 3])),
    }


def digests():
    """Identities of all these, {name: (one, other)}."""
    both = PAIRS | tables()
    return {name: [identity(make()) for make in pair] for name, pair in both.items()}


@pytest.mark.parametrize("name", [*PAIRS, *tables()])
def test_other_contents_have_another_identity_and_equal_ones_the_same(name):
    one, other = (PAIRS | tables())[name]
    assert identity(one()) == identity(one())
    assert identity(other()) == identity(other())
    assert identity(one()) != identity(other())


def test_identities_are_those_of_another_process():
    """Whose hashes of texts, and so orders of sets, are others."""
    here = os.path.dirname(__file__)
    path = os.pathsep.join([here, os.path.dirname(here)])
    others = {os.environ.get("PYTHONHASHSEED")}
    for seed in [seed for seed in ("1", "2") if seed not in others][:1]:
        environment = os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": seed}
        code = "import json, test_identity; print(json.dumps(test_identity.digests()))"
        there = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True
        )
        assert there.returncode == 0, there.stderr
        assert json.loads(there.stdout) == digests()


def test_kinds_of_contents_have_identities_of_their_own():
    alone = [identity(make()) for pair in (PAIRS | tables()).values() for make in pair]
    twice = {"globals within", "columns", "indices of series"}  # begin as those before them
    assert len(set(alone)) == len(alone) - len(twice & {*PAIRS, *tables()})


@pytest.mark.needs_extended
def test_bytes_that_pad_a_number_are_no_content():
    thirds = [np.array([1 / np.longdouble(3)]) for _ in range(2)]
    thirds[1].view(np.uint8)[10:] = 7
    assert thirds[0].tobytes() != thirds[1].tobytes()
    assert identity(thirds[0]) == identity(thirds[1])


def test_equal_arrays_are_the_same_in_any_order_in_memory():
    square = np.arange(12.0).reshape(3, 4)
    for same in (np.asfortranarray(square), square[::-1][::-1], np.ones((9, 4))[::3] * square):
        assert identity(same) == identity(square)


def test_what_is_computed_and_kept_is_no_content():
    bar, before = Bar(2.0), identity(Bar(2.0))
    assert bar.half == 1.0
    assert identity(bar) == before
    one, kept = plate(1.0), lru_cache(capturing(2))
    assert identity([one.springs[0].kinks, kept(3), one]) == identity([(), 6, plate(1.0)])
    assert identity(kept) == identity(lru_cache(capturing(2)))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: memoryview(b"1"), "cannot pickle memoryview"),
        (lambda: Lock(), "cannot pickle '_thread.lock'"),
        (lambda: {"case": [x for x in [Lock()]]}, "no contents to know it by"),
        (lambda: (x for x in [1]), "cannot pickle 'generator'"),
        (lambda: capturing(Lock()), "test_identity.capturing.<locals>.<lambda> uses k: .*lock"),
        (lambda: of_globals(TABLE=Lock()), "rig.f uses TABLE: .*lock"),
        (lambda: deep(), "nested too deeply"),
    ],
)
def test_what_has_no_contents_is_refused_by_name(make, words):
    with pytest.raises(TensegrityError, match=words):
        identity(make())


def deep():
    ends = []
    for _ in range(5000):
        ends = [ends]
    return ends


LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.complex_numbers()
    | st.text(max_size=5) | st.binary(max_size=5) | st.dates() | st.timedeltas()
    | st.fractions() | st.decimals(allow_nan=False)
    | arrays.arrays(
        arrays.scalar_dtypes() | arrays.array_dtypes(), arrays.array_shapes(max_side=3)
    )
)  # fmt: skip
VALUES = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text(max_size=3), inner, max_size=3)
        | st.builds(Bar, inner)
        | st.builds(partial, st.just(round), inner)
        | st.builds(capturing, inner)
    ),
    max_leaves=6,
)


def opened(x):
    """What is in a value as nested lists of texts: an identity by other means, for these alone."""
    kind = type(x).__name__
    if isinstance(x, np.ndarray):
        return [kind, str(x.dtype.descr), str(x.shape), opened(x.tolist())]
    if isinstance(x, (list, tuple)):
        return [kind, *map(opened, x)]
    if isinstance(x, dict):
        return [kind, *map(opened, x.items())]
    if isinstance(x, Bar):
        return [kind, opened(x.length), x.name]
    if isinstance(x, partial):
        return [kind, opened(x.args)]
    if callable(x):
        return [kind, opened(x.__closure__[0].cell_contents)]
    if isinstance(x, (int, bytes)):
        return [kind, str(x)]
    return [kind, repr(x)]


def same_values(count):
    @settings(max_examples=count, deadline=None, database=None)
    @given(VALUES, VALUES, st.data())
    def check(one, other, data):
        assert identity(copy.deepcopy(one)) == identity(one)
        assert (identity(one) == identity(other)) == (opened(one) == opened(other))
        before, after = data.draw(st.tuples(LEAVES, LEAVES))
        different = opened(before) != opened(after)
        for wrap in (capturing, Bar, lambda x: [one, {"x": (x, other)}], with_default, Scaled):
            assert (identity(wrap(before)) != identity(wrap(after))) == different

    check()
    print(f"{count} pairs of values")


def test_values_have_one_identity_exactly_if_they_are_the_same():
    same_values(150)


@pytest.mark.slow
def test_many_values_have_one_identity_exactly_if_they_are_the_same():
    same_values(5000)


def test_a_spring_is_known_by_all_its_numbers():
    """Also where two print alike."""
    close = [PowerLaw(1.0, n) for n in (1.37, math.nextafter(1.37, 2))]
    assert identity(close[0]) != identity(close[1])
    far = [
        Potential(sp.Rational(1, 3) * R**2 + x * R**3, R, domain=(-9.0, 9.0)) for x in (0.21, 0.23)
    ]
    assert identity(far[0]) != identity(far[1])
