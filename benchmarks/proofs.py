"""The cost of a proof over that of what it proves: waves at twice the speed of sound, and folds.

Processor time, minima over repeats; waves on the ring on which they were computed, and on the line.
"""

from __future__ import annotations

import math

from benchmarks._timing import cpu, table
from tensegrity import Prism, equilibrium_path, prove, solitary_wave

STIFF, SOFT = Prism(1.0, 0.7, 0.01, 1.0), Prism(1.0, 0.25, 0.1, 1.0)
ELASTIC = Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0)
WAVES = {"compression at 2 cs": (STIFF, 2.0), "rarefaction at 1.03 cs": (SOFT, 1.03)}
ROUNDS = 2


def main() -> None:
    """Print the ratios."""
    rows = []
    for name, (prism, ratio) in WAVES.items():
        spring = prism.potential()
        wave = solitary_wave(spring, speed_ratio=ratio)
        for where, period in (("ring", None), ("line", math.inf)):
            rivals = {
                "it": lambda spring=spring, ratio=ratio: solitary_wave(spring, speed_ratio=ratio),
                "proof": lambda wave=wave, period=period: prove(wave, period=period),
            }
            rows.append((f"{name}, {where}", *_ratio(rivals)))
    for name, prism in (("fold, rigid prism", SOFT), ("fold, elastic prism", ELASTIC)):
        path = equilibrium_path(prism)
        rivals = {
            "it": lambda prism=prism: equilibrium_path(prism),
            "proof": lambda path=path: prove(path),
        }
        rows.append((name, *_ratio(rivals)))
    columns = ("of a", "alone [ms]", "proof [ms]", "ratio")
    table("Proofs over what they prove", columns, rows, ours=("ratio",))


def _ratio(rivals: dict) -> tuple[float, float, float]:
    times = cpu(rivals, ROUNDS)
    return 1e3 * times["it"], 1e3 * times["proof"], times["proof"] / times["it"]
