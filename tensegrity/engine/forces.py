"""Forces of bonds and their derivatives in NumPy: for statics and modes.

Rows are those of `Bonds`: sites, and in a network walls and a spare one; the last two may be left
out of `u`, as they do not move contacts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tensegrity.engine.programs import derived, run

PART = 2**15  # contacts that are done together: what lies between takes ten times their memory


def elongations(bonds, u):
    """Elongation r of each bond [m], (..., bonds), and its gradient, (..., bonds, dim).

    `u` has the shape (..., rows, dim), on a line (..., sites).
    """
    if bonds.contacts is None:
        return stretch(bonds, u), np.ones((*u.shape[:-1], u.shape[-1] - 1, 1))
    w, pair = _moved(bonds.contacts, u)
    reference = bonds.contacts.geometry[: bonds.dim]
    along = np.broadcast_to(reference.T, w.shape).astype(w.dtype)
    if bonds.dim > 1:
        apart = reference.T[pair] + w[..., pair, :]
        along[..., pair, :] = apart / np.sqrt(np.sum(apart**2, axis=-1, keepdims=True))
    return _stretch(bonds, w, pair), along


def stretch(bonds, u):
    """The elongations alone."""
    if bonds.contacts is None:
        return np.diff(u, axis=-1)
    count = len(bonds.contacts.kind)
    if count <= PART:
        return _stretch(bonds, *_moved(bonds.contacts, u))
    parts = [_part(bonds, slice(k, k + PART)) for k in range(0, count, PART)]
    return np.concatenate([stretch(part, u) for part in parts], axis=-1)


def _part(bonds, members):
    """The same with some of the contacts only."""
    of = bonds.contacts
    kind, first, second = of.kind[members], of.first[members], of.second[members]
    geometry = of.geometry[:, members]
    return replace(
        bonds, contacts=replace(of, kind=kind, first=first, second=second, geometry=geometry)
    )


def _moved(contacts, u):
    """Displacement of the second site of each contact from the first, or from a wall; the pairs."""
    pair = contacts.kind == 0
    first = np.where(pair, contacts.first, 0)
    return u[..., contacts.second, :] - np.where(pair[:, None], u[..., first, :], 0), pair


def _stretch(bonds, w, pair):
    geometry, dim = bonds.contacts.geometry, bonds.dim
    reference, gap, length = geometry[:dim], geometry[dim], geometry[dim + 1]
    r = gap + np.sum(reference.T * w, axis=-1)  # walls, and on a line
    if dim > 1:
        axes = (*reference[:, pair], *np.moveaxis(w[..., pair, :], -1, 0))
        (r[..., pair],) = run(derived(_elongation, dim), np, (*axes, gap[pair], length[pair]))
    return r


def _elongation(dim):
    """The elongation of `derivations.geometry`, in (D, w, g, L)."""
    from derivations import geometry

    symbols = (*(x for v in geometry.vectors(dim) for x in v), geometry.initial, geometry.length)
    return [geometry.elongation(dim)], symbols


def ends(bonds):
    """Rows of the first and of the second site or wall of each bond."""
    if bonds.contacts is None:
        count = np.arange(len(bonds.group))
        return count, count + 1
    return bonds.contacts.first, bonds.contacts.second


def rows(bonds):
    """Number of rows that bonds join."""
    return len(bonds.group) + 1 if bonds.contacts is None else bonds.contacts.rows


def pulls(bonds, tension, along):
    """What bonds pull at the rows [N], (..., rows, dim)."""
    found = np.zeros((*tension.shape[:-1], rows(bonds), along.shape[-1]), dtype=tension.dtype)
    each = np.moveaxis(tension[..., None] * along, -2, 0)
    first, second = ends(bonds)
    by_row = np.moveaxis(found, -2, 0)  # a view
    np.add.at(by_row, first, each)
    np.subtract.at(by_row, second, each)
    return found


def tangent(bonds, r, along, tension, stiffness):
    """Derivative of what bonds pull at the rows, with its sign turned: the stiffness matrix.

    Parameters
    ----------
    r, tension, stiffness : ndarray, (bonds,)
        Elongation [m], force [N], and its derivative [N/m].
    along : ndarray, (bonds, dim)

    Returns
    -------
    scipy.sparse.coo_array, (rows dim, rows dim)
        [N/m]; a wall has columns of zeros, as its row does not move it.
    """
    from scipy.sparse import coo_array

    dim = along.shape[1]
    block = stiffness[:, None, None] * along[:, :, None] * along[:, None, :]
    pair = np.ones(len(r), dtype=bool)
    if bonds.contacts is not None:
        pair = bonds.contacts.kind == 0
        apart = np.where(pair, bonds.contacts.geometry[-1] + r, 1.0)
        across = np.eye(dim) - along[:, :, None] * along[:, None, :]
        block = block + np.where(pair, tension / apart, 0.0)[:, None, None] * across
    first, second = ends(bonds)
    parts = [(second, second, block, slice(None)), (first, second, -block, slice(None))]
    parts += [(first, first, block, pair), (second, first, -block, pair)]
    axis = np.arange(dim)
    at, to, values = [], [], []
    for row, column, matrix, members in parts:
        shape = matrix[members].shape
        at.append(np.broadcast_to(dim * row[members][:, None, None] + axis[:, None], shape).ravel())
        to.append(np.broadcast_to(dim * column[members][:, None, None] + axis, shape).ravel())
        values.append(matrix[members].ravel())
    size = dim * rows(bonds)
    return coo_array(
        (np.concatenate(values), (np.concatenate(at), np.concatenate(to))), shape=(size, size)
    )
