"""Stiffening power laws carry compression waves, softening ones rarefaction under preload."""

import numpy as np

from figures import _measure, _scenes
from figures._draw import name_curves
from figures._limits import slope
from figures._measure import row
from tensegrity import TensegrityError, solitary_wave, speed

GROUP = "waves"

NORMAL = (1.5, 2.0, 3.0)
ABNORMAL = 0.5
SIZES = (0.1, 1.0, 10.0)  # m, peaks
RAREFACTION = 0.6  # m, peak in the precompressed chain of exponent ABNORMAL
BLOW = 0.5  # m/s
STRUCK = (1.5, ABNORMAL)  # exponents of the precompressed chains that are struck
BLOWS = {"pushed": BLOW, "pulled": -BLOW}  # velocity of the first mass
TIMED = (80, 130)  # bonds


def run_speed(wave, bonds=(40, 60)):
    """Speed of an exact wave along a chain [sites/s], with its error."""
    reach = int(wave.reach()) + 2
    scene = _scenes.launched(wave, bonds[1] + 3 * reach, reach, bonds[1] + reach)
    sites = [site + reach for bond in bonds for site in (bond, bond + 1)]
    far, interval = tuple(bond + reach for bond in bonds), 0.1 / wave.speed
    _, found = _measure.resolved(scene, lambda run: {"speed": speed(run, far)}, interval, sites)
    return found["speed"]


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
    power = slope(SIZES, speeds)
    middle = waves[len(waves) // 2]
    error = abs(run_speed(middle).value - middle.speed)
    return {
        "constant": _measure.Number(middle.speed, error),
        "power": _measure.Number(power, abs(power - (exponent - 1) / 2)),
        "width": _measure.Number(middle.width(), middle.residual),
    }


def no_wave():
    """The message for a wave without precompression and n < 1."""
    try:
        solitary_wave(_scenes.power(ABNORMAL), amplitude=-1.0)
    except TensegrityError as error:
        return str(error)
    return "there is one"


def struck(exponent, speed, sites=180, travel=150):
    """A precompressed chain whose free end is struck; pushed where the speed [m/s] is positive."""
    spring = _scenes.power(exponent, 1.0)
    return _scenes.impact(spring, sites, {0: speed}, travel / spring.sound_speed())


def leading(run):
    """Speed of the first large pulse over that of sound, and its sign times its size [m]."""
    fast, peak = _measure.leader(run, TIMED)
    return {"ratio": fast / run.scene.springs[0].sound_speed(), "peak": peak}


def data():
    """Speeds for n > 1, the rarefaction wave for n < 1, two struck chains."""
    tables = {f"n{n:g}": _measure.as_table(scaling(n)) for n in NORMAL}
    wave = solitary_wave(_scenes.power(ABNORMAL, 1.0), amplitude=RAREFACTION)
    found = run_speed(wave)
    error = max(abs(found.value - wave.speed), found.error) / wave.sound_speed
    tables["abnormal"] = _measure.as_table({"ratio": _measure.Number(wave.speed_ratio, error)})
    tables["abnormal_rest"] = {"message": [no_wave()]}
    x = np.linspace(-8, 8, 401)
    tables["profiles"] = {"x": x, f"{ABNORMAL}": wave.elongation(x) / RAREFACTION}
    for n in NORMAL:
        wave = solitary_wave(_scenes.power(n), amplitude=-1.0)
        tables["profiles"][f"{n}"] = wave.elongation(x)
    for n in STRUCK:
        for blow in BLOWS:
            scene = struck(n, BLOWS[blow])
            run, found = _measure.resolved(scene, leading, 0.1)
            tables[f"n{n:g} {blow}"] = _measure.as_table(found)
            r = run.scene.elongation(run.final.u)
            tables[f"n{n:g} {blow} last"] = {"bond": np.arange(r.size), "elongation": r}
    return tables


def draw(figure, tables):
    """The struck chains at the last instant, and profiles."""
    figure.set_size_inches(9, 6.5)
    above, below = figure.subplots(2, 1)
    for n in STRUCK:
        for blow, line in zip(BLOWS, ("-", ":"), strict=True):
            style, label = f"C{STRUCK.index(n)}{line}", f"n = {n:g}, {blow}"
            above.plot(*tables[f"n{n:g} {blow} last"].values(), style, lw=0.9, label=label)
    above.set(xlabel="bond", ylabel="elongation [m]", xlim=(90, 179))
    above.set_title("free ends of precompressed chains pushed and pulled")
    name_curves(above, at=_front)
    x, *_ = tables["profiles"].values()
    for n in (ABNORMAL, *NORMAL):
        below.plot(x, tables["profiles"][f"{n}"], label=f"n = {n}")
    below.set(xlabel="distance from the peak [sites]", ylabel="elongation over its size")
    below.set_title("exact waves")
    name_curves(below, at=lambda y: np.flatnonzero(np.abs(y) > 0.4)[-1])


def _front(y):
    """The last bond with half of the largest elongation."""
    return np.flatnonzero(np.abs(y) > 0.5 * np.abs(y).max())[-1]


def table(tables):
    """Rows for the table of the group."""
    for n in NORMAL:
        constant, power, width = _measure.from_table(tables[f"n{n:g}"]).values()
        found = f"c = {constant.value:.10f} A^{power.value:.6f}, width {width.value:.4f} sites"
        error = f"{constant.error:.0e} (a chain), {power.error:.0e}"
        claim = "normal: compression waves, the larger the faster"
        yield row(f"power law n = {n:g}, no precompression", claim, found, error)
    scene, claim = f"power law n = {ABNORMAL:g}", "abnormal: rarefaction waves"
    (ratio,) = _measure.from_table(tables["abnormal"]).values()
    found = f"rarefaction of {RAREFACTION:g} m runs at {ratio.value:.8f} cs"
    yield row(f"{scene}, precompressed by 1 m", claim, found, ratio.error)
    yield row(f"{scene}, no precompression", claim, tables["abnormal_rest"]["message"][0], "proof")
    claim = "normal: compression leads; abnormal: rarefaction leads"
    for n in STRUCK:
        for blow in BLOWS:
            found = _measure.from_table(tables[f"n{n:g} {blow}"])
            ratio, peak = found["ratio"], found["peak"].value
            what = "compression" if peak < 0 else "rarefaction"
            kind = f"supersonic {what} leads" if ratio.value > 1 else f"no soliton, {what} leads"
            scene = f"power law n = {n:g}, precompressed, free end {blow} at {BLOW} m/s"
            found = f"{kind}: {ratio.value:.6f} cs, peak {peak:+.4f} m"
            yield row(scene, claim, found, ratio.error)
