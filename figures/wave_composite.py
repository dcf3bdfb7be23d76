"""Interfaces of nonlinear chains reflect waves that acoustics does not predict.

Rarefaction from hard to soft, and both kinds from soft to hard: fractions of energy and impulse
compared with those of linear chains of the same impedances.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from figures import _measure, _scenes
from figures._measure import Number
from tensegrity import (
    Potential,
    TensegrityError,
    interface,
    pulses,
    solitary_wave,
)

NAME = "wave_composite"
GROUP = "waves"


class Case(NamedTuple):
    """Two chains and the wave that comes along the first one."""

    near: Potential
    far: Potential
    ratio: float  # speed of the wave over that of sound
    step: float  # of the coarser run [s]
    before: int = 560  # bonds of either part: nothing comes back from the ends in time
    after: int = 1200


def cases():
    """The interfaces that are drawn, by what comes along."""
    soft = _scenes.softening
    strong, weak = _scenes.rigid(0.7, 2e-4, 0.001, 20.0), _scenes.rigid(0.8, 0.0026, 0.005, 0.25)
    return {
        "rarefaction, hard to soft (stiff when stretched)": Case(soft(0.001), strong, 1.16, 0.04),
        "rarefaction, hard to soft (weak)": Case(soft(0.005), weak, 1.03, 0.08),
        "compression, soft (weak) to hard": Case(weak, soft(0.005), 1.3, 0.08),
        "rarefaction, soft to hard": Case(soft(0.05), _scenes.rigid(0.8, 0.02, 0.05), 1.04, 0.08),
    }


REFLECTION = "a reflected solitary rarefaction wave with oscillatory tail in the hard branch"
TRANSMISSION = "a delayed train of compression pulses in the soft branch"
OTHERWISE = "anomalous reflection of compression and rarefaction waves"
TIMED = 380, 500  # bonds before the interface at which a reflected pulse is timed
PASSED = 70, 120  # and a transmitted one, beyond
CUT = 1e-10  # of the peak, cut off where the wave is launched
COUNTED = 0.25  # of the largest elongation beyond: from there a pulse counts
CLOSE = 1e-3  # a reflected rarefaction this close to the exact wave of its peak is a soliton
EVERY = 5  # steps between recorded instants


def composite(case, travel=None):
    """The wave on its way to the interface, at site `before`.

    Parameters
    ----------
    case : Case
    travel : float, optional
        Bonds that sound goes back from the interface within the run; by default nine tenths of
        those before it.

    Returns
    -------
    wave : SolitaryWave
    scene : Scene
    """
    wave = solitary_wave(case.near, speed_ratio=case.ratio)
    away = wave.reach(CUT) + 2
    chain = interface(case.near, case.far, (case.before, case.after + 1))
    state = wave.launch(chain, case.before - away, tail=CUT)
    travel = 0.9 * case.before if travel is None else travel
    duration = 1.1 * away / wave.speed + 1.03 * travel / wave.sound_speed
    return wave, _measure.Scene(chain, state, duration)


def met(wave):
    """Time at which the peak reaches the interface [s]."""
    return (wave.reach(CUT) + 2) / wave.speed


def acoustics(case):
    """Reflected over incident impulse in linear chains: (Z - Z')/(Z + Z')."""
    z, further = case.near.sound_speed(), case.far.sound_speed()
    return (z - further) / (z + further)


def outcome(run, wave, case, timed=TIMED, passed=PASSED):
    """Numbers of one incidence.

    Returns
    -------
    dict
        energy, impulse: of the near part at last, over incident ones; back, back peak: speed
        over sound and elongation [m] of the leading reflected pulse; on, on peak: the same of
        the first large pulse beyond; late: how much later than sound it comes there [s];
        momentum error: of the whole chain, over that of the wave.
    """
    sound, further = wave.sound_speed, case.far.sound_speed()
    energy = run.scene.site_energy(run.final)
    near, last = (
        _measure.peak(run, case.before - bonds, after=met(wave) + 0.9 * bonds / sound)
        for bonds in timed
    )
    first, second = (_measure.peak(run, case.before + bonds) for bonds in passed)
    return {
        "energy": float(energy[: case.before].sum() / energy.sum()),
        "impulse": float(run.final.v[: case.before].sum() / wave.momentum),
        "back": (timed[1] - timed[0]) / (last[0] - near[0]) / sound,
        "back peak": last[1],
        "on": (passed[1] - passed[0]) / (second[0] - first[0]) / further,
        "on peak": second[1],
        "late": first[0] - met(wave) - passed[0] / further,
        "momentum error": float(np.abs(run.v.sum(axis=1) / wave.momentum - 1).max()),
    }


def exact_ratio(spring, peak):
    """Speed over sound of the exact wave of a peak, with its residual; nan where there is none."""
    try:
        wave = solitary_wave(spring, amplitude=peak)
    except TensegrityError:
        return Number(math.nan, math.nan)
    return Number(wave.speed_ratio, wave.residual)


def train(run, before, since):
    """Pulses beyond the interface ahead of sound emitted there at an instant.

    Returns
    -------
    int, int
        How many of compression, of rarefaction.
    """
    r = np.abs(run.scene.elongation(run.final.u))
    front = before + run.scene.springs[-1].sound_speed() * (run.t[-1] - since)
    found = pulses(run, fraction=COUNTED * r[before:].max() / r.max())
    signs = [pulse.amplitude > 0 for pulse in found if pulse.place > front]
    return signs.count(False), signs.count(True)


def data():
    """Numbers and the last instant of each case."""
    tables = {}
    for name, case in cases().items():
        wave, scene = composite(case)
        run, found = _measure.resolved(
            scene, lambda run, w=wave, c=case: outcome(run, w, c), EVERY * case.step, step=case.step
        )
        since = met(wave) + max(found["late"].value, 0.0)
        pushed, pulled = train(run, case.before, since)
        found |= {
            "acoustics": Number(acoustics(case), 0.0),
            "exact back": exact_ratio(case.near, found["back peak"].value),
            "exact on": exact_ratio(case.far, found["on peak"].value),
            "compression pulses": Number(pushed, 0.0),
            "rarefaction pulses": Number(pulled, 0.0),
            "incident peak": Number(wave.amplitude, wave.residual),
            "time": Number(run.t[-1], 0.0),
        }
        tables[name] = _measure.as_table(found)
        r = run.scene.elongation(run.final.u)
        bonds = np.arange(r.size) - case.before
        tables[f"{name} last"] = {"bond": bonds, "elongation": r / wave.amplitude}
    return tables


def draw(figure, tables):
    """The last instant of each case, with the energy that went back."""
    figure.set_size_inches(9, 6.5)
    for ax, name in zip(figure.subplots(2, 2).flat, cases(), strict=True):
        last, found = tables[f"{name} last"], _measure.from_table(tables[name])
        ax.plot(last["bond"], last["elongation"], "C0", lw=0.7)
        ax.axvline(0, color="0.5", lw=0.8, ls=":")
        energy, linear = 100 * found["energy"].value, 100 * found["acoustics"].value ** 2
        ax.margins(x=0)
        ax.set_title(f"{name}\n{energy:.1f} % of the energy reflected; acoustics: {linear:.1f} %",
                     fontsize=10)  # fmt: skip
    figure.supxlabel("bonds from the interface", fontsize=10)
    figure.supylabel("final elongation / peak of the incident wave", fontsize=10)
    figure.suptitle("The energy reflected is not what acoustics predicts", fontsize=12)


def table(tables):
    """Rows for the table of the group."""
    rows = []
    for name in cases():
        found = _measure.from_table(tables[name])
        value = {key: number.value for key, number in found.items()}
        ends = f"time {value['time']:.0f} s"
        rows.append(
            _measure.row(
                f"composite, {name}: reflection",
                REFLECTION if "rarefaction, hard" in name else OTHERWISE,
                f"{_reflected(value)}; at {ends} energy {value['energy']:.6f} (acoustics "
                f"{value['acoustics'] ** 2:.4f}), impulse {value['impulse']:+.6f} (acoustics "
                f"{value['acoustics']:+.4f})",
                max(found[key].error for key in ("energy", "impulse", "back")),
            )
        )
        kind = "rarefaction" if value["on peak"] > 0 else "compression"
        rows.append(
            _measure.row(
                f"composite, {name}: transmission",
                TRANSMISSION if "rarefaction, hard" in name else OTHERWISE,
                f"{value['compression pulses']:.0f} compression and "
                f"{value['rarefaction pulses']:.0f} rarefaction pulses faster than sound, from "
                f"{COUNTED:g} of the largest; first a {kind} at {value['on']:.5f} sound speeds "
                f"({_exact(value['exact on'])}), {value['late']:+.2f} s after sound",
                max(found["on"].error, found["late"].error),
            )
        )
    return rows


def _reflected(value):
    kind = "rarefaction" if value["back peak"] > 0 else "compression"
    text = f"{kind} leads at {value['back']:.6f} cs"
    if abs(value["back"] - value["exact back"]) < CLOSE and value["back"] > 1:
        return f"{text}, a soliton ({_exact(value['exact back'])})"
    return f"{text}, no soliton"


def _exact(ratio):
    return "no exact wave" if math.isnan(ratio) else f"exact wave of its peak {ratio:.6f}"
