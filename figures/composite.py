"""Rarefaction wave at an interface of prism chains: reflected wave and transmitted train."""

from __future__ import annotations

import math

import numpy as np

from figures import _composite, _composite_words, _measure
from figures._composite import Interface
from figures._composite_search import COLUMNS, FAINT, KINDS, best, interface, results
from figures._composite_words import cases_of, quantities
from figures._solitons import LEAST
from tensegrity import Potential, RangeError, solitary_wave

NAME = "composite"
GROUP = "composite"
table, text = _composite_words.table, _composite_words.text

VERIFIED = 2  # best interfaces, from different seeds, that are recomputed
TRAVEL = 100  # bonds that sound travels in the far chain
LEAST_TRAVEL = 200  # ... and in the near one
PULSES = "back", "pressed", "on", "train"  # reflected and transmitted: rarefaction, compression
LONGEST = 3000  # ... at most
CUBIC = (1.0, 1.0, 0.36), (0.010237, -1.149207, 1.542135), 1.388055, 1.6  # laws, mass, c/cs
CUBIC_TIME = 700.0  # s


def duration(real):
    """Duration over which an interface is simulated [s]."""
    near, far = real.sounds
    return min(max(TRAVEL / far, LEAST_TRAVEL / near), LONGEST / near)


def verified(named):
    """The interface of named numbers and its `_composite.Outcome`, from scratch.

    Elastic prisms are replaced by polynomials unless the motion leaves the range of the fit.
    """
    exact = interface(named)
    real = _composite.fitted(exact)
    try:
        return real, _composite.outcome(real, duration(real), 2 * TRAVEL)
    except RangeError:
        return exact, _composite.outcome(exact, duration(exact), 2 * TRAVEL)


def cubic():
    """Interface of two cubic springs that shows one wave and nearly the other."""
    import sympy as sp

    r, k, a, b = sp.symbols("r k a b")
    law = k * (r**2 / 2 + a * r**3 / 3 + b * r**4 / 4)
    near, far = (
        Potential(law, r, dict(zip((k, a, b), numbers, strict=True))) for numbers in CUBIC[:2]
    )
    peak = solitary_wave(near, speed_ratio=CUBIC[3]).amplitude
    return Interface(near, far, (1.0, CUBIC[2]), peak)


def numbers(real, one):
    """Numbers reported for one incidence."""
    back, train = one.verdict
    near, far, pushed = one.momenta()
    sounds, z = real.sounds, real.impedances
    return {
        "reflected solitary rarefactions": back,
        "transmitted solitary compressions": train,
        "incident speed over sound": one.incident.speed_ratio,
        "incident peak [m]": one.incident.amplitude,
        "impedance far over near": z[1] / z[0],
        "sound far over near": sounds[1] / sounds[0],
        "momentum of the near chain": near,
        "momentum of the far chain": far,
        "momentum of the compressions": pushed,
        "momentum error": abs(near + far - 1),
        "time [s]": one.run.t[-1] - one.begun.arrival,
        "step [s]": one.run.dt,
        "energy error": one.run.energy_error,
        "largest change of a peak at half the step": one.moved,
        "at an end, over the peak": one.fine.ends,
    }


def pulse_table(one):
    """Supersonic pulses, one per row."""
    columns = {}
    energy = one.incident.energy
    answer = one.fine
    kinds = zip(PULSES, (answer.back, answer.pressed, answer.leading, answer.train), strict=True)
    for name, several in kinds:
        for found in several:
            row = {"where": name, **dict(zip(type(found).__annotations__, found, strict=True))}
            row["energy"] /= energy
            row["momentum"] /= abs(one.incident.momentum)
            row["solitary"] = found.is_solitary(energy)
            for key, value in row.items():
                columns.setdefault(key, []).append(value)
    return columns


def profile(real, one, name, number):
    """A pulse at the last instant, and the exact wave of the same peak at that position."""
    side = int(name == "train")
    found = (one.fine.back, one.fine.train)[side][number]
    r = np.diff(one.run.final.u)
    part = _composite.parts(r, one.run.final.v, one.begun.before)[side][0]
    spring, mass = (real.near, real.far)[side], real.masses[side]
    wave = solitary_wave(spring, mass, amplitude=found.peak)
    bonds = np.arange(
        max(math.floor(found.place - found.width), 0), math.ceil(found.place + found.width) + 1
    )
    x = np.linspace(bonds[0], bonds[-1], 200)
    return {
        "bond": bonds, "elongation": part[bonds], "x": x,
        "exact": wave.elongation(x - found.place),
    }  # fmt: skip


def data():
    """Verdicts, pulses, profiles and energy density of the best interface; control and search."""
    tables, search = {}, results()
    control = cubic()
    cases = [("cubic laws", control, _composite.outcome(control, CUBIC_TIME, 2 * TRAVEL))]
    for kind, seed, named in best(search["best"])[:VERIFIED]:
        cases.append((f"prisms, {kind}, seed {seed}", *verified(named)))
    chief = max(cases[1:], key=lambda case: (case[2].does_both, min(case[2].verdict)))[0]
    for name, real, one in cases:
        tables[name] = {"quantity": list(n := numbers(real, one)), "value": list(n.values())}
        tables[f"{name} pulses"] = pulse_table(one)
        if name == chief:
            tables["density"] = _measure.density(one.run)
            tables["interface"] = {"site": [one.begun.before]}
            for where, several in (("back", one.fine.back), ("train", one.fine.train)):
                for k, _ in zip(range(2), several, strict=False):
                    if several[k].width > 0:
                        tables[f"profile {where} {k}"] = profile(real, one, where, k)
    return tables | search


def draw(figure, tables):
    """The best interface in space and time, its pulses on exact waves, the search, momenta."""
    figure.set_size_inches(17, 14)
    axes = figure.subplot_mosaic(
        [["density", "density", "search", "search"], ["p0", "p1", "p2", "p3"],
         ["momentum"] * 4],
        height_ratios=[1.2, 0.8, 1.1],
    )  # fmt: skip
    before = tables["interface"]["site"][0]
    _measure.draw_density(axes["density"], tables["density"], "the best interface of prisms")
    axes["density"].axvline(before, color="w", lw=0.8, ls=":")
    profiles = [name for name in tables if name.startswith("profile")]
    for k in range(4):
        ax = axes[f"p{k}"]
        if k >= len(profiles):
            ax.axis("off")
            continue
        one = tables[profiles[k]]
        ax.plot(one["x"], one["exact"], "C1", lw=1.2)
        ax.plot(one["bond"], one["elongation"], "C0o", ms=4)
        ax.set(xlabel="bonds from the interface", ylabel="elongation [m]")
        where = WHERE[profiles[k].split()[1]]
        ax.set_title(f"{where}\ndots: run, line: exact wave of the same peak", fontsize=9)
    verified = [energies(tables[f"{name} pulses"]) for name in cases_of(tables)[1:]]
    _draw_search(axes["search"], tables["search"], verified)
    _draw_momenta(axes["momentum"], tables)


WHERE = {
    "back": "reflected rarefaction",
    "on": "transmitted rarefaction",
    "train": "transmitted compression",
}


def energies(pulses):
    """Energies, over that of the incident wave, of the first reflected solitary rarefaction and of
    the second transmitted solitary compression; 0 where there is none."""
    every = zip(pulses["where"], pulses["energy"], pulses["solitary"], strict=True)
    found = [(where, float(energy)) for where, energy, solitary in every if solitary]
    back, train = (
        sorted((energy for name, energy in found if name == where), reverse=True)
        for where in ("back", "train")
    )
    return (*back, 0.0)[0], (*train, 0.0, 0.0)[1]


def _draw_search(ax, found, verified):
    kinds = np.array(found["kind"])
    reflected, second = (np.array(found[key], dtype=float) for key in ("reflected", COLUMNS[3]))
    least = FAINT
    for k, kind in enumerate(KINDS):
        mine = kinds == kind
        ax.scatter(
            np.maximum(reflected[mine], least), np.maximum(second[mine], least), 9, f"C{k}",
            alpha=0.5, label=f"{kind}, {mine.sum()} simulated", edgecolors="none",
        )  # fmt: skip
    both = np.maximum(np.array(verified).T, least)
    ax.scatter(*both, 130, "C3", marker="*", label="best of two seeds, verified by longer runs")
    for line in (ax.axhline, ax.axvline):
        line(LEAST, color="0.4", lw=0.8, ls=":")
    ax.set(
        xscale="log", yscale="log", xlim=(least / 2, 1.5), ylim=(least / 2, 1.5),
        xlabel="energy of the reflected solitary rarefaction / incident",
        ylabel="energy of the second solitary compression / incident",
    )  # fmt: skip
    ax.set_title(
        "search: the claim holds beyond both dotted lines; zeros are drawn at the axes", fontsize=10
    )
    ax.legend(fontsize=8, loc="upper left", frameon=True)


def _draw_momenta(ax, tables):
    names = cases_of(tables)
    for k, name in enumerate(names):
        value = quantities(tables[name])
        parts = (
            ("near chain", value["momentum of the near chain"], "C0"),
            ("far chain", value["momentum of the far chain"], "C1"),
            ("solitary compressions in the far chain", value["momentum of the compressions"], "C3"),
        )
        for j, (label, fraction, colour) in enumerate(parts):
            ax.barh(k + 0.25 * (1 - j), fraction, 0.22, color=colour, label=None if k else label)
    ax.axvline(1, color="0.4", lw=0.8, ls=":")
    ax.axvline(0, color="0.4", lw=0.8)
    ax.set_yticks(range(len(names)), [name.replace(", seed", ",\nseed") for name in names])
    ax.set(xlabel="final momentum / incident momentum (tension has the sign of the incident wave)")
    ax.set_title("distribution of the final momentum", fontsize=10)
    ax.legend(fontsize=8, loc="lower right", frameon=True)
