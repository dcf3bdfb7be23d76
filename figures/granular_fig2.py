"""Speeds read every 3 µs scatter by a tenth; located peaks give one ratio, near the paper's.

Fig. 2 of the paper: a single wave splits at the junction of the half guide, all steel.
"""

import math

import numpy as np

from derivations import contact, junction
from figures import _guide
from figures._guide import STEEL
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
            "energy error": [run.energy_error],
            "difference of the branches": [_guide.skew(run)],
            "momentum error": [_guide.momentum_error(run)],
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
    phases, found = np.arange(PHASES) * _guide.CLOCK / PHASES, []
    records = list(zip(*_read(run), strict=True))
    for phase in phases:
        instants = []
        for force, (start, end) in records:
            t, samples = sampled(run.t, force, _guide.CLOCK, phase)
            inside = (t >= start) & (t <= end)
            instants.append(t[inside][np.argmax(samples[inside])])
        incident, *others = np.diff(instants)[::2]
        found.append([incident / other for other in others])
    transmitted, reflected = np.array(found).T
    return {"phase [s]": phases, "V_t/V_i": transmitted, "V_r/V_i": reflected}


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
    read = [tables["clock"][k] for k in ("V_t/V_i", "V_r/V_i")]
    spread = [f"{x.min():.3f} to {x.max():.3f}" for x in read]
    settled = tables["settling"]["peak [N]"]
    back, forth = (  # (I1, I2)/I0 of eq. (7)
        float((x / junction.incident).subs(junction.waves, 1)) for x in junction.at_thirty_degrees()
    )
    power = float(contact.scalings()[0].subs(contact.exponent, 1.5))
    found = {
        "V_i [m/s]": (v_i, "", 566.96),
        "V_t [m/s]": (v_t, "", 506.64),
        "V_r [m/s]": (v_r, "", 415.92),
        "V_t/V_i": (v_t / v_i, PRINTED[0], 0.894),
        "V_r/V_i": (v_r / v_i, PRINTED[1], 0.734),
        "V_t/V_i read every 3 us, over phases": (spread[0], PRINTED[0]),
        "V_r/V_i read every 3 us, over phases": (spread[1], PRINTED[1]),
        "fraction of phases that give the paper's pair": agreeing(tables),
        "F_i/F_t": (f_i / f_t, 1.6, 2),
        "F_i/F_t by eq. (7)": (forth**-power, 1.6),
        "F_i/F_r": (f_i / f_r, 6.9, 8.4),
        "F_i/F_r by eq. (7)": (back**-power, 6.9),
        "peak at bead 1 of the branch over bead 15": settled[0] / settled[14],
        "the same at bead 4": (settled[3] / settled[14], "settled"),
        "largest other peak in stem 1 over the incident one": others(tables),
        "change of these ratios with a step of 0.4 us, not 0.1 us": step_error(tables),
        "difference of both branches": _guide.number(tables, "difference of the branches"),
        **_guide.balances(tables),
    }
    return _guide.rows("2", found)


def others(tables):
    """Highest peak in stem 1 besides the incident and the reflected one, over the incident one."""
    found = []
    for sensor in SENSORS[:2]:
        heights = np.sort(peaks(*_guide.curve(tables, *sensor), FAINT)[1])[::-1]
        found.append(heights[2] / heights[0])
    return float(max(found))


def draw(figure, tables):
    """Curves as in the paper; speeds as sampled every 3 us."""
    figure.set_size_inches(9, 4.6)
    left, right = figure.subplots(1, 2, width_ratios=(1.7, 1.2))
    _guide.draw_curves(left, tables["curves"], [2.5] * 4, f"struck at {SPEED} m/s")
    (v_i, v_t, v_r), _ = ratios(tables)
    clock, names = tables["clock"], ("V_t/V_i", "V_r/V_i")
    for k, (name, v, printed) in enumerate(zip(names, (v_t, v_r), PRINTED, strict=True)):
        right.plot(1e6 * clock["phase [s]"], clock[name], f"C{k}.", ms=3)
        right.axhline(v / v_i, color=f"C{k}", lw=1)
        right.axhline(printed, color=f"C{k}", lw=1, ls=":")
        words = f"${name}$ = {v / v_i:.4f}, in the paper {printed}"
        right.text(0.05, 1.19 - 0.05 * k, words, color=f"C{k}")
    right.set(xlabel="phase of the sampling [µs]", ylabel="ratio of speeds", ylim=(0.6, 1.25),
              title="dots: read every 3 µs")  # fmt: skip
