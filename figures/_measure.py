"""Numbers read off runs, each with the error that a second resolution shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from tensegrity import Chain, Record, State, simulate
from tensegrity.observables import passage, speed

SHOWN_SITES, SHOWN_INSTANTS = 200, 200  # at most, of a space-time density
FAINTEST = 1e-5  # of the largest energy of a site: below it is shown as that


class Scene(NamedTuple):
    """What `simulate` needs: a chain, its state and how long it is followed [s]."""

    chain: Chain
    state: State
    duration: float


class Number(NamedTuple):
    """A measured number and the error of its method."""

    value: float
    error: float


def resolved(scene, read, interval, sites=None):
    """Run a scene twice, the second time with half the step.

    Parameters
    ----------
    scene : Scene
    read : callable
        read(run) gives {name: float}.  The finer run also is recorded twice as densely, so that
        the error of reading it shows too.
    interval : float
        Largest time between recorded instants of the coarser run [s].
    sites : sequence of int, optional
        To record; by default all.

    Returns
    -------
    run : Run
        The finer one.
    numbers : {name: Number}
        The error is the difference of the two runs.
    """
    dt = default_step(scene)
    dt = interval / max(round(interval / dt), 1) if dt < interval else interval
    record = Record(every=max(round(interval / dt), 1), sites=sites)
    coarse = simulate(*scene, method="rkn6", dt=dt, record=record)
    fine = simulate(*scene, method="rkn6", dt=dt / 2, record=record)
    before, now = read(coarse), read(fine)
    numbers = {k: Number(now[k], abs(now[k] - before[k])) for k in now}
    return fine, numbers | {"energy error": Number(fine.energy_error, coarse.energy_error)}


def default_step(scene):
    """The step that `simulate` takes by itself [s], from the first part of a run."""
    first = simulate(scene.chain, scene.state, scene.duration / 20, method="rkn6")
    return min(first.dt, scene.duration)


def density(run):
    """Space-time density of energy as a table: the time and each shown site's energy.

    Parameters
    ----------
    run : Run
        With all sites recorded.

    Returns
    -------
    dict
        {"time": (T,), "<site>": (T,), ...}; sites in groups hold the mean of the group.
    """
    rows = np.unique(np.linspace(0, len(run.t) - 1, SHOWN_INSTANTS).round().astype(int))
    energy = run.scene.site_energy(run.u[rows], run.v[rows])
    group = -(-energy.shape[1] // SHOWN_SITES)
    whole = energy.shape[1] // group * group
    energy = energy[:, :whole].reshape(len(rows), -1, group).mean(axis=2)
    share = np.maximum(energy / energy.max(), FAINTEST)
    places = (np.arange(energy.shape[1]) + 0.5) * group - 0.5
    columns = {f"{x:g}": rounded(column) for x, column in zip(places, share.T, strict=True)}
    return {"time": rounded(run.t[rows], 6), **columns}


def rounded(values, digits=4):
    """Values with that many digits: what a picture needs."""
    return np.array([float(f"{x:.{digits}g}") for x in values])


def draw_density(axes, table, title=None):
    """The table of `density` with logarithmic colours."""
    from matplotlib.colors import LogNorm

    names = [name for name in table if name != "time"]
    image = axes.pcolormesh(
        np.array(names, dtype=float),
        table["time"],
        np.stack([table[name] for name in names], axis=1),
        norm=LogNorm(FAINTEST, 1),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    axes.grid(False)
    axes.set(xlabel="site", ylabel="time [s]")
    axes.figure.colorbar(image, ax=axes, label="energy per site / largest")
    if title:
        axes.set_title(title, fontsize=10)


def row(scene, claim, measured, error):
    """A row of the group's table."""
    return {
        "scene": scene,
        "claim in the talk": claim,
        "measured": measured,
        "method error": error if isinstance(error, str) else f"{error:.1g}",
    }


def as_table(numbers):
    """{name: Number} as columns."""
    return {
        "quantity": list(numbers),
        "value": [n.value for n in numbers.values()],
        "error": [n.error for n in numbers.values()],
    }


def from_table(table):
    """Back from `as_table`."""
    rows = zip(table["quantity"], table["value"], table["error"], strict=True)
    return {name: Number(float(value), float(error)) for name, value, error in rows}


def passing_width(run, bond, level=0.05):
    """Width in sites of the wave that passes a bond: its speed times the time above a level."""
    left = run.sites.index(bond)
    r, rate = (np.diff(x[:, left : left + 2])[:, 0] for x in (run.u, run.v))
    crest = float(CubicHermiteSpline(run.t, r, rate)(passage(run.t, r, rate)))
    above = CubicHermiteSpline(run.t, r / crest - level, rate / crest).roots(extrapolate=False)
    return (above[-1] - above[0]) * speed(run, (bond - 20, bond))


def launched_width(wave, travel=60):
    """Width at 5 % of an exact wave that has run along a chain, with its error."""
    reach = int(wave.reach()) + 2
    bond = 2 * reach + travel
    scene = Scene(chain := Chain(wave.potential, bond + 2 * reach + 2, wave.mass),
                  wave.launch(chain, at=reach), (bond + reach) / wave.speed)  # fmt: skip
    sites = [bond - 20, bond - 19, bond, bond + 1]
    return resolved(scene, lambda run: {"width": passing_width(run, bond)}, 0.02 / wave.speed,
                    sites)[1]["width"]  # fmt: skip
