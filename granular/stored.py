"""How scenes of beads are kept in files and made again: see `tensegrity.runs.archive`.

A law of contact is a function, which no file holds: its answers are kept, in the order in which
it was asked, and given again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

from granular.bead_chain import BeadChain
from granular.beads import Bead, Striker
from granular.contact import Contact
from granular.guide import Guide
from granular.layout import Layout, Piece
from granular.materials import Material
from granular.packing import Pack
from tensegrity.runs.archive import in_time, register


def register_scenes() -> None:
    """Let files hold scenes of beads."""
    for kind in (Material, Bead, Striker, Contact, Piece, Layout):
        register(kind, _fields)
    for kind in (BeadChain, Guide):
        register(kind, _scene, _again(kind))
    register(Pack, lambda scene: {**scene._made_of, **in_time(scene)})


def _fields(x: Any) -> dict[str, Any]:
    return {field.name: getattr(x, field.name) for field in fields(x)}


def _scene(x: Any) -> dict[str, Any]:
    return {**x._made_of, "contacts": x._contacts, **in_time(x)}


def _again(kind: Callable[..., Any]) -> Callable[..., Any]:
    """Makes a scene of that kind, with a law that gives the same answers."""

    def make(contacts: Iterable[Contact], **parts: Any) -> Any:
        answers = iter(contacts)
        return kind(**parts, law=lambda bead, other: next(answers))

    return make
