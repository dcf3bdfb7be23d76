"""A train splits into two equal ones, and these recombine behind the diamond.

Fig. 3 of the paper: trains of waves in the full guide, all PTFE and all steel.
"""

from figures import _guide
from figures._guide import PTFE, STEEL, curve, number
from granular import diamond_guide
from tensegrity import largest_peak, peaks

NAME = "granular_fig3"
GROUP = "granular"

SENSORS = (("stem 1", 16), ("branch 1", 7), ("branch 1", 27), ("branch 1", 43), ("stem 2", 5))
SCENES = {  # bead, striker and its speed [m/s], duration, step [s], newtons per division there
    "PTFE": (PTFE, _guide.light, 0.25, 4.2e-3, 0.4e-6, 0.5),
    "steel": (STEEL, _guide.heavy, 0.18, 2.0e-3, 0.1e-6, 5.0),
}
LEVEL = 0.1  # of the largest peak: threshold of a counted pulse
ENTERED = {"PTFE": 1.9e-3, "steel": 0.55e-3}  # s: before anything returns to the sensors


def data(by=1.0):
    """Curves, densities and energies of both scenes.

    The steps differ: rows of curves are spaced by 4 us in PTFE and 1 us in steel, those of the
    densities by 4 us and 3 us.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    tables = {}
    for name, (bead, striker, speed, t_end, dt, _) in SCENES.items():
        run = _guide.followed(diamond_guide(bead=bead, striker=striker(by * speed)), t_end, dt)
        found = _guide.scene_tables(run, SENSORS, 1)
        found["numbers"]["difference of the branches"] = [_guide.skew(run)]
        tables |= {f"{name}_{key}": one for key, one in found.items()}
    return tables


def scene(tables, name):
    """The tables of one scene."""
    start = f"{name}_"
    return {k.removeprefix(start): t for k, t in tables.items() if k.startswith(start)}


def table(tables):
    """The statements of the paper on both trains, and the numbers of the runs."""
    lines = {}
    for name in SCENES:
        one = scene(tables, name)
        stem, branch = (peaks(*curve(one, *s, ENTERED[name]), LEVEL)[1] for s in SENSORS[:2])
        first, _, bent, _ = (peaks(*curve(one, *s), LEVEL)[1][0] for s in SENSORS[1:])
        last = largest_peak(*curve(one, *SENSORS[-1]))[1]
        lines |= {
            f"{name}: largest in a branch over largest in stem 1":
            (branch.max() / stem.max(), "about half"),
            f"{name}: pulses above 10 %, stem 1 and branch, until returns":
            (f"{len(stem)}, {len(branch)}", "a train, two trains"),
            f"{name}: difference of both branches":
            (number(one, "difference of the branches"), "identical"),
            f"{name}: leading pulse at bead 43 over bead 7 (120 deg bend between)":
            (bent / first, "passes"),
            f"{name}: largest in stem 2 over largest in stem 1 (150 deg bends)":
            (last / stem.max(), "recombine"),
            **_guide.balances(one, f"{name}: "),
        }  # fmt: skip
    return _guide.rows("3", lines)


def draw(figure, tables):
    """Both scenes, one row per scene."""
    figure.set_size_inches(9, 10)
    titles = ("PTFE, 0.45 g at 0.25 m/s", "steel, 5.33 g at 0.18 m/s")
    for name, axes, title in zip(SCENES, figure.subplots(2, 2), titles, strict=True):
        divisions = [SCENES[name][-1]] * len(SENSORS)
        names = (title, "stem 1, branch 1, stem 2")
        _guide.draw_scene(axes, scene(tables, name), divisions, names)
