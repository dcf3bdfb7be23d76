"""Which soft chains reflect a solitary rarefaction wave, and which answer with compression."""

from __future__ import annotations

import numpy as np

from figures import _measure, _scenes
from figures.wave_composite import PASSED, Case, acoustics, composite, met
from tensegrity import Record, StabilityError, TensegrityError, simulate
from tensegrity.waves.asymptotics import sound_speed

NAME = "wave_composite_map"
GROUP = "waves"

HEIGHT, PRESTRAIN, PRELOAD = 0.8, 2.6e-3, 0.005  # of the soft prism; N
RATIOS = (1.03, 1.06, 1.1, 1.16)  # speeds of the wave over sound
STIFFNESSES = (0.25, 1.0, 4.0, 10.0)  # N/m, of the cross strings of the soft prism
STEP, HALVINGS = 0.08, 4  # s, and how often it may be halved where the bars nearly meet
TIMED = 300, 400  # bonds before the interface
SIZES = 460, 1200  # bonds of either part


def answer(ratio, k_cross):
    """What leads back from one interface and what leads on.

    Returns
    -------
    dict
        rho: acoustics; back, on: speeds of the first large pulses over sound there, with the
        sign of their elongation; nan where the bars meet.
    """
    soft = _scenes.rigid(HEIGHT, PRESTRAIN, PRELOAD, k_cross)
    case = Case(_scenes.softening(PRELOAD), soft, ratio, STEP, *SIZES)
    wave, scene = composite(case)
    bonds = [case.before - bond for bond in TIMED] + [case.before + bond for bond in PASSED]
    rho = acoustics(case)
    try:
        run = followed(scene, [site for bond in bonds for site in (bond, bond + 1)])
    except TensegrityError:  # the bars meet, or so nearly that no step follows
        return {"rho": rho, "back": np.nan, "on": np.nan}
    gone = met(wave) + 0.9 * TIMED[0] / wave.sound_speed
    back, crest = _measure.leader(run, bonds[:2], after=gone)
    on, further = _measure.leader(run, bonds[2:])
    return {
        "rho": rho,
        "back": np.copysign(back / wave.sound_speed, crest),
        "on": np.copysign(on / sound_speed(soft), further),
    }


def followed(scene, sites, halvings=HALVINGS):
    """A run with the largest of a few steps that is stable throughout."""
    dt = STEP / 2 ** (HALVINGS - halvings)
    try:
        record = Record(every=round(0.32 / dt), sites=sites)
        return simulate(*scene, method="rkn6", dt=dt, record=record)
    except StabilityError:
        if not halvings:
            raise
        return followed(scene, sites, halvings - 1)


def data():
    """The answers over speed and stiffness."""
    columns = {}
    for ratio in RATIOS:
        for k_cross in STIFFNESSES:
            found = {"ratio": ratio, "k_cross": k_cross} | answer(ratio, k_cross)
            for key, value in found.items():
                columns.setdefault(key, []).append(float(value))
    return {"map": columns}


def in_words(speed):
    """A signed speed over sound."""
    return f"{'rarefaction' if speed > 0 else 'compression'} {abs(speed):.4f} c$_s$"


def draw(figure, tables):
    """A cell for each speed and soft prism."""
    figure.set_size_inches(9, 5.5)
    ax, columns = figure.subplots(), tables["map"]
    for k, (back, on) in enumerate(zip(columns["back"], columns["on"], strict=True)):
        x, y = k % len(STIFFNESSES), k // len(STIFFNESSES)
        colour = "C1" if back > 1 else "C0" if on < -1 else "0.85"
        ax.scatter(x, y, 900, c=colour, marker="s")
        text = "the bars meet" if np.isnan(back) else f"{in_words(back)}\n{in_words(on)}"
        ax.annotate(text, (x, y), (0, -38), textcoords="offset points", ha="center", fontsize=8)
        ax.annotate(f"{columns['rho'][k]:+.2f}", (x, y), ha="center", va="center", fontsize=8)
    ax.set_xticks(range(len(STIFFNESSES)), [f"{k:g}" for k in STIFFNESSES])
    ax.set_yticks(range(len(RATIOS)), [f"{ratio:g}" for ratio in RATIOS])
    ax.set(xlabel="k_cross of the soft prism [N/m]", ylabel="speed of the rarefaction wave / sound")
    ax.set(xlim=(-0.6, len(STIFFNESSES) - 0.4), ylim=(-0.7, len(RATIOS) - 0.5))
    title = (
        "orange: a supersonic rarefaction leads back; blue: a supersonic compression leads on\n"
        "in the square: acoustics; below: what leads back, what leads on"
    )
    ax.set_title(title, fontsize=10)


def table(tables):
    """Row for the table of the group."""
    back, on = (np.array(tables["map"][key], dtype=float) for key in ("back", "on"))
    soliton, compression = back > 1, on < -1
    return [
        _measure.row(
            f"composite, rarefaction at {RATIOS[0]} to {RATIOS[-1]} cs, hard to soft, "
            f"{len(back)} interfaces",
            "reflected solitary rarefaction wave and a train of compression pulses",
            f"a supersonic rarefaction leads back in {soliton.sum()}, a supersonic compression "
            f"leads on in {compression.sum()}, both in {(soliton & compression).sum()}: not "
            f"reproduced in one; the bars meet in {np.isnan(back).sum()}",
            "speeds between two bonds",
        )
    ]
