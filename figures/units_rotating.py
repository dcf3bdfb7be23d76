"""Waves of rotating units: slower than sound any height and no tail, faster ones never small.

Rigid units on hinges in a row, tilted by 0.35 rad; the rotation travels with the extension.  Waves
slower than sound begin at height 0, at the speed of sound, and their tail is round-off.  Between
sound and the fastest linear wave of that branch (shaded) there are none.  Faster waves turn the
other way, from a finite angle on (the gap in amplitude), and with them travels a train of short
waves, whose height depends on the length of the lattice.  The line is the long-wave integral.
"""

import math

import numpy as np
import sympy as sp
from scipy.optimize import brentq

from figures._draw import note
from figures._files import lines, side_by_side
from tensegrity import Chain, PairLaw, dispersion, solitary_wave

GROUP = "units"

TILT, SHEAR, BENDING = 0.35, 0.01851, 3.835e-5  # rad; over the stiffness of extension, and N m
INERTIAS = 1.0, 1 / (4 * 1.815**2)  # kg, kg m²
RATIOS = 0.65, 0.7, 0.75, 0.8, 0.9, 0.97, 0.999  # speeds over that of sound, below it
SPEEDS = 0.3, 0.35, 0.4, 0.5, 0.65, 0.8  # sites/s, above it
SHOWN = {"slower": 0.8, "faster": 0.5}  # ratio, and speed, whose profiles are drawn
PHASES = np.linspace(0.01, math.pi, 400)
NEAR = np.linspace(0.0, 60.0, 1201)  # sites from the peak


def pair():
    """The bond, of extension and rotation of both units."""
    (u, a), (U, A) = first, second = sp.symbols("u a"), sp.symbols("U A")
    arm = 1 / (2 * sp.cos(TILT))
    along = U - u + arm * (2 * sp.cos(TILT) - sp.cos(TILT + a) - sp.cos(TILT + A))
    across = arm * (sp.sin(TILT + A) - sp.sin(TILT + a))
    energy = along**2 / 2 + SHEAR * across**2 / 2 + BENDING * (a + A) ** 2 / 2
    return PairLaw(energy, first, second, site=2 * BENDING * a**2)


def long_wave_peak(speed):
    """Where cos b - cos(b + a) = S a cos b, S² = 8 Kt (1 - c²)/c²; above 0 if slower than sound."""
    level = math.sqrt(8 * BENDING * (1 - speed**2)) / speed

    def gap(a):
        return (math.cos(TILT) - math.cos(TILT + a)) / math.cos(TILT) / a - level

    slow = level > math.tan(TILT)
    return brentq(gap, *((1e-9, 1.2) if slow else (-1.5, -1e-9)), xtol=1e-15)


def described(wave):
    """A row of the table of waves."""
    tail = wave.tail
    low, more, k = (tail.amplitude, tail.change, tail.wavenumber) if tail else (0.0, 0.0, 0.0)
    return {
        "speed": wave.speed, "of sound": wave.speed_ratio, "du": wave.amplitude[0],
        "rotation": wave.amplitude[1], "tail": low, "tail, other periods": low + more,
        "wavenumber": k, "residual": wave.residual,
    }  # fmt: skip


def data():
    row, tables = Chain(pair(), 8, mass=INERTIAS), {}
    for kind, name, values in (("slower", "speed_ratio", RATIOS), ("faster", "speed", SPEEDS)):
        waves = {x: solitary_wave(row, **{name: x}) for x in values}
        tables[kind] = side_by_side([described(wave) for wave in waves.values()])
        shown = waves[SHOWN[kind]]
        inside = NEAR[shown.x[-1] >= NEAR]
        rotation = shown.elongation(inside)[:, 1]
        tables[f"{kind}, profile"] = {"x": inside, "rotation": rotation}
    lower = dispersion(pair(), INERTIAS, PHASES)[:, 0] / PHASES
    sound = tables["slower"]["speed"][0] / tables["slower"]["of sound"][0]
    tables["limits"] = {"name": ["sound", "linear waves"], "speed": [sound, float(lower.max())]}
    speeds = np.geomspace(0.6 * sound, 0.99, 200)
    peaks = [long_wave_peak(speed) for speed in speeds]
    tables["long waves"] = {"speed": speeds, "rotation": peaks}
    return tables


def draw(figure, tables):
    """Peaks against speed; profiles of two waves; tails against speed."""
    figure.set_size_inches(10, 3.9)
    peaks, profiles, tails = figure.subplots(1, 3, width_ratios=(1.25, 1, 0.9))
    long, colours = tables["long waves"], {"slower": "C0", "faster": "C3"}
    slowest, fastest = tables["limits"]["speed"]
    peaks.axhline(0, color="0.8", lw=0.8)
    peaks.plot(long["speed"], long["rotation"], "0.6", lw=1)
    peaks.axvspan(slowest, fastest, color="0.92", zorder=0)
    note(peaks, "no solitary waves:\nlinear ones are\nas fast", ((slowest * fastest) ** 0.5, 0.3),
         color="0.35", ha="center", va="center")  # fmt: skip
    for kind, colour in colours.items():
        of, profile = tables[kind], tables[f"{kind}, profile"]
        peaks.plot(of["speed"], of["rotation"], "o", color=colour, ms=5)
        profiles.semilogy(profile["x"], np.abs(profile["rotation"]), color=colour)
    smallest = np.max(tables["faster"]["rotation"])
    peaks.annotate(
        "", (0.12, 0), (0.12, smallest), arrowprops={"arrowstyle": "<->", "color": "0.3"}
    )
    note(peaks, "gap in\namplitude", (0.13, smallest / 2), color="0.3", va="center")
    note(peaks, "slower\nthan\nsound", (0.029, -0.05), color="C0", va="top")
    note(peaks, "faster", (0.6, -0.55), color="C3", ha="center")
    peaks.set(xscale="log", xlabel="speed [sites/s]", ylabel="peak rotation [rad]")
    peaks.set_xticks([0.03, 0.1, 0.3, 1], ["0.03", "0.1", "0.3", "1"])
    peaks.set(xlim=(0.027, 1.1), title="waves of each speed")
    note(profiles, f"{SHOWN['slower']:g} of sound", (34, 7e-3), color="C0")
    note(profiles, f"{SHOWN['faster']:g} sites/s:\na tail remains", (20, 5e-5), color="C3")
    profiles.set(xlabel="distance from the peak [sites]", ylabel="size of the rotation [rad]",
                 ylim=(1e-5, 2), title="two of them")  # fmt: skip
    of = tables["faster"]
    tails.vlines(of["speed"], of["tail"], of["tail, other periods"], color="C3", lw=3, alpha=0.4)
    tails.semilogy(of["speed"], of["tail"], "o", color="C3", ms=5)
    tails.set(xlabel="speed [sites/s]", ylabel="amplitude of the tail [rad]",
              xlim=(0.2, 0.9), title="tails of faster waves")  # fmt: skip
    note(tails, "bars: lattices of other lengths", (0.03, 0.76), inside=True, color="0.35")


def table(tables):
    """Waves slower and faster than sound."""
    for kind in ("slower", "faster"):
        yield from ({"wave": kind} | one for one in lines(tables[kind]))
