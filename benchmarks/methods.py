"""Force evaluations per unit of time that each method needs for an error: which ones to keep.

Two smooth scenes on 128 prisms, a blow and a solitary wave; error of the last state against
Blanes and Moan's method in extended precision with far smaller steps.  Evaluations, not seconds:
`python -m benchmarks work-precision` has these.
"""

from __future__ import annotations

import numpy as np

from benchmarks._candidates import GRADIENTS, SPLITTINGS, evaluations, run_gradient
from benchmarks._charts import FOLDER, charted
from tensegrity import METHODS, Chain, Prism, TensegrityError, solitary_wave
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kernel import bind
from tensegrity.scenes.dynamics import dynamics

SITES = 128
LEVELS = 10.0 ** -np.arange(2.0, 13.0)
FINER = 1.25  # ratio of the numbers of steps of two runs
MOST = 500.0  # evaluations per unit of 1/omega; a fifth for what runs in NumPy
REFERENCE = 500.0  # evaluations per unit of 1/omega, method of order 6
EXTENDED = bool(np.finfo(np.longdouble).eps < np.finfo(float).eps)


def scenes():
    """{name: (chain, state, duration, bound of omega)}."""
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


def final(chain, state, method, dt, steps, engine=None):
    """u and v after a run."""
    if engine is None:
        u, v = dynamics(chain).arrays(state)
        loop = dynamics(chain).bind(u, v, method, dt)
    else:
        u, v = state.u.astype(engine.dtype), state.v.astype(engine.dtype)
        loop = bind(u, v, dynamics(chain).loop_bonds, method, dt, engine)
    loop.advance(steps)
    return u[: chain.sites], v[: chain.sites]


def gap(found, exact):
    """Largest difference in u or v, over the largest value."""
    parts = [np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in zip(found, exact, strict=True)]
    return float(max(parts)) if np.isfinite(parts).all() else np.inf


def candidates():
    """{name: (order, evaluations per step, stability limit, runner)}."""
    found = {}
    for name, method in (METHODS | SPLITTINGS).items():
        if not method.explicit:
            continue
        per_step = evaluations(method.kicks) if hasattr(method, "kicks") else method.stages
        found[name] = method.order, per_step, method.stability_limit, method
    for name, method in GRADIENTS.items():
        found[name] = method.order, method.evaluations, method.limit, method
    return found


def measure(scene, levels=LEVELS):
    """{name: (evaluations per unit of time, errors)} of one scene."""
    chain, state, t_end = scene
    fastest = omega(*scene)
    scale = t_end * fastest
    engine = Compiled.of(dynamics(chain).loop_bonds, extended=EXTENDED)
    steps = int(REFERENCE * scale / METHODS["rkn6"].stages)
    exact = final(chain, state, METHODS["rkn6"], t_end / steps, steps, engine)
    found = {}
    for name, (_, per_step, limit, method) in candidates().items():
        counts, errors, steps = [], [], int(1.02 * scale / limit) + 1
        most = scale * (MOST / 5 if name in GRADIENTS else MOST)
        while per_step * steps < most and (not errors or min(errors) > levels[-1] / 2):
            dt = t_end / steps
            run = run_gradient if name in GRADIENTS else final
            try:
                error = gap(run(chain, state, method, dt, steps), exact)
            except TensegrityError:  # a spring beyond its domain
                error = np.inf
            counts.append(per_step * steps / t_end)
            errors.append(error)
            if len(errors) > 8 and errors[-1] > min(errors[:-4]):
                break  # round-off
            steps = int(np.ceil(steps * FINER))
        found[name] = np.array(counts), np.array(errors)
    return found


def needed(counts, errors, level):
    """Evaluations from which on an error is kept, between two runs along a power law; or nan."""
    good = np.flatnonzero(errors <= level)
    if good.size == 0:
        return np.nan
    above = np.flatnonzero(errors > level)
    above = above[above < np.flatnonzero(errors == errors.min())[0]] if above.size else above
    if above.size == 0:
        return counts[good[0]]
    i = above[-1]
    if not np.isfinite(errors[i]) or i + 1 == len(errors) or errors[i + 1] > level:
        return counts[good[good > i][0]] if (good > i).any() else np.nan
    share = np.log(errors[i] / level) / np.log(errors[i] / errors[i + 1])
    return counts[i] * (counts[i + 1] / counts[i]) ** share


KEPT_FOR = {
    "verlet": "rough looks, and the widest use",
    "rkn6": "smooth scenes, and networks",
    "rk4": "results that were made with it",
}
CLEARLY = 0.97  # of another's cost


def verdict(name, costs):
    """What a method costs against the cheapest kept one, and what became of it."""
    mine = np.array([several[name] for several in costs.values()])
    kept = np.array(
        [np.nanmin([x for n, x in c.items() if n in KEPT_FOR and n != name], axis=0)
         for c in costs.values()]
    )  # fmt: skip
    with np.errstate(invalid="ignore"):
        ratio = mine / kept
    better = (ratio < CLEARLY).any(axis=0)
    least, most = np.nanmin(ratio), np.nanmax(ratio)
    what = f"{least:.2f} to {most:.2f} of the cheapest {'other ' * (name in KEPT_FOR)}method kept"
    if better.any():
        what += f", less at {', '.join(f'{level:.0e}' for level in LEVELS[better])}"
    if name in KEPT_FOR:
        return f"kept for {KEPT_FOR[name]}: {what}"
    reason = "; it takes a loop with gradients of its own" if name in GRADIENTS else ""
    return f"not kept: {what}{reason}"


def chart(found, folder=FOLDER):
    """Evaluations against error, as PNG and CSV; the files written."""
    rows = [
        (scene, name, *pair)
        for scene, several in found.items()
        for name, table in several.items()
        for pair in zip(*table, strict=True)
        if np.isfinite(pair[1])
    ]
    names = ("scene", "method", "evaluations_per_second", "error")
    with charted("methods", folder, names, rows, figsize=(11, 5)) as (figure, written):
        several = figure.subplots(1, len(found), sharex=True)
        for axes, (scene, methods) in zip(np.atleast_1d(several), found.items(), strict=True):
            for number, (name, (counts, errors)) in enumerate(methods.items()):
                kept = name in METHODS
                axes.loglog(
                    errors, counts, "-" if kept else ":", color=f"C{number % 10}",
                    lw=2 if kept else 1, marker="osv^D*"[number % 6], ms=3, label=name,
                )  # fmt: skip
            axes.set_xlim(1, LEVELS[-1] / 10)
            axes.set_xlabel(f"error of the last state, {scene} [1]")
        np.atleast_1d(several)[0].set_ylabel("evaluations of the forces per unit of time [1/s]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside right center", fontsize=8)
    return written


def main():
    """Print what each method costs at each error, and what became of it."""
    found = {name: measure(scene) for name, scene in scenes().items()}
    costs = {
        scene: {n: np.array([needed(*r, level) for level in LEVELS]) for n, r in several.items()}
        for scene, several in found.items()
    }
    heads = "".join(f"{level:9.0e}" for level in LEVELS)
    for scene, several in costs.items():
        print(f"\nevaluations of the forces per unit of time, {scene}\n{'error':>22}{heads}")
        for name, row in several.items():
            print(f"{name:>22}" + "".join("        -" if np.isnan(x) else f"{x:9.3g}" for x in row))
    print()
    for name, (order, per_step, limit, _) in candidates().items():
        print(
            f"{name:>22}: order {order}, {per_step:4.3g} evaluations a step, stable to "
            f"dt omega {limit:.3f}; {verdict(name, costs)}"
        )
    print(*chart(found), sep="\n")
