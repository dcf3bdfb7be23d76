"""Enclosures of folds, by interval Newton methods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.prisms.closed import exact
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.proofs.balls import (
    Balls,
    BallSpring,
    Enclosure,
    ball,
    exact_prism,
    flint,
    precision,
)

FOLD_BITS, WIDTHS = 256, [10.0**-k for k in range(2, 9)]  # of the height
SHRINKS = 12  # steps of the interval Newton method


@dataclass(frozen=True)
class Fold:
    """A limit point of a rigid prism, enclosed.

    Attributes
    ----------
    height, load, twist : Enclosure
        [m], [N] with compression > 0, [rad].
    unique : float
        Half the range of heights about it in which it is the only one [m].
    """

    height: Enclosure
    load: Enclosure
    twist: Enclosure
    unique: float

    def __str__(self) -> str:
        return (
            f"proved: a fold at height {self.height} m, load {self.load} N, twist {self.twist} "
            f"rad, the only one within {self.unique:.2g} m"
        )


def folds(path: EquilibriumPath, read: str) -> tuple[Fold, ...]:
    """Enclosures of the folds of a rigid prism, by the interval Newton method for V'' = 0."""
    prism = path.prism
    if not prism.is_rigid:
        raise TensegrityError(
            f"{check.shown(prism)}: folds are proved of prisms with rigid bases and bars"
        )
    folds = []
    with precision(FOLD_BITS):
        spring = BallSpring.of(prism.potential(), read)
        rest, *of = (ball(spring.source["prism"][k]) for k in (5, 0, 1, 2, 3))
        for event in path.events:
            if event.kind == "fold":
                r = flint().arb(event.at["height"]) - rest
                folds.append(_fold(spring, r.mid(), rest, exact_prism(prism, of)))
    return tuple(folds)


def _fold(spring: BallSpring, near: Any, rest: Any, prism: Any) -> Fold:
    arb = flint().arb

    def newton(box: Any) -> Any:
        middle = box.mid()
        slope = 6 * spring.series(box, 4, FOLD_BITS)[3]
        return middle - 2 * spring.series(middle, 3, FOLD_BITS)[2] / slope

    for width in WIDTHS:
        half = arb(width) * rest
        box = near + arb(0, 1) * half
        image = newton(box)
        if image.is_finite() and box.contains_interior(image):
            break
    else:
        raise TensegrityError(
            f"no fold is proved near height {float(near + rest):.9g} m: the proof needs V''' != 0"
        )
    for _ in range(SHRINKS):
        image = newton(image).intersection(image)
    height = image + rest
    load = -spring.series(image, 2, FOLD_BITS)[1]
    (twist,) = exact("twist", prism, height, own=Balls())
    return Fold(Enclosure.of(height), Enclosure.of(load), Enclosure.of(twist), float(half))
