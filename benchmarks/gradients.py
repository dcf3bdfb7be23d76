"""Cost of a gradient: over the run that it is of, over differences, and over stored states.

Ratios of CPU time in one process, minima over rounds.  A gradient is value and derivatives; the
run is `simulate` with equally few rows; the bare loop is timed too.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from benchmarks._timing import cpu, record, table
from tensegrity import METHODS, Chain, PowerLaw, Prism, Record, gradient, simulate
from tensegrity import objective as o
from tensegrity.scenes.dynamics import dynamics

STEPS, DT = 40_000, 0.02
STORED = (1_000, 16_000)  # steps: what is stored grows with them
PEERS = ("ours", "jax", "diffrax")


def scenes(bonds=60):
    """{name: (chain, state, the requested parameters)}."""
    ends, spread = ("free", "fixed"), np.linspace(0.01, 0.05, bonds)
    prisms = Chain([Prism(1.0, 0.7, p, 1.0).potential() for p in spread], bonds + 1, ends=ends)
    hertz = Chain([PowerLaw(1 + k, 1.5) for k in spread], bonds + 1, ends=ends)
    return {
        f"{bonds} prisms": (prisms, prisms.at_rest({0: 0.05}), ("prestrain",)),
        f"{bonds} Hertz contacts": (hertz, hertz.at_rest({0: 0.05}), ("stiffness",)),
    }


def loop(chain, state, method, steps):
    """A call of the bare loop."""
    u, v = dynamics(chain).arrays(state)
    bound = dynamics(chain).bind(u, v, METHODS[method], DT)
    return lambda: bound.advance(steps)


def costs(name, chain, state, chosen, method="verlet", steps=STEPS):
    """Rows of the table: ratios of one scene."""
    t_end, last = steps * DT, chain.sites - 2
    peak, few = o.peak(o.load(bond=last)), Record(every=-(-steps // 32))
    run_of, how = (chain, state, t_end), {"dt": DT, "method": method}
    times = cpu({
        "loop": loop(chain, state, method, steps),
        "run": lambda: simulate(chain, state, t_end, dt=DT, method=method, record=few),
        "chosen": lambda: gradient(peak, *run_of, **how, wanted=chosen),
        "none": lambda: gradient(peak, *run_of, **how, wanted=()),
        "all": lambda: gradient(peak, *run_of, **how),
        "ten": lambda: gradient([o.load(bond=k) for k in range(0, last, last // 8)], *run_of,
                                **how, wanted=chosen),
    })  # fmt: skip
    ratios = [times[k] / times[base] for base in ("run", "loop")
              for k in ("chosen", "none", "all", "ten")]  # fmt: skip
    ns = 1e9 * times["loop"] / (steps * (last + 1))
    return (f"{name}, {method}", ns, *ratios)


def differences(name, chain, state, chosen):
    """CPU seconds of a gradient, and of 60 more runs for one-sided differences."""
    t_end, last = STEPS * DT, chain.sites - 2
    few, peak = Record(every=STEPS), o.peak(o.load(bond=last))
    times = cpu({
        "run": lambda: simulate(chain, state, t_end, dt=DT, record=few),
        "gradient": lambda: gradient(peak, chain, state, t_end, dt=DT, wanted=chosen),
    }, 3)  # fmt: skip
    many = (last + 2) * times["run"]
    return name, times["gradient"], many, many / times["gradient"]


def stored(peer, steps):
    """(seconds of a gradient, megabytes at most) of a peer in a process of its own."""
    answer = subprocess.run(
        [sys.executable, "-m", "benchmarks._adjoint", peer, str(steps)], capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    if answer.returncode:
        last = answer.stderr.strip().splitlines()[-1:] or ["no answer"]
        return None, last[0]
    seconds, megabytes, value, norm = map(float, answer.stdout.split())
    return (seconds, megabytes, value, norm), ""


def main():
    """Print ratios with their targets."""
    kinds = ("chosen", "none", "all", "8 in one")
    rows = [costs(name, *one, method) for name, one in scenes().items()
            for method in ("verlet", "rkn6")]  # fmt: skip
    part = len(kinds) + 2
    table("value and gradient over the run (aim: prisms 4, Hertz 3, at most 6)",
          ["", "ns a bond", *kinds], [row[:part] for row in rows], ours=kinds)  # fmt: skip
    table("the same over the bare loop", ["", "ns a bond", *kinds],
          [(*row[:2], *row[part:]) for row in rows], ours=kinds)  # fmt: skip
    rows = [differences(name, *one) for name, one in scenes().items()]
    heads = ["", "gradient", "differences", "ratio"]
    table("60 parameters: CPU seconds", heads, rows, theirs=["ratio"])
    rows, values = [], {}
    for peer in PEERS:
        for steps in STORED:
            found, why = stored(peer, steps)
            if found is None:
                print(f"{peer}: {why}")
                break
            rows.append((f"{peer}, {steps} steps", *found[:2]))
            values.setdefault(steps, []).append(found[2:])
    table("60 prisms, verlet, displacement at the end by 60 prestrains, each in its process",
          ["", "s", "MB at most"], rows)  # fmt: skip
    taken = {name: seconds for name, seconds, _ in rows}
    for name, seconds in taken.items():
        record("60 prisms", name, "ours over it", taken[f"ours,{name.split(',')[1]}"], seconds)
    for steps, found in values.items():
        off = np.ptp(found, axis=0) / np.abs(found[0])
        print(f"{steps} steps: values agree to {off[0]:.1e}, norms of gradients to {off[1]:.1e}")
