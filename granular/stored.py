"""Storage of scenes of beads in files; see `tensegrity.runs.archive`.

A contact law is a function, which cannot be stored: the contacts that it returned are, in the order
of its calls, and are returned again when the scene is rebuilt.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from granular.assembly import SharedSprings
from granular.bead_chain import BeadChain
from granular.beads import Bead, Material, Striker
from granular.contact import Contact
from granular.dissipation import Dissipation
from granular.guide import Guide
from granular.layout import Layout, Piece
from granular.packing import Pack
from tensegrity.runs.archive import in_time, register
from tensegrity.runs.identity import PARTS


def register_scenes() -> None:
    """Register scenes of beads, so that files can contain them."""
    for kind in (Material, Bead, Striker, Contact, Dissipation, Piece, Layout):
        register(kind)
    for kind, name in ((BeadChain, "contacts"), (Guide, "contacts"), (Pack, "answers")):
        register(kind, partial(_scene, name), partial(_again, kind, name))
    PARTS[SharedSprings] = lambda x: x._law  # its answers follow from it


def _scene(name: str, x: Any) -> dict[str, Any] | None:
    """What a scene is built from, its contacts under a name."""
    parts = {**x._arguments, **in_time(x), "forces": x._arguments["forces"]}  # not of contacts
    if getattr(x, "_hertzian", False):
        return parts
    if x._arguments.get("contacts") == "follow":
        return None  # later contacts have a law that no file holds
    return {**parts, name: x._contacts}


def _again(kind: Callable[..., Any], name: str, **parts: Any) -> Any:
    """The scene that is rebuilt from its stored contacts."""
    if name in parts:
        answers = iter(parts.pop(name))
        parts["law"] = lambda bead, other: next(answers)
    return kind(**parts)
