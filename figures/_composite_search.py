"""Interfaces of prisms searched for both waves.

Genes are numbers from 0 to 1, for what `LIMITS` names.  Each seed first draws interfaces uniformly,
then adapts a normal distribution (covariance matrix adaptation, `cmaes`) from the best of them.  A
coarse run, velocity Verlet with polynomials for the springs, several interfaces as a batch of an
`Ensemble`, gives the fitness of an interface; `figures.composite` recomputes the best ones.
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from figures import _composite
from figures._composite import Interface
from figures._files import lines, side_by_side
from figures._solitons import MISFIT, pulses
from figures._stored import stored
from tensegrity import (
    METHODS,
    Ensemble,
    Potential,
    Prism,
    State,
    TensegrityError,
    sweep,
)
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs.polynomial import polynomial_of_coefficients
from tensegrity.waves.family import Family
from tensegrity.waves.solitary import approximate_wave

LIMITS = {  # lowest, highest, and whether even in the logarithm
    "height near": (0.3, 1.5, False),
    "prestrain near": (1e-3, 1.0, True),
    "height far": (0.3, 1.5, False),
    "prestrain far": (1e-4, 1.0, True),
    "base far": (0.3, 3.0, True),
    "k_cross far": (1e-3, 10.0, True),
    "mass far": (0.1, 10.0, True),
    "preload": (0.0, 0.2, False),
    "peak": (0.05, 0.95, False),
    "k_base near": (0.7, 100.0, True),
    "k_bar near": (3.0, 300.0, True),
    "k_base far": (0.7, 100.0, True),
    "k_bar far": (3.0, 300.0, True),
}
"""Base 1 m and k_cross 1 N/m of the near prism, mass 1 kg of its sites; k_base and k_bar over the
k_cross of their prism, inf where a kind has rigid ones; the preload over the smaller k_cross times
base; the peak over the largest elongation of the near prism."""
COMMON = list(LIMITS)[:9]
KINDS = {  # which prisms have elastic bases and bars
    "elastic to rigid": (True, False),
    "elastic to elastic": (True, True),
    "rigid to rigid": (False, False),
}

ROUNDS = 2  # in each of which seeds draw first
SEEDS, DRAWN = 7, 704  # seeds of a round, and interfaces that each draws
BEGUN, ADAPTED = 4, 160  # descents, from the best of different seeds, and interfaces of each
POPULATION, PART = 16, 64  # interfaces that a descent, or a draw, computes at a time
ORDER = (0, 1, 0, 1, 2, 1)  # kinds of the seeds, in turn
SIGMA = 0.1  # of a gene, at the start of a descent
BATCH = 8
BONDS = 300, 200  # of the near and the far chain
TRAVEL = 70  # bonds that sound goes in the far chain
LONGEST = 500.0  # ... or in the near one
SHORTEST = 180.0
ROWS = 12
TIMED = 0.75  # of the near chain: as far as the reflected wave is followed
STEP = 0.5  # of a step of Verlet, times the largest frequency
DEGREE, FIT = 27, 1e-5  # of the polynomials; error
STIFFEST = 0.8  # part of a domain, whose stiffness sets the step
COVERED = (0.95, 0.8)  # of a domain that they cover, in turn
FAINT = 1e-7  # energy fraction that counts as zero
AHEAD, BEHIND = 0.1, 1e-5  # what energy before and behind a front counts that is no exact wave
WORTHY = 1e-5  # energy fraction ahead of sound above which exact waves are computed
BARRED = -10.0  # worth of what is no interface, and less the farther from one
COLUMNS = ("worth", "reflected", "compression 1", "compression 2")
FOLLOWED = "followed"


def names(kind):
    """Names of the genes of a kind of interface."""
    sides = [side for side, elastic in zip(("near", "far"), KINDS[kind], strict=True) if elastic]
    return [*COMMON, *(f"{member} {side}" for side in sides for member in ("k_base", "k_bar"))]


def values(kind, genes):
    """Named numbers of a row of genes."""
    named = dict.fromkeys(LIMITS, math.inf)
    for gene, name in zip(genes, names(kind), strict=True):
        low, high, logarithmic = LIMITS[name]
        gene = min(max(float(gene), 0.0), 1.0)
        named[name] = low * (high / low) ** gene if logarithmic else low + (high - low) * gene
    return named


def interface(named):
    """The interface of named numbers."""
    one = {key: named[key] for key in LIMITS}
    k = one["k_cross far"]
    load = one["preload"] * min(1.0, k * one["base far"])
    springs = []
    for side, base, stiff in (("near", 1.0, 1.0), ("far", one["base far"], k)):
        prism = Prism(
            base, one[f"height {side}"] * base, one[f"prestrain {side}"], stiff,
            k_base=one[f"k_base {side}"] * stiff, k_bar=one[f"k_bar {side}"] * stiff,
        )  # fmt: skip
        springs.append(prism.potential(load))
    peak = one["peak"] * springs[0].domain[1]
    return Interface(*springs, (1.0, one["mass far"]), peak)


def polynomial(spring):
    """A polynomial of one degree for all elastic prisms, so that they run as a batch."""
    if type(spring) is Potential:  # a closed form
        return spring
    for fitted in _composite.fits(spring, COVERED, FIT):
        if fitted.degree <= DEGREE:
            padded = np.append(fitted.values, np.zeros(DEGREE - fitted.degree))
            about = spring.length, fitted.domain, fitted.error_estimate
            return polynomial_of_coefficients(DEGREE, padded, *about)
    raise TensegrityError(f"no polynomial of degree {DEGREE}")


class Candidate(NamedTuple):
    """One interface on its way into an ensemble, its time scaled so that the run takes 1 s."""

    number: int
    interface: Interface
    wave: object
    arrival: float
    stiffest: float  # largest frequency [rad] of a run


class Worth(NamedTuple):
    """The fitness of an interface, and the energy fractions that determine it."""

    worth: float
    reflected: float = 0.0
    first: float = 0.0
    second: float = 0.0
    reason: str = ""


def prepared(kind, number, genes):
    """A `Candidate`, or the `Worth` of what cannot be run."""
    try:
        real = interface(values(kind, genes))
    except TensegrityError as error:
        return Worth(2 * BARRED, reason=type(error).__name__)
    (near, far), (z, z_far) = real.sounds, real.impedances
    excess = max(math.log(far / near), 0) + max(math.log(z_far / z), 0)
    excess += max(math.log(0.06 * near / far), 0)
    if excess > 0:
        return Worth(BARRED - min(excess, 9), reason="not from hard to soft")
    try:
        real = replace(real, near=polynomial(real.near), far=polynomial(real.far))
    except TensegrityError as error:
        return Worth(1.95 * BARRED, reason=type(error).__name__)
    try:
        wave = approximate_wave(Family(real.near, 1), real.masses[0], real.peak)
    except TensegrityError:
        slope = float(real.near.stiffness_slope(0.0)) * real.peak / real.near.stiffness(0.0)
        return Worth(BARRED - min(max(-slope, 0), 9), reason="no rarefaction wave")
    if 2 * (wave.reach(_composite.CUT) + 2) > BONDS[0]:
        return Worth(BARRED, reason="incident wave too wide")
    duration = max(min(TRAVEL / far, LONGEST / near), SHORTEST / near)
    arrival = (wave.reach(_composite.CUT) + 2) / wave.speed
    whole = duration + arrival
    scaled = Interface(
        real.near, real.far, tuple(m / whole**2 for m in real.masses), real.peak
    )  # fmt: skip
    wave = replace(
        wave, mass=scaled.masses[0], speed=wave.speed * whole, momentum=wave.momentum / whole,
        sound_speed=wave.sound_speed * whole,
    )  # fmt: skip
    r = np.linspace(-STIFFEST, STIFFEST, 41)
    top = 0.0
    for spring, mass, reach in zip(
        (real.near, real.far), scaled.masses, (2 * real.peak, math.inf), strict=True
    ):
        low, high = max(spring.domain[0], -reach), min(spring.domain[1], reach)
        met_stiffness = spring.stiffness(np.where(r < 0, -low * r, high * r))
        top = max(top, 4 * float(met_stiffness.max()) / mass)
    return Candidate(number, scaled, wave, arrival / whole, math.sqrt(top))


def followed(candidates):
    """{number: Worth} of up to `BATCH` candidates, which run at once, even if some springs lock."""
    filled = [*candidates, *[candidates[0]] * (BATCH - len(candidates))]
    begun = [_composite.start(x.interface, x.wave, *BONDS) for x in filled]
    scene = Ensemble([x.chain for x in begun])
    state = State(*(np.stack([getattr(x.state, n) for x in begun], axis=1) for n in ("u", "v")))
    steps = math.ceil(max(x.stiffest for x in filled) / STEP / ROWS)
    of = dynamics(scene)
    loop = of.bind(*of.arrays(state), METHODS["verlet"], 1 / (ROWS * steps))
    alive, found, rows = np.ones(BATCH, dtype=bool), {}, []
    for row in range(ROWS):
        loop.forget_range()
        loop.go(row * steps, (row + 1) * steps)
        rows.append(tuple(x.copy() for x in loop.output))
        inside = _inside(of.springs, loop.range)
        for k in np.flatnonzero(alive & ~inside):
            worth = BARRED * (1 - row / ROWS) / 2
            found[filled[k].number] = Worth(worth, reason="beyond the domain of a spring")
        alive &= inside
        if not alive.any():
            return found
    u, v = (np.array(x) for x in zip(*rows, strict=True))
    t = np.arange(1, ROWS + 1) / ROWS
    return found | {
        x.number: evaluated(x, t, u[..., k], v[..., k])
        for k, x in enumerate(candidates)
        if alive[k]
    }


def _inside(springs, ranges):
    """Whether all bonds of each batch member stayed where their springs are defined; (BATCH,)."""
    low, high = springs.domains.T
    good = (ranges[:, 0] > low) & (ranges[:, 1] < high)
    return good[springs.group].all(axis=0)


def evaluated(candidate, t, u, v):
    """The worth of an interface, from the rows of its run."""
    real, wave, before = candidate.interface, candidate.wave, BONDS[0]
    t = t - candidate.arrival
    sounds = real.sounds
    early = np.flatnonzero(t <= TIMED * before / wave.speed)[-1]
    sides, fractions, found = [], [], []
    for side, row, sign in ((0, early, 1), (1, -1, -1)):
        part = _composite.parts(np.diff(u[row]), v[row], before)[side]
        sides.append((side, sign, *part, (real.near, real.far)[side], sounds[side] * t[row]))
    for _, sign, r, _, spring, place in sides:
        front = max(math.floor(place), 0)
        energy = 2 * spring.energy(np.where(sign * r > 0, r, 0.0)) / wave.energy
        fractions.append(
            AHEAD * energy[front + 1 :].sum() + BEHIND * energy[front // 2 : front + 1].sum()
        )
    if min(fractions) < AHEAD * WORTHY:
        return Worth(rank(*fractions, 0.0))
    for side, sign, r, speeds, spring, front in sides:
        size = float((sign * r[math.floor(front) :]).max(initial=0.0))
        exact = _rough(spring, real.masses[side], sign)
        several = pulses(r, speeds, sign, exact, front, 0.1 * size, limit=1 + side)
        found.append([quality(x.misfit) * x.energy / wave.energy for x in several])
    first = max(found[0], default=0.0)
    train = [*sorted(found[1], reverse=True), 0.0, 0.0]
    worth = rank(max(first, fractions[0]), max(train[0], fractions[1]), train[1])
    return Worth(worth, first, *train[:2])


def _rough(spring, mass, sign):
    try:
        side = Family(spring, sign)
    except TensegrityError as error:
        reason = error

        def none(peak):
            raise reason

        return none
    return lambda peak: approximate_wave(side, mass, abs(peak))


def quality(misfit):
    """1 for an exact wave within the definition, less beyond, nothing from five times that on."""
    return min(1.0, max(0.0, (5 - misfit / MISFIT) / 4))


def rank(reflected, first, second):
    """Fitness of three energy fractions: the least counts most."""
    a, b, c = (math.log10(max(x, FAINT) / FAINT) for x in (reflected, first, second))
    return min(a, b) + min(a, b, c) + 0.2 * (a + b + c)


def worths(kind, rows):
    """`Worth` of each row of genes."""
    found = {k: prepared(kind, k, row) for k, row in enumerate(rows)}
    candidates = sorted(
        (x for x in found.values() if isinstance(x, Candidate)), key=lambda x: x.stiffest
    )
    for k in range(0, len(candidates), BATCH):
        found |= followed(candidates[k : k + BATCH])
    return [found[k] for k in range(len(rows))]


def drawn(kind, rng):
    """Genes drawn evenly, and their worths."""
    genes = rng.random((DRAWN, len(names(kind))))
    parts = (genes[k : k + PART] for k in range(0, DRAWN, PART))
    return list(genes), [x for part in parts for x in worths(kind, part)]


def adapted(kind, rng, start):
    """Genes moved from a start by covariance matrix adaptation, and their worths."""
    from cmaes import CMA

    optimizer = CMA(
        np.clip(start, 0.02, 0.98), SIGMA, np.tile([0.0, 1.0], (len(start), 1)),
        seed=int(rng.integers(2**31)), population_size=POPULATION,
    )  # fmt: skip
    genes, found = [], []
    for _ in range(ADAPTED // POPULATION):
        rows = [optimizer.ask() for _ in range(POPULATION)]
        several = worths(kind, rows)
        optimizer.tell([(row, -x.worth) for row, x in zip(rows, several, strict=True)])
        genes += rows
        found += several
    return genes, found


def descent(case):
    """All interfaces that one seed draws, of one kind, or computes on its way from given genes:
    rows (*genes, *worth)."""
    kind, seed, given = case
    rng = np.random.default_rng(seed)
    genes, found = adapted(kind, rng, np.array(given)) if given else drawn(kind, rng)
    return [
        (*map(float, row), *map(float, one[:4]), one.reason)
        for row, one in zip(genes, found, strict=True)
    ]


def first_cases(number):
    """(kind, seed, no genes) of the draws of a round."""
    seeds = [number * (SEEDS + BEGUN) + k for k in range(SEEDS)]
    return [(list(KINDS)[ORDER[seed % len(ORDER)]], seed, ()) for seed in seeds]


def last_cases(cases, found):
    """(kind, seed, genes) of the descents of a round, each from the best of another seed."""
    best = [max(rows, key=lambda row: row[-5]) for rows in found]
    order = sorted(range(len(best)), key=lambda k: -best[k][-5])[:BEGUN]
    seed = cases[-1][1] + 1
    return [(cases[k][0], seed + j, best[k][:-5]) for j, k in enumerate(order)]


def searched(executor=None):
    """Cases, and all interfaces that each computed."""
    cases, found = [], []
    for number in range(ROUNDS):
        cases += first_cases(number)
        found += computed(cases[len(found) :], executor)
        cases += last_cases(cases[-SEEDS:], found[-SEEDS:])
        found += computed(cases[len(found) :], executor)
    return cases, found


def computed(cases, executor):
    """What each case computed; the error of the first one that failed is raised."""
    found = sweep(descent, cases, executor)
    for one in found:
        if not isinstance(one, list):
            raise TensegrityError(one.error)
    return found


@stored("composite")
def results():
    """Three tables: the best interface of each case with all numbers, energy fractions of all
    that were simulated, and how many were not, and why."""
    simulated, best, counts = [], [], {}
    with ProcessPoolExecutor() as pool:
        cases, found = searched(pool)
    for (kind, seed, _), rows in zip(cases, found, strict=True):
        top = max(rows, key=lambda row: row[-5])
        about = {"kind": kind, "seed": seed}
        best.append(about | dict(zip(COLUMNS, top[-5:-1], strict=True)) | values(kind, top[:-5]))
        for row in rows:
            reason = row[-1] or FOLLOWED
            counts[kind, seed, reason] = counts.get((kind, seed, reason), 0) + 1
            if reason == FOLLOWED:
                fractions = (float(f"{x:.3g}") for x in row[-4:-1])
                simulated.append(about | dict(zip(COLUMNS[1:], fractions, strict=True)))
    best.sort(key=lambda row: -row["worth"])
    tally = [
        {"kind": kind, "seed": seed, "reason": reason, "count": count}
        for (kind, seed, reason), count in sorted(counts.items())
    ]
    tables = {"best": best, "search": simulated, "counts": tally}
    return {name: side_by_side(rows) for name, rows in tables.items()}


def best(columns):
    """[(kind, seed, named numbers)] of that table of the best, in the order of the lesser energy
    of their two waves."""
    rows = sorted(lines(columns), key=lambda row: -min(row[key] for key in COLUMNS[1:3]))
    return [(row["kind"], int(row["seed"]), {name: row[name] for name in LIMITS}) for row in rows]
