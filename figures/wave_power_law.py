"""Power-law springs, stiffening (n > 1) and softening (n < 1) in compression."""

from __future__ import annotations

import numpy as np

from figures import _measure, _scenes
from tensegrity import Record, TensegrityError, simulate, solitary_wave
from tensegrity.observables import speed

NAME = "wave_power_law"
GROUP = "waves"

NORMAL = (1.5, 2.0, 3.0)
ABNORMAL = 0.5
SIZES = (0.1, 1.0, 10.0)  # m, crests
RAREFACTION = 0.6  # m, crest in the precompressed chain of exponent ABNORMAL
BLOW = 0.3  # m/s
SHOWN = (1.5, ABNORMAL)  # exponents of the precompressed chains that are struck


def run_speed(wave, bonds=(40, 60)):
    """Speed of an exact wave along a chain [sites/s], with its error."""
    reach = int(wave.reach()) + 2
    scene = _scenes.launched(wave, bonds[1] + 3 * reach, reach, bonds[1] + reach)
    sites = [site + reach for bond in bonds for site in (bond, bond + 1)]
    far = tuple(bond + reach for bond in bonds)
    found = _measure.resolved(
        scene, lambda run: {"speed": speed(run, far)}, 0.05 / wave.speed, sites
    )
    return found[1]["speed"]


def scaling(exponent):
    """Speeds of waves of several sizes without precompression: c = C A^((n - 1)/2).

    Returns
    -------
    dict
        constant: C for masses and stiffness 1, with the error seen on a chain; power: fitted
        exponent of A, its error the deviation from (n - 1)/2.
    """
    waves = [solitary_wave(_scenes.power(exponent), amplitude=-size) for size in SIZES]
    speeds = np.array([wave.speed for wave in waves])
    power = float(np.polyfit(np.log(SIZES), np.log(speeds), 1)[0])
    middle = waves[len(waves) // 2]
    error = abs(run_speed(middle).value - middle.speed)
    return {
        "constant": _measure.Number(middle.speed, error),
        "power": _measure.Number(power, abs(power - (exponent - 1) / 2)),
        "width": _measure.Number(middle.width(), middle.residual),
    }


def no_wave():
    """What is said of a wave without precompression for n < 1."""
    try:
        solitary_wave(_scenes.power(ABNORMAL), amplitude=-1.0)
    except TensegrityError as error:
        return str(error)
    return "there is one"


def struck(exponent, sites=160, duration=110.0):
    """A precompressed chain, its first mass held, the next one pushed: dense and last rows."""
    scene = _scenes.impact(
        _scenes.power(exponent, 1.0), sites, {1: BLOW}, duration / exponent**0.5, ("fixed", "free")
    )
    return simulate(*scene, method="rkn6", record=Record())


def data():
    """Speeds for n > 1, the rarefaction wave for n < 1, two struck chains."""
    tables = {f"n{n:g}": _measure.as_table(scaling(n)) for n in NORMAL}
    wave = solitary_wave(_scenes.power(ABNORMAL, 1.0), amplitude=RAREFACTION)
    found = run_speed(wave)
    error = max(abs(found.value - wave.speed), found.error) / wave.sound_speed
    tables["abnormal"] = _measure.as_table({"ratio": _measure.Number(wave.speed_ratio, error)})
    tables["abnormal_rest"] = {"message": [no_wave()]}
    x = np.linspace(-8, 8, 401)
    tables["profiles"] = {"x": x, f"{ABNORMAL}": wave.elongation(x) / RAREFACTION} | {
        f"{n}": solitary_wave(_scenes.power(n), amplitude=-1.0).elongation(x) for n in NORMAL
    }
    for n in SHOWN:
        run = struck(n)
        tables[f"density{n:g}"] = _measure.density(run)
        r = run.scene.elongation(run.final.u)
        tables[f"last{n:g}"] = {"bond": np.arange(r.size), "elongation": r}
    return tables


def draw(figure, tables):
    """Densities of the struck chains, their last instant, profiles."""
    figure.set_size_inches(12, 8)
    axes = figure.subplots(2, 2)
    for ax, n in zip(axes[0], SHOWN, strict=True):
        _measure.draw_density(ax, tables[f"density{n:g}"], f"n = {n:g}, pushed at {BLOW} m/s")
    for n in SHOWN:
        last = tables[f"last{n:g}"]
        axes[1, 0].plot(last["bond"], last["elongation"], lw=0.9, label=f"n = {n:g}")
    axes[1, 0].set(xlabel="bond", ylabel="elongation [m]", title="last instant")
    for name, profile in tables["profiles"].items():
        if name != "x":
            axes[1, 1].plot(tables["profiles"]["x"], profile, label=f"n = {name}")
    axes[1, 1].set(xlabel="distance from the crest [sites]", ylabel="elongation over its size")
    for ax in axes[1]:
        ax.legend(fontsize=8)


def table(tables):
    """Rows for the table of the group."""
    rows = []
    for n in NORMAL:
        found = _measure.from_table(tables[f"n{n:g}"])
        rows.append(
            _measure.row(
                f"power law n = {n:g}, no precompression",
                "normal: compression waves, the larger the faster",
                f"c = {found['constant'].value:.10f} A^{found['power'].value:.6f}, "
                f"width {found['width'].value:.4f} sites",
                f"{found['constant'].error:.0e} (a chain), {found['power'].error:.0e}",
            )
        )
    ratio = _measure.from_table(tables["abnormal"])["ratio"]
    scene = f"power law n = {ABNORMAL:g}"
    claim = "abnormal: rarefaction waves"
    last = {n: np.array(tables[f"last{n:g}"]["elongation"], dtype=float) for n in SHOWN}
    front = {n: _foremost(r) for n, r in last.items()}
    return [
        *rows,
        _measure.row(
            f"{scene}, precompressed by 1 m",
            claim,
            f"rarefaction of {RAREFACTION:g} m runs at {ratio.value:.8f} cs",
            ratio.error,
        ),
        _measure.row(
            f"{scene}, no precompression", claim, tables["abnormal_rest"]["message"][0], "proof"
        ),
        _measure.row(
            f"precompressed, held end, pushed {BLOW:g} m/s",
            "normal: compression leads; abnormal: rarefaction leads",
            "; ".join(f"n = {n:g}: foremost crest {front[n]:+.4f} m" for n in SHOWN),
            "sign only",
        ),
    ]


def _foremost(r):
    size = np.abs(r)
    return r[np.flatnonzero(size > 0.5 * size.max())[-1]]
