"""Speeds read every 3 µs scatter by a tenth; located peaks give one ratio, near the paper's.

Fig. 2 of the paper: a single wave splits at the junction of the half guide, all steel.
"""

from __future__ import annotations

import math

import numpy as np

from derivations import contact, junction
from figures import _guide
from figures._guide import STEEL, row
from granular import sensor_force, y_guide
from tensegrity import first_peak, peaks, sampled

NAME = "granular_fig2"
GROUP = "granular"

SPEED = 0.585  # of the striker [m/s]
END = 420e-6  # s
SENSORS = (("stem 1", 12), ("stem 1", 16), ("branch 1", 4), ("branch 1", 8))
PHASES = 300  # of the sampling clock
FAINT = 1e-3  # of the largest: lower peaks are not read
BEYOND = 40e-6  # s after the incident peak: the reflected one is on its way
COARSE = 4  # times the step, with which the ratios must be the same
PRINTED = (0.917, 0.688)  # V_t/V_i and V_r/V_i of the paper's runs
ROUNDED = 6e-4  # they were rounded to three digits


def data(by=1.0):
    """Sensor curves, ratios of speeds and forces, and the speeds that 3 us sampling would give.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    guide = y_guide(bead=STEEL, striker=_guide.light(by * SPEED))
    run = _guide.followed(guide, END, every=2)
    coarse = _guide.followed(guide, END, COARSE * run.dt, every=1)
    numbers = [first_peak(run.t, sensor_force(run, "branch 1", n))[1] for n in range(1, 16)]
    return {
        "curves": _guide.curves(run, SENSORS),
        "peaks": located(run),
        "coarse": located(coarse),
        "settling": {"bead": np.arange(1, 16), "peak [N]": np.array(numbers)},
        "clock": _clock(run),
        "numbers": {
            "energy error": np.array([run.energy_error]),
            "difference of the branches": np.array([_guide.skew(run)]),
            "momentum error": np.array([_guide.momentum_error(run)]),
        },
    }


def _read(run):
    """Forces in the order of the wave's passage, and the time window in which each is read."""
    order = [*SENSORS, ("stem 1", 16), ("stem 1", 12)]
    forces = [sensor_force(run, *sensor) for sensor in order]
    after = first_peak(run.t, forces[1])[0] + BEYOND
    return forces, [(-math.inf, math.inf)] * 4 + [(after, math.inf)] * 2


def located(run):
    """Instants and heights of the incident, the transmitted and the reflected wave's peaks."""
    found = [first_peak(run.t, f, window) for f, window in zip(*_read(run), strict=True)]
    times, heights = np.array(found).T
    way = run.scene.distance("stem 1", (12, 16))
    return {"t [s]": times, "height [N]": heights, "way [m]": np.full(6, way)}


def _clock(run):
    """V_t/V_i and V_r/V_i from the largest samples, for each phase of the clock."""
    phases = np.arange(PHASES) * _guide.CLOCK / PHASES
    forces, windows = _read(run)
    found = []
    for phase in phases:
        read = [
            _largest_sample(*sampled(run.t, f, _guide.CLOCK, phase), window)
            for f, window in zip(forces, windows, strict=True)
        ]
        incident, transmitted, reflected = np.diff(read)[::2]
        found.append((incident / transmitted, incident / reflected))
    transmitted, reflected = np.array(found).T
    return {"phase [s]": phases, "V_t/V_i": transmitted, "V_r/V_i": reflected}


def _largest_sample(times, values, window):
    """Instant of the largest sample within a time."""
    inside = (times >= window[0]) & (times <= window[1])
    return times[inside][np.argmax(values[inside])]


def ratios(tables, step="peaks"):
    """V_i, V_t, V_r [m/s] and F_i, F_t, F_r [N], by located peaks; "coarse": of larger steps."""
    times, way = tables[step]["t [s]"], tables[step]["way [m]"][0]
    return way / np.diff(times)[::2], tables[step]["height [N]"][[1, 2, 4]]


def step_error(tables):
    """Largest relative change of the ratios of speeds and of forces with a larger step."""
    fine, coarse = (
        np.array([x[1:] / x[0] for x in ratios(tables, step)]) for step in ("peaks", "coarse")
    )
    return float(np.max(np.abs(coarse / fine - 1)))


def agreeing(tables):
    """Fraction of the phases at which the sampled ratios are those of the paper."""
    read = np.stack([tables["clock"]["V_t/V_i"], tables["clock"]["V_r/V_i"]])
    return float(np.mean(np.all(np.abs(read.T - PRINTED) < ROUNDED, axis=1)))


def table(tables):
    """Numbers of this figure in the paper and here."""
    (v_i, v_t, v_r), (f_i, f_t, f_r) = ratios(tables)
    share, name = agreeing(tables), "2"
    read = [tables["clock"][k] for k in ("V_t/V_i", "V_r/V_i")]
    spread = [f"{x.min():.3f} to {x.max():.3f}" for x in read]
    settled = tables["settling"]["peak [N]"]
    back, forth = (float(x.subs(junction.waves, 1)) for x in _split_ratios())
    power = float(contact.scalings()[0].subs(contact.exponent, 1.5))
    return [
        row(name, "V_i [m/s]", float(v_i), "", 566.96),
        row(name, "V_t [m/s]", float(v_t), "", 506.64),
        row(name, "V_r [m/s]", float(v_r), "", 415.92),
        row(name, "V_t/V_i", float(v_t / v_i), PRINTED[0], 0.894),
        row(name, "V_r/V_i", float(v_r / v_i), PRINTED[1], 0.734),
        row(name, "V_t/V_i read every 3 us, over phases", spread[0], PRINTED[0]),
        row(name, "V_r/V_i read every 3 us, over phases", spread[1], PRINTED[1]),
        row(name, "fraction of phases that give the paper's pair", share),
        row(name, "F_i/F_t", float(f_i / f_t), 1.6, 2),
        row(name, "F_i/F_t by eq. (7)", forth**-power, 1.6),
        row(name, "F_i/F_r", float(f_i / f_r), 6.9, 8.4),
        row(name, "F_i/F_r by eq. (7)", back**-power, 6.9),
        row(name, "peak at bead 1 of the branch over bead 15", float(settled[0] / settled[14])),
        row(name, "the same at bead 4", float(settled[3] / settled[14]), "settled"),
        row(name, "largest other peak in stem 1 over the incident one", others(tables)),
        row(name, "change of these ratios with a step of 0.4 us, not 0.1 us", step_error(tables)),
        row(
            name, "difference of both branches", _guide.number(tables, "difference of the branches")
        ),
        *_guide.balances(name, tables),
    ]


def others(tables):
    """Highest peak in stem 1 besides the incident and the reflected one, over the incident one."""
    curves = tables["curves"]
    found = []
    for part, bead in SENSORS[:2]:
        heights = np.sort(peaks(curves["t [s]"], curves[f"{part} {bead} [N]"], FAINT)[1])[::-1]
        found.append(heights[2] / heights[0])
    return float(max(found))


def _split_ratios():
    """(I1, I2)/I0 of eq. (7)."""
    return [x / junction.incident for x in junction.at_thirty_degrees()]


def draw(figure, tables):
    """Curves as in the paper; speeds as sampled every 3 us."""
    figure.set_size_inches(9, 4.6)
    left, right = figure.subplots(1, 2, width_ratios=(1.7, 1.2))
    _guide.draw_curves(left, tables["curves"], [2.5] * 4, f"struck at {SPEED} m/s")
    (v_i, v_t, v_r), _ = ratios(tables)
    clock = tables["clock"]
    for k, (name, exact, printed) in enumerate(
        zip(("V_t/V_i", "V_r/V_i"), (v_t / v_i, v_r / v_i), PRINTED, strict=True)
    ):
        right.plot(1e6 * clock["phase [s]"], clock[name], f"C{k}.", ms=3)
        right.axhline(exact, color=f"C{k}", lw=1)
        right.axhline(printed, color=f"C{k}", lw=1, ls=":")
        words = f"${name}$ = {exact:.4f}, in the paper {printed}"
        right.text(0.05, 1.19 - 0.05 * k, words, color=f"C{k}")
    right.set(xlabel="phase of the sampling [µs]", ylabel="ratio of speeds", ylim=(0.6, 1.25),
              title="dots: read every 3 µs")  # fmt: skip
