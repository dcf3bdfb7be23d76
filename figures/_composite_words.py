"""Text of the page on interfaces of prisms: the claim, the definition, the verdict, its reason."""

from __future__ import annotations

import numpy as np

from figures import _composite, _solitons
from figures._composite_search import COLUMNS, FOLLOWED, LIMITS, best
from figures._files import lines

CLAIM = (
    "a reflected solitary rarefaction wave with oscillatory tail in the acoustically hard branch; "
    "and a delayed train of transmitted compression solitary pulses in the acoustically soft branch"
)


def quantities(table):
    """{quantity: number} of a table."""
    return dict(zip(table["quantity"], table["value"], strict=True))


def cases_of(tables):
    """Names of the recomputed interfaces."""
    return [name for name in tables if f"{name} pulses" in tables]


def pulses_in_words(table, where):
    """The solitary pulses of one kind."""
    mine = [row for row in lines(table) if row["where"] == where and row["solitary"]]
    return (
        "; ".join(
            f"peak {row['peak']:.4g} m, {row['ratio']:.4f} times the sound speed, misfit "
            f"{100 * row['misfit']:.2g} %, energy {row['energy']:.2g}, {row['ahead']:.0f} sites "
            "ahead of the acoustic front"
            for row in mine
        )
        or "none"
    )


def table(tables):
    """One row per incidence."""
    rows = []
    for name in cases_of(tables):
        value, pulses = quantities(tables[name]), tables[f"{name} pulses"]
        rows.append(
            {
                "what": name,
                "reflected solitary rarefactions": pulses_in_words(pulses, "back"),
                "transmitted solitary compressions": pulses_in_words(pulses, "train"),
                "momentum near, far, compressions": ", ".join(
                    f"{value[f'momentum of the {part}']:+.5f}"
                    for part in ("near chain", "far chain", "compressions")
                ),
                "at half the step": f"peaks change by {value[CHANGE]:.1g}",
            }
        )
    return rows


CHANGE = "largest change of a peak at half the step"


def searched(tables):
    """Numbers of interfaces computed, and of those that showed one wave, the other, or both."""
    found, least = tables["search"], _solitons.LEAST
    back = np.array(found["reflected"], dtype=float) >= least
    one, two = (np.array(found[key], dtype=float) >= least for key in COLUMNS[2:4])
    return {
        "interfaces": int(np.sum(tables["counts"]["count"])),
        "followed": len(back),
        "a reflected solitary rarefaction": int(back.sum()),
        "a transmitted solitary compression": int(one.sum()),
        "two of them": int(two.sum()),
        "a reflected one and one transmitted": int((back & one).sum()),
        "a reflected one and two transmitted": int((back & two).sum()),
    }


def text(tables):
    """Definition, space, verdict, numbers and reason."""
    names = cases_of(tables)
    both = [
        name for name in names[1:]
        if quantities(tables[name])["reflected solitary rarefactions"] >= 1
        and quantities(tables[name])["transmitted solitary compressions"] >= _composite.TRAIN
    ]  # fmt: skip
    verdict = (
        f"**Verdict: reproduced with prisms, in {len(both)} of {len(names) - 1} interfaces "
        "recomputed from scratch.**" if both else
        "**Verdict: not reproduced by any interface of prisms; the nearest ones follow.**"
    )  # fmt: skip
    lines = [
        f"The talk: \"{CLAIM}\".", "", verdict, "",
        f"A pulse counts as solitary if it differs from the exact wave of the same peak by at most "
        f"{_solitons.MISFIT:.0%} of the maximum in elongation and in velocity, over the width "
        f"of the wave at {_solitons.LEVEL:.0%}; if its peak is ahead of the acoustic front that "
        f"leaves the interface when the incident peak arrives; and if it carries at least "
        f"{_solitons.LEAST:g} of the incident energy.  No end was reached (elongations there "
        f"below {_composite.QUIET:g} of the incident peak), and half the step gives the same "
        f"count.  {_composite.TRAIN} compression pulses make a train.", "",
        "Search, from acoustically hard to soft: interfaces are drawn uniformly for each seed; the "
        "last cases continue by covariance matrix adaptation from the best of different seeds.  "
        + _seeds_in_words(tables["counts"]), "",
        "| parameter | from | to | uniform in |", "|---|---|---|---|",
        *(f"| {name} | {low:g} | {high:g} | {'its logarithm' if log else 'itself'} |"
          for name, (low, high, log) in LIMITS.items()), "",
        "Energies of the search come from short coarse runs, in which slower pulses have not yet "
        "separated: a recomputed interface may show more.", "",
        "| interfaces | number |", "|---|---|",
        *(f"| {name} | {count:,} |" for name, count in searched(tables).items()), "",
        "| reason why others were not simulated | number |", "|---|---|",
        *(f"| {reason} | {count:,} |"
          for reason, count in totals(tables["counts"], "reason").items()
          if reason != FOLLOWED), "",
        "| | reflected solitary rarefactions | transmitted solitary compressions | momentum of "
        "the near chain, the far chain, its solitary compression waves | at half the step |",
        "|---|---|---|---|---|",
        *("| " + " | ".join(row.values()) + " |" for row in table(tables)), "",
        *_genes_in_words(tables["best"], names[1:]),
        *_reason(tables, names[1:]),
    ]  # fmt: skip
    return "\n".join(lines)


def totals(counts, key):
    """Numbers of interfaces computed, by the values of a column."""
    found = {}
    for name, count in zip(counts[key], counts["count"], strict=True):
        found[name] = found.get(name, 0) + int(count)
    return found


def _seeds_in_words(counts):
    kinds = dict(zip(counts["seed"], counts["kind"], strict=True))
    each = totals(counts, "seed")
    return "; ".join(f"seed {int(k)}: {each[k]:,} ({kinds[k]})" for k in sorted(each)) + "."


def _genes_in_words(columns, names):
    """Parameters of the recomputed interfaces."""
    found = [named for _, _, named in best(columns)]
    rows = [f"| {gene} | " + " | ".join(f"{found[k][gene]:.6g}" for k in range(len(names))) + " |"
            for gene in LIMITS]  # fmt: skip
    return ["| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|", *rows, ""]


def _reason(tables, names):
    lines = ["Momentum is conserved: near + far = incident (to "
             f"{max(quantities(tables[n])['momentum error'] for n in names):.0e}).  A rarefaction "
             "reflected alone would require the far chain to hold more than the incident momentum, "
             "all of it tensile; compression pulses carry momentum of the other sign, so each is "
             "balanced by more tension in the far chain or by the compression that follows the "
             "reflected rarefaction in the near one."]  # fmt: skip
    for name in names:
        value = quantities(tables[name])
        lines.append(
            f"{name}: the far chain holds {value['momentum of the far chain']:.4f} of the incident "
            f"momentum, solitary compressions {value['momentum of the compressions']:+.2g}."
        )
    return lines
