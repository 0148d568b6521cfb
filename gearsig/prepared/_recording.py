"""One recording with the results that several methods share, each computed once and on demand."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import AngleSignal, ShaftAngle, resample_to_angle
from gearsig.checks import listed, positive, read_only
from gearsig.errors import GearsigError
from gearsig.orders import (
    AverageLines,
    OrderMap,
    SynchronousAverage,
    average_lines,
    order_map,
    order_spectrum,
    synchronous_average,
)
from gearsig.prepared._angle import phase_followed_angle, refined_angle
from gearsig.prepared._lines import LinesOverFloor, lines_over_noise_floor
from gearsig.recording import ChannelProblem, Recording, check_recording, find_problems
from gearsig.rig import PulseTimes, Rig, TachometerChannel, check_rig, known_ratio
from gearsig.spectra import Spectrum, amplitude_spectrum, ends_meet, fast_length, power_density, with_continuous_ends

T = TypeVar("T")

LONG_SAMPLES = 1 << 18
"""From this length on, a few samples at the end are left out for fast transforms."""

MEMORY_LIMIT_MB = 1024.0
"""Most that a prepared recording keeps: ten minutes of four channels at 25.6 kHz over two shafts are 980 MB."""


class PreparedRecording:
    """A recording whose shaft angle, resampled channels, averages and spectra are computed once and then kept.

    `analyze`, `estimate_crack` and `compare` accept one in place of a recording, so that calls on the same recording
    share common results.

    Parameters
    ----------
    recording : Recording
        Never changed.
    rig : Rig or None
        Used if the recording carries none; its sensors' quantities, units and scales are applied.
    memory_limit_mb : float
        In MB (10⁶ bytes), for everything kept besides the recording. The least recently used results are dropped first,
        and computed again on demand; the latest result is always kept.

    Notes
    -----
    Results are shared, so their arrays are read-only. A refusal is kept as well, and raised again. Not for use by
    several threads at a time.

    Examples
    --------
    >>> import numpy as np
    >>> from gearsig.recording import Channel, Recording
    >>> from gearsig.rig import ConstantSpeed
    >>> time_s = np.arange(20000) / 1000.0
    >>> sine = np.sin(2 * np.pi * 10.0 * time_s)[None, :]
    >>> record = Recording(sine, 1000.0, (Channel("a1", "acceleration", "m/s^2"),), ConstantSpeed(300.0))
    >>> prepared = PreparedRecording(record)
    >>> prepared.over_angle().n_revolutions > 90
    True
    >>> prepared.average("", "a1") is prepared.average("", "a1")
    True
    """

    def __init__(
        self, recording: Recording, rig: Rig | None = None, *, memory_limit_mb: float = MEMORY_LIMIT_MB
    ) -> None:
        check_recording(recording)
        check_rig(rig)
        positive(memory_limit_mb, "memory_limit_mb", "MB")
        self.recording = recording.with_rig(rig) if recording.rig is None and rig is not None else recording
        self.memory_limit_mb = memory_limit_mb
        self._kept: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()

    def __repr__(self) -> str:
        source = self.recording.provenance.source or "made in memory"
        return f"PreparedRecording({source}, {len(self._kept)} results, {self.kept_bytes / 1e6:.1f} MB)"

    @property
    def rig(self) -> Rig:
        """The recording's rig; an empty one if it has none."""
        return self.recording.rig or Rig()

    @property
    def kept_bytes(self) -> int:
        """Size of all arrays kept, in bytes."""
        return sum(n_bytes for _, n_bytes in self._kept.values())

    def keep(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return what `compute` returned, or raise what it raised, when this key was first requested.

        Parameters
        ----------
        key : hashable
            Identifies the result and every setting it depends on; begins with the name of the method's room.
        compute : callable
            Without arguments. An `InputError` or `RefusalError` that it raises is kept as well.
        """
        if key in self._kept:
            self._kept.move_to_end(key)
        else:
            try:
                result: Any = compute()
            except GearsigError as error:
                result = error
            self._kept[key] = result, _size_bytes(result)
            while self.kept_bytes > 1e6 * self.memory_limit_mb and len(self._kept) > 1:
                self._kept.popitem(last=False)
        kept: Any = self._kept[key][0]
        if isinstance(kept, GearsigError):
            raise kept.with_traceback(None)
        return kept  # type: ignore[no-any-return]  # of the type that `compute` returns

    @property
    def problems(self) -> tuple[ChannelProblem, ...]:
        """Problems of the samples of vibration channels, see `gearsig.recording.find_problems`."""
        return self.keep("problems", lambda: find_problems(self.recording))

    def grave_problems(self, channels: Collection[str]) -> list[ChannelProblem]:
        """Return the problems of some channels for which levels and lines may be wrong."""
        return [problem for problem in self.problems if problem.channel in channels and problem.is_grave]

    # Angles: small, and needed by everything.

    def keep_angle(self, find: Callable[[], ShaftAngle]) -> None:
        """Keep an angle known from elsewhere as `shaft_angle`, or the reason why there is none.

        Parameters
        ----------
        find : callable
            Without arguments; called now. Its `InputError` or `RefusalError` is kept.
        """
        with suppress(GearsigError):
            self.keep("angle", find)

    @property
    def shaft_angle(self) -> ShaftAngle:
        """Angle of the reference shaft over the record's duration, with a stated speed refined by the vibration.

        Raises
        ------
        RefusalError
            If the speed cannot be known.
        InputError
            If the speed source is malformed.
        """
        return self.keep(
            "angle",
            lambda: refined_angle(self.recording, self.rig, self.transform).between(0.0, self.recording.duration_s),
        )

    @property
    def followed_angle(self) -> ShaftAngle:
        """`shaft_angle`; if it was estimated from the vibration, made to follow the phase of the mesh harmonics.

        Averages of two records compare only with it; `analyze` does not need it.
        """
        return self.keep("followed angle", lambda: phase_followed_angle(self.recording, self.rig, self.shaft_angle))

    def ratio(self, shaft: str) -> float:
        """Return revolutions of a shaft per revolution of the reference shaft.

        Raises
        ------
        RefusalError
            If the teeth between the two are not known.
        """
        return known_ratio(self.rig, shaft) if shaft and self.rig.shafts else 1.0

    def angle_of(self, shaft: str = "", *, followed: bool = False, ratio: float | None = None) -> ShaftAngle:
        """Return the angle of a shaft.

        Parameters
        ----------
        shaft : str
            Default: the reference shaft.
        followed : bool
            Whether to start from `followed_angle`.
        ratio : float or None
            Revolutions per revolution of the reference shaft, if the rig does not give it.
        """
        angle = self.followed_angle if followed else self.shaft_angle
        turns = self.ratio(shaft) if ratio is None else ratio
        return angle if turns == 1.0 else angle.of_shaft(shaft, turns)

    def has_mark(self, shaft: str) -> bool:
        """Whether angle 0 of a shaft is a mark on that shaft: one pulse per revolution."""
        return has_mark(self.recording, self.rig, shaft)

    # Channels over angle, and results from them.

    def over_angle(
        self,
        shaft: str = "",
        channels: Sequence[str] | None = None,
        *,
        followed: bool = False,
        ratio: float | None = None,
    ) -> AngleSignal:
        """Return channels at equal steps of a shaft's angle, see `gearsig.angle.resample_to_angle`.

        Parameters
        ----------
        shaft : str
            Default: the reference shaft.
        channels : sequence of str or None
            Default: all vibration channels. A subset of channels requested together before is taken from that result.
        followed, ratio
            See `angle_of`.

        Returns
        -------
        AngleSignal
            In the channels' units, with the full bandwidth on most revolutions.
        """
        names = listed(channels, "channels", str) if channels is not None else self.recording.vibration_names()
        turns = self.ratio(shaft) if ratio is None else ratio
        angle = self.angle_of(shaft, followed=followed, ratio=turns)
        # A shaft that turns with the reference shaft shares its signal; without anything to follow, the followed angle
        # shares that of the other one.
        place = ("over angle", angle.shaft, turns, self._is_followed(followed))
        together = (key[-1] for key in self._kept if isinstance(key, tuple) and key[:-1] == place)
        held = next((group for group in together if set(names) <= set(group)), names)
        signal = self.keep((*place, held), lambda: resample_to_angle(self.recording, angle, channels=held))
        return signal if held == names else _rows(signal, names)

    def _is_followed(self, followed: bool) -> bool:
        return followed and self.followed_angle is not self.shaft_angle

    def average(self, shaft: str, channel: str) -> SynchronousAverage:
        """Return the synchronous average of a channel over a shaft's whole revolutions, with its standard error."""
        return self.keep(
            ("average", shaft, channel),
            lambda: synchronous_average(self.over_angle(shaft, [channel]), channel),
        )

    def average_lines(
        self, shaft: str = "", channels: Sequence[str] | None = None, *, followed: bool = False
    ) -> AverageLines:
        """Return the complex lines (amplitude, peak) of the synchronous averages of several channels."""
        names = listed(channels, "channels", str) if channels is not None else self.recording.vibration_names()
        return self.keep(
            ("average lines", shaft, names, self._is_followed(followed)),
            lambda: average_lines(self.over_angle(shaft, names, followed=followed)),
        )

    @property
    def fast_part(self) -> Recording:
        """The recording; if long, shortened by some 0.01 % to a number of samples that transforms fast."""
        n = self.recording.n_samples
        fast = fast_length(n) if n >= LONG_SAMPLES else n
        return self.recording if fast == n else replace(self.recording, samples=self.recording.samples[:, :fast])

    def transform(self, channel: str) -> NDArray[np.complexfloating]:
        """Return the channel's `rfft` over `fast_part`, (n_samples // 2 + 1,), in the samples' precision.

        Single precision adds noise of 2e-7 of the signal's rms, a few times the rounding error of its samples.
        """
        from scipy.fft import rfft

        return self.keep(("transform", channel), lambda: read_only(rfft(self.fast_part.values(channel))))

    def joined_transform(self, channel: str) -> NDArray[np.complexfloating]:
        """Return the `rfft` of the channel with its ends joined, for cutting out bands; see `with_continuous_ends`.

        If one vibration channel must be continued, all are, so that their envelopes have the same length.
        """
        from scipy.fft import rfft

        part = self.fast_part
        if self.keep("ends meet", lambda: all(ends_meet(part.values(name)) for name in part.vibration_names())):
            return self.transform(channel)
        return self.keep(
            ("joined transform", channel),
            lambda: read_only(rfft(with_continuous_ends(part.values(channel), continued=True))),
        )

    def spectrum(self, channel: str) -> Spectrum:
        """Return the amplitude spectrum (peak) over frequency, of `fast_part`."""
        return self.keep(
            ("spectrum", channel),
            lambda: amplitude_spectrum(self.fast_part, channel, transform=self.transform(channel)),
        )

    def power_density(self, channel: str) -> Spectrum:
        """Return Welch's power spectral density over frequency."""
        return self.keep(("density", channel), lambda: power_density(self.recording, channel))

    def order_lines(self, channel: str) -> LinesOverFloor:
        """Return the amplitude spectrum (peak) over order of the reference shaft, with its noise floor."""
        return self.keep(
            ("order lines", channel),
            lambda: lines_over_noise_floor(order_spectrum(self.over_angle("", [channel]), channel)),
        )

    def order_map(self, channel: str) -> OrderMap:
        """Return amplitudes over order of the reference shaft, along the record."""
        return self.keep(("order map", channel), lambda: order_map(self.over_angle("", [channel]), channel))

    def with_rig(self, rig: Rig) -> PreparedRecording:
        """Return the same with another rig, see `Recording.with_rig`; this very object if that is its rig already."""
        if rig is self.recording.rig or (not isinstance(rig.speed, PulseTimes) and rig == self.recording.rig):
            return self
        return PreparedRecording(self.recording.with_rig(rig), memory_limit_mb=self.memory_limit_mb)


def prepare(
    recording: Recording | PreparedRecording, rig: Rig | None = None, *, name: str = "recording"
) -> PreparedRecording:
    """Return a recording prepared; one that is already prepared is returned as it is, unless it lacks the rig.

    Parameters
    ----------
    recording : Recording or PreparedRecording
    rig : Rig or None
        Used if the recording carries none.
    name : str
        Of the caller's parameter, for error messages.
    """
    check_recording(recording, name, Recording | PreparedRecording)
    check_rig(rig)
    if not isinstance(recording, PreparedRecording):
        return PreparedRecording(recording, rig)
    return recording.with_rig(rig) if recording.recording.rig is None and rig is not None else recording


def has_mark(recording: Recording, rig: Rig, shaft: str) -> bool:
    """Whether angle 0 of a shaft is a mark on that shaft: one pulse per revolution."""
    source = recording.speed_source
    if not isinstance(source, PulseTimes | TachometerChannel) or source.pulses_per_revolution != 1:
        return False
    return (source.shaft or rig.reference_shaft) == shaft


def _rows(signal: AngleSignal, names: Sequence[str]) -> AngleSignal:
    """Return some of a signal's channels, without a copy if they are contiguous."""
    rows = [signal.channel_names.index(name) for name in names]
    neighbours = rows == list(range(rows[0], rows[0] + len(rows)))
    return replace(
        signal,
        samples=signal.samples[rows[0] : rows[0] + len(rows)] if neighbours else signal.samples[rows],
        channel_names=tuple(names),
        units=tuple(signal.units[i] for i in rows),
    )


def _size_bytes(result: object) -> int:
    """Return the size of all arrays in a result."""
    if isinstance(result, np.ndarray):
        return int(result.nbytes)
    if is_dataclass(result):
        return sum(_size_bytes(getattr(result, field.name)) for field in fields(result))
    if isinstance(result, Mapping):
        return sum(map(_size_bytes, result.values()))
    return sum(map(_size_bytes, result)) if isinstance(result, tuple | list) else 0
