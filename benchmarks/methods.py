"""Force evaluations per unit of time that each method needs for an error.

Two smooth scenes on 128 prisms, a blow and a solitary wave; error of the last state against
Blanes and Moan's method in extended precision with far smaller steps.  Evaluations, not seconds:
`python -m benchmarks work-precision` has these.
"""

from __future__ import annotations

import numpy as np

from benchmarks._charts import FOLDER, charted
from tensegrity import METHODS, Chain, Prism, solitary_wave, work_precision
from tensegrity.scenes.dynamics import dynamics

SITES = 128
LEVELS = 10.0 ** -np.arange(2.0, 13.0)
EXTENDED = bool(np.finfo(np.longdouble).eps < np.finfo(float).eps)
SECONDS = 60.0  # of one scene


def scenes():
    """{name: (chain, state, duration)}."""
    blown = Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), SITES)
    spring = Prism(1.0, 0.7, 0.01, 1.0).potential()
    wave, chain = solitary_wave(spring, speed_ratio=1.3), Chain(spring, SITES)
    return {
        "blow": (blown, blown.at_rest(dict.fromkeys(range(4), 0.03)), 60.0),
        "wave": (chain, wave.launch(chain, at=40), 60 / wave.speed),
    }


def omega(chain, state, t_end):
    """Bound of the angular frequency over what a run meets [rad/s]."""
    u, v = dynamics(chain).arrays(state)
    loop = dynamics(chain).bind(u, v, METHODS["rkn6"], t_end / 4000)
    loop.advance(4000)
    return dynamics(chain).frequency(loop.range)


def gap(found, exact):
    """Largest difference in u or v, over the largest value."""
    parts = [np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in zip(found, exact, strict=True)]
    return float(max(parts)) if np.isfinite(parts).all() else np.inf


def chart(found, folder=FOLDER):
    """Evaluations against error, as PNG and CSV; the files written."""
    rows = [(scene, row.method, row.evaluations, row.error)
            for scene, one in found.items() for row in one.rows]  # fmt: skip
    names = ("scene", "method", "evaluations", "error")
    with charted("methods", folder, names, rows, figsize=(11, 5)) as (figure, written):
        for axes, (scene, one) in zip(figure.subplots(1, len(found)), found.items(), strict=True):
            one.plot(axes).set_title(scene)
    return written


def main():
    """Print what each method costs at each error."""
    given = "long double" if EXTENDED else None
    found = {k: work_precision(*run, reference=given, seconds=SECONDS)
             for k, run in scenes().items()}  # fmt: skip
    heads = "".join(f"{level:9.0e}" for level in LEVELS)
    for scene, one in found.items():
        title = "evaluations of the forces per unit of time"
        print(f"\n{title}, {scene}\n{'error':>22}{heads}")
        for name in one.methods:
            costs = [one.cost(name, x, "evaluations") / one.t_end for x in LEVELS]
            row = "".join(f"{x:9.3g}" if np.isfinite(x) else "        -" for x in costs)
            print(f"{name:>22}{row}")
    print("", *(method for method in METHODS.values() if method.explicit), sep="\n")
    print(*chart(found), sep="\n")
