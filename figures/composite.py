"""Prisms reflect a solitary rarefaction wave and transmit delayed solitary compression waves.

The talk: "a reflected solitary rarefaction wave with oscillatory tail in the acoustically hard
branch; and a delayed train of transmitted compression solitary pulses in the acoustically soft
branch".  Two interfaces found by searches, each prism by its exact potential, or a polynomial that
differs from it by 1e-11.  A pulse counts as solitary if it differs from an exact wave by at most
5 % of the maximum in elongation and in velocity, over the width of the wave at 5 %.  What is
transmitted is one draw of chaos (`composite_spread`); what is reflected is not.

Momentum is conserved.  A rarefaction reflected alone would require the far chain to hold more than
the incident momentum, all of it tensile; each compression wave is balanced by more tension in the
far chain, or by the compression that follows the reflected rarefaction in the near one.  In the
second interface the leading reflected wave is itself an exact compression, with most of the energy.
"""

import numpy as np

from figures import _composite, _measure
from figures._composite import FOUND, KINDS, NAMES
from figures._files import lines, side_by_side
from figures._stored import stored

NAME = "composite"
GROUP = "composite"

SHOWN = ("reflected, rarefaction", "transmitted first, compression",
         "transmitted second, compression")  # fmt: skip


def numbers(real, coarse, fine):
    """Numbers of one incidence, from its runs with a step and with half of it."""
    (_, before), (run, found) = coarse, fine
    momentum = run.scene.mass * run.final.v / real.incident.momentum
    near, far = momentum[: found.site].sum(), momentum[found.site :].sum()
    peaks = [np.array([row["peak"] for row in _composite.solitary(x)]) for x in (before, found)]
    pushed = sum(p.momentum for p in found.transmitted if p.wave and p.amplitude < 0)
    return {
        "momentum of the near chain": near,
        "momentum of the far chain": far,
        "momentum of the compressions": pushed / real.incident.momentum,
        "momentum error": abs(near + far - 1),
        "time of sound over a far bond [s]": 1 / real.sounds[1],
        "largest change of a peak at half the step": np.abs(peaks[0] / peaks[1] - 1).max(),
    }


def profile(run, pulse, site):
    """A pulse at the last instant, and the exact wave that it agrees with, from the interface."""
    place = pulse.place - 0.5  # bond j is half a site behind site j
    reach = pulse.wave.width()
    bonds = np.arange(int(place - reach), int(place + reach) + 2)
    x = np.linspace(bonds[0], bonds[-1], 200)
    return {
        "bond": bonds - site, "elongation": np.diff(run.final.u)[bonds], "x": x - site,
        "exact": pulse.wave.elongation(x - place),
    }  # fmt: skip


@stored("composite")
def data():
    """Numbers and pulses of both interfaces; profiles and energy density of the first."""
    tables = {"parameters": {"name": list(NAMES), **{k: list(x) for k, x in FOUND.items()}}}
    for name, values in FOUND.items():
        real = _composite.made(values)
        coarse, (run, found) = _composite.followed(real)
        one = numbers(real, coarse, (run, found))
        tables[name] = {key: [value] for key, value in one.items()}
        tables[f"{name} pulses"] = side_by_side(_composite.solitary(found))
        if name == next(iter(FOUND)):
            tables["density"] = _measure.density(run)
            tables["interface"] = {"site": [found.site]}
            back, *on = [p for p in (*found.reflected, *found.transmitted[::-1]) if p.wave]
            tables |= {
                shown: profile(run, pulse, found.site)
                for shown, pulse in zip(SHOWN, (back, *on), strict=True)
            }
    return tables


def solitary(tables, name, kind):
    """Rows of the solitary pulses of one kind, the first to leave the interface in front."""
    return [row for row in lines(tables[f"{name} pulses"]) if row["kind"] == kind]


def in_words(rows):
    """The solitary pulses of one kind."""
    return "; ".join(
        f"{row['ratio']:.4f} times the sound speed, {100 * row['energy']:.1f} % of the energy, "
        f"leaves {row['delay']:.0f} s after the arrival" for row in rows
    ) or "none"  # fmt: skip


def table(tables):
    """One row per interface."""
    rows = []
    for name in FOUND:
        value = {key: float(one[0]) for key, one in tables[name].items()}
        momenta = [x for key, x in value.items() if key.startswith("momentum of")]
        rows.append({
            "what": f"prisms, {name}",
            **{kind: in_words(solitary(tables, name, kind)) for kind in KINDS},
            "sound takes per far bond": f"{value['time of sound over a far bond [s]']:.1f} s",
            "momentum near, far, compressions": ", ".join(f"{x:+.2f}" for x in momenta),
            "at half the step": "peaks change by "
            f"{value['largest change of a peak at half the step']:.1g}",
        })  # fmt: skip
    return rows


def draw(figure, tables):
    """The first interface in space and time, and its pulses on exact waves."""
    figure.set_size_inches(9, 7.5)
    axes = figure.subplot_mosaic([["map"] * 3, list(SHOWN)], height_ratios=(1.5, 1))
    before, density = tables["interface"]["site"][0], axes.pop("map")
    _measure.draw_density(density, tables["density"], "energy, the interface dotted")
    density.axvline(before, color="w", lw=0.8, ls=":")
    density.set_xlim(before - 750, before + 195)
    for x, y, words in (
        (-560, 0.45, "reflected\nrarefaction"),
        (75, 0.22, "delayed\ncompressions"),
    ):
        density.text(before + x, y * density.get_ylim()[1], words, color="w", va="top", fontsize=9)
    for name, ax in axes.items():
        ax.plot(tables[name]["x"], tables[name]["exact"], "C1", lw=1.2)
        ax.plot(tables[name]["bond"], tables[name]["elongation"], "C0o", ms=4)
        ax.set(xlabel="bonds from the interface", ylabel="elongation [m]",
               title=name.replace(", ", "\n"))  # fmt: skip
        ax.locator_params(axis="x", nbins=3, integer=True)
    figure.suptitle("A rarefaction wave comes back, compression waves go on late\n"
                    "dots: run; lines: exact waves of the same peak", fontsize=11)  # fmt: skip
