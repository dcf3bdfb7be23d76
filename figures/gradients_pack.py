"""Only beads below the struck one, within its cone, change the force on the floor of a pack.

Sensitivity of the peak floor force to every diameter, in the plane and in space. Packs of steel
beads of the talk, part II, struck from above. A bead that grows at a fixed centre stiffens its
contacts, gains mass and, above all, reduces the gaps. The derivatives of the peak floor force with
respect to all diameters come from one backward pass; they vanish except for beads that the wave has
reached and whose response has arrived at the floor by then.
"""

from __future__ import annotations

import numpy as np

from figures import _gradients, _packs
from figures._disks import disks
from tensegrity import gradient
from tensegrity import objective as o

NAME = "gradients_pack"
GROUP = "gradients"

ENDS = {"plane": 7e-4, "space": 6e-4}  # s; the floor's peak is before
DT, CHECKPOINTS = 2e-7, 100
MICRON = 1e-6  # m


def scenes():
    """{name: pack}."""
    return {"plane": _packs.plane(), "space": _packs.cube()}


def floor(pack):
    """The trace of the load on its floor."""
    return o.load(wall=list(pack.named_walls).index("floor"))


def data():
    """Bead positions, and derivatives of the peak floor force by their diameters."""
    tables, values = {}, {}
    for name, pack in scenes().items():
        peak, norm = gradient(
            [o.peak(floor(pack)), o.p_norm(floor(pack), 32)], pack, pack.start(), ENDS[name], dt=DT,
            wanted=("diameter",), checkpoints=CHECKPOINTS,
        )  # fmt: skip
        percent = 100 * MICRON * peak.by("diameter") / peak.value
        axes = "xz" if pack.dim == 2 else "xyz"
        columns = dict(zip(axes, pack.positions.T, strict=True))
        tables[name] = columns | {"percent per um": percent}
        values |= {
            f"{name}: beads": pack.sites,
            f"{name}: largest force on the floor [N]": peak.value,
            f"{name}: largest derivative by a diameter [% per um]": np.abs(percent).max(),
            f"{name}: beads with more than a hundredth of the largest":
            np.sum(np.abs(percent) > 0.01 * np.abs(percent).max()),
            f"{name}: 32-norm's derivatives along the peak's (cosine)":
            np.dot(percent, norm.by("diameter"))
            / np.linalg.norm(percent) / np.linalg.norm(norm.by("diameter")),
            f"{name}: digits unaffected by round-off": peak.digits,
            f"{name}: error of the reversed run at the start [m, m/s]": peak.reversal,
        }  # fmt: skip
    return tables | {"numbers": _gradients.numbers(values)}


def table(tables):
    """The numbers that are printed."""
    return _gradients.lines(NAME, tables)


def section(beads):
    """Of beads in space the row of each layer that is next to the struck bead's, behind it."""
    y = np.asarray(beads["y"])
    behind = (y - y[-1]) / _packs.D  # the striker is the last
    return (behind > -0.1) & (behind < 0.6)


def draw(figure, tables):
    """The beads in position, coloured by the derivative; in space a section."""
    figure.set_size_inches(9, 4.6)
    panels = figure.subplots(1, 2, width_ratios=(1.6, 1))
    every, behind = slice(None), section(tables["space"])
    for axes, name, rows, title, size in (
        (panels[0], "plane", every, "in the plane, struck in the middle", 1.0),
        (panels[1], "space", behind, "in space: a section at the striker", 0.85),
    ):
        x, z, value = (np.asarray(tables[name][k])[rows] for k in ("x", "z", "percent per um"))
        dots = disks(
            axes, np.stack([x, z], axis=1), size * _packs.D, cmap="RdBu_r", ec="0.5", lw=0.4
        )
        most = np.abs(np.asarray(tables[name]["percent per um"])).max()
        dots.set(array=value, clim=(-most, most))
        edge = 1e3 * _packs.D * np.array([-0.7, 0.7])
        axes.set(ylabel="height z [mm]", title=title)
        axes.set_xlim(1e3 * np.array([x.min(), x.max()]) + edge)
        axes.set_ylim(1e3 * np.array([z.min(), z.max()]) + edge)
        figure.colorbar(dots, ax=axes, shrink=0.9, location="bottom",
                        label="% of the floor's peak per µm of diameter")  # fmt: skip
