"""Error against processor time: every method, and other programs, on five scenes.

Solitary wave, wave near locking and softening chain (smooth); struck beads and a Y-guide (contacts
that open, steel).  The reference for the last state is Blanes and Moan's method with far smaller
steps, in extended precision where the scene is smooth; a run with twice its step estimates its
error.  All programs take turns on a scene; times are processor times, the least of several rounds.
"simulate" is the whole call with a tolerance, its rows and energies; our other runs are those of
the prepared loop alone with a given step, and a peer's run is its own call.  Compile times are
listed separately.  The chart shows the call, and as a thin line the best loops of all methods; the
table lists each.  Peers evaluate the prism's force in its textbook form; for the softening prism,
whose force solves equations, they use the polynomial fitted to ours.
Forces: the formula, and polynomials of it (`+p`) whose error is a small part of the run's.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import _peers
from benchmarks._peers import Entry
from benchmarks._race import CALL, chart, race, ratios, seconds, show
from benchmarks._timing import table
from benchmarks.methods import EXTENDED, LEVELS, final, gap, omega, scenes
from tensegrity import (
    METHODS,
    Chain,
    Ensemble,
    Polynomial,
    Prism,
    ResolutionError,
    TensegrityError,
    simulate,
    solitary_wave,
)
from tensegrity.engine import codegen, native
from tensegrity.engine.compiled import Compiled
from tensegrity.scenes.dynamics import dynamics

CALLED = 10.0 ** -np.arange(2.0, 12.0)
FINER = 2.0  # ratio of the numbers of steps
MOST = 400.0  # evaluations per unit of 1/omega
REFERENCE = 300.0
FIT = 0.02  # error of a polynomial over that of the run
LANES, ENSEMBLE_SITES, ENSEMBLE_END = 8, 40, 60.0


@dataclass(frozen=True)
class Scene:
    """A scene and what peers need to know of it.

    Attributes
    ----------
    run : (scene, state, duration)
    tension : (symbol, expression), optional
        For the peers.
    polynomial : bool
        Whether the force may be fitted.
    peers : callable () -> entries
    """

    run: tuple
    tension: tuple | None = None
    polynomial: bool = True
    peers: Callable = tuple


def all_scenes():
    """{name: Scene}."""
    from benchmarks.lammps import SPEED, STEEL, guide_walls
    from granular import Striker, chain, y_guide

    prism = Prism(1.0, 0.7, 0.01, 1.0)
    spring, line = prism.potential(), None
    line = Chain(spring, 128)
    fast = solitary_wave(spring, speed_ratio=3.0)
    soft = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05)
    held = Chain(soft, 128, ends=("fixed", "free"))
    beads = chain([STEEL] * 60, striker=Striker(STEEL, SPEED))
    guide = y_guide(bead=STEEL, striker=Striker(STEEL, SPEED))
    textbook = _peers.prism_tension(prism)
    softening = held, held.at_rest({1: 0.15}), 60.0
    struck, guided = (beads, beads.start(), 400e-6), (guide, guide.start(), 300e-6)
    return {
        "wave": Scene(scenes()["wave"], textbook),
        "locking": Scene((line, fast.launch(line, at=40), 60 / fast.speed), textbook),
        "softening": Scene(softening, _peers.polynomial_tension(_fit(softening, 1e-13))),
        "contacts": Scene(
            struck, None, False,
            lambda: _peers.lammps(beads, struck[2], (400, 1600, 6400, 25600)),
        ),
        "Y-guide": Scene(
            guided, None, False,
            lambda: _peers.lammps(guide, guided[2], (300, 1200, 4800), guide_walls(guide)),
        ),
    }  # fmt: skip


def _met(run):
    """Smallest and largest elongation of a run of a chain of equal springs, and some room."""
    chain, state, t_end = run
    u, v = state.u.copy(), state.v.copy()
    loop = dynamics(chain).bind(u, v, METHODS["rkn6"], t_end / 1000)
    loop.advance(1000)
    low, high = loop.range[0]
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def _fit(run, error):
    """A polynomial that good, or as good as there is."""
    ends = _met(run)
    while True:
        try:
            return Polynomial(run[0].springs[0], *ends, error)
        except ResolutionError:
            error *= 3


def reference(run):
    """u and v at the end, and an estimate of their error."""
    scene, state, t_end = run
    smooth = isinstance(scene, Chain) and scene.springs[0].smooth
    engine = Compiled.of(dynamics(scene).loop_bonds, extended=EXTENDED) if smooth else None
    least = REFERENCE * t_end * omega(*run) / METHODS["rkn6"].stages
    steps = 2 * math.ceil((1 if smooth else 10) * least / 2)
    fine, coarse = (
        final(scene, state, METHODS["rkn6"], t_end / n, n, engine) for n in (steps, steps // 2)
    )
    return fine, gap(coarse, fine) / (63 if smooth else 1)


def _error(prepare, exact):
    try:
        return gap(prepare()(), exact)
    except TensegrityError:  # a step too large for it
        return np.inf


def ours(scene, exact):
    """Entries of all methods; with polynomials where they may stand."""
    chain, state, t_end = scene.run
    scale = t_end * omega(*scene.run)
    for name, method in METHODS.items():
        limit = method.stability_limit if method.explicit else 4.0
        steps, most = math.ceil(1.1 * scale / limit), MOST / (1 if method.explicit else 10)
        smallest = np.inf
        while steps * method.stages < most * scale and smallest > LEVELS[-1] / 3:

            def prepare(chain=chain, method=method, steps=steps):
                return lambda: final(chain, state, method, t_end / steps, steps)

            error = _error(prepare, exact)
            if np.isfinite(error):
                yield Entry(name, f"{steps} steps", prepare)
            if scene.polynomial and method.explicit and error < 0.1:
                fit = _fit(scene.run, float(np.clip(FIT * error, 2e-14, 1e-3)))
                moved = dynamics(chain).with_springs([fit])

                def fitted(moved=moved, method=method, steps=steps):
                    return lambda: final(moved, state, method, t_end / steps, steps)

                yield Entry(f"{name} +p", f"{steps} steps, degree {fit.degree}", fitted)
            if error > smallest / 2 and error < 1e-9:
                break  # round-off
            smallest = min(smallest, error)
            steps = math.ceil(steps * FINER)


def calls(scene):
    """Entries of the whole call, from a tolerance to rows and energies."""
    chain, state, t_end = scene.run
    for tol in CALLED:

        def prepare(tol=tol):
            def run():
                found = simulate(chain, state, t_end, tol=tol).final
                return found.u, found.v

            return run

        yield Entry(CALL, f"tol {tol:g}", prepare)


def peers(scene, exact):
    """Entries of the others."""
    yield from scene.peers()
    if scene.tension is None:
        return
    chain, _, t_end = scene.run
    counts = [math.ceil(t_end * omega(*scene.run) * 4.0**k) for k in range(5)]
    yield from _peers.heyoka(*scene.run, scene.tension)
    yield from _peers.scipy(*scene.run, scene.tension)
    if not chain.held:
        yield from _peers.numba_verlet(*scene.run, scene.tension, counts)


def ensemble():
    """A batch of chains, each blow another: ours with lanes, heyoka's batch mode."""
    prism = Prism(1.0, 0.7, 0.01, 1.0)
    spring = prism.potential()
    chain = Chain(spring, ENSEMBLE_SITES)
    batch = Ensemble(chain, LANES)
    states = batch.at_rest({0: np.linspace(0.02, 0.04, LANES)})
    alone = [(chain, batch.select(states, k), ENSEMBLE_END) for k in range(LANES)]
    exact = tuple(np.stack(x, 1) for x in zip(*(reference(a)[0] for a in alone), strict=True))
    scale = ENSEMBLE_END * omega(*alone[-1])

    def entries():
        method = METHODS["rkn6"]
        for k in range(12):
            steps = math.ceil(1.1 * scale / method.stability_limit * 1.5**k)
            fits = {"": spring}
            error = gap(advanced(spring, method, steps)()(), exact)
            if error < 0.1:
                fits[" +p"] = _fit(alone[-1], float(np.clip(FIT * error, 2e-14, 1e-3)))
            for mark, law in fits.items():
                yield Entry(f"rkn6{mark}", f"{steps} steps", advanced(law, method, steps))
            if error < LEVELS[-1] / 3:
                return

    def advanced(law, method, steps):
        line = Chain(law, ENSEMBLE_SITES)
        engine = Compiled.of(dynamics(line).loop_bonds, LANES)

        def prepare():
            return lambda: final(line, states, method, ENSEMBLE_END / steps, steps, engine)

        return prepare

    yield from race(
        [
            *calls(Scene((batch, states, ENSEMBLE_END))),
            *entries(),
            *_peers.heyoka_batch(chain, states, ENSEMBLE_END, _peers.prism_tension(prism)),
        ],
        exact,
    )


def build_time(chain):
    """Seconds to generate and compile the loop of a chain, nothing cached."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        text = codegen.c_text(dynamics(chain).loop_bonds.laws)
        flags = (*native.FLAGS, native.NATIVE, *native.WIDE)
        native.build(text, native.compilers()[0], flags, Path(folder) / "entry")
        return time.perf_counter() - began


TARGETS = (  # scene, contestant, wanted ratio
    ("wave", "heyoka", 8.0),
    ("ensemble", "heyoka batch", 2.4),
    ("wave", "scipy DOP853, compiled", 25.0),
    ("wave", "scipy DOP853, numpy", 60.0),
)


def main():
    """Print times at equal error, ratios, targets and break-even lengths; chart them all."""
    found = {}
    for name, scene in all_scenes().items():
        exact, known = reference(scene.run)
        found[name] = race([*calls(scene), *ours(scene, exact), *peers(scene, exact)], exact)
        show(f"{name}, reference good to {known:.0e}", found[name])
    found["ensemble"] = list(ensemble())
    show(f"{LANES} chains of {ENSEMBLE_SITES} prisms", found["ensemble"])
    goals = []
    for name, contestant, wanted in TARGETS:
        inner = [x for x, level in zip(ratios(found[name], contestant), LEVELS, strict=True)
                 if 0.9e-11 < level < 2e-3 and np.isfinite(x)]  # fmt: skip
        least, most = (min(inner), max(inner)) if inner else (np.nan, np.nan)
        goals.append((f"{name}: {contestant}", f">= {wanted:g}", least, most))
    table("1e-3 ... 1e-11", ["times ours", "target", "measured", "at most"], goals)
    wave = all_scenes()["wave"].run
    built, level = build_time(wave[0]), 1e-6
    mine = min(seconds(found["wave"], name, level) for name in METHODS) / wave[2]
    rows = [("ours", built, mine * 1e3, "-")]
    for name in dict.fromkeys(r[0] for r in found["wave"]):
        if name == CALL or name.removesuffix(" +p") in METHODS:
            continue
        theirs = seconds(found["wave"], name, level) / wave[2]
        compiled = max(r[4] for r in found["wave"] if r[0] == name)
        if not np.isfinite(theirs):  # it did not come that far
            rows.append((name, compiled, "-", "-"))
            continue
        even = max(built - compiled, 0.0) / (theirs - mine) if theirs > mine else "-"
        rows.append((name, compiled, theirs * 1e3, even))
    table(
        f"the wave at {level:g}; length of motion [s] from which ours pays, compiling included",
        ["", "compile [s]", "ms per s", "break-even"],
        rows,
    )
    print(*chart(found), sep="\n")
