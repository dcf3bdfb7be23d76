"""Force evaluations per unit of time that each method needs for an error.

Two smooth scenes on 128 prisms, a blow and a solitary wave; error of the last state against
Blanes and Moan's method in extended precision with far smaller steps.  Evaluations, not seconds:
`python -m benchmarks work-precision` has these.
"""

from __future__ import annotations

import numpy as np

from benchmarks._charts import FOLDER, charted
from tensegrity import METHODS, Chain, Prism, TensegrityError, solitary_wave
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kernel import bind
from tensegrity.scenes.dynamics import dynamics

SITES = 128
LEVELS = 10.0 ** -np.arange(2.0, 13.0)
FINER = 1.25  # ratio of the numbers of steps of two runs
MOST = 500.0  # evaluations per unit of 1/omega
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


def explicit_methods():
    """{name: (order, evaluations per step, method)}; the last kick of a step serves the next."""
    found = {}
    for name, method in METHODS.items():
        if method.explicit:
            kicks = getattr(method, "kicks", None)
            per_step = sum(b != 0 for b in kicks) - (kicks[0] != 0) if kicks else method.stages
            found[name] = method.order, per_step, method
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
    for name, (_, per_step, method) in explicit_methods().items():
        counts, errors, steps = [], [], int(1.02 * scale / method.stability_limit) + 1
        while per_step * steps < scale * MOST and (not errors or min(errors) > levels[-1] / 2):
            dt = t_end / steps
            try:
                error = gap(final(chain, state, method, dt, steps), exact)
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
                marker = "osv^D*"[number % 6]
                axes.loglog(errors, counts, lw=2, marker=marker, ms=3, label=name)
            axes.set_xlim(1, LEVELS[-1] / 10)
            axes.set_xlabel(f"error of the last state, {scene} [1]")
        np.atleast_1d(several)[0].set_ylabel("evaluations of the forces per unit of time [1/s]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside right center", fontsize=8)
    return written


def main():
    """Print what each method costs at each error."""
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
    for name, (order, per_step, method) in explicit_methods().items():
        print(
            f"{name:>22}: order {order}, {per_step:4.3g} evaluations a step, stable to "
            f"dt omega {method.stability_limit:.3f}"
        )
    print(*chart(found), sep="\n")
