"""The pull of one cable fixes the force of all 81 members of a Geiger dome on its ring.

A cable dome of two hoops and eight sectors, its edge held.  Its one state of self-stress is found
without assuming any symmetry; in closed form it follows from the joints of one radial plane.  In
each bay ridge and diagonal have equal and opposite vertical forces, which no post changes: V.  With
their slopes a and b the horizontal ones are V/a and V/b; together they are that of the ridge
outside, and hoop and post balance the diagonal outside.  The state stiffens all 22 mechanisms.
Source: Geiger, Stefaniuk & Chen 1986, The Design and Construction of Two Cable Domes, IASS.
"""

from itertools import chain, pairwise

import numpy as np

from figures._files import lines, side_by_side
from figures._structures import ENDS
from tensegrity import Structure, held, plotting

GROUP = "structures"

SECTORS = 8
RADII, HEADS, FEET = (20.0, 12.0, 5.0, 0.0), (0.0, 2.0, 3.2, 4.0), (0.0, -2.5, 0.1, 1.0)  # m
PULL = 100.0  # kN, of the inner hoop
EA = 1e5, 2e6  # kN, of cables and posts
NAMES = (
    "outer post", "inner post", "crown post", "outer ridge", "middle ridge", "inner ridge",
    "outer diagonal", "middle diagonal", "inner diagonal", "outer hoop", "inner hoop",
)  # fmt: skip


def dome(n=SECTORS):
    """The dome, its supports, and the members of each of `NAMES`."""
    turn = 2 * np.pi * np.arange(n) / n
    levels = [(RADII[0], HEADS[0]), (RADII[1], HEADS[1]), (RADII[1], FEET[1]),
              (RADII[2], HEADS[2]), (RADII[2], FEET[2])]  # fmt: skip
    rings = [np.column_stack([r * np.cos(turn), r * np.sin(turn), 0 * turn + z]) for r, z in levels]
    nodes = np.concatenate([*rings, [[0, 0, HEADS[3]], [0, 0, FEET[3]]]])
    edge, head, low, inner, base = (range(k * n, (k + 1) * n) for k in range(5))
    crown, foot = [5 * n] * n, [5 * n + 1] * n
    pairs = [
        (head, low), (inner, base), (crown[:1], foot[:1]), (edge, head), (head, inner),
        (inner, crown), (edge, low), (head, base), (inner, foot),
        (low, np.roll(low, -1).tolist()), (base, np.roll(base, -1).tolist()),
    ]  # fmt: skip
    kinds = [list(zip(*both, strict=True)) for both in pairs]
    groups = [range(*span) for span in pairwise(np.cumsum([0, *map(len, kinds)]).tolist())]
    bars, cables = (list(chain(*some)) for some in (kinds[:3], kinds[3:]))
    made = Structure(nodes, bars, cables, EA_bar=EA[1], EA_string=EA[0])
    return made, held(edge), groups


def closed(n=SECTORS):
    """Forces of the groups over that of the inner hoop, from the joints of one radial plane."""
    out = -np.diff(RADII)  # lengths of the bays, from the edge
    feet = FEET[1:]
    a, b = np.diff(HEADS) / out, (np.array(HEADS[:-1]) - feet) / out
    v = np.array([0.0, b[1] * 2 * np.sin(np.pi / n), 0.0])
    v[0], v[2] = a[0] * v[1] * (1 / a[1] + 1 / b[1]), v[1] / a[1] / (1 / a[2] + 1 / b[2])
    ridge, diagonal = v / a, v / b
    return np.concatenate([
        -v[:2], [-n * v[2]], np.hypot(1, a) * ridge, np.hypot(1, b) * diagonal,
        diagonal[:2] / (2 * np.sin(np.pi / n)),
    ])  # fmt: skip


def data():
    s, supports, groups = dome()
    stress = s.self_stress(supports)
    tight = s.prestressed(tension={groups[-1][0]: PULL}, supports=supports)
    forces = [tight.tensions[list(group)] for group in groups]
    x = s.positions
    tied = s.self_stress(supports, groups=groups)
    return {
        "groups": side_by_side([
            {"group": name, "members": len(some), "closed form": PULL * exact,
             "computed": float(some[0]), "spread": float(np.ptp(some))}
            for name, some, exact in zip(NAMES, forces, closed(), strict=True)
        ]),
        "members": {**dict(zip(ENDS, x[s.ends].reshape(-1, 6).T, strict=True)),
                    "force": tight.tensions, "string": s.is_string},
        "counts": {"states": [len(stress.states)], "of symmetry": [len(tied.states)],
                   "mechanisms": [len(s.mechanisms(supports))],
                   "least stiffness over hoop": [float(
                       stress.mechanism_stiffness.min() / (stress.feasible * s.lengths)[-1])]},
    }  # fmt: skip


def draw(figure, tables):
    """The dome, one radial plane with its forces, and both computations."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    figure.set_size_inches(11, 6.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.15, 1), width_ratios=(1, 1.15))
    space = figure.add_subplot(grid[0, 0], projection="3d")
    plane, bars = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, :])
    table, of = tables["members"], tables["groups"]
    ends = np.stack([table[name] for name in ENDS], axis=1).reshape(-1, 2, 3)
    force, string = np.array(table["force"]), np.array(table["string"], dtype=bool)
    colour = plotting.dark()(np.clip(force, 0, None) / force.max())
    colour[~string] = (0.1, 0.1, 0.1, 1)
    wide = 0.8 + 3.2 * np.abs(force) / force.max()
    space.add_collection(Line3DCollection(ends, colors=colour, linewidths=wide), autolim=False)
    space.set(xlim=(-20, 20), ylim=(-20, 20), zlim=(-3, 5), xlabel="x [m]", ylabel="y [m]")
    space.set_box_aspect((40, 40, 14), zoom=1.3)
    space.view_init(28, -70)
    space.locator_params(nbins=4)
    space.set_zticks([])
    held_at = ends[np.isclose(np.hypot(*ends[:, 0, :2].T), RADII[0]), 0]
    space.plot(*held_at.T, "^", color="C1", ms=5)
    count = {name: int(one[0]) for name, one in tables["counts"].items()}
    words = f"{count['states']} state of self-stress, {count['mechanisms']} mechanisms"
    space.set_title(f"the dome, held at its edge (triangles): {words}")
    first = np.cumsum([0, *of["members"]])[:-1].astype(int)
    for k, name in enumerate(of["group"]):
        a, b = ends[first[k]][:, [0, 2]]
        style = {"color": colour[first[k]], "lw": wide[first[k]]}
        if "hoop" in name:
            plane.plot(*a, "o", color=style["color"], ms=9, zorder=3)
            middle, shift = a, (0, -15)
        else:
            plane.plot(*np.transpose([a, b]), **style, solid_capstyle="round")
            middle, shift = (a + b) / 2, (0, 4 if "ridge" in name else -11)
            if "post" in name:
                shift = (14 if "crown" in name else -16, -4)
        words = f"{of['computed'][k]:.0f}"
        plane.annotate(words, middle, shift, textcoords="offset points", ha="center", fontsize=10)
    plane.set(
        aspect="equal",
        xlabel="distance from the axis [m]",
        ylabel="z [m]",
        ylim=(-4.2, 5.4),
        xticks=RADII,
    )
    plane.set_title("one radial plane: forces [kN], hoops as dots")
    place = np.arange(len(NAMES))
    bars.bar(place, of["computed"], color=colour[first], width=0.6, label="computed")
    bars.plot(place, of["closed form"], "o", mfc="w", mec="k", ms=7, mew=1.4,
              label="in closed form")  # fmt: skip
    bars.axhline(0, color="0.2", lw=0.8)
    bars.set_xticks(place, [name.replace(" ", "\n") for name in of["group"]], fontsize=10)
    bars.set(ylabel="force [kN], tension > 0")
    bars.legend(loc="upper left", frameon=False)
    off = np.abs(np.array(of["computed"]) - of["closed form"]).max() / PULL
    bars.set_title(
        f"81 members, computed, and 11 groups in closed form: equal to {off:.0e} of the hoop"
    )


def table(tables):
    for line in lines(tables["groups"]):
        yield {"group": line["group"], "members": int(line["members"]),
               "closed form [kN]": line["closed form"], "computed [kN]": line["computed"],
               "spread in the group [kN]": line["spread"]}  # fmt: skip
    counts = {name: one[0] for name, one in tables["counts"].items()}
    yield {"group": "states, of these with the symmetry; mechanisms; their least stiffness [1/m]",
           "members": counts["states"], "closed form [kN]": counts["of symmetry"],
           "computed [kN]": counts["mechanisms"],
           "spread in the group [kN]": counts["least stiffness over hoop"]}  # fmt: skip
