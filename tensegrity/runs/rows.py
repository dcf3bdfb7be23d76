"""The recorded rows of a run as tables, data sets and frames."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from tensegrity import check
from tensegrity.branches.table import Table
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.frames import Frames
from tensegrity.printing import Printed
from tensegrity.runs.record import require_all_sites
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.picture import is_string
from tensegrity.typing import Array, Indices
from tensegrity.unit_names import unit_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

QUANTITIES = {"u": "m", "v": "m/s", "energy": "J", "elongation": "m", "tension": "N"}


class Rows(Printed):
    """Rows of a run; see `Run`."""

    scene: Any
    t: Array
    u: Array
    v: Array
    energy: Array
    sites: tuple[int, ...]
    method: str
    dt: float
    steps: int
    complete: bool
    error_estimate: float | None
    force_model: str
    _batch: int

    def _of_bonds(self, what: str) -> Array:
        """Elongation [m] or tension [N] of the bonds at all rows, (T, bonds)."""
        require_all_sites(self)
        of = dynamics(self.scene)
        if what == "tension" and of.springs.changing:
            raise TensegrityError("springs change in time: their tensions are not evaluated")
        scene = self.scene.listed(self.u) if of.follows else self.scene
        values = scene.elongation if what == "elongation" else scene.bond_tension
        return np.asarray(values(self.u))

    @checked
    def table(
        self,
        quantity: Annotated[str, QUANTITIES] = "u",
        sites: Sequence[int] | None = None,
        times: ArrayLike | None = None,
    ) -> Table:
        """One quantity at the recorded instants, a column for each site or bond.

        Parameters
        ----------
        quantity : {"u", "v", "energy", "elongation", "tension"}, optional
            Displacement [m] or velocity [m/s] of sites, total energy [J], elongation [m] or tension
            [N] of bonds.
        sites : sequence of int, optional
            Numbers of the sites, or bonds; by default all that were recorded.
        times : array_like, (n,), optional
            Instants [s], for each of which the nearest recorded one is taken; by default all.

        Returns
        -------
        Table
            With the columns "t", then "u 3" or, in the plane and in space, "u 3 x" and so on; it
            has `to_csv`, `to_dataframe` and `plot`.

        Raises
        ------
        TensegrityError
            A quantity that is none of these, a site that was not recorded, an instant outside the
            run; bonds of a run in which not all sites were recorded; runs of an ensemble.
        """
        if self._batch:
            raise TensegrityError("a batch has no table: take that of one of its runs, run[k]")
        of_bonds = quantity in ("elongation", "tension")
        values = self._of_bonds(quantity) if of_bonds else getattr(self, quantity)
        numbers = list(range(values.shape[1])) if of_bonds else [*self.sites]
        rows = self._rows_at(times)
        columns, units, unit = {"t": self.t[rows]}, {"t": "s"}, QUANTITIES[quantity]
        if quantity == "energy":
            if sites is not None:
                raise TensegrityError("sites of the total energy: leave them out")
            columns[quantity], units[quantity], numbers = values[rows], unit, []
        wanted = numbers if sites is None else check.sequence("sites", sites, "numbers")
        kind = "bond" if of_bonds else "site"
        for number in [check.whole(kind, one, least=0) for one in wanted]:
            if number not in numbers:
                raise TensegrityError(f"{kind} {number} is none of the {len(numbers)} recorded")
            each = values[:, numbers.index(number)][rows].reshape(len(rows), -1).T
            axes = [f" {axis}" for axis in "xyz"] if values.ndim > 2 else [""]
            for axis, column in zip(axes, each, strict=False):
                name = f"{quantity} {number}{axis}"
                columns[name], units[name] = column, unit
        return Table(columns, (), "the last instant", _units=units)

    def _rows_at(self, times: Any) -> Indices:
        """Rows of the recorded instants nearest to some times."""
        if times is None:
            return np.arange(len(self.t))
        (wanted,) = check.columns(times=times)
        outside = wanted[(wanted < self.t[0]) | (wanted > self.t[-1])]
        if outside.size:
            span = f"from {self.t[0]:g} to {self.t[-1]:g} s"
            raise TensegrityError(f"time {outside[0]:g} s is outside the run, {span}")
        after = np.searchsorted(self.t, wanted).clip(1, max(1, len(self.t) - 1))
        if len(self.t) == 1:
            return np.zeros(len(wanted), dtype=np.int64)
        nearer = wanted - self.t[after - 1] <= self.t[after] - wanted
        return after - nearer

    def to_csv(
        self,
        path: str | PathLike[str],
        quantity: str = "u",
        sites: Sequence[int] | None = None,
        times: ArrayLike | None = None,
    ) -> None:
        """Write a `table` with 17 digits, below a line that names columns and units.

        Parameters
        ----------
        path : str or path
            A file that is there is replaced.
        quantity, sites, times : optional
            See `table`.

        Raises
        ------
        TensegrityError
            As `table`; a file that cannot be written.
        """
        self.table(quantity, sites, times).to_csv(path)

    def to_dataframe(
        self,
        quantity: str = "u",
        sites: Sequence[int] | None = None,
        times: ArrayLike | None = None,
    ) -> Any:
        """A `table` as one of pandas.

        Parameters
        ----------
        quantity, sites, times : optional
            See `table`.

        Returns
        -------
        pandas.DataFrame
            With the columns of `table`, and "headings" with the units in `attrs`.

        Raises
        ------
        TensegrityError
            As `table`, or if pandas is not installed.
        """
        return self.table(quantity, sites, times).to_dataframe()

    def frames(self) -> Frames:
        """The sites at the recorded instants, their velocities, and the bonds with their tensions,
        unless these change in time; a chain is laid out along a line."""
        if self._batch:
            raise TensegrityError(f"a run of {self.u.shape[-1]} scenes: take that of one, run[k]")
        require_all_sites(self, " to show")
        scene, of = self.scene, dynamics(self.scene)
        if self.u.ndim == 2:
            lengths = np.array([scene.springs[k].length or 1.0 for k in range(scene.sites - 1)])
            start, bodies = np.append(0.0, np.cumsum(lengths)), getattr(scene, "bodies", ())
            places, velocity = (start + self.u)[..., None], self.v[..., None]
            radius = np.array([getattr(one, "radius", 0.0) for one in bodies]) if bodies else None
        else:
            scene = scene.listed(self.u) if of.follows else scene
            places, velocity, radius = scene.positions + self.u, self.v, scene.radius
        string = [is_string(scene.springs[k].at(0.0)) for k in range(len(scene.bonds))]
        values = {} if of.springs.changing else {"tension [N]": self._of_bonds("tension")}
        given = scene.bonds, np.array(string, dtype=bool), values, {"velocity [m/s]": velocity}
        return Frames(repr(self.scene), "time [s]", self.t, places, *given, radius)

    def to_xarray(self) -> Any:
        """The recorded rows as a data set of xarray.

        Returns
        -------
        xarray.Dataset
            `u` [m] and `v` [m/s] over t, site and, of a network, axis ("x", "y", "z"); `energy`,
            and `work` and `loss` where the scene is driven or damped [J] over t; `impulse` on the
            walls [N s] over t, wall and axis.  The coordinates are t [s] and the numbers of the
            sites that were recorded; runs of an ensemble have `scene` as the last dimension.
            Variables have their unit in `attrs["units"]`; method, step [s] and error estimate are
            attributes of the set.

        Raises
        ------
        TensegrityError
            If xarray is not installed.
        """
        xarray = check.package("xarray", "to_xarray", "data")
        behind, axis = ["scene"] * self._batch, ["axis"] * (self.u.ndim - 2 - self._batch)
        along = list("xyz"[: self.u.shape[2]]) if axis else ["x"]
        kinds: dict[str, tuple[list[str], str, str]] = {
            "u": (["site", *axis], "m", "displacement"),
            "v": (["site", *axis], "m/s", "velocity"),
            "energy": ([], "J", "total energy"),
            "work": ([], "J", "work done on the scene"),
            "loss": ([], "J", "energy taken by dashpots"),
            "impulse": (["wall", "axis"], "N s", "impulse that a wall received"),
        }
        rows = {
            name: (["t", *names, *behind], getattr(self, name), {"long_name": words, "units": unit})
            for name, (names, unit, words) in kinds.items()
            if getattr(self, name) is not None
        }
        for _, _, of in rows.values():
            of["units"] = unit_text(of["units"])
        seconds = {"units": unit_text("s")}
        places: dict[str, Any] = {"t": ("t", self.t, seconds), "site": ("site", list(self.sites))}
        if axis or "impulse" in rows:
            places["axis"] = "axis", along
        about = {
            "method": self.method,
            "dt": self.dt,
            "steps": self.steps,
            "force_model": self.force_model,
        }
        if self.error_estimate is not None:
            about["error_estimate"] = self.error_estimate
        return xarray.Dataset(rows, places, about | {"complete": int(self.complete)})

    def show(self) -> Any:
        """Play the run in a notebook, drawn as prisms, beads or members.

        Returns
        -------
        object
            A notebook displays it as a page with a slider over at most 300 instants; dragging turns
            a body in space.

        Raises
        ------
        TensegrityError
            Sites or instants that were not recorded; the runs of an ensemble.

        Examples
        --------
        >>> from tensegrity import Chain, Prism, Record, simulate
        >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), sites=20)
        >>> simulate(chain, chain.at_rest({0: 0.09}), 10.0, record=Record(interval=1.0)).show()
        11 instants of a run, shown in a notebook
        """
        from tensegrity.runs.viewer import shown

        return shown(self)
