"""Storage of scenes of beads in files; see `tensegrity.runs.archive`.

A contact law is a function, which cannot be stored: the contacts that it returned are, in the order
of its calls, and are returned again when the scene is rebuilt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from granular.assembly import SharedSprings
from granular.bead_chain import BeadChain
from granular.beads import Bead, Striker
from granular.contact import Contact
from granular.dissipation import Dissipation
from granular.guide import Guide
from granular.layout import Layout, Piece
from granular.materials import Material
from granular.packing import Pack
from tensegrity.runs.archive import in_time, register
from tensegrity.runs.identity import PARTS


def register_scenes() -> None:
    """Register scenes of beads, so that files can contain them."""
    for kind in (Material, Bead, Striker, Contact, Dissipation, Piece, Layout):
        register(kind)
    for kind in (BeadChain, Guide):
        register(kind, _scene, _again(kind))
    register(Pack, _pack, _pack_again)
    PARTS[SharedSprings] = lambda x: x._law  # its answers follow from it


def _scene(x: Any) -> dict[str, Any]:
    arguments = {**x._arguments, "contacts": x._contacts, **in_time(x)}
    return arguments | {k: v for k, v in x._arguments.items() if k == "forces"}  # not of contacts


def _pack(x: Any) -> dict[str, Any] | None:
    if x._hertzian:
        return {**x._arguments, **in_time(x)}
    if x._arguments["contacts"] == "follow":
        return None  # later contacts have a law that no file holds
    return {**x._arguments, **in_time(x), "answers": x._contacts, "forces": x._arguments["forces"]}


def _pack_again(answers: Iterable[Contact] | None = None, **parts: Any) -> Pack:
    if answers is None:
        return Pack(**parts)
    each = iter(answers)
    return Pack(**parts, law=lambda bead, other: next(each))


def _again(kind: Callable[..., Any]) -> Callable[..., Any]:
    """A function that rebuilds a scene of that kind from its stored contacts."""

    def make(contacts: Iterable[Contact], **parts: Any) -> Any:
        answers = iter(contacts)
        return kind(**parts, law=lambda bead, other: next(answers))

    return make
