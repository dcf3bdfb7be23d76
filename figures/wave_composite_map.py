"""Leading pulses behind interfaces with soft chains: reflected rarefaction or compression.

Each interface is run at two resolutions, the second with twice as many steps and rows.  The leading
pulse is the first above a level; where a small change makes another pulse the first, the map marks
it.
"""

from __future__ import annotations

import numpy as np

from figures import _measure, _scenes
from figures.wave_composite import PASSED, Case, acoustics, composite, met
from tensegrity import Record, StabilityError, TensegrityError, simulate

NAME = "wave_composite_map"
GROUP = "waves"

HEIGHT, PRESTRAIN, PRELOAD = 0.8, 2.6e-3, 0.005  # of the soft prism; N
RATIOS = (1.03, 1.06, 1.1, 1.16)  # speeds of the wave over sound
STIFFNESSES = (0.25, 1.0, 4.0, 10.0)  # N/m, of the cross strings of the soft prism
STEP, HALVINGS = 0.08, 4  # s, and how often it may be halved where the bars nearly meet
ROW = 0.32  # s between rows of the coarser runs
SAME = 1e-3  # of a speed over sound: resolutions that differ by more say different things
TIMED = 300, 400  # bonds before the interface
SIZES = 460, 1200  # bonds of either part


def answer(ratio, k_cross):
    """The leading reflected and the leading transmitted pulse of one interface.

    Returns
    -------
    dict
        rho: acoustics; back, on: speeds of the first large pulses over sound there, with the
        sign of their elongation; nan where the bars meet.  coarse back, coarse on: the same at
        twice the step, with half as many rows.
    """
    soft = _scenes.rigid(HEIGHT, PRESTRAIN, PRELOAD, k_cross)
    case = Case(_scenes.softening(PRELOAD), soft, ratio, STEP, *SIZES)
    wave, scene = composite(case)
    bonds = [case.before - bond for bond in TIMED] + [case.before + bond for bond in PASSED]
    sites = [site for bond in bonds for site in (bond, bond + 1)]
    found = {"rho": acoustics(case)}
    try:
        coarse = followed(scene, sites, STEP)
        runs = {"coarse ": coarse, "": followed(scene, sites, coarse.dt / 2, ROW / 2)}
    except TensegrityError:  # the bars meet, or so nearly that no step follows
        runs = {}
    for name in ("coarse ", ""):
        for where in ("back", "on"):
            found[f"{name}{where}"] = np.nan
    gone = met(wave) + 0.9 * TIMED[0] / wave.sound_speed
    for name, run in runs.items():
        back, peak = _measure.leader(run, bonds[:2], after=gone)
        on, further = _measure.leader(run, bonds[2:])
        found[f"{name}back"] = np.copysign(back / wave.sound_speed, peak)
        found[f"{name}on"] = np.copysign(on / soft.sound_speed(), further)
    return found


def followed(scene, sites, dt, between=ROW, halvings=HALVINGS):
    """A run with the largest of a few steps that is stable throughout."""
    try:
        record = Record(every=round(between / dt), sites=sites)
        return simulate(*scene, method="rkn6", dt=dt, record=record)
    except StabilityError:
        if not halvings:
            raise
        return followed(scene, sites, dt / 2, between, halvings - 1)


def data():
    """The answers over speed and stiffness."""
    columns = {}
    for ratio in RATIOS:
        for k_cross in STIFFNESSES:
            found = {"ratio": ratio, "k_cross": k_cross} | answer(ratio, k_cross)
            for key, value in found.items():
                columns.setdefault(key, []).append(float(value))
    return {"map": columns}


def verdicts(columns, name=""):
    """Of each interface: 1 a supersonic rarefaction leads back, -1 a supersonic compression on, 2
    both, 0 neither, nan where the bars meet."""
    back, on = (np.array(columns[f"{name}{key}"], dtype=float) for key in ("back", "on"))
    soliton, compression = back > 1, on < -1
    found = np.where(soliton & compression, 2, np.where(soliton, 1, np.where(compression, -1, 0)))
    return np.where(np.isnan(back), np.nan, found)


def moved(columns):
    """Largest change of a speed over sound from one resolution to the other, of each interface;
    inf where another pulse leads, nan where the bars meet."""
    changes = []
    for key in ("back", "on"):
        coarse, fine = (np.array(columns[f"{x}{key}"], dtype=float) for x in ("coarse ", ""))
        changes.append(np.where(coarse * fine < 0, np.inf, np.abs(coarse - fine)))
    return np.max(changes, axis=0)


def in_words(speed):
    """A signed speed over sound."""
    return f"{'rarefaction' if speed > 0 else 'compression'} {abs(speed):.4f} c$_s$"


def draw(figure, tables):
    """One cell for each speed and soft prism."""
    figure.set_size_inches(9, 5.5)
    ax, columns = figure.subplots(), tables["map"]
    colours = {2: "C3", 1: "C1", -1: "C0"}
    both = zip(verdicts(columns, "coarse "), verdicts(columns), strict=True)
    changes = moved(columns)
    for k, (pair, change) in enumerate(zip(both, changes, strict=True)):
        x, y = k % len(STIFFNESSES), k // len(STIFFNESSES)
        back, on = columns["back"][k], columns["on"][k]
        for shift, one in zip((-0.07, 0.07), pair, strict=True):
            if change > SAME:
                ax.scatter(x + shift, y, 1000, c="k", marker="s", zorder=1)
            ax.scatter(x + shift, y, 700, c=colours.get(one, "0.85"), marker="s", zorder=2)
        text = "the bars meet" if np.isnan(back) else f"{in_words(back)}\n{in_words(on)}"
        ax.annotate(text, (x, y), (0, -38), textcoords="offset points", ha="center", fontsize=8)
        ax.annotate(f"{columns['rho'][k]:+.2f}", (x, y), ha="center", va="center", fontsize=8)
    ax.set_xticks(range(len(STIFFNESSES)), [f"{k:g}" for k in STIFFNESSES])
    ax.set_yticks(range(len(RATIOS)), [f"{ratio:g}" for ratio in RATIOS])
    ax.set(
        xlabel="k_cross of the soft prism [N/m]",
        ylabel="speed of the rarefaction wave / sound speed",
    )
    ax.set(xlim=(-0.6, len(STIFFNESSES) - 0.4), ylim=(-0.7, len(RATIOS) - 0.5))
    title = (
        "orange: supersonic rarefaction reflected; blue: supersonic compression transmitted; red "
        "both; grey neither\nleft half of a square: coarser, right half: twice as fine; framed: "
        f"speeds differ by more than {SAME:g}\n"
        "in the square: acoustics; below: leading reflected and transmitted pulse, finer run"
    )
    ax.set_title(title, fontsize=10)


def table(tables):
    """Row for the table of the group."""
    columns = tables["map"]
    coarse, fine, change = verdicts(columns, "coarse "), verdicts(columns), moved(columns)
    met_bars = np.isnan(fine)
    differ = ~met_bars & ((coarse != fine) | (change > SAME))
    others = ", ".join(
        f"{columns['ratio'][k]:g} cs to {columns['k_cross'][k]:g} N/m by {change[k]:.1g}"
        for k in np.flatnonzero(differ)
    )
    alike = change[~met_bars & ~differ].max(initial=0.0)
    return [
        _measure.row(
            f"composite, rarefaction at {RATIOS[0]} to {RATIOS[-1]} cs, hard to soft, "
            f"{len(fine)} interfaces",
            "reflected solitary rarefaction wave and a train of compression pulses",
            f"a supersonic rarefaction leads back in {np.isin(fine, (1, 2)).sum()}, a supersonic "
            f"compression leads on in {np.isin(fine, (-1, 2)).sum()}, both in {(fine == 2).sum()}: "
            f"not reproduced in one; the bars meet in {met_bars.sum()}",
            f"two resolutions agree to {alike:.1g} of a speed in {(~met_bars & ~differ).sum()}, "
            f"and differ in {differ.sum()}{f': {others}' if others else ''}",
        )
    ]
