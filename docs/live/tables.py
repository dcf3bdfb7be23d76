"""Scenes of the page, and tables of the exact waves that it launches."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from docs.live.kernel import ELASTIC, ELASTIC_PRISM
from tensegrity import (
    Chain,
    Potential,
    Prism,
    State,
    equilibrium_path,
    floquet,
    solitary_wave,
)
from tensegrity.notebook import progress

PER_SITE = 8  # places of a profile
FAINTEST = 1e-4  # of the peak, where a profile ends
DIGITS = 6  # of what is only drawn
SHAPES = 64  # of the elastic prism, that are drawn
CUT = 1e-14  # of the peak, where a launched wave ends


@dataclass(frozen=True)
class Spring:
    """A rigid prism of base 1 m by its numbers, or the elastic one of the kernel.

    Attributes
    ----------
    height : float
        [m].
    prestrain, k_cross, preload : float
        The constant in N/m, the load in N.
    elastic : bool
    """

    height: float
    prestrain: float
    k_cross: float = 1.0
    preload: float = 0.0
    elastic: bool = False

    def potential(self) -> Potential:
        """The spring in Python."""
        if self.elastic:
            return ELASTIC
        return Prism(1.0, self.height, self.prestrain, self.k_cross).potential(self.preload)


SLOW, FAST, MEDIUM = Spring(0.7, 0.01), Spring(0.6, 0.001), Spring(0.8, 0.02)
SOFT = Spring(0.5, 0.4, 1.0, 0.05, elastic=True)
HARD, LOOSE = Spring(0.8, 0.2, 10.0), Spring(0.8, 0.05)

WAVES = {"slow 1.05": (SLOW, 1.05), "medium 1.6": (MEDIUM, 1.6), "hard 1.05": (HARD, 1.05)}

SCENES: dict[str, dict[str, Any]] = {  # the first is shown at the start
    "12.16": {
        "label": "12.16 \u00d7 sound speed",
        "near": FAST, "units": 200, "blow": 0.16,
        "note": "Small prestrain and a strong impact: the leading pulse travels at about twelve "
        "times the sound speed and is about two prisms wide, close to the tent.",
    },
    "2-3": {
        "label": "2\u20133 \u00d7 sound speed",
        "near": SLOW, "units": 300, "blow": 0.09,
        "note": "An impact on the first mass generates a solitary wave about three prisms wide and "
        "a subsonic tail.",
    },
    "1.05": {
        "label": "1.05 \u00d7 sound speed",
        "near": SLOW, "units": 400, "waves": [{"wave": "slow 1.05", "at": 40, "way": 1}],
        "blow": 0.011,
        "note": "An exact wave just above the sound speed, about seven prisms wide, of permanent "
        "form. At this small prestrain sech\u00b2 overestimates its amplitude.",
    },
    "collision": {
        "label": "Collision",
        "near": MEDIUM, "units": 240, "blow": 0.06,
        "waves": [{"wave": "medium 1.6", "at": 60, "way": 1},
                  {"wave": "medium 1.6", "at": -60, "way": -1}],
        "note": "Head-on collision of two exact waves. Dashed: their undisturbed positions; "
        "the actual waves emerge ahead of them and leave some radiation behind.",
    },
    "softening": {
        "label": "Softening",
        "near": SOFT, "units": 400, "blow": 0.15, "held": True,
        "note": "A thick prism with elastic bases and bars softens under its preload. The first "
        "mass is held and the next one struck: a rarefaction (extension) wave leads.",
    },
    "hard-soft": {
        "label": "Hard\u2013soft",
        "near": HARD, "far": LOOSE, "units": 400, "blow": 0.1,
        "waves": [{"wave": "hard 1.05", "at": 130, "way": 1}],
        "note": "An exact wave in a hard chain is incident on a soft one at the middle. A narrow "
        "compression pulse is transmitted; an extension wave with a tail is reflected.",
    },
}  # fmt: skip


def scene(name: str, units: int | None = None) -> tuple[Chain, State]:
    """A scene of the page as a chain of this package, and how it starts."""
    given = SCENES[name]
    units = units or given["units"]
    near = given["near"].potential()
    springs: Any = near
    if "far" in given:
        springs = [near] * (units // 2) + [given["far"].potential()] * (units - units // 2)
    held = given.get("held", False)
    chain = Chain(springs, units + 1, ends=("fixed" if held else "free", "free"))
    if "waves" not in given:
        return chain, chain.at_rest({int(held): given["blow"]})
    state = chain.at_rest()
    for one in given["waves"]:
        spring, ratio = WAVES[one["wave"]]
        wave = solitary_wave(spring.potential(), speed_ratio=ratio)
        state = state + wave.launch(chain, one["at"] % (units + 1), one["way"])
    return chain, state


def tables() -> dict[str, Any]:
    """What the page is given: scenes, and waves to launch."""
    from dataclasses import asdict

    scenes = {}
    for name, given in SCENES.items():
        springs = {part: asdict(given[part]) for part in ("near", "far") if part in given}
        scenes[name] = given | springs
    with progress(len(WAVES), "waves") as bar:
        waves = {name: _launched(*given, bar) for name, given in WAVES.items()}
    return {
        "scenes": scenes,
        "waves": waves,
        "elastic": _elastic_shapes()
        | {
            "slope": float(ELASTIC.stiffness_slope(0.0)),
            "low": f"it leaves the computed range: {ELASTIC.ends[0]}",
            "high": f"it leaves the computed range: {ELASTIC.ends[1]}",
        },
    }


def _elastic_shapes():
    """Twist [rad] and base [m] of the elastic prism at equally spaced elongations."""
    path = equilibrium_path(ELASTIC_PRISM, max_height=ELASTIC.length + ELASTIC.domain[1])
    low, high = ELASTIC.domain
    r = np.linspace(low, high, SHAPES)
    order = np.argsort(path.height)
    found = {
        name: _short(np.interp(r + ELASTIC.length, path.height[order], getattr(path, name)[order]))
        for name in ("twist", "base")
    }
    return found | {"from": low, "to": high}


def _launched(spring, ratio, bar):
    """One exact wave at whole distances from its peak, ahead of which all is at rest, and its
    profile."""
    wave = solitary_wave(spring.potential(), speed_ratio=ratio)
    bar.update()
    reach = math.ceil(wave.reach(CUT)) + 1
    at = np.arange(-reach, reach + 1)
    x = np.arange(math.ceil(wave.reach(FAINTEST) * PER_SITE) + 1) / PER_SITE
    return {
        "speed": wave.speed,
        "peak": wave.amplitude,
        "stable": floquet(wave).stable,
        "reach": reach,
        "u": wave.displacement(at).tolist(),
        "v": (-wave.speed * wave.rate(at)).tolist(),
        "shift": float(wave.displacement(-math.inf)),
        "step": 1 / PER_SITE,
        "elongation": _short(wave.elongation(x) / wave.amplitude),
        "velocity": _short(-wave.speed * wave.rate(x) / wave.amplitude),
    }


def _short(values):
    return [float(f"{x:.{DIGITS}g}") if abs(x) > 1e-9 else 0 for x in values]
