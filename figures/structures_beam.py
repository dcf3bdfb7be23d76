"""Prestress steers a beam of waves on a plate by twenty degrees, on the way too; line is its path.

A Gaussian packet of the lower branch starts with its crests at 20 degrees to the rows of a plate.
Its path is compared with the mean of the group velocities over its spectrum, weighted by energy.
In the last run, on a larger plate, the prestress changes on the way.  The packet keeps its wave
vectors, and if the change is slow, the action of each wave, its energy over its frequency; its
direction turns.  A fast change also excites waves of the upper branch.  Without prestress all
members are bars, for the strings would go slack.
Source: the talk, concluding remarks, "wave-steering".
"""

from functools import cache

import numpy as np
import sympy as sp
from scipy.optimize import brentq

import tensegrity
from figures._tables import arrays
from tensegrity import Force, Lattice, Record, State, bands, simulate

GROUP = "structures"

SITES, WIDTH, TRAVEL, START = 60, 7.0, 22.0, (20, 32)  # cells
FREQUENCY, CRESTS = 1.2, np.radians(20.0)  # rad/s, rad
SIZE = 1e-3  # m, of the largest displacement
DENSITIES = (0.0, 0.2, 0.4)  # N/m, of the strings
CHANGED, RAMP = (0.05, 0.4), 5.0  # N/m, and s
LARGER, LONGER, THERE = 84, 38.4, (20, 50)  # cells of that run
APART = 16  # rows on either side of the change that belong to neither leg
K_BAR, K_STRING = 1.5, 2.0  # N/m
NEGLIGIBLE = 1e-12
ROWS = 61
LEGS = (0, ROWS // 2 - APART), (ROWS // 2 + APART, -1)


def plate(density):
    bars, strings = [(0, 0, (1, 1)), (0, 0, (1, -1))], [(0, 0, (1, 0)), (0, 0, (0, 1))]
    if not density:
        k = np.repeat([K_BAR, K_STRING], 2)
        return Lattice([(0, 0)], np.eye(2), bars + strings, k_bar=k)
    lattice = Lattice([(0, 0)], np.eye(2), bars, strings, K_BAR, K_STRING)
    return lattice.prestressed(density * np.array([-1, -1, 2, 2]))


def carrier(lattice):
    """Phases of the lower branch at the frequency and angle of the packet [rad]."""
    n = np.array([np.cos(CRESTS), np.sin(CRESTS)])
    off = lambda k: bands(lattice, [k * n]).frequencies[0, 0] - FREQUENCY  # noqa: E731
    return brentq(off, 0.05, 2.0, xtol=1e-13) * n


def spectrum(lattice, centre):
    """Phases, amplitudes and lower branch of a packet."""
    line = 2 * np.pi * np.fft.fftfreq(2 * SITES)
    phases = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    away = (phases - centre + np.pi) % (2 * np.pi) - np.pi
    amplitude = np.exp(-0.5 * WIDTH**2 * np.sum(away**2, axis=1))
    kept = (amplitude > NEGLIGIBLE) & (phases != 0).any(axis=1)
    return phases[kept], amplitude[kept], bands(lattice, phases[kept], True, True)


def velocity(lattice, centre, before=None):
    """Mean group velocity of a packet, weighted by energy [m/s]; before a change in another."""
    phases, amplitude, found = spectrum(lattice, centre)
    w = found.frequencies[:, 0]
    old = w if before is None else bands(before, phases).frequencies[:, 0]
    weight = amplitude**2 * old * w  # action times frequency
    return weight @ found.velocities[:, 0] / weight.sum()


def launched(lattice, centre, sites, start, t_end, forces=()):
    """The run of a packet on a plate whose border is held."""
    phases, amplitude, found = spectrum(lattice, centre)
    main = bands(lattice, [centre], shapes=True).shapes[0, 0, 0]
    shape, w = found.shapes[:, 0, 0], found.frequencies[:, 0]
    shape = shape * np.exp(-1j * np.angle(shape @ main.conj()))[:, None]
    cells = np.stack(np.meshgrid(*[np.arange(sites)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    turned = np.exp(1j * ((cells - start) @ phases.T)) * amplitude
    u, v = (turned @ shape).real, (turned @ (-1j * w[:, None] * shape)).real
    scene, scale = lattice.network((sites, sites), forces=forces), SIZE / np.abs(u).max()
    u, v = scale * u, scale * v
    u[list(scene.held)] = v[list(scene.held)] = 0.0
    record = Record(interval=t_end / (ROWS - 1))
    return simulate(scene, State(u, v), t_end, tol=1e-7, record=record)


@cache
def followed(density):
    """A run of a packet, and its predicted velocity."""
    lattice = plate(density)
    centre = carrier(lattice)
    expected = velocity(lattice, centre)
    t_end = TRAVEL / float(np.linalg.norm(expected))
    return launched(lattice, centre, SITES, START, t_end), expected


@cache
def turned(ramp=RAMP):
    """A run in which the prestress changes at half its time, within some seconds; both velocities.

    Natural lengths that change add to each member a tension that does not depend on its length.
    """
    soft, firm = (plate(q) for q in CHANGED)
    centre = carrier(soft)
    expected = velocity(soft, centre), velocity(firm, centre, soft)
    half = LONGER / 2 / float(np.linalg.norm(expected[0]))
    before, after = (lattice.network((LARGER, LARGER)) for lattice in (soft, firm))
    rest, (t, gain) = np.zeros(before.shape), sp.symbols("t gain")
    gained = {"gain": after.bond_tension(rest) - before.bond_tension(rest)}
    grown = Force(gain * (1 + sp.erf((t - half) / ramp)) / 2, on="bonds", parameters=gained)
    return launched(soft, centre, LARGER, THERE, 2 * half, (grown,)), expected


def centres(run):
    """Centres of kinetic energy [m], (rows, 2)."""
    energy = np.sum(run.v**2, axis=2)
    return energy @ run.scene.positions / energy.sum(axis=1)[:, None]


def angle(direction):
    return float(np.degrees(np.arctan2(direction[1], direction[0])))


def angles(run, expected, rows=(0, -1)):
    """The direction of a run between two rows and the expected one [degrees]."""
    path = centres(run)
    return angle(path[rows[1]] - path[rows[0]]), angle(expected)


def data():
    tables, found = {}, []

    def follow(run, path, at_end):
        tables[path] = dict(zip("xy", centres(run).T, strict=True))
        tables[at_end] = {"kinetic energy": np.sum(run.v[-1] ** 2, axis=1)}

    for q in DENSITIES:
        (run, velocity), lattice = followed(q), plate(q)
        alone = bands(lattice, [carrier(lattice)], velocities=True).velocities[0, 0]
        seen, expected = angles(run, velocity)
        found.append({"force density": q, "run": seen, "spectrum": expected,
                      "carrier": angle(alone), "energy error": run.energy_error})  # fmt: skip
        follow(run, f"path at {q}", f"map at {q}")
    tables["angles"] = arrays(found)
    run, velocities = turned()
    follow(run, "changed path", "changed map")
    found = [angles(run, *leg) for leg in zip(velocities, LEGS, strict=True)]
    tables["changed"] = dict(zip(("run", "spectrum"), np.array(found).T, strict=True))
    return tables


def draw(figure, tables):
    """The path of each packet, and its energy at the end."""
    figure.set_size_inches(9, 9)
    shown = {f"prestress {q} N/m: {x:.2f}°": (f"path at {q}", f"map at {q}")
             for q, x in zip(DENSITIES, tables["angles"]["run"], strict=True)}  # fmt: skip
    legs = "changed on the way: {:.1f}°, then {:.1f}°".format(*tables["changed"]["run"])
    shown[legs] = "changed path", "changed map"
    for ax, (words, (path, at_end)) in zip(figure.subplots(2, 2).flat, shown.items(), strict=True):
        energy = tables[at_end]["kinetic energy"]
        side = round(len(energy) ** 0.5)
        ax.imshow(energy.reshape(side, side).T, origin="lower", cmap="Blues")
        ax.plot(*tables[path].values(), "C3", lw=1.5)
        ax.set(xlabel="cell along the rows", ylabel="cell across the rows", title=words)


def animate(tables, path):
    tensegrity.animate(turned()[0], path, "speed", frames=ROWS)


def table(tables):
    for q, run, expected, alone, error in zip(*tables["angles"].values(), strict=True):
        yield {"plate": f"force density {q:g} N/m", "run [deg]": float(run),
               "spectrum [deg]": float(expected), "carrier [deg]": float(alone),
               "energy error": float(error)}  # fmt: skip
    for leg, run, expected in zip(("before", "after"), *tables["changed"].values(), strict=True):
        yield {"plate": f"{CHANGED[0]:g} to {CHANGED[1]:g} N/m on the way, {leg}",
               "run [deg]": float(run), "spectrum [deg]": float(expected)}  # fmt: skip
