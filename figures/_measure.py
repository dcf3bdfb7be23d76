"""Numbers measured in runs, each with an error estimated from a second resolution."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from tensegrity import Chain, Record, State, arrival, duration, simulate, speed

SHOWN_SITES, SHOWN_INSTANTS = 200, 200  # at most, of a space-time density
FAINTEST = 1e-5  # of the largest energy of a site: below it is shown as that


class Scene(NamedTuple):
    """Arguments of `simulate`: a chain, its state and the duration [s]."""

    chain: Chain
    state: State
    duration: float


class Number(NamedTuple):
    """A measured number and the error of its method."""

    value: float
    error: float


def resolved(scene, read, interval, sites=None, step=None, quiet=0.0):
    """Run a scene twice, the second time with half the step.

    Parameters
    ----------
    scene : Scene
    read : callable
        read(run) gives {name: float}.  The finer run is also recorded twice as densely, so that
        the error estimate includes the sampling.
    interval : float
        Largest time between recorded instants of the coarser run [s].
    sites : sequence of int, optional
        To record; by default all.
    step : float, optional
        Largest step of the coarser run [s]; by default what `simulate` takes for its first part.
    quiet : float, optional
        Time at first that is not recorded [s]; the run that is read counts time from there.

    Returns
    -------
    run : Run
        The finer one.
    numbers : {name: Number}
        The error is the difference of the two runs.
    """
    every = math.ceil(interval / (step or default_step(scene)))
    dt, record = interval / every, Record(every=every, sites=sites)
    coarse, first = _run(scene, dt, record, quiet)
    fine, second = _run(scene, dt / 2, record, quiet)
    before, now = read(coarse), read(fine)
    numbers = {k: Number(now[k], abs(now[k] - before[k])) for k in now}
    return fine, numbers | {"energy error": Number(second, first)}


def _run(scene, dt, record, quiet):
    """A run of a scene, recorded after the quiet time, and its energy error from the start."""
    state, head = scene.state, 0.0
    if quiet:
        nothing = Record(every=math.ceil(quiet / dt) + 1, sites=[0])
        skipped = simulate(scene.chain, state, quiet, method="rkn6", dt=dt, record=nothing)
        state, head = skipped.final, skipped.energy_error
    run = simulate(scene.chain, state, scene.duration - quiet, method="rkn6", dt=dt, record=record)
    return run, max(head, run.energy_error)


def default_step(scene):
    """The default step of `simulate` [s], from the first part of a run."""
    first = simulate(scene.chain, scene.state, scene.duration / 20, method="rkn6")
    return min(first.dt, scene.duration)


def density(run):
    """Space-time density of energy as a table; see `density_table`."""
    return density_table(run.t, run.scene.site_energy(run))


def density_table(t, energy):
    """Space-time density of energy: the time, and the energy of each shown site over the largest.

    Parameters
    ----------
    t : ndarray, (T,)
        [s]
    energy : ndarray, (T, sites)
        [J]

    Returns
    -------
    dict
        {"time": (T,), "<site>": (T,), ...}; sites in groups hold the mean of the group.
    """
    rows = np.unique(np.linspace(0, len(t) - 1, SHOWN_INSTANTS).round().astype(int))
    group = -(-energy.shape[1] // SHOWN_SITES)
    whole = energy.shape[1] // group * group
    energy = energy[rows, :whole].reshape(len(rows), -1, group).mean(axis=2)
    fraction = np.maximum(energy / energy.max(), FAINTEST)
    places = (np.arange(energy.shape[1]) + 0.5) * group - 0.5
    columns = {f"{x:g}": rounded(column) for x, column in zip(places, fraction.T, strict=True)}
    return {"time": rounded(t[rows], 6), **columns}


def rounded(values, digits=4):
    """Values rounded to the digits that a picture shows."""
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


def peak(run, bond, after=0.0):
    """Instant [s] at which the leading pulse passes a bond, and its peak elongation [m]."""
    instant, left = arrival(run, bond, after=after), run.sites.index(bond)
    elongation, rate = (np.diff(x[:, left : left + 2])[:, 0] for x in (run.u, run.v))
    return instant, float(CubicHermiteSpline(run.t, elongation, rate)(instant))


def leader(run, bonds, after=0.0):
    """Speed of the leading pulse between two bonds [sites/s, > 0 either way], and its peak
    elongation at the second one [m]."""
    (near, _), (far, amplitude) = (peak(run, bond, after) for bond in bonds)
    return abs(bonds[1] - bonds[0]) / (far - near), amplitude


def launched_width(wave, travel=60):
    """Width at 5 % of an exact wave that has run along a chain, with its error."""
    reach = int(wave.reach()) + 2
    bond = 2 * reach + travel
    chain = Chain(wave.potential, bond + 2 * reach + 2, wave.mass)
    scene = Scene(chain, wave.launch(chain, at=reach), (bond + reach) / wave.speed)
    sites = [bond - 20, bond - 19, bond, bond + 1]

    def width(run):
        return {"width": duration(run, bond) * speed(run, (bond - 20, bond))}

    return resolved(scene, width, 0.05 / wave.speed, sites)[1]["width"]
