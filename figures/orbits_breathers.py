"""Breathers in the gap of precompressed steel and aluminium beads, and which of them are stable.

Between the acoustic and the optic band a vibration stays where it is.  Centred on a heavy bead it
is unstable in the whole gap.  Centred on a light one it has a real multiplier above 1 only where
its energy falls with its frequency (shaded); below, only weak pairs are left, which come from the
ends of the chain.  Contacts open soon, where the elongation exceeds the overlap at rest.
Source: Boechler, Theocharis, Job, Kevrekidis, Porter & Daraio 2010, Discrete breathers in
one-dimensional diatomic granular crystals, for the chain.
"""

import math

import numpy as np

from figures._tables import arrays
from tensegrity import Chain, PowerLaw, State, floquet, periodic_orbit

GROUP = "waves"

HERTZ, PRELOAD, MASSES = 5.464421336726e9, 20.0, (0.02884, 0.00975)  # N/m^1.5, N, kg
OVERLAP = (PRELOAD / HERTZ) ** (2 / 3)  # m
EDGES = 4710.527278, 8101.488936  # of the gap [Hz]
SITES = {"heavy": 81, "light": 79}  # ends of steel: an aluminium one has a mode of its own
FREQUENCIES = np.array([*range(8050, 7700, -10), *range(7700, 6850, -50)], dtype=float)  # Hz
SHOWN = 7200.0  # Hz
REAL = 1e-9  # imaginary part of a multiplier that counts as real


def family(centre):
    """Breathers of falling frequency, and their places."""
    sites = SITES[centre]
    x = np.arange(sites) - sites // 2
    light = np.arange(sites) % 2 == 1
    row = Chain(PowerLaw(HERTZ, 1.5, preload=PRELOAD), sites, np.where(light, *MASSES[::-1]))
    shape = light * (np.sin if centre == "heavy" else np.cos)(np.pi * x / 2)
    width = math.sqrt(1 - (FREQUENCIES[0] / EDGES[1]) ** 2)
    orbit, found = State(1e-6 * shape / np.cosh(width * x), 0.0 * x), []
    for frequency in FREQUENCIES:
        orbit = periodic_orbit(row, orbit, period=1 / frequency)
        found.append(orbit)
    return x, found


def largest(orbit):
    """The largest real multiplier, 1 if none is above it."""
    found = floquet(orbit).multipliers
    return max(float(found.real[np.abs(found.imag) < REAL].max(initial=1.0)), 1.0)


def data():
    tables = {}
    for centre in SITES:
        sites, orbits = family(centre)
        tables[centre] = {"frequency": FREQUENCIES} | arrays([
            {"energy": one.energy, "multiplier": largest(one),
             "elongation": np.abs(np.diff(one.state.u)).max() / OVERLAP} for one in orbits
        ])  # fmt: skip
        shown = orbits[int(np.flatnonzero(FREQUENCIES == SHOWN)[0])].state.u
        tables[f"{centre} shape"] = {"site": sites, "displacement": shown - shown.mean()}
    return tables


def unstable(light):
    """Frequencies between which the energy falls with them [kHz]."""
    frequency, energy, *_ = light.values()
    least = int(np.argmin(energy))
    return frequency[least] / 1e3, frequency[int(np.argmax(energy[:least]))] / 1e3


def draw(figure, tables):
    figure.set_size_inches(9, 3.4)
    shape, energy, multiplier = figure.subplots(1, 3)
    for k, (centre, color) in enumerate((("heavy", "C3"), ("light", "C0"))):
        x, u = tables[f"{centre} shape"].values()
        shape.plot(x, 1e6 * u - 7 * k, f"{color}.-", ms=4, lw=0.8)
        frequency, joule, real, _ = tables[centre].values()
        energy.plot(frequency / 1e3, 1e6 * joule, color)
        multiplier.plot(frequency / 1e3, real, color)
        shape.annotate(f"centred on\na {centre} bead", (3.4, 2.7 - 7.2 * k), color=color)
    energy.annotate("heavy", (7.3, 210), color="C3")
    energy.annotate("light", (7.05, 118), color="C0")
    multiplier.annotate("heavy", (7.45, 2.6), color="C3")
    multiplier.annotate("light", (7.5, 1.15), color="C0")
    shape.set(xlabel="site", ylabel="displacement [µm], shifted", xlim=(-10, 12), ylim=(-11, 5))
    for ax in (energy, multiplier):
        ax.axvspan(*unstable(tables["light"]), color="C0", alpha=0.12, lw=0)
        ax.set(xlabel="frequency [kHz]")
    shape.set_title("Two breathers at 7.2 kHz")
    energy.set(ylabel="energy [µJ]", title="One energy falls, then rises")
    multiplier.set(ylabel="largest real multiplier", title="Unstable where it falls")


def table(tables):
    for centre in SITES:
        frequency, energy, real, elongation = tables[centre].values()
        here = int(np.flatnonzero(frequency == SHOWN)[0])
        yield {
            "breather": f"centred on a {centre} bead, {SHOWN:g} Hz",
            "energy [J]": float(energy[here]),
            "largest elongation over the overlap": float(elongation[here]),
            "largest real multiplier": float(real[here]),
            "least energy at [Hz]": float(frequency[int(np.argmin(energy))]),
            "real multiplier from [Hz]": float(frequency[real > 1.001].min()),
            "to [Hz]": float(frequency[real > 1.001].max()),
        }  # fmt: skip
