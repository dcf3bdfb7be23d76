"""The problems of a structure under growing loads, and as its natural lengths change.

The model is that of `Structure`; bars and strings have no thickness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.minimum import least_part
from tensegrity.printing import listed
from tensegrity.structures.active_set import outgoing, selected, strains_at
from tensegrity.structures.equations import SmoothPiece
from tensegrity.structures.laws import KINDS
from tensegrity.structures.loading import Loading, Plates
from tensegrity.structures.problem import StructureProblem, critical_kinks
from tensegrity.structures.supports import NEGLIGIBLE, Supports
from tensegrity.typing import Array

NEUTRAL = 1e-10  # eigenvalues below this fraction of the stiffness are zero


def nodal(structure: Any, loads: Any) -> Array:
    """Loads {node: force} as an array (nodes, dim) [N]."""
    result = np.zeros(structure.positions.shape)
    if loads is None:
        return result
    if not isinstance(loads, Mapping):
        raise TensegrityError(f"loads {check.shown(loads)} must be a dict {{node: force}}")
    for node, force in loads.items():
        number = check.whole("loaded node", node, least=0, below=structure.nodes)
        result[number] = check.vector(f"load of node {number}", force, (structure.dim,))
    return result


def loaded(
    structure: Any,
    supports: Any,
    branch: str,
    loads: Any,
    max_load: float,
    max_shortening: float,
) -> StructureProblem:
    """The problem of a structure under growing loads; `equilibrium_path` documents the arguments.

    Parameters
    ----------
    structure : Structure
    supports : Supports
    branch : {"stable", "symmetric"}
    loads : dict or None
        {node: force (dim,)}.
    max_load, max_shortening : float
        Load [N] and shortening [m] at which the path ends.

    Returns
    -------
    StructureProblem

    Raises
    ------
    TensegrityError
        As of `equilibrium_path` and `control_path`.
    """
    if supports is None:
        raise TensegrityError("a path of a structure needs supports: held(...) or plates(...)")
    check.kind("supports", supports, Supports)
    max_load = check.number("max_load", max_load, above=0, finite=False, unit="N")
    max_shortening = check.number("max_shortening", max_shortening, above=0, finite=False, unit="m")
    _refuse_unknown(branch)
    normal = supports.direction(structure.dim)
    pattern = nodal(structure, loads)
    if loads is None:
        if not supports.upper:
            raise TensegrityError("give loads, or plates of which one moves")
        pattern[list(supports.upper)] = -normal / len(supports.upper)
    size = np.linalg.norm(pattern, axis=1).sum()
    if not size > 0:
        raise TensegrityError("loads of 0 N give no direction to follow")
    pattern = pattern / size
    motions = _motions(structure, supports, pattern)
    work = float(np.abs(motions.T @ pattern.ravel()).max(initial=0.0))
    if not work > 1e-12:
        raise EquilibriumError("the loads do no work in any motion that the supports permit")
    loading = Loading(
        structure.members, structure.positions, motions, pattern, 0 * structure.lengths,
        _plate(structure, supports), (max_load, max_shortening), 0 * pattern,
        np.zeros(len(structure.ends), dtype=bool),
    )  # fmt: skip
    return _first_piece(structure, supports, loading, branch)


def controlled(
    structure: Any, natural_lengths: Any, supports: Any, branch: str, loads: Any, keep: Any
) -> StructureProblem:
    """The problem of a structure whose natural lengths change; see `control_path`.

    Parameters
    ----------
    structure : Structure
    natural_lengths : dict
        {member: final natural length [m]}.
    supports : Supports or None
    branch : {"stable", "symmetric"}
    loads : dict or None
        {node: force (dim,) [N]}.
    keep : {"EA", "k"} or None
        None: as members were given.

    Returns
    -------
    StructureProblem

    Raises
    ------
    TensegrityError
        As of `equilibrium_path` and `control_path`.
    """
    _refuse_unknown(branch)
    if not isinstance(natural_lengths, Mapping) or not natural_lengths:
        raise TensegrityError(
            f"natural_lengths {check.shown(natural_lengths)} must be a dict {{member: length}}"
        )
    change = np.zeros(len(structure.ends))
    for member, value in natural_lengths.items():
        number = structure.member_number(member)
        length = check.number(f"natural length of member {number}", value, above=0, unit="m")
        change[number] = length - structure.natural_lengths[number]
    if not change.any():
        raise TensegrityError("natural_lengths equal those of the structure: there is no path")
    dead = nodal(structure, loads)
    motions = _motions(structure, supports, dead)
    if not motions.shape[1]:
        raise EquilibriumError("the supports permit no motion: natural lengths cannot change")
    loading = Loading(
        structure.members, structure.positions, motions, None, change,
        _plate(structure, supports), (math.inf, 1.0), dead,
        _keeping(structure, keep) & (change != 0),
    )  # fmt: skip
    gradient = structure.members.gradient(structure.positions) - dead
    left = np.abs(motions.T @ gradient.ravel()).max()
    size = np.abs(structure.tensions).max() + 1e-9 * np.max(
        structure.stiffnesses * structure.lengths
    )
    if left > 1e-6 * size:
        raise EquilibriumError(
            f"the structure is not in equilibrium: {left:.3g} N are unbalanced, forces are "
            f"{size:.3g} N; "
            "see equilibrium and Structure.relaxed"
        )
    return _first_piece(structure, supports, loading, branch)


def _first_piece(structure: Any, supports: Any, loading: Loading, branch: str) -> StructureProblem:
    """The first piece of a path."""
    u, kinks = np.zeros(loading.free + 1), loading.members.kinks
    strains, sense = strains_at(loading, u, np.zeros(len(kinks.place), bool)), 1
    critical, above = critical_kinks(strains), strains > 0
    if len(critical):
        whole = above | (kinks.kind == KINDS.index("slack"))
        whole[critical] = True
        softest = np.linalg.eigvalsh(SmoothPiece(loading, whole, critical, strains).tangent(u))[0]
        if not softest > NEUTRAL * float(loading.members.stiffness.max()):
            raise EquilibriumError(
                f"{len(critical)} strings are without tension at the start and a motion is "
                f"without stiffness (smallest eigenvalue {softest:.3g} N/m): no branch is "
                "determined; prestress the structure"
            )
        chosen = selected(outgoing(loading, u, above, critical), branch, critical)
        if chosen is None:
            raise EquilibriumError(
                f"{len(critical)} strings are at their natural length at the start and no "
                "equilibrium path leads away from it"
            )
        above, sense = chosen.above, chosen.sense
    about = {"structure": structure, "supports": supports, "winding": _words(loading)}
    problem = StructureProblem(loading, branch, about, u, above, critical, sense)
    left = least_part(problem.piece.linearised(u)[1] * problem.piece.scale)
    if left <= NEGLIGIBLE:  # the equations are rank deficient: several branches leave the start
        raise EquilibriumError(
            "a motion is without stiffness at the start and not driven (smallest singular "
            f"value {left:.3g} of the largest): no branch is determined; prestress it"
        )
    return problem


def _keeping(structure: Any, keep: Any) -> Array:
    """Which members keep EA as their natural lengths change, (members,)."""
    if keep is None:
        return np.asarray(structure.keeps_EA)
    if not isinstance(keep, str) or keep not in ("EA", "k"):
        raise TensegrityError(f"keep {check.shown(keep)} must be 'EA' or 'k'")
    kept = np.full(len(structure.ends), keep == "EA")
    kept[[*structure.law]] = False
    return kept


def _words(loading: Loading) -> str:
    """What members whose natural lengths change keep."""
    laws = loading.members.laws
    of_law = np.isin(np.arange(len(loading.kept)), laws.member if laws else ())
    wound = loading.change != 0
    words = {
        "EA is kept: wound members get stiffer": loading.kept,
        "spring constants k are kept: wound cables, which keep EA, get stiffer": ~loading.kept
        & ~of_law,
        "laws of the elongation are kept": of_law,
    }
    said = {text: np.flatnonzero(wound & which) for text, which in words.items()}
    several = sum(len(members) > 0 for members in said.values()) > 1
    return "; ".join(
        text + several * f" (members {listed(members)})"
        for text, members in said.items()
        if len(members)
    )


def _refuse_unknown(branch: str) -> None:
    if not isinstance(branch, str) or branch not in ("stable", "symmetric"):
        raise TensegrityError(f"branch {check.shown(branch)} must be 'stable' or 'symmetric'")


def _plate(structure: Any, supports: Supports | None) -> Plates | None:
    if supports is None or not (supports.lower or supports.upper):
        return None
    return supports.direction(structure.dim), supports.lower, supports.upper


def _motions(structure: Any, supports: Supports | None, pattern: Array) -> Array:
    freedom = structure.freedom(supports)
    freedom.refuse_unbalanced(structure.positions, pattern)
    return np.asarray(freedom.motions @ freedom.complement())
