"""Scenes, states and results in one .npz file: arrays, and a text that describes their structure.

The text is JSON.  An object in it is the name of a registered class, with the numbers, arrays and
other objects it is built from; nothing in a file is evaluated or unpickled.  An object of no
registered class, such as an energy of the user's own, is stored as its printed form and its
identity, by which it is recognised when the user supplies it again.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tensegrity import check
from tensegrity.engine import methods
from tensegrity.errors import TensegrityError
from tensegrity.prisms.closed import rigid_law
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.prisms.plates import plate_law
from tensegrity.prisms.prism import Prism
from tensegrity.readonly import Repeated
from tensegrity.runs.identity import PARTS, identity
from tensegrity.runs.record import Record
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.force import Force
from tensegrity.scenes.forcing import Damping, Drive
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.scenes.walls import Wall
from tensegrity.springs.pair_law import PairLaw
from tensegrity.springs.polynomial import Polynomial, polynomial_of_coefficients
from tensegrity.springs.potential import Potential
from tensegrity.springs.power_law import PowerLaw
from tensegrity.springs.provenance import potential_of_law, provenance
from tensegrity.springs.spline import SplineLaw
from tensegrity.structures.member_springs import MemberSpring

FORMAT = "tensegrity 1"


class SceneMissing(TensegrityError, AttributeError):
    """An attribute was requested of a scene of which a file holds the printed form only."""


class PrintedScene:
    """Placeholder of a scene that cannot be rebuilt from a file.

    Attributes
    ----------
    text : str
        The printed form of the scene.
    fingerprint : str
        Its identity, see `tensegrity.runs.identity`, or "" if it has none.
    """

    def __init__(self, text, fingerprint) -> None:
        self.text, self.fingerprint = text, fingerprint

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        raise SceneMissing(
            f"{name} of the scene {self.__dict__.get('text', '')} is not in the file, which has "
            "its printed form only: build the scene again"
        )

    def __repr__(self) -> str:
        return self.text


class Kind(NamedTuple):
    """How objects of a class are converted to a dict and rebuilt from one."""

    type: type
    take: object
    make: object


KINDS: dict[str, Kind] = {}


def register(kind, take=None, make=None):
    """Register a class, so that its objects (not those of subclasses) can be stored.

    Parameters
    ----------
    kind : type
    take : callable object -> dict of str, optional
        Returns what the object is built from: numbers, text, None, arrays, sequences and dicts of
        these, and objects of registered classes; by default the fields of a dataclass.
    make : callable, optional
        Rebuilds the object from these, passed by name, sequences as tuples; by default the class.
    """
    KINDS[kind.__name__] = Kind(kind, take or _fields, make or kind)
    PARTS[kind] = take or _fields


def storable(scene: Any) -> Any:
    """A scene, or the printed form of one that no file can hold, to be recognised by.

    Raises
    ------
    TensegrityError
        Such a scene has something in it that has no identity, such as a function with a lock.
    """
    if isinstance(scene, PrintedScene) or holds(scene):
        return scene
    return PrintedScene(repr(scene), identity(scene))


def holds(x: Any) -> bool:
    """Whether a file can hold something so that it can be rebuilt."""
    trial = _Writer()
    try:
        json.dumps(trial.value(x))
    except TypeError:  # such as complex numbers
        return False
    return not trial.opaque


def write(path, kind, data):
    """Write a dict to a file, completely or not at all, through a temporary file.

    Parameters
    ----------
    path : str or path
    kind : str
        Name of the contents, checked by `read`.
    data : dict of str
        Values that `register` describes; any object under the name "scene".

    Raises
    ------
    TensegrityError
        The file cannot be written; an existing file stays unchanged.
    """
    writer, path = _Writer(), check.path("path", path)
    parts = {
        name: writer.scene(value) if name == "scene" else writer.value(value)
        for name, value in data.items()
    }
    text = json.dumps({"format": FORMAT, "kind": kind, "data": parts, "objects": writer.objects})
    with check.replacing(path) as new, open(new, "wb") as file:
        np.savez(file, text=np.array(text), **writer.arrays)


def read(path, kind, make=dict):
    """Read a file that `write` wrote.

    Parameters
    ----------
    path : str or path
    kind : str
        Name of the contents.
    make : callable (dict) -> object, optional

    Returns
    -------
    object
        The result of `make` for the stored dict, in which a scene that cannot be rebuilt is a
        `PrintedScene`.

    Raises
    ------
    TensegrityError
        There is no such file, it is damaged, or it holds something else.
    """
    path = check.path("path", path)
    if not path.is_file():
        raise TensegrityError(f"there is no file {path}")
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as arrays:
            arrays = {name: arrays[name] for name in arrays.files}
        whole = json.loads(str(arrays.pop("text")[()]))
        if whole["format"] != FORMAT or whole["kind"] != kind:
            raise TensegrityError(f"it holds a {whole['kind']} of {whole['format']}")
        reader = _Reader(whole["objects"], arrays)
        return make({name: reader.value(value) for name, value in whole["data"].items()})
    except UnknownKind:
        raise
    except Exception as error:  # a damaged file raises errors of zip, NumPy, JSON and our classes
        raise TensegrityError(f"{path} holds no {kind}, or is damaged: {error}") from error


def array(
    name: str, value: Any, shape: tuple[int | None, ...], are_finite: bool = True
) -> NDArray[Any]:
    """Check an array that was read from a file.

    Parameters
    ----------
    name : str
        Name in messages.
    value : object
    shape : tuple of int or None
        Required shape; None stands for any length.
    are_finite : bool, optional
        Whether all numbers must be finite.

    Returns
    -------
    ndarray
        The value itself.

    Raises
    ------
    TensegrityError
        Not an array of floats of this shape, or a number that is not finite.
    """
    is_one = isinstance(value, np.ndarray) and value.dtype == float and value.ndim == len(shape)
    if not is_one or any(n not in (None, m) for n, m in zip(shape, value.shape, strict=True)):
        raise TensegrityError(f"{name} {check.shown(value)} is not an array of floats {shape}")
    return check.finite(name, value) if are_finite else value


class UnknownKind(TensegrityError):
    """A file holds an object of a class that no imported package has registered."""


class _Writer:
    def __init__(self) -> None:
        self.arrays, self.objects, self._known, self.opaque = {}, [], {}, False

    def scene(self, scene):
        """A scene, or the printed form of one that cannot be rebuilt."""
        try:
            scene = storable(scene)
        except TensegrityError:  # a file of results holds it all the same; nothing equals it
            scene = PrintedScene(repr(scene), "")
        if isinstance(scene, PrintedScene):
            return {"printed": scene.text, "fingerprint": scene.fingerprint}
        return self.value(scene)

    def value(self, x):
        if x is None or isinstance(x, (bool, int, float, str)):
            return x
        if isinstance(x, np.generic):
            return x.item()
        is_masked = isinstance(x, np.ma.MaskedArray)  # a file would lose the mask
        if isinstance(x, np.ndarray) and not (is_masked or x.dtype.hasobject):
            name = f"a{len(self.arrays)}"
            self.arrays[name] = np.ascontiguousarray(x)
            return {"array": name}
        if isinstance(x, (tuple, list, range)):
            return [self.value(one) for one in x]
        if isinstance(x, dict):
            return {"dict": [[self.value(key), self.value(one)] for key, one in x.items()]}
        if isinstance(x, Path):
            return str(x)
        return {"object": self._object(x)}

    def _object(self, x):
        if id(x) not in self._known:
            known = KINDS.get(type(x).__name__)
            parts = known.take(x) if known is not None and known.type is type(x) else None
            if parts is None:
                self.opaque, parts = True, {}
            package = type(x).__module__.split(".")[0]
            made = [package, type(x).__name__, {k: self.value(part) for k, part in parts.items()}]
            self._known[id(x)] = len(self.objects), x  # referenced, so that its id stays its own
            self.objects.append(made)
        return self._known[id(x)][0]


class _Reader:
    def __init__(self, objects, arrays) -> None:
        self._objects, self._arrays, self._made = objects, arrays, {}

    def value(self, x):
        if isinstance(x, list):
            return tuple(self.value(one) for one in x)
        if not isinstance(x, dict):
            return x
        if "array" in x:
            return self._arrays[x["array"]]
        if "dict" in x:
            return {self.value(key): self.value(one) for key, one in x["dict"]}
        if "printed" in x:
            for text in (x["printed"], x["fingerprint"]):
                check.kind("printed form", text, str)
            return PrintedScene(x["printed"], x["fingerprint"])
        return self._object(x["object"])

    def _object(self, number):
        if number not in self._made:
            package, name, parts = self._objects[number]
            if name not in KINDS:
                raise UnknownKind(
                    f"class {name} is not registered: import {package} first, or use the version "
                    "that wrote the file"
                )
            values = {key: self.value(one) for key, one in parts.items()}
            self._made[number] = KINDS[name].make(**values)
        return self._made[number]


def _fields(x):
    return {field.name: getattr(x, field.name) for field in fields(x)}


def _shared(springs):
    """The different springs, and the index of each spring into these."""
    springs = Repeated.of(springs)
    return {"different": springs.different, "number": springs.number.astype(int)}


def _spread(springs):
    return Repeated(**springs)


def _power_law(x):
    stiffness, preload, _, exponent = x.values.tolist()
    return {"stiffness": stiffness, "exponent": exponent, "preload": preload, "length": x.length}


def _rigid(x):
    of_table = isinstance(x.law, SplineLaw)
    if not of_table and all(x.law != rigid_law(any_sides) for any_sides in (False, True)):
        return None
    parts = {"spline": x.law.arguments, "noise": x.noise} if of_table else {}
    parts |= {"values": x.values, "length": x.length, "domain": x.domain, "ends": x.ends}
    return parts | dict(zip(("origin", "made_of"), provenance(x), strict=True))


def _make_rigid(values, length, domain, ends, origin, made_of=None, spline=None, noise=0.0):
    law = SplineLaw(*spline) if spline else rigid_law(len(values) > len(rigid_law().parameters))
    array("parameters", values, (len(law.parameters),))
    for text in (*ends, origin):
        check.kind("text of a potential", text, str)
    if made_of is not None:
        check.kind("prism", made_of[0], Prism)
    made = potential_of_law(law, values, length, domain, ends, origin, made_of)
    made.noise = noise
    return made


def _polynomial(x):
    names = ("degree", "values", "length", "domain", "error_estimate")
    return {name: getattr(x, name) for name in names}


def _elastic(x):
    _, (prism, preload) = provenance(x)
    return {"prism": prism, "preload": preload}


def in_time(x: Any) -> dict[str, Any]:
    """Drives, damping and forces of a scene; expressions of time are stored in printed form."""
    parts = {"drive": dict(x.drive), "damping": x.damping, "forces": dynamics(x).further_forces}
    return {name: value for name, value in parts.items() if value}


def _drive(x):
    given = {"parameters": dict(x.parameters)} if x.parameters else {}
    return {"displacement": x.displacement, "force": x.force} | given


def _force(x):
    return {"expression": x.expression, "on": x.on, "at": x.at, "parameters": dict(x.parameters)}


def _chain(x):
    parts = {"springs": _shared(x.springs), "sites": x.sites, "mass": x.mass, "ends": x.ends}
    return parts | in_time(x) | ({"stretch": x.stretch} if x.stretch else {})


def _make_chain(springs, sites, mass, ends, **forcing):
    return Chain(_spread(springs), sites, mass, ends, **forcing)


def _ensemble(x):
    same = all(scene is x.scenes[0] for scene in x.scenes)
    return {"scenes": x.scenes[0], "count": x.count} if same else {"scenes": x.scenes}


def _wall(x):
    return {"point": x.point, "normal": x.normal, "extent": x.extent}


def _make_wall(point, normal, extent):
    wall = Wall(point, normal, extent)
    if not np.allclose(wall.normal, normal, rtol=1e-15, atol=1e-15):
        raise TensegrityError(f"wall normal {normal} must have length 1")
    object.__setattr__(wall, "normal", normal)  # a second division by its length can change bits
    return wall


def _network(x):
    opening, gaps = np.split(dynamics(x).contact_bonds.contacts.gap, [len(x.bonds)])
    law, cables = dynamics(x).law, dynamics(x).cables
    if law is not None and not isinstance(law.given, Potential):
        return None  # a function, which no file holds
    followed = {"contacts": "walls"} if dynamics(x).walls_alone else {}
    if law is not None:
        followed = {"contacts": "follow", "law": law.given}
    return {
        "positions": x.positions, "bonds": x.bonds, "springs": _shared(x.springs),
        "lengths": x.lengths if opening.any() else None,  # else to the bits of the positions
        "mass": x.mass, "walls": x.walls, "wall_contacts": x.wall_contacts, "wall_gaps": gaps,
        "radius": x.radius, "loads": x.loads, "held": x.held, **followed, **in_time(x),
        "cables": cables, **({} if x.bond_mass is None else {"bond_mass": x.bond_mass}),
    }  # fmt: skip


def _make_network(bonds, springs, wall_contacts, wall_gaps, **others):
    each, count = _spread(springs), len(bonds)
    if len(wall_contacts):
        others |= {"wall_spring": each[count:]}
        if others.get("contacts") != "walls":
            others |= {"wall_contacts": wall_contacts, "wall_gaps": wall_gaps}
    return Network(bonds=bonds, spring=each[:count], **others)


register(Repeated, _shared)
register(Damping, lambda x: {k: v if v.ndim else float(v) for k, v in _fields(x).items()})
register(Drive, _drive)
register(Force, _force)
register(PowerLaw, _power_law)
register(Potential, _rigid, _make_rigid)
register(ElasticPotential, _elastic)
register(PairLaw, lambda x: x.of_prism, plate_law)
register(Polynomial, _polynomial, polynomial_of_coefficients)
register(MemberSpring, lambda x: x.given)
register(Wall, _wall, _make_wall)
register(Chain, _chain, _make_chain)
register(Ensemble, _ensemble)
register(Network, _network, _make_network)
for _kind in (
    State, Record, Prism, methods.Splitting, methods.Corrected, methods.Nystrom, methods.Midpoint,
):  # fmt: skip
    register(_kind)
