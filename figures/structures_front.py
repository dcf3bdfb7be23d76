"""Optic waves run ahead in struck octahedra; displacement follows at the speed of sound.

All nodes of one layer are struck along its normal.  In the endless lattice small motion is a sum of
its Bloch waves.  The displacement that the blow leaves behind spreads with the longitudinal waves
of the moduli.  Waves of a higher branch, whose group velocity is larger, arrive before it, and no
speed bounds the first traces, which are small.  Runs of a finite lattice agree until its held
border is felt; harder blows slacken strings, and their front is slower.
Source: the talk, "impact protection".
"""

import numpy as np

from figures._draw import note
from figures.structures_struck import KINDS, normal, octahedra
from tensegrity import Record, State, bands, moduli, simulate

GROUP = "structures"

LINE, LONG, FAR = 800, 720.0, (24, 48, 96, 144)  # cells; s; cells from the struck one
SMALL = 1e-4  # of the blow's speed: the head
COUNTS, STRUCK, NEAR = (11, 11, 11), 3, (1, 2, 3, 4)  # cells; layer; layers from it
BLOWS, AFTER, STEP = (1e-3, 0.03), 14.0, 0.04  # m/s, s, s
SHOWN = (60.0, 120.0, 240.0)  # s


def lattice():
    return octahedra(KINDS[0])


def sound_speed():
    """Longitudinal speed along the normal [m/s]."""
    cell = lattice()
    return float(moduli(cell).speeds(normal(cell)[0])[-1])


def group(points=2000):
    """Frequencies and group velocities along the normal of waves along it, (points, branches)."""
    cell = lattice()
    phases = np.zeros((points, 3))
    phases[:, 2] = np.linspace(0.01, np.pi, points)
    found = bands(cell, phases, velocities=True)
    return found.frequencies, np.abs(found.velocities @ normal(cell)[0])


def summed(times, cells=LINE):
    """Mean displacement along the normal [s] and velocity, of unit speed at first, of each layer of
    the endless lattice, (times, cells)."""
    cell = lattice()
    phases = np.zeros((cells, 3))
    phases[:, 2] = 2 * np.pi * np.fft.fftfreq(cells)
    found = bands(cell, phases, shapes=True)
    blow = np.tile(normal(cell)[0], (cell.nodes, 1)).ravel()
    part = np.abs(found.shapes.reshape(*found.frequencies.shape, -1) @ blow) ** 2 / cell.nodes
    w = found.frequencies
    u, v = [], []
    for t in times:  # the limit t of sin(w t)/w for the translation
        u.append(np.fft.ifft(np.sum(part * t * np.sinc(w * t / np.pi), axis=1)).real)
        v.append(np.fft.ifft(np.sum(part * np.cos(w * t), axis=1)).real)
    return np.array(u), np.array(v)


def left():
    """Displacement that a blow of unit speed leaves behind in the endless lattice [s]."""
    return normal(lattice())[1] / (2 * sound_speed())


def arrivals(t, rows, level):
    """When each column first reaches a level [s], between rows."""
    found = []
    for y in rows.T:
        k = int(np.argmax(y > level))
        found.append(np.interp(level, y[k - 1 : k + 1], t[k - 1 : k + 1]))
    return np.array(found)


def struck(speed):
    """Times, and mean displacement along the normal over the speed of layers from the struck one
    [s], in the middle of a finite lattice; and the run."""
    cell = lattice()
    scene, n = cell.network(COUNTS), normal(cell)[0]
    at = np.stack(np.unravel_index(np.arange(scene.sites) // cell.nodes, COUNTS), axis=1)
    free = np.ones(scene.sites, dtype=bool)
    free[list(scene.held)] = False
    v = np.where(((at[:, 2] == STRUCK) & free)[:, None], speed * n, 0.0)
    run = simulate(scene, State(np.zeros_like(v), v), AFTER, dt=STEP, method="corrected6",
                   record=Record(interval=0.25))  # fmt: skip
    middle = (at[:, :2] == np.array(COUNTS[:2]) // 2).all(axis=1)
    layers = [middle & (at[:, 2] == STRUCK + k) for k in NEAR]
    u = np.stack([(run.u[:, one] @ n).mean(axis=1) for one in layers], axis=1)
    return run.t, u / speed, run


def data():
    t, far = np.arange(0.0, LONG, 0.5), list(FAR)
    u, v = summed(t)
    half, head = arrivals(t, u[:, far], left() / 2), arrivals(t, v[:, far], SMALL)
    tables = {"far": {"cell": np.array(FAR), "half the displacement [s]": half, "head [s]": head}}
    tables["layers"] = {"place [m]": normal(lattice())[1] * np.arange(120)}
    for when in SHOWN:
        tables["layers"][f"at {when:g} s"] = v[int(np.searchsorted(t, when)), :120]
    w, along = group(400)
    tables["group"] = {"frequency": w.ravel(), "velocity": along.ravel()}
    for speed in BLOWS:
        t, u, run = struck(speed)
        tables[f"run at {speed:g} m/s"] = {"t": t} | dict(zip(map(str, NEAR), u.T, strict=True))
        tables[f"run at {speed:g} m/s"]["energy error"] = np.full(len(t), run.energy_error)
    u, _ = summed(t, 64)
    tables["sum"] = {"t": t} | {str(k): u[:, k] for k in NEAR}
    return tables


def draw(figure, tables):
    """Layers at three times; group velocities; displacements of runs on those of the sum."""
    figure.set_size_inches(11, 4.2)
    layers, group_of, runs = figure.subplots(1, 3)
    c, fastest = sound_speed(), tables["group"]["velocity"].max()
    x, *shown = tables["layers"].values()
    for k, (when, v) in enumerate(zip(SHOWN, shown, strict=True)):
        up = 0.4 * (len(SHOWN) - 1 - k)
        layers.plot(x, v + up, f"C{k}", lw=1)
        layers.annotate(f"{when:g} s", (x[-1], up + 0.04), color=f"C{k}", ha="right")
        layers.plot(2 * [c * when], [up - 0.05, up + 0.12], "k--", lw=1)
        layers.plot(2 * [fastest * when], [up - 0.05, up + 0.12], "C3:", lw=1.5)
    layers.set(xlabel="place [m]", ylabel="velocity over that of the blow (shifted)")
    layers.set_title("layers; dashed: sound, dotted: fastest")
    group_of.plot(*tables["group"].values(), ".", color="C0", ms=2)
    group_of.axhline(c, color="k", ls="--", lw=1)
    group_of.annotate(f"sound, {c:.3f} m/s", (1.45, c + 0.006))
    group_of.annotate(f"fastest, {fastest:.3f} m/s", (0.65, fastest - 0.004), color="C3")
    group_of.set(xlabel="frequency [rad/s]", ylabel="group velocity [m/s]")
    group_of.set(xlim=(0, 2.6), ylim=(0, 0.38), title="waves along the normal")
    for k in NEAR:
        runs.plot(tables["sum"]["t"], tables["sum"][str(k)], "0.6", lw=3)
        for speed, style in zip(BLOWS, ("C0-", "C3-"), strict=True):
            own = tables[f"run at {speed:g} m/s"]
            runs.plot(own["t"], own[str(k)], style, lw=1)
    words = "grey: endless lattice\nblue: run, 1 mm/s\nred: run, 3 cm/s"
    note(runs, words, (0.03, 0.8), inside=True)
    runs.set(xlabel="time [s]", ylabel="displacement over speed of the blow [s]")
    runs.set_title(f"layers {NEAR[0]} to {NEAR[-1]} after the struck one")


def table(tables):
    cell, *times = tables["far"].values()
    way = np.diff(cell) * normal(lattice())[1]
    yield {"wave": "longitudinal sound", "speed [m/s]": sound_speed()}
    fastest = float(tables["group"]["velocity"].max())
    yield {"wave": "largest group velocity along the normal", "speed [m/s]": fastest}
    levels = "half the displacement", f"{SMALL:g} of the blow's speed"
    for k, speeds in enumerate(zip(*(way / np.diff(t) for t in times), strict=True)):
        for words, speed in zip(levels, speeds, strict=True):
            wave = f"{words}, from cell {cell[k]} to {cell[k + 1]}"
            yield {"wave": wave, "speed [m/s]": float(speed)}
    for speed in BLOWS:
        own = tables[f"run at {speed:g} m/s"]
        off = max(np.abs(own[str(k)] - tables["sum"][str(k)]).max() for k in NEAR)
        yield {"wave": f"run at {speed:g} m/s",
               "off the sum, over what is left": float(off / left()),
               "energy error": float(own["energy error"][0])}  # fmt: skip
