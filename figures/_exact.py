"""Checks of exact waves: residuals off the grid, closed forms, launches on a chain."""

from __future__ import annotations

import time

import numpy as np
import sympy as sp

from tensegrity import (
    Chain,
    Potential,
    PowerLaw,
    Prism,
    Record,
    predict,
    simulate,
    solitary_wave,
    speed,
)

PRISMS = ((0.7, 0.01), (0.6, 0.001), (0.8, 0.1))  # height over base, prestrain
RATIOS = (1.001, 1.01, 1.05, 1.3, 2.0, 5.0)
STROKE = 0.97  # of the locking stroke, up to which residuals are reported
EXPONENTS = (1.5, 2.0, 3.0)
SITES, LEAD, BETWEEN = 620, 40, (60, 510)


def rigid_waves(spring):
    """Waves of a rigid prism at `RATIOS`, as far as its stroke allows, and the seconds of each."""
    largest, found = predict(spring)["compression"].speeds[1] / spring.sound_speed(), []
    for ratio in RATIOS:
        if ratio < largest:
            began = time.perf_counter()
            wave = solitary_wave(spring, speed_ratio=ratio)
            if wave.amplitude / spring.domain[0] <= STROKE:
                found.append((wave, time.perf_counter() - began))
    return found


def launched(wave):
    """Relative change of the form and speed of a wave over 500 sites."""
    chain = Chain(wave.potential, SITES)
    duration = 500 / wave.speed
    record = Record(every=2, sites=[x for b in BETWEEN for x in (b, b + 1)])
    run = simulate(chain, wave.launch(chain, LEAD), duration, method="rkn6", dt=0.02, record=record)
    there = wave.launch(chain, LEAD + 500)
    lost = chain.elongation(run.final.u) - chain.elongation(there.u)
    return np.abs(lost).max() / abs(wave.amplitude), abs(speed(run, BETWEEN) / wave.speed - 1)


def toda_gap(decay=1.0):
    """Largest difference from Toda's soliton, over its peak."""
    r = sp.Symbol("r")
    speed = np.sinh(decay) / decay
    wave = solitary_wave(Potential(sp.exp(-r) + r - 1, r), speed=speed)
    x = np.linspace(-10, 10, 401)
    closed = -np.log1p((np.sinh(decay) / np.cosh(decay * x)) ** 2)
    return np.abs(wave.elongation(x) - closed).max() / np.abs(closed).max()


def constants():
    """{exponent: (c of c = k A^((n - 1)/2) for unit stiffness, mass and peak, residual)}."""
    waves = {n: solitary_wave(PowerLaw(1.0, n, length=1.0), amplitude=-1.0) for n in EXPONENTS}
    return {n: (wave.speed, wave.residual) for n, wave in waves.items()}


def checks():
    """A table {quantity, value} of all of these."""
    rows = {}
    for height, prestrain in PRISMS:
        waves = rigid_waves(Prism(1.0, height, prestrain, 1.0).potential())
        ratios = ", ".join(f"{wave.speed_ratio:g}" for wave, _ in waves)
        name = f"prism {height}, prestrain {prestrain}, c/cs {ratios}"
        rows[f"{name}: largest residual"] = max(wave.residual for wave, _ in waves)
        rows[f"{name}: seconds, at most"] = max(took for _, took in waves)
    wave = solitary_wave(Prism(1.0, 0.7, 0.01, 1.0).potential(), speed_ratio=2.0)
    form, pace = launched(wave)
    rows |= {"launched at 2 cs, 500 sites: form": form, "launched at 2 cs, 500 sites: speed": pace}
    rows["Toda's soliton: largest difference"] = toda_gap()
    for n, (constant, residual) in constants().items():
        rows[f"power {n:g}: speed constant (residual {residual:.0e})"] = constant
    return {"quantity": list(rows), "value": list(rows.values())}
