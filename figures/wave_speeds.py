"""Near the sound speed waves are far from sech², at twelve times it they nearly are the tent."""

import numpy as np

from figures import _impact, _measure, _scenes
from figures._measure import row
from tensegrity import sech2, solitary_wave

GROUP = "waves"

# speed over sound: height, prestrain of the prism; way, velocities to look between
WAVES = {
    1.05: ((0.7, 0.01), {"travel": 400, "bracket": (0.009, 0.014), "around": 7}),
    2.0: ((0.7, 0.01), {"travel": 100, "bracket": (0.06, 0.075), "around": 4}),
    3.0: ((0.7, 0.01), {"travel": 80, "bracket": (0.115, 0.125), "around": 4}),
    12.16: ((0.6, 0.001), {"travel": 48, "bracket": (0.155, 0.165), "around": 4}),
}
NEAR = (1.01, 1.05)  # speeds at which sech^2 is compared, at these prestrains
PRESTRAINS = (0.1, 0.01)
CLAIMED = {
    1.05: "localised on about 7 prisms",
    2.0: "localised on 3 prisms",
    3.0: "localised on 3 prisms",
    12.16: "almost the tent of 2 sites (1.9 at 5 %)",
}


def data():
    """Profiles and numbers of each speed."""
    tables = {}
    for ratio, (prism, how) in WAVES.items():
        found, _ = _impact.comparison(_scenes.rigid(*prism), ratio, **how)
        tables |= {f"{ratio:g} {name}": table for name, table in found.items()}
    return tables | {"near sound": near_sound()}


def near_sound():
    """Deviation of sech^2 from the exact wave, over its peak, by speed and prestrain."""
    x = np.linspace(-10, 10, 801)
    table = {"speed ratio": NEAR}
    for prestrain in PRESTRAINS:
        spring = _scenes.rigid(0.7, prestrain)
        waves = [solitary_wave(spring, speed_ratio=ratio) for ratio in NEAR]
        table[f"{prestrain:g}"] = [
            float(np.abs(sech2(spring, ratio, x) - wave.elongation(x)).max() / abs(wave.amplitude))
            for ratio, wave in zip(NEAR, waves, strict=True)
        ]
    return table


def draw(figure, tables):
    """Profiles of each speed."""
    figure.set_size_inches(9, 7)
    for axes, (ratio, (prism, _)) in zip(figure.subplots(2, 2).flat, WAVES.items(), strict=True):
        one = {name: tables[f"{ratio:g} {name}"] for name in ("curves", "launched", "emerged")}
        title = f"{ratio:g} $c_s$, height {prism[0]:g} m, prestrain {prism[1]:g}"
        _impact.draw(axes, one, title)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncol=5)


def table(tables):
    """Rows for the table of the group."""
    for ratio in WAVES:
        found = _measure.from_table(tables[f"{ratio:g} numbers"])
        exact = f"(exact {found['width, exact [sites]'].value:.6f})"
        for name in ("launched", "emerged"):
            width = found[f"width, {name} [sites]"]
            scene, words = (
                f"wave at {ratio:g} cs, {name}",
                f"{width.value:.6f} sites at 5 % {exact}",
            )
            yield row(scene, CLAIMED[ratio], words, width.error)
    near, errors = tables["near sound"], "deviation from the exact wave"
    for p in PRESTRAINS:
        off = (f"{gap:.3f} of the peak at {ratio:g} cs"
               for ratio, gap in zip(NEAR, near[f"{p:g}"], strict=True))  # fmt: skip
        scene, words = f"sech^2, height 0.7 m, prestrain {p:g}", f"off by {', '.join(off)}"
        yield row(scene, "matches near sound", words, errors)
    for ratio in (2.0, 3.0, 12.16):
        gap = _measure.from_table(tables[f"{ratio:g} numbers"])["tent - exact, over the peak"]
        words = f"off by {gap.value:.3f} of the peak"
        yield row(f"tent, {ratio:g} cs", "almost coincides at 12.16 cs", words, errors)
