"""A soft branch retains two fifths of the energy for milliseconds, more if stem 2 is stopped."""

from __future__ import annotations

from figures import _guide
from figures._guide import PARYLENE, PTFE, STEEL, row
from granular import diamond_guide, energies, materials, simulate
from tensegrity import Record

NAME = "granular_trapping"
GROUP = "granular"

SCENES = {  # soft branch, speed of the light striker [m/s], what stops stem 2
    "PTFE branch, stem 2 open": (PTFE, 0.20, None),
    "PTFE branch, stem 2 stopped": (PTFE, 0.20, materials["steel"]),
    "Parylene branch, stem 2 open": (PARYLENE, 0.50, None),
    "Parylene branch, stem 2 stopped": (PARYLENE, 0.50, materials["steel"]),
}
END, DT, EVERY = 2.4e-3, 0.2e-6, 20  # s, s, steps between rows
FROM = 0.8e-3  # s: the pulse has left the steel branch


def data(by=1.0):
    """Fractions of the energy in the parts of the guide.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    tables = {}
    for name, (soft, speed, end) in SCENES.items():
        striker = _guide.light(by * speed)
        guide = diamond_guide(bead=STEEL, branches=(STEEL, soft), striker=striker, end=end)
        how = {"dt": DT, "method": "rkn6", "record": Record(every=EVERY)}
        run = simulate(guide, guide.start(), END, **how)
        parts = energies(run).parts
        shares = {part: energy / run.energy[0] for part, energy in parts.items()}
        tables[name] = {"t [s]": run.t, **shares}
    return tables


def table(tables):
    """Mean and final fraction in the soft branch once the pulse has left the steel branch."""
    lines = []
    for name, one in tables.items():
        late = one["branch 2"][one["t [s]"] > FROM]
        for when, share in (("mean from 0.8 ms", late.mean()), ("at 2.4 ms", late[-1])):
            words = f"{name}: fraction in the soft branch, {when}"
            lines.append(row("trapping", words, float(share), "trapped"))
    return lines


def draw(figure, tables):
    """Stacked fractions against time."""
    figure.set_size_inches(9, 6)
    for axes, (name, one) in zip(figure.subplots(2, 2).ravel(), tables.items(), strict=True):
        parts = [part for part in one if part != "t [s]"]
        axes.stackplot(1e3 * one["t [s]"], [one[part] for part in parts], labels=parts, alpha=0.85)
        axes.set(xlabel="time [ms]", ylabel="fraction of the energy", title=name, ylim=(0, 1))
        axes.margins(x=0)
    handles, labels = axes.get_legend_handles_labels()
    kinds = {"branch 1": "branch 1 (steel)", "branch 2": "branch 2 (soft)"}
    labels = [kinds.get(label, label) for label in labels]
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9)
