"""The reverse loop: the stages of a run inverted one by one, with the adjoint of each stage.

A stage of a splitting can be inverted from its result, so the derivatives of a run need no stored
states: the adjoint of each stage is applied where the stage is inverted.  The coefficients are
those of `methods.Splitting`; the loop is the C text of `reverse.c`.
"""

from __future__ import annotations

import ctypes
import math
from functools import cached_property

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.bonds import PAIR, WALL, integers, parameters
from tensegrity.engine.bound import stages
from tensegrity.engine.codegen import reverse_text
from tensegrity.engine.forces import refuse_cables
from tensegrity.engine.inertia import ACROSS, END
from tensegrity.engine.layout import coupling
from tensegrity.engine.native import aligned, library, structure
from tensegrity.engine.schemes import Splitting
from tensegrity.once import once

SCENE = structure("reverse.c", "scene")
COTANGENTS = structure("reverse.c", "cotangents")
TANGENTS = structure("reverse_nystrom.c", "tangents")
PACK = 8  # numbers that C may write or read beyond the last one


@once
def _compiled(laws, own, wanted, dim):
    flags = [f"-DDIM={dim}"] if dim else []
    return library(reverse_text(laws, own, wanted, dim), flags)


class Layout:
    """Layout of bonds for the reverse loop, and the derivatives that it computes.

    Parameters
    ----------
    bonds : Bonds
    wanted : tuple of tuple of int
        For each law the indices of the parameters with respect to which to differentiate.

    Attributes
    ----------
    dim, sites : int
        Coordinates of a site in a network, 0 on a line; number of sites.
    rows : int
        Rows of the arrays: sites, and in a network one for all walls; in a chain sites padded to
        whole SIMD vectors, and one more vector.
    shape : tuple of int
        Shape of u, v and their derivatives.
    room : int
        Length of arrays over bonds, with the padding that C may write.
    most : int
        Largest number of requested parameters of a law.
    kind : ndarray of int, (bonds,)
        Index into `bonds.KINDS`.
    ends : tuple of ndarray of int
        Rows of both ends of each bond; any wall has the same row.
    place : ndarray of int, (bonds,)
        Place of each bond in the order of the loop.
    is_ring : bool
        Whether the bonds are those of a ring, whose states are (sites,).
    """

    def __init__(self, bonds, wanted):
        refuse_cables(bonds, "derivatives of a motion")
        self.is_ring, bonds = bonds.stretch is not None, bonds.in_pattern
        self.bonds, self.wanted = bonds, wanted
        source, contacts, count = bonds.runs.source, bonds.contacts, len(bonds.group)
        self.dim, self.sites = bonds.dim, len(bonds.inverse_mass)
        packs = -(-self.sites // PACK) * PACK
        self.rows = self.sites + 1 if self.dim else packs + PACK
        self.shape = (self.rows, self.dim) if self.dim else (self.rows,)
        self.room = max(len(source), 0 if self.dim else self.rows) + PACK
        self.most = max((len(x) for x in wanted), default=0)
        self.kind, self.ends = np.full(count, PAIR), (np.arange(count), np.arange(count) + 1)
        if contacts is not None:
            self.kind = contacts.kind
            self.ends = np.where(self.kind == WALL, self.sites, contacts.first), contacts.second
        self.place = np.argsort(source)

    @cached_property
    def library(self):
        """The compiled reverse loop."""
        return _compiled(self.bonds.laws, self.bonds.own, self.wanted, self.dim)

    def parameters(self, bonds):
        """Fields of a scene that hold parameters; see `bonds.parameters`."""
        return parameters(bonds, self.bonds.runs, self.bonds.own)

    def coupling(self, by_heavy):
        """Fields of a scene for bonds with mass; `by_heavy` receives the derivatives."""
        of, heavy = self.bonds.coupling, [*self.bonds.heavy]
        fields = dict.fromkeys(("coupled", "coupling", "heavy", "hb"))
        if of is None:
            return fields | {"couplings": 0, "heavies": 0}
        ends = np.stack([end[heavy] for end in self.ends], axis=1) * self.dim
        return coupling(self.bonds) | {
            "couplings": len(of.target), "heavies": len(heavy), "heavy": integers(ends),
            "hb": by_heavy,
        }  # fmt: skip

    def laws_at(self, r, members):
        """Tension, stiffness, and derivatives of the tension with respect to parameters.

        Parameters
        ----------
        r : ndarray, (..., members)
            Elongations [m].
        members : ndarray of int
            Numbers of the bonds.

        Returns
        -------
        f, k : ndarray, (..., members)
            [N], [N/m]
        d : ndarray, (most, ..., members)
            With respect to the requested parameters.
        """
        f, k, d = np.empty(r.shape), np.empty(r.shape), np.zeros((self.most, *r.shape))
        for group in np.unique(self.bonds.group[members]):
            mine = np.flatnonzero(self.bonds.group[members] == group)
            law = int(self.bonds.law[group])
            count = len(self.wanted[law])
            flat = np.ascontiguousarray(r[..., mine]).ravel()
            p = np.ascontiguousarray(self.bonds.parameters[group])
            room = flat.size + PACK
            outputs, flat = np.empty((2 + count, room)), np.append(flat, np.zeros(PACK))
            places = [x.ctypes.data for x in (p, flat, outputs[0], outputs[1])]
            places.append(outputs.ctypes.data + 2 * outputs.strides[0])
            self.library.evaluate(law, room - PACK, room, *places)
            outputs = outputs[:, :-PACK].reshape(-1, *r.shape[:-1], len(mine))
            f[..., mine], k[..., mine], d[:count, ..., mine] = outputs[0], outputs[1], outputs[2:]
        return f, k, d


class ReverseLoop:
    """The prepared reverse loop, which inverts steps and propagates derivatives of objectives.

    Parameters
    ----------
    layout : Layout
    method : Splitting
    dt : float
        Step [s].
    totals : Totals
        Receives the derivatives with respect to masses, parameters and elongations.

    Attributes
    ----------
    u, v : ndarray, (rows[, dim])
        The present state [m], [m/s].
    ub, vb : ndarray, (objectives, rows[, dim])
        Derivatives with respect to these.
    scene : Structure
    """

    def __init__(self, layout, method, dt, totals):
        self.layout, self._totals = layout, totals
        b, dim, runs, room = layout.bonds, layout.dim, layout.bonds.runs, layout.room
        n, sites, size = len(runs.source), layout.sites, max(dim, 1)
        self.u, self.v, w, load = (aligned(layout.shape) for _ in range(4))
        self.ub, self.vb = (aligned((totals.objectives, *layout.shape)) for _ in range(2))
        w[:sites] = b.inverse_mass.reshape(sites, -1) if dim else b.inverse_mass
        place = np.zeros((2, n))
        if dim:
            load[:sites] = b.contacts.load
            place = np.ascontiguousarray(b.contacts.geometry[:, runs.source])
        entries, (first, second) = self.u.size, (size * x[runs.source] for x in layout.ends)
        where = {"from": first, "to": second, "first": runs.first}
        where |= {"law": 2 * runs.law + runs.own, "wall": runs.kind == WALL}
        together = not dim and totals.objectives > 1 and isinstance(method, Splitting)
        rows = method.stages if together else 1
        scratch = {"r": room, "f": room + 2, "bent": room, "k": (rows, room)}
        scratch |= {"d": (rows, layout.most, room), "pull": (rows, entries)}
        ends = geometry.own(b.laws) is not None
        scratch |= {"along": (dim * (1 + ends), n), "turn": entries}
        self.scene = SCENE(
            **stages(method, dt),
            **layout.parameters(b),
            **layout.coupling(totals.heavy),
            **{name: integers(x) for name, x in where.items()},
            **{name: aligned(size) for name, size in scratch.items()},
            u=self.u,
            v=self.v,
            w=w,
            ub=self.ub,
            vb=self.vb,
            load=load,
            geometry=place,
            values=np.ascontiguousarray(b.parameters[b.group[runs.source]])
            if ends
            else np.zeros(0),
            wb=totals.arrays[0],
            pb=totals.arrays[1],
            gb=totals.arrays[2],
            runs=len(runs.law),
            bonds=n,
            entries=entries,
            stride=room,
            objectives=totals.objectives,
            wanted=layout.most,
            room=entries if dim else entries - PACK,
            together=together,
        )
        self._address = ctypes.addressof(self.scene)

    def retune(self, bonds):
        """Restart with the masses and parameters of other bonds in the same runs of a chain;
        derivatives and totals are reset to 0."""
        self.scene.filled["w"][: self.layout.sites] = bonds.inverse_mass
        for name, values in self.layout.parameters(bonds).items():
            self.scene.filled[name][:] = values
        for array in (self.ub, self.vb, *self._totals.arrays):
            array[:] = 0

    def set(self, u, v):
        """Set the state, (sites[, dim])."""
        for array, values in ((self.u, u), (self.v, v)):
            here = array[: self.layout.sites]
            here[:] = values.reshape(here.shape)

    def state(self):
        """Copies of u and v, (sites[, dim])."""
        u, v = (x[: self.layout.sites].copy() for x in (self.u, self.v))
        return (u[:, 0], v[:, 0]) if self.layout.is_ring else (u, v)

    def reverse(self, steps, last, cotangents=None, opened=True):
        """Invert steps.

        Parameters
        ----------
        steps, last : int
            How many, and the number of the last of them.
        cotangents : OutputCotangents, optional
            Derivatives of the objectives with respect to the states between, the first included.
        opened : bool, optional
            Whether the first of them includes the closing kick of the step before; the last one
            lacks its own.
        """
        given = None if cotangents is None else cotangents.address
        self.layout.library.reverse(self._address, steps, opened, last, given)

    def reverse_stages(self, method, dt, path, ends, last=0, cotangents=None, **given):
        """The adjoint of the steps of a Runge-Kutta method.

        Parameters
        ----------
        method : Nystrom
        dt : float
            [s]
        path : ndarray, (stages of all steps, 2, entries of the sites)
            u and v of the stages.
        ends : ndarray of int, (2, places)
            Between which sites the derivatives of further forces act; the number of sites stands
            for the ground and for walls.
        last : int, optional
            Number of the last step.
        cotangents : OutputCotangents, optional
            Derivatives of the objectives with respect to the states before, the first included.
        **given : ndarray
            `stiff` and `loss` (stages of all steps, places, dim, dim), these derivatives; `pulled`,
            `moved`, the numbers of driven entries; `pull_by`, `u_by` and `v_by` (stages of all
            steps, those[, parameters]), derivatives of the drives by one or more parameters;
            `slopes` (stages of all steps, objectives, entries), which receives the derivatives of
            the objectives by the accelerations of the stages.

        Returns
        -------
        ndarray, (objectives[, parameters])
            Derivatives by those parameters.
        """
        q, entries, objectives = method.stages, self.ub[0].size, len(self.ub)
        by = np.zeros((objectives, *given["pull_by"].shape[2:]))
        powers = {"nodes": 1, "velocities": 1, "rates": 1, "matrix": 2, "positions": 2}
        arrays = {name: dt**k * np.array(getattr(method, name)) for name, k in powers.items()}
        arrays |= {"path": path, "by": by, "dt": np.array([dt]), "slopes": None} | given
        arrays |= {name: np.zeros((objectives, q, entries)) for name in ("of_u", "of_v")}
        arrays["slope"] = np.zeros(entries)
        numbers = {"stages": q, "free": path.shape[2], "places": ends.shape[1]}
        numbers |= {"pulling": len(given["pulled"]), "moving": len(given["moved"])}
        numbers["count"] = math.prod(by.shape[1:])
        first, second = max(self.layout.dim, 1) * ends
        arrays |= dict(zip(("first", "second", "pulled", "moved"),
                           map(integers, (first, second, given["pulled"], given["moved"])),
                           strict=True))  # fmt: skip
        arrays = {k: x if x is None else np.ascontiguousarray(x) for k, x in arrays.items()}
        filled, before = TANGENTS(**arrays, **numbers), cotangents and cotangents.address
        self.layout.library.reverse_nystrom(
            self._address, ctypes.addressof(filled), len(path) // q, last, before
        )
        return arrays["by"]

    def add_cotangents(self, cotangents, k):
        """Add the derivatives of the objectives with respect to the state after step number k."""
        self.layout.library.add_cotangents(self._address, cotangents.address, k)


class Totals:
    """Derivatives that the reverse pass accumulates.

    Attributes
    ----------
    arrays : tuple of ndarray
        The arrays w, p and g of the loop, in its order.
    """

    def __init__(self, layout, objectives):
        self.objectives, self._layout = objectives, layout
        self.arrays = (
            aligned((objectives, *layout.shape)),
            aligned((objectives, layout.most, layout.room)),
            np.zeros((objectives, len(layout.bonds.runs.source))),
        )
        self.heavy = np.zeros((objectives, len(layout.bonds.heavy)))

    @property
    def w(self):
        """With respect to the inverse mass of every entry; (objectives, sites[, dim])."""
        return self.arrays[0][:, : self._layout.sites]

    @property
    def bond_mass(self):
        """With respect to the masses of bonds; (objectives, bonds), 0 for those without mass."""
        bonds, wb = self._layout.bonds, self.w.sum(axis=-1)
        total = np.zeros((self.objectives, len(bonds.group)))
        first, second = (end[[*bonds.heavy]] for end in self._layout.ends)
        total[:, [*bonds.heavy]] = -END * (wb[:, first] + wb[:, second]) - ACROSS * self.heavy
        return total

    @property
    def p(self):
        """With respect to the requested parameters; (objectives, wanted, bonds)."""
        return self.arrays[1][..., self._layout.place]

    @property
    def g(self):
        """With respect to the elongations, in a network; (objectives, bonds)."""
        return self.arrays[2][:, self._layout.place]


class OutputCotangents:
    """Derivatives of objectives with respect to some entries of the states of a run.

    Parameters
    ----------
    rows : ndarray, (objectives, steps, places)
        The derivatives.
    places : ndarray of int
        Entries of u, then of v.
    u_count : int
        How many of these are entries of u.
    begin : int
        Number of the step of the first row.
    """

    def __init__(self, rows, places, u_count, begin):
        self._structure = COTANGENTS(
            rows=np.ascontiguousarray(rows, dtype=float),
            places=integers(places),
            count=len(places),
            u_count=u_count,
            begin=begin,
            end=begin + rows.shape[1] - 1,
        )
        self.address = ctypes.addressof(self._structure)
