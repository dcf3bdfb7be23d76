"""Errors of prestrain of 1 % cost an acoustic lens two per cent of its peak."""

from __future__ import annotations

import numpy as np

from figures import _lens
from figures._lens import row

NAME = "lens_errors"
GROUP = "lens"

ERRORS = (0.003, 0.01, 0.03)  # standard deviations of the relative error of a prestrain
SEEDS = range(20)


def detuned(error, seed):
    """Peak at the focus over that of the lens, and over the sum of its own single peaks."""
    lens = _lens.lens()
    t = _lens.around(lens, 4.0, 4.0)
    wrong = 1 + error * np.random.default_rng(seed).standard_normal(lens.chains)
    each = lens.pressures(lens.focus, t, lens.chain_prestrains * wrong)
    peak = _lens.top(t, each.sum(axis=0))[1]
    whole = _lens.top(t, lens.pressure(lens.focus, t))[1]
    return peak / whole, peak / sum(_lens.top(t, p)[1] for p in each)


def data():
    """Fractions of the peak for each error and seed."""
    shares = {"seed": np.array(SEEDS)}
    for error in ERRORS:
        found = np.array([detuned(error, seed) for seed in SEEDS])
        shares |= {f"{error:g} of the lens": found[:, 0], f"{error:g} of its own": found[:, 1]}
    return {"shares": shares}


def table(tables):
    """Ranges of the fractions."""
    rows = []
    for error in ERRORS:
        case = f"errors of prestrain of {100 * error:g} %, {len(SEEDS)} seeds"
        for kind, words in (("lens", "that of the lens"), ("its own", "the sum of single peaks")):
            key = f"{error:g} of its own" if kind == "its own" else f"{error:g} of the lens"
            found = tables["shares"][key]
            reference = "0.98 to 0.995" if (error, kind) == (0.01, "its own") else ""
            text = f"{found.min():.4f} to {found.max():.4f}, mean {found.mean():.4f}"
            rows.append(row(case, f"peak over {words}", text, reference))
    return rows


def draw(figure, tables):
    """Peaks for each size of the errors."""
    axes = figure.subplots()
    for k, error in enumerate(ERRORS):
        for kind, side, colour in (("of the lens", -0.2, "C0"), ("of its own", 0.2, "C1")):
            found = tables["shares"][f"{error:g} {kind}"]
            axes.plot(k + side + np.linspace(-0.12, 0.12, len(found)), found, f"{colour}o", ms=4)
    for words, x, colour in (("over that\nof the lens", -0.3, "C0"),
                             ("over the sum of\nits single peaks", 0.1, "C1")):  # fmt: skip
        axes.text(x, 0.97, words, color=colour, va="top")
    axes.set_xticks(range(len(ERRORS)), [f"{100 * e:g} %" for e in ERRORS])
    axes.set(xlabel="standard deviation of the errors of prestrain", ylabel="peak at the focus")
