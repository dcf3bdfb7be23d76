"""A gap stops waves in a lattice, and slack strings limit the force behind a blow.

Resonators in a frame are shaken along one edge: what is transmitted is held against the decay per
cell of `decay`.  Octahedra of little prestress are struck on a face: strings slacken, and the force
behind is held against that of the same lattice with members that never do.
Source: the talk, "stop-bands", "impact protection".
"""

import numpy as np
import sympy as sp

from figures._files import lines
from figures._tables import arrays
from tensegrity import Damping, Drive, Lattice, Record, State, catalogue, decay, simulate

GROUP = "structures"

CELLS, FAR, STRENGTH = 40, 25, 0.6  # cells either way; the first one with dashpots; N s/m
RAMP, END, DT, SIZE = 40.0, 300.0, 0.04, 1e-3  # s, s, s, m
FREQUENCIES = (0.9, 1.4, 1.7)  # rad/s
FITTED = (2, 12)  # cells between which the decay is read
LAYERS, PRESTRAIN, BLOWS = 6, 0.01, (0.003, 0.01, 0.03, 0.1)  # m/s
AFTER, STEP, FINE = 60.0, 0.02, 0.01  # s
KINDS = ("strings that slacken", "members that never do")


def resonators():
    return catalogue.resonators(k_bar=20.0, k_diagonal=5.0, masses=(1.0, 2.0))


def amplitudes(frequency):
    """Largest displacement of the frame along the middle row over that of the edge, by cell."""
    t, cell = sp.Symbol("t"), resonators()
    x = cell.tile((CELLS, CELLS)).positions
    grown = 1 - sp.exp(-((t / RAMP) ** 2))
    shaken = Drive(displacement=(SIZE * grown * sp.sin(frequency * t), 0))
    ground = STRENGTH * np.clip((x[:, 0] - FAR) / (CELLS - FAR), 0, None) ** 2
    edge = dict.fromkeys(np.flatnonzero(x[:, 0] < 1e-9).tolist(), shaken)
    scene = cell.network((CELLS, CELLS), damping=Damping(ground=ground), drive=edge)
    times = np.linspace(END - 6 * np.pi / frequency, END, 60)
    run = simulate(scene, scene.at_rest(), END, method="verlet", dt=DT, record=Record(times=times))
    row = [int(np.abs(x - [n, CELLS // 2]).sum(axis=1).argmin()) for n in range(FAR)]
    return np.abs(run.u[:, row, 0]).max(axis=0) / SIZE


def octahedra(kind):
    """The lattice, or one of the same members that all carry compression too."""
    cell = catalogue.octahedra(k_bar=20.0, prestrain=PRESTRAIN)
    if kind == KINDS[0]:
        return cell
    members = [(i, j, tuple(o)) for (i, j), o in zip(cell.ends, cell.offsets, strict=True)]
    return Lattice(cell.positions, cell.vectors, members, k_bar=cell.stiffnesses,
                   natural_lengths=cell.natural_lengths)  # fmt: skip


def normal(cell):
    """Of the layers, and their distance [m]."""
    n = np.cross(*cell.vectors[:2])
    n *= np.sign(n @ cell.vectors[2]) / np.linalg.norm(n)
    return n, float(n @ cell.vectors[2])


def struck(kind, speed, step=STEP, method="corrected6"):
    """Largest force on the held nodes behind [N], and fraction of slack strings, of a blow."""
    lattice = octahedra(kind)
    scene = lattice.network((LAYERS,) * 3)
    n, _ = normal(lattice)
    layer = np.arange(scene.sites) // lattice.nodes % LAYERS
    held = np.isin(np.arange(scene.sites), scene.held)
    v = np.where(((layer == 0) & ~held)[:, None], speed * n, 0.0)
    run = simulate(scene, State(np.zeros_like(v), v), AFTER, method=method, dt=step,
                   record=Record(interval=0.25))  # fmt: skip
    behind = np.isin(scene.bonds, np.flatnonzero(held & (layer == LAYERS - 1)))
    strings = np.array([getattr(spring, "tension_only", False) for spring in scene.springs])
    force, slack = [], []
    for u in run.u:
        d = np.diff((scene.positions + u)[scene.bonds], axis=1)[:, 0]
        length = np.linalg.norm(d, axis=1)
        pull = scene.bond_tension(u) * (d @ n) / length
        force.append(pull @ (behind[:, 0] * 1.0 - behind[:, 1]))
        slack.append(np.mean(length[strings] < scene.lengths[strings]) if strings.any() else 0.0)
    return {"force [N]": np.abs(np.array(force) - force[0]).max(), "slack": max(slack),
            "energy error": run.energy_error}  # fmt: skip


def data():
    cell = resonators()
    tables = {"transmitted": {"cell": np.arange(FAR)}, "decay": {"frequency [rad/s]": FREQUENCIES}}
    rates = np.abs(decay(cell, FREQUENCIES).imag).min(axis=1)
    fitted = []
    for w in FREQUENCIES:
        found = amplitudes(w)
        tables["transmitted"][f"{w} rad/s"] = found
        inside = slice(*FITTED)
        fitted.append(-np.polyfit(np.arange(FAR)[inside], np.log(found[inside]), 1)[0])
    tables["decay"] |= {"computed": rates, "run": np.array(fitted)}
    for kind in KINDS:
        found = arrays([struck(kind, speed) for speed in BLOWS])
        tables[kind] = {"speed [m/s]": np.array(BLOWS)} | found
    tables["fine"] = arrays([struck(KINDS[0], BLOWS[-1], FINE)])
    return tables


def draw(figure, tables):
    figure.set_size_inches(9, 3.9)
    sent, slack, force = figure.subplots(1, 3)
    cells, *found = tables["transmitted"].values()
    rates = tables["decay"]["computed"]
    for k, (w, values, rate) in enumerate(zip(FREQUENCIES, found, rates, strict=True)):
        sent.semilogy(cells, values, f"C{k}.-", lw=1)
        if rate > 0:
            line = values[FITTED[0]] * np.exp(-rate * (cells - FITTED[0]))
            sent.semilogy(cells, line, "k--", lw=1)
        sent.annotate(f"{w} rad/s", (15, values[15] * (0.4 if not rate else 1.7)), color=f"C{k}")
    sent.set(xlabel="cell from the shaken edge", ylabel="amplitude over that of the edge")
    sent.set_title("waves decay in the gap")
    speed, peak, loose, _ = tables[KINDS[0]].values()
    slack.semilogx(speed, 100 * loose, "C0o-")
    slack.set(xlabel="speed of the blow [m/s]", ylabel="most slack strings [%]")
    slack.set_title("harder blows slacken more")
    rigid = tables[KINDS[1]]["force [N]"]
    force.loglog(speed, rigid, "C3o-", speed, peak, "C0o-")
    words = "members that\nnever slacken"
    force.annotate(words, (speed[1], 2.2 * rigid[1]), color="C3", ha="center")
    force.annotate("strings that\nslacken", (speed[2], 0.55 * peak[2]), color="C0")
    force.set(xlabel="speed of the blow [m/s]", ylabel="largest force behind [N]")
    force.set_title("slackening lowers the force")


def table(tables):
    for w, rate, run in zip(*tables["decay"].values(), strict=True):
        yield {"lattice": f"resonators shaken at {w} rad/s, decay per cell",
               "run": float(run), "computed": float(rate)}  # fmt: skip
    force = "force behind [N]"
    for line, rigid in zip(*(lines(tables[kind]) for kind in KINDS), strict=True):
        speed, peak, slack, error = line.values()
        yield {"lattice": f"octahedra struck at {speed} m/s", force: float(peak),
               "never slack": float(rigid["force [N]"]), "slack": float(slack),
               "energy error": float(error)}  # fmt: skip
    peak, slack, error = (float(value) for (value,) in tables["fine"].values())
    yield {"lattice": f"the last one with steps of {FINE} s", force: peak, "slack": slack,
           "energy error": error}  # fmt: skip
