"""A soft branch retains two fifths of the energy for milliseconds, more if stem 2 is stopped."""

from figures import _guide
from figures._guide import PARYLENE, PTFE, STEEL
from granular import diamond_guide, energies, materials

NAME = "granular_trapping"
GROUP = "granular"

SCENES = {  # soft branch, speed of the light striker [m/s], what stops stem 2
    "PTFE branch, stem 2 open": (PTFE, 0.20, None),
    "PTFE branch, stem 2 stopped": (PTFE, 0.20, materials["steel"]),
    "Parylene branch, stem 2 open": (PARYLENE, 0.50, None),
    "Parylene branch, stem 2 stopped": (PARYLENE, 0.50, materials["steel"]),
}
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
        run = _guide.followed(guide, 2.4e-3, 0.2e-6, every=20)
        parts = energies(run).parts.items()
        tables[name] = {"t [s]": run.t, **{part: x / run.energy[0] for part, x in parts}}
    return tables


def table(tables):
    """Mean and final fraction in the soft branch once the pulse has left the steel branch."""
    lines = {}
    for name, one in tables.items():
        late = one["branch 2"][one["t [s]"] > FROM]
        for when, share in (("mean from 0.8 ms", late.mean()), ("at 2.4 ms", late[-1])):
            lines[f"{name}: fraction in the soft branch, {when}"] = share, "trapped"
    return _guide.rows("trapping", lines)


def draw(figure, tables):
    """Stacked fractions against time."""
    figure.set_size_inches(9, 6)
    for axes, (name, one) in zip(figure.subplots(2, 2).flat, tables.items(), strict=True):
        t, *parts = one.values()
        axes.stackplot(1e3 * t, parts, labels=list(one)[1:], alpha=0.85)
        axes.set(xlabel="time [ms]", ylabel="fraction of the energy", title=name, ylim=(0, 1))
        axes.margins(x=0)
    handles, labels = axes.get_legend_handles_labels()
    kinds = {"branch 1": "branch 1 (steel)", "branch 2": "branch 2 (soft)"}
    labels = [kinds.get(label, label) for label in labels]
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9)
