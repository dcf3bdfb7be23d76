"""Every printed formula of the two sources, rederived: which hold and which do not.

Each mark stands for a formula or a claim.  It is compared with what SymPy derives from energies
and geometry, symbolically or at 50 random points to 30 digits; a formula classed as a convention
or a misprint must also be shown to fail as printed.  `make derivations` writes out every derivation
step by step.
"""

from collections import Counter

import sympy as sp

from derivations import ledger
from derivations.argument import NAMES, Verdict, derivation

GROUP = "derivations"

# verdict: colour, mark, and what it is called here
KINDS = {
    "holds": ("C0", "s", "holds"),
    "holds under a convention": ("C2", "o", "holds under a convention"),
    "misprint": ("C1", "X", "misprint"),
    "no data in the source": ("0.5", "D", "a claim without formula"),
}  # fmt: skip


def data():
    """Entries with their verdicts; misprints as printed and as derived."""
    checks = [ledger.check(entry) for entry in ledger.entries()]
    misprints = [check.entry for check in checks if check.entry.verdict is Verdict.MISPRINT]
    return {
        "entries": {
            "name": [check.entry.name for check in checks],
            "derivation": [derivation(check.entry.derivation).TITLE for check in checks],
            "place": [check.entry.place for check in checks],
            "verdict": [check.entry.verdict.value for check in checks],
            "confirmed": [check.confirmed for check in checks],
            "how": [check.how for check in checks],
        },
        "misprints": {
            "place": [entry.place for entry in misprints],
            "printed": [equation(entry.left, entry.printed) for entry in misprints],
            "derived": [equation(entry.left, ledger.derived(entry)) for entry in misprints],
            "note": [entry.note for entry in misprints],
        },
        "derivations": {"title": [derivation(name).TITLE for name in NAMES]},
    }


def equation(left, right):
    """An equation of two sides, as text with TeX in it."""
    if isinstance(right, list):
        return "decided by cases in which it must hold or fail"
    side = f"{left}:" if " " in str(left) else f"${sp.latex(left)} =$"
    return f"{side} ${sp.latex(right)}$"


def table(tables):
    """Number of entries of each verdict, and how they were decided."""
    entries = tables["entries"]
    for kind, (*_, words) in KINDS.items():
        yield {"quantity": words, "here": entries["verdict"].count(kind)}
    yield {"quantity": "verdicts that the derivations confirm", "here": sum(entries["confirmed"])}
    yield {"quantity": "decided symbolically", "here": entries["how"].count("symbolic")}


def draw(figure, tables):
    """A row of marks for each derivation; below, the misprints as printed and as derived."""
    figure.set_size_inches(9, 9.5)
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.1, 1))
    axes = upper.subplots()
    entries, titles = tables["entries"], tables["derivations"]["title"]
    place, pairs = Counter(), list(zip(entries["derivation"], entries["verdict"], strict=True))
    for kind, (colour, mark, words) in KINDS.items():
        points = []
        for title in [one for one, verdict in pairs if verdict == kind]:
            points.append((place[title], titles.index(title)))
            place[title] += 1
        label = f"{words}: {len(points)}"
        axes.scatter(*zip(*points, strict=True), 52, colour, marker=mark, label=label)
    for row, title in enumerate(titles):
        if not place[title]:
            axes.text(-0.3, row, "not printed in the sources", color="0.4", va="center")
    axes.set_yticks(range(len(titles)), titles, fontsize=8)
    axes.set(xticks=[], ylabel="derivation", ylim=(len(titles) - 0.4, -0.6), xlim=(-0.7, 27.5))
    axes.grid(False)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    axes.legend(loc="lower right", fontsize=8)
    for x, head in ((0.02, "a misprint"), (0.38, "as derived")):
        lower.text(x, 0.96, head, weight="bold")
    misprints = list(zip(*tables["misprints"].values(), strict=True))
    for k, (where, printed, derived, note) in enumerate(misprints):
        y = 0.94 * (1 - k / len(misprints))
        lower.text(0.02, y - 0.06, printed, color="C1", va="center", fontsize=11)
        lower.text(0.38, y - 0.06, derived, color="C0", va="center", fontsize=11)
        lower.text(0.02, y - 0.13, f"{where}: {note}", fontsize=8, color="0.3", va="center")
