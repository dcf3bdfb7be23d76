"""Prisms reflect a solitary rarefaction wave and transmit delayed solitary compression waves.

Two interfaces found by searches, each prism by its exact potential.  A pulse counts as solitary
where it is supersonic and its shape is that of the exact wave of the same peak to 5 %.  What is
transmitted is one draw of chaos (`composite_spread`); what is reflected is not.
"""

from __future__ import annotations

import math

import numpy as np

from figures import _composite, _measure
from figures._composite import FOUND, NAMES
from figures._files import lines
from figures._solitons import LEAST, LEVEL, MISFIT
from figures._stored import stored
from tensegrity import solitary_wave

NAME = "composite"
GROUP = "composite"

CLAIM = (
    "a reflected solitary rarefaction wave with oscillatory tail in the acoustically hard branch; "
    "and a delayed train of transmitted compression solitary pulses in the acoustically soft branch"
)
KINDS = {
    "back": "reflected rarefaction",
    "pressed": "reflected compression",
    "on": "transmitted rarefaction",
    "train": "transmitted compression",
}
SHOWN = {"back 0": "reflected, rarefaction", "train 0": "transmitted first, compression",
         "train 1": "transmitted second, compression"}  # fmt: skip


def numbers(real, one):
    """Numbers of one incidence."""
    near, far, pushed = one.momenta()
    sounds, z = real.sounds, real.impedances
    return {
        "incident speed over sound": one.incident.speed_ratio,
        "incident peak [m]": one.incident.amplitude,
        "impedance far over near": z[1] / z[0],
        "sound far over near": sounds[1] / sounds[0],
        "momentum of the near chain": near,
        "momentum of the far chain": far,
        "momentum of the compressions": pushed,
        "momentum error": abs(near + far - 1),
        "time [s]": one.run.t[-1] - one.begun.arrival,
        "time of sound over a far bond [s]": 1 / sounds[1],
        "step [s]": one.run.dt,
        "energy error": one.run.energy_error,
        "largest change of a peak at half the step": one.moved,
        "at an end, over the peak": one.fine.ends,
    }


def pulse_table(real, one):
    """Supersonic pulses, one per row; each left the interface by the delay after the incident peak
    arrived there, by its place and speed."""
    rows, answer = [], one.fine
    several = (answer.back, answer.pressed, answer.leading, answer.train)
    for where, found in zip(KINDS, several, strict=True):
        sound = real.sounds[where in ("on", "train")]
        for pulse in found:
            row = {"where": where, **pulse._asdict()}
            row["energy"] /= one.incident.energy
            row["momentum"] /= abs(one.incident.momentum)
            row["solitary"] = pulse.is_solitary(one.incident.energy)
            row["delay"] = one.run.t[-1] - one.begun.arrival - pulse.place / (pulse.ratio * sound)
            rows.append(row)
    return {key: [row[key] for row in rows] for key in rows[0]}


def profile(real, one, where, number):
    """A pulse at the last instant, and the exact wave of the same peak at that position."""
    side = int(where == "train")
    found = (one.fine.back, one.fine.train)[side][number]
    r = np.diff(one.run.final.u)
    part = _composite.parts(r, one.run.final.v, one.begun.before)[side][0]
    wave = solitary_wave((real.near, real.far)[side], real.masses[side], amplitude=found.peak)
    low, high = math.floor(found.place - found.width), math.ceil(found.place + found.width)
    bonds, x = np.arange(low, high + 1), np.linspace(low, high, 200)
    return {
        "bond": bonds, "elongation": part[bonds], "x": x,
        "exact": wave.elongation(x - found.place),
    }  # fmt: skip


@stored("composite")
def data():
    """Numbers and pulses of both interfaces; profiles and energy density of the first."""
    tables = {}
    for name, values in FOUND.items():
        real = _composite.made(dict(zip(NAMES, values, strict=True)))
        one = _composite.outcome(real, _composite.duration(real))
        tables[name] = {"quantity": list(n := numbers(real, one)), "value": list(n.values())}
        tables[f"{name} pulses"] = pulse_table(real, one)
        if name == next(iter(FOUND)):
            tables["density"] = _measure.density(one.run)
            tables["interface"] = {"site": [one.begun.before]}
            for shown in SHOWN:
                where, number = shown.split()
                tables[shown] = profile(real, one, where, int(number))
    return tables


def solitary(tables, name, where):
    """Rows of the solitary pulses of one kind, the first to leave the interface in front."""
    rows = [x for x in lines(tables[f"{name} pulses"]) if x["where"] == where and x["solitary"]]
    return sorted(rows, key=lambda row: row["delay"])


def in_words(rows):
    """The solitary pulses of one kind."""
    return (
        "; ".join(
            f"{row['ratio']:.4f} times the sound speed, {100 * row['energy']:.1f} % of the energy, "
            f"misfit {100 * row['misfit']:.2g} %, leaves {row['delay']:.0f} s after the arrival"
            for row in rows
        )
        or "none"
    )


def table(tables):
    """One row per interface."""
    rows = []
    for name in FOUND:
        value = dict(zip(tables[name]["quantity"], tables[name]["value"], strict=True))
        rows.append({
            "what": f"prisms, {name}",
            "reflected rarefactions": in_words(solitary(tables, name, "back")),
            "reflected compressions": in_words(solitary(tables, name, "pressed")),
            "transmitted rarefactions": in_words(solitary(tables, name, "on")),
            "transmitted compressions": in_words(solitary(tables, name, "train")),
            "sound takes per far bond": f"{value['time of sound over a far bond [s]']:.1f} s",
            "momentum near, far, compressions": ", ".join(
                f"{value[f'momentum of the {part}']:+.5f}"
                for part in ("near chain", "far chain", "compressions")
            ),
            "at half the step": "peaks change by "
            f"{value['largest change of a peak at half the step']:.1g}",
        })  # fmt: skip
    return rows


def text(tables):
    """Claim, definition, parameters and what was found."""
    rows = table(tables)
    parameters = [
        f"| {name} | " + " | ".join(f"{values[k]:.6g}" for values in FOUND.values()) + " |"
        for k, name in enumerate(NAMES)
    ]
    heads = ["| | " + " | ".join(row["what"] for row in rows) + " |", "|---" * 3 + "|"]
    found = [
        f"| {key} | " + " | ".join(row[key] for row in rows) + " |" for key in list(rows[0])[1:]
    ]
    return "\n".join([
        f"The talk: \"{CLAIM}\".", "",
        f"A pulse counts as solitary if it differs from the exact wave of the same peak by at most "
        f"{MISFIT:.0%} of the maximum in elongation and in velocity, over the width of the wave at "
        f"{LEVEL:.0%}; if its peak is ahead of the acoustic front that leaves the interface when "
        f"the incident peak arrives; and if it carries at least {LEAST:g} of the incident energy. "
        f"No end was reached (elongations there below {_composite.QUIET:g} of the incident peak), "
        "and half the step gives the same count.", "", *heads, *found, "",
        "Momentum is conserved. A rarefaction reflected alone would require the far chain to hold "
        "more than the incident momentum, all of it tensile; each compression wave is balanced by "
        "more tension in the far chain, or by the compression that follows the reflected "
        "rarefaction in the near one. In the second interface the leading reflected wave is "
        "itself an exact compression, with most of the energy.", "", *heads, *parameters,
    ])  # fmt: skip


def draw(figure, tables):
    """The first interface in space and time, and its pulses on exact waves."""
    figure.set_size_inches(9, 7.5)
    axes = figure.subplot_mosaic([["map"] * 3, list(SHOWN)], height_ratios=(1.5, 1))
    before = tables["interface"]["site"][0]
    density = axes["map"]
    _measure.draw_density(density, tables["density"], "(a) energy, the interface dotted")
    density.axvline(before, color="w", lw=0.8, ls=":")
    density.set_xlim(before - 750, before + 195)
    for x, y, words in (
        (-560, 0.45, "reflected\nrarefaction"), (75, 0.22, "delayed\ncompressions"),
    ):  # fmt: skip
        density.text(before + x, y * density.get_ylim()[1], words, color="w", va="top", fontsize=9)
    for (name, words), letter in zip(SHOWN.items(), "bcd", strict=True):
        ax, one = axes[name], tables[name]
        ax.plot(one["x"], one["exact"], "C1", lw=1.2)
        ax.plot(one["bond"], one["elongation"], "C0o", ms=4)
        ax.set(xlabel="bonds from the interface")
        ax.locator_params(axis="x", nbins=3, integer=True)
        ax.set_title(f"({letter}) " + words.replace(", ", "\n"), fontsize=10)
    axes["back 0"].set_ylabel("elongation [m]")
    for name in list(SHOWN)[1:]:
        axes[name].set_ylabel("elongation [m]")
    figure.suptitle("A rarefaction wave comes back, compression waves go on late\n"
                    "dots: run; lines: exact waves of the same peak", fontsize=11)  # fmt: skip
