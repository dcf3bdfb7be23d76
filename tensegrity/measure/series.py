"""Time series: a quantity at increasing instants, with the noise of its samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.measure.peaks import noise_of
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import fixed
from tensegrity.typing import Array
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from typing import Any

    from matplotlib.axes import Axes

EVEN = 0.1  # of the interval, by which intervals may differ, as instants are printed rounded
REGULAR = 0.9  # of the intervals, from which instants are those of a clock


@dataclass(frozen=True, eq=False, repr=False)
class TimeSeries(Printed):
    """A quantity at increasing instants, as an instrument recorded it.

    Where numbers are taken, as by `fit` and NumPy, it stands for its values; `peaks`, `arrival`,
    `speed` and `Drive(force=)` take it as it is.

    Parameters
    ----------
    t : array_like, (T,)
        Instants [s], increasing.
    values : array_like, (T,)
    unit : str, optional
        Of the values.
    noise : float, optional
        Standard deviation of the noise of each sample, independent of that of others; by default
        estimated as by `peaks`, 0 of samples without noise.
    history : sequence of str, optional
        What was done with the samples.

    Raises
    ------
    TensegrityError
        Arrays of different lengths, values that are not finite, instants that do not increase.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegrity import TimeSeries, peaks
    >>> t = np.linspace(0, 1, 501)
    >>> pulse = np.exp(-(((t - 0.303) / 0.05) ** 2))
    >>> force = TimeSeries(t, pulse + 0.01 * np.random.default_rng(1).normal(size=501), "N")
    >>> print(force)
    501 samples from 0 to 1 s, every 0.002 s
    -0.0271116 to 1.00474 N, noise 0.0094 N
    >>> peaks(force).instant.round(3)
    array([0.303])
    """

    t: Array
    values: Array
    unit: str = ""
    noise: float = None  # type: ignore[assignment]
    history: Sequence[str] = ()

    if TYPE_CHECKING:  # what converts is taken, a number is kept

        def __init__(
            self,
            t: ArrayLike,
            values: ArrayLike,
            unit: str = "",
            noise: float | None = None,
            history: Sequence[str] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        t, values = check.columns(t=self.t, values=self.values)
        check.kind("unit", self.unit, str)
        if len(t) < 2 or not np.all(np.diff(t) > 0):
            least = np.diff(t).min(initial=0.0)
            raise TensegrityError(f"t must increase over 2 instants or more, not by {least:g} s")
        given = self.noise
        noise = noise_of(t, values) if given is None else check.number("noise", given, least=0)
        history = [
            check.kind("history", one, str)
            for one in check.sequence("history", self.history, "texts")
        ]
        parts = {"t": fixed(t), "values": fixed(values), "noise": noise}
        for name, value in (parts | {"history": tuple(history)}).items():
            object.__setattr__(self, name, value)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.values, dtype=dtype)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def interval(self) -> float:
        """Median of the intervals between samples [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def lost(self) -> list[tuple[float, int]]:
        """Samples that a clock of this interval would have taken: after which instant [s], and how
        many; none where the instants are not those of a clock."""
        ratios = np.diff(self.t) / self.interval
        if np.mean(np.abs(ratios - 1) < EVEN) < REGULAR:
            return []
        missing = np.rint(ratios).astype(int) - 1
        return [(float(self.t[k]), int(missing[k])) for k in np.flatnonzero(missing > 0)]

    @checked
    def since(self, instant: Annotated[float, "s"]) -> TimeSeries:
        """The samples from the last one before an instant [s] on, and time counted from there, as a
        `Drive` needs it; a TensegrityError where fewer than two remain."""
        after = slice(max(int(np.searchsorted(self.t, instant, "right")) - 1, 0), None)
        words = (*self.history, f"time counted from {instant:g} s")
        return TimeSeries(self.t[after] - instant, self.values[after], self.unit, self.noise, words)

    @checked
    def filtered(
        self,
        below: Annotated[float, "> 0", "1/s"] | None = None,
        above: Annotated[float, "> 0", "1/s"] | None = None,
        order: Annotated[int, ">= 1", "< 21"] = 4,
        zero_phase: bool = True,
    ) -> TimeSeries:
        """The part of some frequencies, by a Butterworth filter.

        Parameters
        ----------
        below : float, optional
            Cutoff of a low pass [Hz], below half the sampling rate.
        above : float, optional
            Cutoff of a high pass [Hz], below the other one; with both, a band pass.
        order : int, optional
            Of the filter.
        zero_phase : bool, optional
            Filter forward and backward: nothing is delayed, the ratios of amplitudes are squared,
            1/2 at the cutoff, and peaks begin before they arrive.  False: forward alone, as an
            instrument does, with the ratio 1/sqrt(2) and the phase of the filter.

        Returns
        -------
        TimeSeries
            Its `history` says what was done, with the delay of low frequencies.  Its samples
            deviate together with their neighbours, so that it has noise 0: peaks are interpolated.

        Raises
        ------
        TensegrityError
            No cutoff, or one out of bounds; samples that are lost or not evenly spaced, or fewer
            than the filter needs.
        """
        from scipy import signal

        cutoffs = [one for one in (above, below) if one is not None]
        rate = 1 / self.interval
        if not cutoffs or cutoffs != sorted(set(cutoffs)) or cutoffs[-1] >= rate / 2:
            raise TensegrityError(
                f"cutoffs above {above} and below {below} Hz must be one or two, in this order, "
                f"below half the sampling rate, {rate / 2:g} Hz"
            )
        for instant, count in self.lost[:1]:
            raise TensegrityError(f"{count} samples lost after {instant:g} s: cannot be filtered")
        if np.abs(np.diff(self.t) * rate - 1).max() > EVEN:
            raise TensegrityError("samples that are not evenly spaced cannot be filtered")
        kind = "bandpass" if len(cutoffs) == 2 else "highpass" if below is None else "lowpass"
        try:
            sections = signal.butter(
                order, cutoffs if above and below else cutoffs[0], kind, output="sos", fs=rate
            )
            values = (signal.sosfiltfilt if zero_phase else signal.sosfilt)(sections, self.values)
        except ValueError as error:
            raise TensegrityError(f"{len(self)} samples cannot be filtered: {error}") from None
        words = f"{kind} {' to '.join(f'{one:g}' for one in cutoffs)} Hz, Butterworth order {order}"
        if zero_phase:
            words += ", forward and backward: no phase"
        elif kind == "lowpass":
            w, h = signal.sosfreqz(sections, [0, 1e-4 * cutoffs[0]], fs=rate)
            late = -np.angle(h[1] / h[0]) / (2 * np.pi * w[1])
            words += f", forward: low frequencies are {late:.4g} s late"
        else:
            words += ", forward: with its phase"
        return TimeSeries(self.t, values, self.unit, 0.0, (*self.history, words))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the samples, with a band of two standard deviations; returns Matplotlib's axes."""
        drawn: Axes = plotting.axes(ax)
        (line,) = drawn.plot(self.t, self.values, lw=1.0)
        if self.noise:
            band = self.values - 2 * self.noise, self.values + 2 * self.noise
            drawn.fill_between(self.t, *band, color=line.get_color(), alpha=0.25, lw=0)
        label = f"value [{self.unit}]" if self.unit else "value"
        drawn.set(xlabel=in_units("t [s]"), ylabel=in_units(label))
        return drawn

    def _lines(self) -> Lines:
        unit = f" {self.unit}" if self.unit else ""
        yield (
            f"{len(self)} samples from {self.t[0]:g} to {self.t[-1]:g} s, every {self.interval:g} s"
        )
        ends = f"{self.values.min():g} to {self.values.max():g}{unit}"
        yield f"{ends}, noise {self.noise:.3g}{unit}"
        yield from (f"  {count} lost after {instant:g} s" for instant, count in self.lost)
        yield from (f"  {words}" for words in self.history)
