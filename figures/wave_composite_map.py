"""No interface of a softening and a soft chain reflects rarefaction and transmits compression.

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


PATCHES = {
    0: ("0.85", "neither"), 1: ("C1", "supersonic rarefaction back"),
    -1: ("C0", "supersonic compression on"), 2: ("C3", "both"),
}  # fmt: skip


def draw(figure, tables):
    """One patch for each speed and soft prism."""
    from matplotlib.patches import Patch, Rectangle

    figure.set_size_inches(8, 5)
    ax, columns = figure.subplots(), tables["map"]
    found, change = verdicts(columns), moved(columns)
    for k, verdict in enumerate(found):
        colour = "w" if np.isnan(verdict) else PATCHES[int(verdict)][0]
        corner = k % len(STIFFNESSES) - 0.5, k // len(STIFFNESSES) - 0.5
        hatch = "//" if change[k] > SAME else None
        box = {"facecolor": colour, "edgecolor": "w", "hatch": hatch}
        ax.add_patch(Rectangle(corner, 1, 1, **box))
        if np.isnan(verdict):
            ax.annotate("the bars meet", (corner[0] + 0.5, corner[1] + 0.5), ha="center")
    shown = [Patch(facecolor=colour, label=label) for colour, label in PATCHES.values()]
    shown.append(Patch(facecolor="w", edgecolor="0.5", hatch="//", label="two resolutions differ"))
    figure.legend(handles=shown, loc="outside lower center", ncols=3, fontsize=9)
    ax.set_xticks(range(len(STIFFNESSES)), [f"{k:g}" for k in STIFFNESSES])
    ax.set_yticks(range(len(RATIOS)), [f"{ratio:g}" for ratio in RATIOS])
    ax.set(
        xlabel="stiffness of the cross strings of the soft prism [N/m]",
        ylabel="speed of the rarefaction wave / sound speed",
        xlim=(-0.5, len(STIFFNESSES) - 0.5), ylim=(-0.5, len(RATIOS) - 0.5),
        title="Where a rarefaction comes back, no compression goes on",
    )  # fmt: skip
    ax.grid(False)


def in_words(speed):
    """A signed speed over sound."""
    return f"{'rarefaction' if speed > 0 else 'compression'} {abs(speed):.4f} cs"


def table(tables):
    """Rows for the table of the group: all interfaces together, then each."""
    columns = tables["map"]
    coarse, fine, change = verdicts(columns, "coarse "), verdicts(columns), moved(columns)
    met_bars = np.isnan(fine)
    differ = ~met_bars & ((coarse != fine) | (change > SAME))
    others = ", ".join(
        f"{columns['ratio'][k]:g} cs to {columns['k_cross'][k]:g} N/m by {change[k]:.1g}"
        for k in np.flatnonzero(differ)
    )
    alike = change[~met_bars & ~differ].max(initial=0.0)
    rows = [
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
    each = zip(*(columns[key] for key in ("ratio", "k_cross", "rho", "back", "on")), strict=True)
    for (ratio, k_cross, rho, back, on), one in zip(each, change, strict=True):
        words = f"back {in_words(back)}, on {in_words(on)}; acoustics {rho:+.2f}"
        rows.append(
            _measure.row(
                f"composite, {ratio:g} cs to {k_cross:g} N/m", "",
                "the bars meet" if np.isnan(back) else words, "" if np.isnan(one) else one,
            )
        )  # fmt: skip
    return rows
