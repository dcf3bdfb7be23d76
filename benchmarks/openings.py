"""Contacts that open: CPU time of an error with the steps of rkn6, and with them corrected.

Struck Hertz beads, the first half of the Y-guide and a row of 200 beads with random velocities;
errors of u and v at the end, over the largest of each, against corrected steps far finer, which
finer steps without corrections approach.  Then what a step costs where contacts open, and where
none does; the energy and the momentum over a long time; and the paper's scenes at the default
step.  Rivals take turns; times are CPU times, least of several rounds.
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from benchmarks._timing import table
from granular import Bead, Striker, chain, materials, simulate, y_guide
from tensegrity import METHODS, Chain, Network, PowerLaw, Record, State
from tensegrity.engine.kernel import bind
from tensegrity.scenes.dynamics import dynamics

METHOD, PLAIN = "corrected6", "rkn6"
WANTED = 1e-10
COUNTS = np.round(200 * 1.25 ** np.arange(36)).astype(int)  # of steps, to 500,000
ROW = 3  # of them in a row that are good enough
SEEN = 1e-9  # of the largest overlap: smaller ones do not count as events
ROUNDS, SECONDS = 7, 0.3
LONG, LONG_STEP = 5000.0, 0.05  # s
STEEL = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
PTFE = Bead(4.76e-3, materials["ptfe"], mass=0.123e-3)


def struck():
    """60 steel beads, the last on a wall of steel, hit by another."""
    row = chain([STEEL] * 59, striker=Striker(STEEL, 0.5))
    return row, row.start(), 400e-6


def guide():
    """The first half of the guide of the paper."""
    y = y_guide(bead=STEEL, striker=Striker(STEEL, 0.585))
    return y, y.start(), 300e-6


def gas():
    """200 unit masses in a row, touching, with unit contacts and random velocities."""
    row = Chain(PowerLaw(1.0, 1.5), 200)
    velocity = np.random.default_rng(0).standard_normal(200)
    return row, State(np.zeros(200), velocity), 40.0


SCENES = {"60 beads, struck": struck, "half Y-guide, 300 us": guide, "200 beads, gas": gas}


class Prepared:
    """A scene in the bare loop of a method, from its start again and again."""

    def __init__(self, scene, state, t_end, method, steps):
        self._start, self._sites, self._steps = dynamics(scene).arrays(state), scene.sites, steps
        self._rows = tuple(x.copy() for x in self._start)
        self._loop = bind(
            *self._rows, dynamics(scene).loop_bonds, METHODS[method], t_end / steps, divided=False
        )

    def __call__(self):
        """u and v at the end."""
        for row, start in zip(self._rows, self._start, strict=True):
            row[...] = start
        self._loop.advance(self._steps)
        return tuple(row[: self._sites].copy() for row in self._rows)


def gap(one, other):
    """Largest difference of two (u, v), each over the largest of `other`."""
    pairs = zip(one, other, strict=True)
    return max(float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in pairs)


def enough(scene, method, reference, wanted=WANTED):
    """Fewest steps that are good enough, as the next `ROW` numbers are, and the error there."""
    met = []
    for steps in COUNTS.tolist():
        error = gap(Prepared(*scene, method, steps)(), reference)
        met = [*met, (steps, error)] if error <= wanted else []
        if len(met) == ROW:
            return met[0]
    return steps, error


def reference_of(scene, wanted=WANTED):
    """A corrected run so fine that a coarser one differs by far less than is wanted."""
    for steps in COUNTS.tolist():
        coarse, fine = (Prepared(*scene, METHOD, n * steps)() for n in (1, 2))
        if gap(coarse, fine) < wanted / 10:
            return fine
    raise ValueError(f"no number of steps up to {COUNTS[-1]} reaches {wanted}")


def cpu(rivals, rounds=ROUNDS):
    """Least CPU time of each call [s], in turns."""
    best = dict.fromkeys(rivals, float("inf"))
    for _ in range(rounds):
        for name, call in rivals.items():
            spent, count, began = 0.0, 0, time.process_time()
            while spent < SECONDS / rounds or not count:
                call()
                count, spent = count + 1, time.process_time() - began
            best[name] = min(best[name], spent / count)
    return best


def events(scene, steps=20_000):
    """How often a contact opened or closed by more than round-off."""
    space, state, t_end = scene
    u, v = dynamics(space).arrays(state)
    loop = bind(u, v, dynamics(space).loop_bonds, METHODS[METHOD], t_end / steps, divided=False)
    place = dynamics(space).springs.kinks[dynamics(space).springs.group, 0]
    overlaps = []
    for step in range(steps):
        loop.advance(1, opened=step > 0)
        overlaps.append(place - dynamics(space).elongations(u[: space.sites]))
    far = np.abs(overlaps) > SEEN * np.max(overlaps)
    return sum(
        int(np.sum(np.diff(np.sign(w[x])) != 0))
        for w, x in zip(np.transpose(overlaps), far.T, strict=True)
    )


def errors():
    """CPU times of an error of `WANTED`."""
    rows = []
    for name, scene in SCENES.items():
        made = scene()
        reference = reference_of(made)
        steps = [x for method in (METHOD, PLAIN) for x in enough(made, method, reference)]
        times = cpu({m: Prepared(*made, m, n) for m, n in ((METHOD, steps[0]), (PLAIN, steps[2]))})
        ratio = times[PLAIN] / times[METHOD]
        rows.append(
            (name, str(events(made)), *steps, 1e3 * times[METHOD], 1e3 * times[PLAIN], ratio)
        )
    heads = ["", "events", "steps", "error", "plain steps", "error", "ms", "plain ms", "ratio"]
    table(f"CPU time of an error of {WANTED:g}, {METHOD} and {PLAIN}", heads, rows)


def rows_of(preload, sites):
    """A long row of contacts and a blow that opens them where there is no preload."""
    row = Chain(PowerLaw(1.0, 1.5, preload=preload), sites)
    return row, row.at_rest({0: 0.1})


def lattice(preload, side=20):
    """A square lattice of touching beads in the plane, with a blow in its corner."""
    x = np.stack(np.meshgrid(*[np.arange(float(side))] * 2), -1).reshape(-1, 2)
    near = np.linalg.norm(x[:, None] - x, axis=-1)
    pairs = np.argwhere(np.triu((near < 1.01) & (near > 0)))
    net = Network(x, pairs, PowerLaw(1.0, 1.5, preload=preload))
    return net, net.at_rest({0: (0.1, 0.07)})


def costs():
    """CPU time of a step over that of the plain method."""
    rows, scenes = [], {}
    for preload, words in ((1.0, "none opens"), (0.0, "contacts open")):
        for sites in (60, 1000, 20_000):
            scenes[f"{sites} beads, {words}"] = rows_of(preload, sites)
        scenes[f"lattice of 760, {words}"] = lattice(0.3 * preload)
    for name, (space, state) in scenes.items():
        steps = max(10, 200_000 // len(space.springs))
        rivals = {m: Prepared(space, state, 0.05 * steps, m, steps) for m in (METHOD, PLAIN)}
        times = cpu(rivals)
        per = {m: 1e9 * t / steps / len(space.springs) for m, t in times.items()}
        rows.append((name, per[METHOD], per[PLAIN], per[METHOD] / per[PLAIN]))
    table("ns per contact and step", ["", METHOD, PLAIN, "ratio"], rows)


def drift():
    """Largest errors of energy and momentum over a long time."""
    row = Chain(PowerLaw(1.0, 1.5), 8, ends=("fixed", "fixed"))
    free = Chain(PowerLaw(1.0, 1.5, preload=0.05), 8)
    velocity = dict(enumerate(0.5 * np.random.default_rng(1).standard_normal(8)))
    rows = []
    for name, space, v in (
        ("8 beads between walls, no preload", row, {k: velocity[k] for k in range(1, 7)}),
        ("8 free beads, preload", free, velocity),
    ):
        state = space.at_rest(v)
        for method in (METHOD, PLAIN):
            run = simulate(space, state, LONG, method=method, dt=LONG_STEP, record=Record(every=20))
            there = np.array([np.sum(space.mass * v) for v in run.v])
            size = np.sum(space.mass * np.abs(run.v[0]))
            moved = np.max(np.abs(there - there[0])) / size if space is free else float("nan")
            rows.append((f"{name}, {method}", run.energy_error, moved))
    table(f"largest errors over {LONG:g} s, dt = {LONG_STEP:g} s", ["", "energy", "momentum"], rows)


def defaults():
    """Error of the energy and CPU time at the default step, in scenes of the paper."""
    rows = []
    for name, bead, speed, t_end in (("steel", STEEL, 0.585, 420e-6), ("PTFE", PTFE, 0.25, 1.6e-3)):
        space = y_guide(bead=bead, striker=Striker(STEEL, speed))
        how = {"t_end": t_end, "record": Record(every=10)}
        calls = {m: partial(simulate, space, space.start(), method=m, **how) for m in (None, PLAIN)}
        for method, seconds in cpu(calls, 3).items():
            run = calls[method]()
            rows.append((f"{name}, {run.method}", run.energy_error, 1e6 * run.dt, 1e3 * seconds))
    table("half guide at the default step", ["", "energy", "dt [us]", "ms"], rows)


def main():
    """Print all of it."""
    errors()
    costs()
    drift()
    defaults()


if __name__ == "__main__":
    main()
