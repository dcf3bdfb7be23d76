"""Many chains in one call, and savings by sites at rest and by rows that are not recorded.

CPU time, all in turn in one run; the wall clock only where threads are compared.  heyoka advances
eight chains in the lanes of a vector, each with the natural length of its own cross strings, and
keeps the last state only, as we do with `Record(times=[T])`.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import sympy as sp

from benchmarks import _peers
from benchmarks._timing import best, cpu, table
from tensegrity import METHODS, Chain, Ensemble, PowerLaw, Prism, Record, State, simulate, sweep
from tensegrity.precision.peers import heyoka_system
from tensegrity.scenes.dynamics import dynamics

LANES, STEPS = 64, 4000  # of the bare loop, one block of chains
COUNTS, SITES, T_END, TOL = (100, 1_000, 10_000), 40, 40.0, 1e-9
BATCHES = 4  # of eight chains, by heyoka
FAINT = 1e-295  # m/s of the far end: all sites move
CASES = 20_000


def different(count):
    """Chains of prisms of different prestrain, their state, and their prisms."""
    rng = np.random.default_rng(0)
    prisms = [Prism(1.0, 0.7, p, 1.0) for p in rng.uniform(0.005, 0.05, count)]
    scene = Ensemble([Chain(prism.potential(), SITES) for prism in prisms])
    return scene, scene.at_rest({0: rng.uniform(0.01, 0.03, count)}), prisms


def heyoka_seconds():
    """CPU time of a chain by heyoka, and its largest difference from ours; None without it."""
    if not _peers.has("heyoka"):
        return None
    import heyoka as hy

    from derivations import rigid_elastic
    from derivations.prism import natural_cross

    scene, start, prisms = different(8 * BATCHES)
    r = sp.Symbol("r")
    values = _peers.prism_values(prisms[0], r)
    del values[natural_cross]
    tension = r, rigid_elastic.force().subs(values)
    system = heyoka_system(scene.scenes[0], tension, {natural_cross: hy.par[0]})
    states = np.concatenate([start.u, start.v])
    lengths = np.array([[float(prism.natural_lengths().cross) for prism in prisms]])
    solver = hy.taylor_adaptive_batch(
        system, states[:, :8].copy(), pars=lengths[:, :8].copy(), tol=TOL, compact_mode=True
    )
    ends = []

    def run():
        ends.clear()
        for k in range(0, 8 * BATCHES, 8):
            solver.set_time(np.zeros(8))
            solver.state[:], solver.pars[:] = states[:, k : k + 8], lengths[:, k : k + 8]
            solver.propagate_until([T_END] * 8)
            ends.append(solver.state[:SITES].copy())

    seconds = cpu({"heyoka": run})["heyoka"] / (8 * BATCHES)
    ours = simulate(scene, start, T_END, tol=1e-12).final.u
    return seconds, float(np.abs(np.hstack(ends) - ours).max() / np.abs(ours).max())


def ensembles():
    """Print the cost of a chain in ensembles of several sizes."""
    os.environ["TENSEGRITY_THREADS"] = "1"
    per_chain, last = {}, Record(times=[T_END])
    for count in COUNTS:
        scene, start, _ = different(count)
        rows = {"rows": lambda: simulate(scene, start, T_END, tol=TOL)}  # noqa: B023
        if count == COUNTS[-1]:
            rows = {}  # 500 rows of all chains take 6.4 GB
        rows["end"] = lambda: simulate(scene, start, T_END, tol=TOL, record=last)  # noqa: B023
        per_chain[count] = {name: 1e3 * t / count for name, t in cpu(rows).items()}
    peer = heyoka_seconds()
    theirs = 1e3 * peer[0] if peer else np.nan
    rows = [
        (f"{n} chains", x.get("rows", np.nan), x["end"], x["end"] / theirs)
        for n, x in per_chain.items()
    ]
    title = f"CPU time of a chain of {SITES} prisms, tol {TOL:g} [ms]"
    table(title, ["", "500 rows", "last state", "over heyoka"], rows, ours=["over heyoka"])
    if peer:
        print(f"heyoka, batches of 8: {theirs:.3g} ms, error {peer[1]:.1e}")
    scene, start, _ = different(COUNTS[1])
    found = {}
    for threads in ("1", "2"):
        os.environ["TENSEGRITY_THREADS"] = threads
        call = {threads: lambda: simulate(scene, start, T_END, tol=TOL, record=last)}
        found |= best(call)
    del os.environ["TENSEGRITY_THREADS"]
    rows = [(f"{COUNTS[1]} chains", found["2"] / found["1"], "<= 0.53")]
    table("wall clock on two threads over one", ["", "ratio", "target"], rows, ours=["ratio"])


def numba_lanes():
    """Steps of velocity Verlet of chains of unit masses, with a stiffness each, in numba."""
    import numba

    @numba.njit(error_model="numpy")
    def advance(u, v, stiffness, dt, steps):
        sites, lanes = u.shape
        left = np.empty(lanes)
        for _ in range(steps):
            left[:] = 0.0
            for j in range(sites - 1):
                for k in range(lanes):
                    overlap = max(u[j, k] - u[j + 1, k], 0.0)
                    force = stiffness[k] * overlap * np.sqrt(overlap)
                    v[j, k] += dt * (left[k] - force)
                    u[j, k] += dt * v[j, k]
                    left[k] = force
            for k in range(lanes):
                v[-1, k] += dt * left[k]
                u[-1, k] += dt * v[-1, k]

    return advance


def lanes():
    """Print the bare loop of Hertz chains with constants of their own."""
    rng = np.random.default_rng(0)
    stiffness, dt, method = rng.uniform(0.8, 1.2, LANES), 1e-4, METHODS["verlet"]
    v = 1e-3 * rng.normal(size=(SITES, LANES))
    springs, calls = [PowerLaw(k, 1.5) for k in stiffness], {}
    for name, kinds in (("one for all", [springs[0]] * LANES), ("of each chain", springs)):
        scene = Ensemble([Chain(kind, SITES) for kind in kinds])
        arrays = dynamics(scene).arrays(State(np.zeros_like(v), v))
        calls[name] = partial(dynamics(scene).bind(*arrays, method, dt).advance, STEPS)
    if _peers.has("numba"):
        u, rate = np.zeros_like(v), v.copy()
        calls["numba"] = partial(numba_lanes(), u, rate, stiffness, dt, STEPS)
        calls["numba"]()  # compiles
    found = {name: t / (STEPS * (SITES - 1) * LANES) for name, t in cpu(calls).items()}
    rows = [(name, 1e9 * t, t / found.get("numba", np.nan)) for name, t in found.items()]
    title = f"bare Verlet of {LANES} Hertz chains of {SITES} beads, by constants"
    table(title, ["", "ns, a bond", "over numba"], rows, ours=["over numba"])


def spared():
    """Print savings over the full computation."""
    rows = []
    for name, spring, sites, t_end, v in (
        ("4,000 prisms, half the way", Prism(1.0, 0.7, 0.1, 1.0).potential(), 4000, 1100.0, 0.05),
        ("2,000 prisms, all the way", Prism(1.0, 0.7, 0.1, 1.0).potential(), 2000, 1100.0, 0.05),
        ("2,000 beads, all the way", PowerLaw(1.0, 1.5), 2000, 3000.0, 0.1),
    ):
        chain = Chain(spring, sites)
        start = chain.at_rest({0: v})
        faint = start.v.copy()
        faint[-1] = FAINT
        dt = simulate(chain, start, t_end).dt
        found = cpu({
            "rest": lambda: simulate(chain, start, t_end, dt=dt),  # noqa: B023
            "all": lambda: simulate(chain, State(start.u, faint), t_end, dt=dt),  # noqa: B023
        })  # fmt: skip
        rows.append((name, found["rest"] / found["all"]))
    table("sites at rest left out, over all sites", ["", "ratio"], rows, ours=["ratio"])
    rows = []
    soft = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05)
    for name, spring, sites, t_end in (
        ("128 prisms", Prism(1.0, 0.7, 0.01, 1.0).potential(), 128, 60.0),
        ("200 soft elastic prisms", soft, 200, 60.0),
        ("200 beads", PowerLaw(1.0, 1.5), 200, 300.0),
    ):
        chain = Chain(spring, sites)
        start, last = chain.at_rest({0: 0.03}), Record(times=[t_end])
        found = cpu({
            "last": lambda: simulate(chain, start, t_end, tol=TOL, record=last),  # noqa: B023
            "rows": lambda: simulate(chain, start, t_end, tol=TOL),  # noqa: B023
        })  # fmt: skip
        rows.append((name, found["last"] / found["rows"], "<= 1.1"))
    title = "Record(times=[T]) over 500 rows"
    table(title, ["", "ratio", "target"], rows, ours=["ratio"])


def swept():
    """Print the overhead of a case of a sweep."""
    with ProcessPoolExecutor(2) as pool:
        sweep(abs, range(100), pool)
        seconds = best({"sweep": lambda: sweep(abs, range(CASES), pool)})["sweep"]
    print(f"\na case of a sweep on two processes: {1e6 * seconds / CASES:.2g} us (target: 10)")


def main():
    """Print all tables."""
    ensembles()
    lanes()
    spared()
    swept()
