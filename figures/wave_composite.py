"""Interfaces of nonlinear chains reflect waves that acoustics does not predict.

Rarefaction from hard to soft, and both kinds from soft to hard: fractions of energy and impulse
compared with those of linear chains of the same impedances.
"""

import math
from typing import NamedTuple

import numpy as np

from figures import _measure, _scenes
from figures._measure import Number
from tensegrity import Potential, interface, solitary_wave, transmission

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
CUT = 1e-10  # of the peak, cut off where the wave is launched
COUNTED = 0.25  # of the largest elongation of a chain: from there a pulse counts
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


def acoustics(case):
    """Reflected over incident impulse in linear chains: (Z - Z')/(Z + Z')."""
    z, further = case.near.sound_speed(), case.far.sound_speed()
    return (z - further) / (z + further)


def outcome(run, wave, case):
    """Numbers of one incidence.

    Returns
    -------
    dict
        energy, impulse: of the near part at last, over incident ones; back, back peak: speed
        over sound and elongation [m] of the leading reflected pulse; on, on peak: the same of
        the leading transmitted one; late: how much later it leaves the interface than the
        incident peak arrives [s]; compression, rarefaction: exact waves beyond; momentum error:
        of the whole chain, over that of the wave.  Speeds are nan where there is no exact wave.
    """
    found = transmission(run, fraction=COUNTED)
    back, on = found.reflected[0], found.transmitted[-1]
    beyond = [pulse.amplitude > 0 for pulse in found.transmitted if pulse.wave]
    return {
        "energy": found.reflected_energy,
        "impulse": float(run.final.v[: case.before].sum() / wave.momentum),
        "back": back.wave.speed_ratio if back.wave else math.nan,
        "back peak": back.amplitude,
        "on": on.wave.speed_ratio if on.wave else math.nan,
        "on peak": on.amplitude,
        "late": float(found.transmitted_delays[-1]),
        "compression": beyond.count(False),
        "rarefaction": beyond.count(True),
        "momentum error": float(np.abs(run.v.sum(axis=1) / wave.momentum - 1).max()),
    }


def data():
    """Numbers and the last instant of each case."""
    tables = {}
    for name, case in cases().items():
        wave, scene = composite(case)
        run, found = _measure.resolved(
            scene, lambda run, w=wave, c=case: outcome(run, w, c), EVERY * case.step, step=case.step
        )
        found |= {"acoustics": Number(acoustics(case), 0.0), "time": Number(run.t[-1], 0.0)}
        tables[name] = _measure.as_table(found)
        r = run.scene.elongation(run.final.u)
        bonds = np.arange(r.size) - case.before
        tables[f"{name} last"] = {"bond": bonds, "elongation": r / wave.amplitude}
    return tables


def draw(figure, tables):
    """The last instant of each case, with the energy that went back."""
    figure.set_size_inches(9, 6.5)
    for ax, name in zip(figure.subplots(2, 2).flat, cases(), strict=True):
        found = _measure.from_table(tables[name])
        ax.plot(*tables[f"{name} last"].values(), "C0", lw=0.7)
        ax.axvline(0, color="0.5", lw=0.8, ls=":")
        energy, linear = 100 * found["energy"].value, 100 * found["acoustics"].value ** 2
        ax.margins(x=0)
        ax.set_title(f"{name}\n{energy:.1f} % of the energy reflected; acoustics: {linear:.1f} %")
    figure.supxlabel("bonds from the interface", fontsize=10)
    figure.supylabel("final elongation / peak of the incident wave", fontsize=10)
    figure.suptitle("The energy reflected is not what acoustics predicts", fontsize=12)


def table(tables):
    """Rows for the table of the group."""
    rows = []
    for name in cases():
        found = _measure.from_table(tables[name])
        value = {key: number.value for key, number in found.items()}
        is_hard = "rarefaction, hard" in name
        rows += [
            _measure.row(
                f"composite, {name}: reflection",
                REFLECTION if is_hard else OTHERWISE,
                f"{leading(value, 'back')}; at time {value['time']:.0f} s energy "
                f"{value['energy']:.6f} (acoustics {value['acoustics'] ** 2:.4f}), impulse "
                f"{value['impulse']:+.6f} (acoustics {value['acoustics']:+.4f})",
                np.nanmax([found[key].error for key in ("energy", "impulse", "back")]),
            ),
            _measure.row(
                f"composite, {name}: transmission",
                TRANSMISSION if is_hard else OTHERWISE,
                f"solitons above {COUNTED:g} of the largest: {value['compression']:.0f} of "
                f"compression, {value['rarefaction']:.0f} of rarefaction; "
                f"{leading(value, 'on')}, leaves {value['late']:+.2f} s after the arrival",
                np.nanmax([found["on"].error, found["late"].error]),
            ),
        ]
    return rows


def leading(value, side):
    """What leads on one side of the interface."""
    kind, ratio = "rarefaction" if value[f"{side} peak"] > 0 else "compression", value[side]
    return f"{kind} leads, " + (
        "no soliton" if math.isnan(ratio) else f"a soliton at {ratio:.6f} sound speeds"
    )
