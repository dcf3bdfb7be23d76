"""Two rows of bistable discs that join in one compute AND or OR, depending on one torque.

The discs of `transition_switch` stand in two input rows, whose last discs are joined to a junction
from which an output row starts.  With the torque of all others the junction needs both fronts to
switch; with a larger one either will do.  It passes an OR on without switching the other input
back, since its springs to the inputs are softer than those of the rows (logic by fronts in media
that branch: J. Raney et al., PNAS 113, 9722 (2016)).
"""

from itertools import pairwise

import numpy as np

from figures import transition_switch as row
from figures._draw import note
from figures._scenes import linear
from figures._tables import arrays
from tensegrity import Damping, Network, Record, State, simulate

GROUP = "waves"

DISCS = 8  # of each row
SOFTER = 0.6  # of the junction's springs to the inputs, over those of the rows
GATES = {"AND": row.TORQUE, "OR": 12e-3}  # torques of the junction [N m]
INPUTS = "", "A", "B", "AB"
SHOWN = (("AND", "A"), ("AND", "AB"), ("OR", "A"))
TORQUES = (3e-3, 6e-3, 9e-3, 10e-3, 10.5e-3, 11e-3, 11.5e-3, 12e-3, 12.5e-3)
END, INSTANTS, SKIP = 450.0, 226, 3
FAR = 1000.0  # m: position of the ground, so that elongations to it are twists
JUNCTION = 2 * DISCS
PARTS = {"A": range(DISCS), "B": range(DISCS, 2 * DISCS),
         "output": range(2 * DISCS + 1, 3 * DISCS + 1)}  # fmt: skip


def gate(torque):
    """The network of both inputs, the junction with a torque, the output, and the ground."""
    a, b, out = PARTS.values()
    ground = out[-1] + 1
    joints = [(a[-1], JUNCTION), (b[-1], JUNCTION)]
    bonds = [pair for part in (a, b, (JUNCTION, *out)) for pair in pairwise(part)]
    unit, softer = row.unit(row.TORQUE), linear(SOFTER * row.COUPLING)
    places = np.concatenate([[*range(DISCS)] * 2, DISCS + np.arange(DISCS + 1), [-FAR]])
    units = [unit.varied({"M": torque}) if n == JUNCTION else unit for n in range(ground)]
    springs = [row.SPRING] * len(bonds) + [softer] * len(joints) + units
    grounded = [(ground, n) for n in range(ground)]
    return Network(
        places[:, None], [*bonds, *joints, *grounded], springs, held=[ground],
        damping=Damping(ground=row.DASHPOT),
    )  # fmt: skip


def run(torque, inputs):
    """The run after blows on the first discs of some inputs."""
    network = gate(torque)
    u, v = np.zeros((2, *network.shape))
    u[:-1] = row.wells(row.unit(row.TORQUE))[0]
    for name in inputs:
        v[PARTS[name][0]] = row.BLOW
    record = Record(times=np.linspace(0, END, INSTANTS))
    return simulate(network, State(u, v), END, tol=1e-5, record=record)


def switched(twist):
    """How many discs of each part are in the lower well, by twists (discs,)."""
    return {name: int(np.sum(twist[list(part)] > 0)) for name, part in PARTS.items()}


def data():
    """Twists of three runs, what each gate gives, and what one input gives by torque."""
    tables, found = {}, []
    for name, torque in GATES.items():
        for inputs in INPUTS:
            one = run(torque, inputs)
            found.append({"gate": name, "inputs": inputs} | switched(one.u[-1, :, 0]))
            if (name, inputs) in SHOWN:
                tables[f"{name} of {inputs}"] = {"t": one.t[::SKIP]} | {
                    f"twist {n}": one.u[::SKIP, n, 0] for n in range(3 * DISCS + 1)
                }
    tables["gates"] = arrays(found)
    tables["by torque"] = {"torque": np.array(TORQUES)} | {
        f"of {inputs}": np.array([switched(run(m, inputs).u[-1, :, 0])["output"] for m in TORQUES])
        for inputs in ("A", "AB")
    }
    return tables


def draw(figure, tables):
    """Three runs, and the output by the torque of the junction."""
    figure.set_size_inches(11, 8.4)
    *panels, last = figure.subplots(2, 2).ravel()
    for ax, (name, inputs) in zip(panels, SHOWN, strict=True):
        t, *twists = tables[f"{name} of {inputs}"].values()
        shown = ax.imshow(
            twists, cmap="coolwarm", vmin=-0.5, vmax=0.5, aspect="auto",
            extent=(t[0], t[-1], 3 * DISCS + 0.5, -0.5),
        )  # fmt: skip
        for edge in (DISCS, JUNCTION, JUNCTION + 1):
            ax.axhline(edge - 0.5, color="k", lw=1)
        middles = [np.mean(part) for part in PARTS.values()]
        ax.set_yticks([*middles, JUNCTION], ["input A", "input B", "output", "junction"])
        ax.grid(visible=False)
        ax.set(xlabel="time [s]", ylabel="discs")
        struck = " and ".join(inputs) + (" is struck" if len(inputs) == 1 else " are struck")
        ax.set_title(f"junction {1e3 * GATES[name]:g} mN m ({name}): {struck}")
    figure.colorbar(shown, ax=[panels[1]]).set_label("twist [rad]")
    ax, found = last, tables["by torque"]
    both = ("AB", "both are struck", "s", DISCS - 0.4), ("A", "one is struck", "o", 0.3)
    for k, (inputs, words, marker, level) in enumerate(both):
        ax.plot(1e3 * found["torque"], found[f"of {inputs}"], f"C{k}", marker=marker, ms=6)
        ax.annotate(words, (5.0, level), color=f"C{k}")
    for name, torque in GATES.items():
        ax.axvline(1e3 * torque, color="0.6", lw=1, ls="--")
        note(ax, name, (1e3 * torque, DISCS / 2), (4, 0))
    ax.set(xlabel="torque of the junction [mN m]", ylabel="discs of the output switched")
    ax.set_title("A larger torque makes an OR of an AND")


def table(tables):
    """Discs that are switched in the end."""
    return [dict(zip(tables["gates"], (x.item() for x in each), strict=True))
            for each in zip(*tables["gates"].values(), strict=True)]  # fmt: skip
