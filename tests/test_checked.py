"""Checks that annotations declare: what they refuse, convert and leave alone."""

from __future__ import annotations

import inspect
import math
from dataclasses import FrozenInstanceError, dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
import pytest

from tensegrity import PowerLaw, Prism, TensegrityError
from tensegrity.checked import checked, declared
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Count, Fraction, Index, Length, Mass, Motion

if TYPE_CHECKING:
    from decimal import Decimal

COLOURS = ("red", "blue")
MOST = 7


@checked
def described(
    length: Length,
    count: Count = 3,
    *,
    mass: Mass | None = None,
    share: Annotated[float, ">= 0", f"< {MOST}", "or inf"] = 0.5,
    is_bent: bool = False,
    colour: Annotated[str, COLOURS] = "red",
    spring: Potential | None = None,
    other: float | Array | None = None,
    late: Decimal | None = None,
    motion: Motion | None = None,
    name: str = "",
) -> float:
    """Its arguments."""
    return length, count, mass, share, is_bent, colour, spring, other, late, motion, name


@checked
@dataclass(frozen=True)
class Rod:
    """A rod."""

    length: Length
    mass: Mass = 1.0
    label: str = field(default="rod")
    area: float = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "area", self.mass / self.length)


REFUSED = {
    "length 0 m must be above 0": lambda: described(0),
    "length -1 m must be above 0": lambda: described(length=-1),
    "length inf m is not finite": lambda: described(math.inf),
    "length 'x' is not a number": lambda: described("x"),
    "length None is not a number": lambda: described(None),
    "count 0 must be at least 1": lambda: described(1, 0),
    "count 2.5 is not a whole number": lambda: described(1, 2.5),
    "mass True is not a number": lambda: described(1, mass=True),
    "share 7 must be below 7": lambda: described(1, share=MOST),
    "share -1e-300 must be at least 0": lambda: described(1, share=-1e-300),
    "share nan is not a number": lambda: described(1, share=math.nan),
    "is_bent 1 must be True or False": lambda: described(1, is_bent=1),
    "colour 'green' must be one of red, blue": lambda: described(1, colour="green"),
    "colour [] must be one of red, blue": lambda: described(1, colour=[]),
    "spring 3.0 is not a Potential": lambda: described(1, spring=3.0),
    "mass 0 kg must be above 0": lambda: Rod(1, mass=0),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_an_annotation_does_not_allow_is_refused_in_words(words):
    with pytest.raises(TensegrityError) as caught:
        REFUSED[words]()
    assert str(caught.value) == words


def test_a_prism_where_a_potential_belongs_is_told_what_gives_one():
    with pytest.raises(TensegrityError, match=r"is not a Potential: give prism\.potential\(\)$"):
        described(1, spring=Prism(1.0, 0.7, 0.01, 1.0))


def test_values_reach_the_body_converted():
    length, count, mass, share, is_bent, *_ = described(
        np.float32(2), np.int8(4), mass=np.array(3), share=0, is_bent=np.True_
    )
    assert (length, count, mass, share, is_bent) == (2.0, 4, 3.0, 0.0, True)
    assert [type(x) for x in (length, count, mass, is_bent)] == [float, int, float, bool]


def test_none_is_taken_where_the_annotation_has_it_and_what_has_several_types_is_left_alone():
    *_, spring, other, late, motion, name = described(
        1, mass=None, spring=None, other="x", late="x", motion=1, name=5
    )
    assert (spring, other, late, motion, name) == (None, "x", "x", 1, 5)


def test_numbers_at_and_beside_every_bound():
    just = math.nextafter
    for share in (0.0, 0, just(7, 0)):
        assert described(1, share=share)[3] == share
    assert described(5e-324)[0] == 5e-324
    for bad in (just(0, -1), 7.0, just(7, 8)):
        with pytest.raises(TensegrityError, match=r"share .* must be"):
            described(1, share=bad)


def test_a_frozen_dataclass_is_made_of_converted_values():
    rod = Rod(np.int64(2), mass=np.float32(4))
    assert rod == Rod(2.0, 4.0)
    assert rod.area == 2.0
    assert [type(x) for x in (rod.length, rod.mass)] == [float, float]
    with pytest.raises(FrozenInstanceError):
        rod.mass = 2.0


def test_signatures_show_types_alone():
    shown = str(inspect.signature(described)).replace("'", "")
    assert shown.startswith(
        "(length: float, count: int = 3, *, mass: float | None = None, share: float = 0.5, "
        "is_bent: bool = False, colour: str = red, spring: Potential | None = None"
    )
    assert str(inspect.signature(Rod)).startswith("(length: 'float', mass: 'float' = 1.0")
    assert inspect.getdoc(described) == "Its arguments."


def test_what_is_declared_can_be_asked():
    of = declared(described)
    assert of["length"].keywords == {"above": 0, "unit": "m"}
    assert (of["mass"].kind, of["mass"].optional) == (float, True)
    assert of["share"].keywords == {"least": 0, "below": MOST, "finite": False}
    assert set(of) == {"length", "count", "mass", "share", "is_bent", "colour", "spring"}
    assert list(declared(Rod)) == ["length", "mass"]
    assert declared(PowerLaw)["exponent"].keywords == {"above": 0}
    assert declared(len) == {}


def test_a_bound_that_cannot_be_read_is_an_error_at_the_first_call():
    @checked
    def unknown(x: Annotated[float, f"< {NOWHERE}"]) -> float:  # noqa: F821
        return x

    @checked
    def several(x: Fraction | Index) -> float:
        return x

    with pytest.raises(NameError, match="NOWHERE"):
        unknown(1.0)
    with pytest.raises(TypeError, match="one type"):
        several(1.0)
