"""Prestress and preload tune the speed and width of waves, even during their propagation."""

import math

import numpy as np

import tensegrity as ts
from figures import _measure, _scenes
from figures._measure import Number, row
from figures._tables import arrays

GROUP = "waves"

UNITS = {"sound speed": "sites/s", "wave speed": "sites/s", "width": "sites", "impedance": "kg/s"}
MAPS = {  # members besides base 1 m, k_cross 1 N/m; amplitude [m]; prestrains; preloads [N]
    "stiffening": (
        {"height": 0.8}, -0.02, np.geomspace(1e-3, 0.3, 8), np.linspace(0, 0.1, 6),
    ),
    "softening": (
        {"height": 0.5, "k_base": 2.0, "k_bar": 20.0}, 0.02,
        np.linspace(0.1, 0.5, 6), np.linspace(0, 0.12, 6),
    ),
}  # fmt: skip

HEIGHT, BEFORE, AFTER = 0.8, 0.02, 0.1  # prestrains between which the cross strings are drawn in
RATIO = 1.5  # of the wave, over the speed of sound before
RAMPS = {"slow": 6.0, "quick": 0.5}  # s: the prestrain goes with erf(time/this)
WINDOW = 11  # of these times, to both sides together: erf is constant outside, to round-off
START, LEAD = 40, 50.0  # site; s before the change
AFTERWARDS = 70.0  # s
TIMED = (55, 80), (60, 110)  # bonds before; bonds from where the peak is after the change
STEP = 0.1  # s


def characteristics(prism, preload, amplitude):
    """Sound speed, speed and width of the wave of a peak, impedance; nan where there is none.

    There is none beyond the limit point, and no wave where the bars meet before that peak.

    Returns
    -------
    tuple
        In the order of `UNITS`, for masses of 1 kg.
    """
    try:
        spring = prism.potential(preload)
    except ts.EquilibriumError:
        return (math.nan,) * 4  # beyond the limit point
    sound = spring.sound_speed()
    impedance = math.sqrt(float(spring.stiffness(0.0)))
    try:
        wave = ts.solitary_wave(spring, amplitude=amplitude)
    except ts.LockingError:
        return sound, math.nan, math.nan, impedance
    return sound, wave.speed, wave.width(), impedance


def chart(members, amplitude, prestrains, preloads):
    """The characteristics over prestrain and preload, as columns."""
    rows = []
    for prestrain in prestrains:
        prism = ts.Prism(base=1.0, prestrain=prestrain, k_cross=1.0, **members)
        for preload in preloads:
            found = zip(UNITS, characteristics(prism, preload, amplitude), strict=True)
            rows.append({"prestrain": prestrain, "preload": preload, **dict(found)})
    return arrays(rows)


def drawn_in(ramp):
    """The prism's spring over time, its cross strings drawn in about WINDOW/2 ramps."""
    import sympy as sp

    done = (1 + sp.erf(sp.Symbol("t") / ramp - WINDOW / 2)) / 2
    return _scenes.rigid(HEIGHT, BEFORE).over_time(prestrain=BEFORE + (AFTER - BEFORE) * done)


def tuned(ramp, dt, ratio=RATIO):
    """A wave before, during and after the change: three runs, the middle one with its work."""
    spring = drawn_in(ramp)
    wave = ts.solitary_wave(spring.at(0.0), speed_ratio=ratio)
    fast = 1.6 * wave.speed  # sites/s, more than the wave has after the change
    sites = round(START + wave.speed * LEAD + fast * (WINDOW * ramp + AFTERWARDS))
    scene = _scenes.launched(wave, sites, START, 1)
    record = ts.Record(every=max(1, round(0.2 / dt)))
    how = {"method": "rkn6", "dt": dt, "record": record}
    before, change = ts.simulate(scene.chain, scene.state, LEAD, **how), WINDOW * ramp
    during = ts.simulate(of_spring(scene.chain, spring), before.final, change, **how)
    last = of_spring(scene.chain, spring.at(change))
    return before, during, ts.simulate(last, during.final, AFTERWARDS, **how)


def of_spring(chain, spring):
    """The same chain with another spring, perhaps one that changes."""
    return ts.Chain(spring, chain.sites, chain.mass, chain.ends)


def outcome(before, during, after):
    """Speeds before and after, and what the wave holds at last.

    Returns
    -------
    dict
        before, after: speeds [sites/s]; peak: elongation over that of the exact wave of that
        speed, less 1; fraction: of the energy at last, in that wave; work: done by the change, over
        the energy at first; momentum: its largest change, relative; energy: largest deviation of
        energy - work, over the energy at first.
    """
    start = int(ts.pulses(after, 0, fraction=0.5)[-1].place - 0.5)
    now, elongation = _measure.leader(after, [start + bond for bond in TIMED[1]])
    wave = ts.solitary_wave(after.scene.springs[0], speed=now)
    first, work = before.energy[0], during.work[-1]
    momenta = np.concatenate([run.v @ run.scene.mass for run in (before, during, after)])
    gaps = (before.energy, during.energy - during.work, after.energy - work)
    return {
        "before": ts.speed(before, TIMED[0]),
        "after": now,
        "peak": elongation / wave.amplitude - 1,
        "fraction": float(wave.energy / after.energy[-1]),
        "work": float(work / first),
        "momentum": float(np.abs(momenta / momenta[0] - 1).max()),
        "energy": float(max(np.abs(gap - first).max() for gap in gaps) / first),
    }


def densities(before, during, after, spring):
    """Density of energy through all three runs, in the springs of each instant."""
    rows = [before.scene.site_energy(before)]
    for t, u, v in zip(during.t, during.u, during.v, strict=True):
        rows.append(of_spring(during.scene, spring.at(t)).site_energy(ts.State(u, v))[None])
    rows.append(after.scene.site_energy(after))
    t = np.concatenate([before.t, LEAD + during.t, LEAD + during.t[-1] + after.t])
    return _measure.density_table(t, np.concatenate(rows))


def data():
    """Maps; numbers and densities of the changes while a wave travels."""
    tables = {f"{name} map": chart(*given) for name, given in MAPS.items()}
    for name, ramp in RAMPS.items():
        coarse, runs = tuned(ramp, STEP), tuned(ramp, STEP / 2)
        before, now = outcome(*coarse), outcome(*runs)
        found = {key: Number(now[key], abs(now[key] - before[key])) for key in now}
        tables[name] = _measure.as_table(found)
    tables["quick density"] = densities(*runs, drawn_in(ramp))
    return tables


def draw(figure, tables):
    """Speed of waves over prestrain and preload; a wave during a change."""
    figure.set_size_inches(9, 7)
    axes = figure.subplot_mosaic([[*MAPS], ["change"] * 2])
    for name, given in MAPS.items():
        columns, ax, shape = tables[f"{name} map"], axes[name], (len(given[2]), len(given[3]))
        grid = [np.reshape(columns[key], shape) for key in ("prestrain", "preload", "wave speed")]
        image = ax.pcolormesh(*grid, cmap="viridis", shading="nearest")
        ax.grid(False)
        ax.set_xscale("log" if name == "stiffening" else "linear")
        ax.set(xlabel="prestrain", ylabel="preload [N]")
        ax.set_title(f"{name}: speed of a wave of {given[1]:g} m")
        figure.colorbar(image, ax=ax, label="sites/s")
    words = f"cross strings drawn in at {LEAD + WINDOW / 2 * RAMPS['quick']:.3g} s"
    _measure.draw_density(axes["change"], tables["quick density"], words)


def table(tables):
    """Rows for the table of the group."""
    for name, (_, peak, prestrains, preloads) in MAPS.items():
        columns = tables[f"{name} map"]
        ranges = [f"{q} {np.nanmin(columns[q]):.3f} to {np.nanmax(columns[q]):.3f} {unit}"
                  for q, unit in UNITS.items()]  # fmt: skip
        found = ", ".join(ranges)
        count = len(columns["preload"])
        none, locked = (int(np.isnan(columns[q]).sum()) for q in ("sound speed", "wave speed"))
        if none:
            found += f"; {none} of {count} beyond the limit point"
        if locked > none:
            found += f"; {locked - none} of {count} have no wave of that peak (white): "
            found += "their bars meet before"
        scene = f"{name} prism, prestrain {prestrains[0]:g} to {prestrains[-1]:g}, preload 0 to "
        scene += f"{preloads[-1]:g} N, peak {peak:g} m"
        claim = "wave properties tunable by local and global prestress"
        yield row(scene, claim, found, "residual of the waves, 1e-12")
    for name, ramp in RAMPS.items():
        numbers = _measure.from_table(tables[name])
        of = {key: number.value for key, number in numbers.items()}
        scene = f"prestrain {BEFORE:g} to {AFTER:g} while a wave travels, {name} ({ramp:g} s)"
        found = (
            f"speed {of['before']:.6f} to {of['after']:.6f} sites/s, with {of['fraction']:.4f} of "
            f"the energy; peak that of the exact wave to {abs(of['peak']):.0e}; work "
            f"{of['work']:.4f} of the energy at first; energy less work closes to "
            f"{of['energy']:.0e}, momentum to {of['momentum']:.0e}"
        )
        error = max(numbers["before"].error, numbers["after"].error)
        yield row(scene, "adjusted on the fly", found, error)
