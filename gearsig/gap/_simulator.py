"""What the gap diagnosis asks of a simulator: a twin of one rig that runs at any point, with effects switched on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isclose
from typing import Protocol, runtime_checkable

from gearsig.checks import FloatArray
from gearsig.recording import Recording
from gearsig.rig import PathOfContact, Rig, ToothContact


@dataclass(frozen=True)
class GapEffect:
    """An effect of the catalogue as the diagnosis sees it.

    Parameters
    ----------
    name, group, title : str
    severity_name, unit : str
    signature : str
        Where theory expects it.
    shows_in : tuple of str
        Kinds of features, see `sims.effects.Effect.shows_in`.
    is_nuisance : bool
        Of the measurement chain: in every real recording, never a cause in the machine.
    signs : tuple of (str, int)
        The textbook's: features that rise (1), fall (−1) or change either way (0); ``{side}`` is driver or driven.
    moves_pitches : float
        By how much, either way, its place within a tooth's engagement moves between the severities of its candidates.
    is_on_every_tooth : bool
        Whether it sits on all teeth of a gear, on each by itself.
    profile_varies_with : str
        Name of its severity or of an option with which the profile of its change over a tooth's engagement varies
        steadily, so that it can be interpolated; empty: it varies with nothing.
    turns_with_shaft : bool
        Whether it is a force that turns with a shaft, which of a linear machine makes the first order alone.
    """

    name: str
    group: str
    title: str
    severity_name: str
    unit: str
    signature: str = ""
    shows_in: tuple[str, ...] = ()
    is_nuisance: bool = False
    signs: tuple[tuple[str, int], ...] = ()
    moves_pitches: float = 0.0
    is_on_every_tooth: bool = False
    profile_varies_with: str = ""
    turns_with_shaft: bool = False


@dataclass(frozen=True)
class AddedEffect:
    """An effect that is switched on: severity in the effect's unit, and its options (gear, tooth, bearing, order)."""

    name: str
    severity: float
    options: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def place(self) -> tuple[tuple[str, float | str], ...]:
        """The options, for a key."""
        return tuple(sorted(self.options.items()))


@dataclass(frozen=True)
class OperatingCondition:
    """An operating point of the driver's shaft.

    Parameters
    ----------
    speed_rpm : float
    torque_nm : float
    """

    speed_rpm: float
    torque_nm: float


SAME_SPEED, SAME_TORQUE = 0.03, 0.1
"""Relative: recordings nearer than this to each other are of one operating condition."""


def point_text(point: OperatingCondition) -> str:
    """Write an operating point for people."""
    return f"{float(f'{point.speed_rpm:.4g}'):.6g} rpm and {point.torque_nm:.3g} N·m"


def same_condition(first: OperatingCondition, second: OperatingCondition) -> bool:
    """Whether two points are one operating condition."""
    return same_speed(first, second) and same_load(first, second)


def same_speed(first: OperatingCondition, second: OperatingCondition) -> bool:
    """Whether two points are at one speed."""
    return isclose(first.speed_rpm, second.speed_rpm, rel_tol=SAME_SPEED)


def same_load(first: OperatingCondition, second: OperatingCondition) -> bool:
    """Whether two points are at one torque."""
    return isclose(first.torque_nm, second.torque_nm, rel_tol=SAME_TORQUE)


class Twin(Protocol):
    """A simulated machine that is set to one rig; what is not known of the rig is usual for its size.

    The same `seed` gives the same flanks, tolerances and noise at every point, with every effect (common random
    numbers): two runs differ by the effect only.
    """

    @property
    def key(self) -> str:
        """Text that changes whenever a run would come out otherwise: model, version, values."""
        ...

    @property
    def point(self) -> OperatingCondition:
        """The rig's nominal operating point, as is usual for its size where the rig does not tell."""
        ...

    def run(
        self,
        point: OperatingCondition,
        added: Sequence[AddedEffect] = (),
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
        noise: int = 0,
    ) -> Recording:
        """Return a recording with the rig's geometry; another `noise` is another run of the same machine."""
        ...

    def candidates(self, effect: str) -> Sequence[AddedEffect]:
        """Return settings of an effect worth a try on this machine, from barely noticeable to strong."""
        ...

    def preset_toml(self, point: OperatingCondition, added: Sequence[AddedEffect], notes: Sequence[str]) -> str:
        """Return the machine with the effects as a preset file that `gearsig simulate` runs."""
        ...


@runtime_checkable
class CanBeQuiet(Protocol):
    """A twin that can also run where nothing vibrates but what an effect adds."""

    def quiet(self) -> Twin:
        """Return the machine without the noise of its surroundings, its own vibration as small as may be."""
        ...


def as_tried(twin: Twin) -> Twin:
    """Return the twin that effects are tried on: without noise, if it can be."""
    return twin.quiet() if isinstance(twin, CanBeQuiet) else twin


@runtime_checkable
class CanRunUp(Protocol):
    """A twin whose speed can also rise, for the path to be measured."""

    @property
    def point(self) -> OperatingCondition:
        """The rig's nominal operating point."""
        ...

    def run_up(
        self,
        from_rpm: float,
        to_rpm: float,
        torque_nm: float,
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
    ) -> Recording:
        """Return a recording of the healthy machine whose speed rises, by equal factors in equal times."""
        ...


@runtime_checkable
class HasFurtherSettings(Protocol):
    """A twin that knows further settings of a tooth's fault, which take another profile over the engagement."""

    def further_settings(self, effect: str) -> Sequence[AddedEffect]:
        """Return those settings, beside the candidates; none where these show all there is."""
        ...


@runtime_checkable
class HasFurtherPlaces(Protocol):
    """A twin that can also be measured where its rig has no sensor."""

    def with_further_sensors(self) -> tuple[Twin, Mapping[str, str]]:
        """Return the machine with a further sensor at each place that has none, and those channels' places."""
        ...


class GapSimulator(Protocol):
    """A simulator that takes part in the gap diagnosis."""

    @property
    def name(self) -> str:
        """As on the command line."""
        ...

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return the effects that have a meaning for this model."""
        ...

    def twin_of(self, rig: Rig) -> Twin:
        """Return a twin of the rig.

        Raises
        ------
        RefusalError
            If the rig's data do not suffice, with what is missing.
        """
        ...


# --------------------
# The same of machines that start and stop, whose equations of motion are compared and not their vibration.
# --------------------


@dataclass(frozen=True)
class DriveFacts:
    """How a start–stop machine is built and driven: its rig's contact, and what its recording shows.

    Parameters
    ----------
    path : PathOfContact
    contact : ToothContact
        Of the rig; half the play, driven inertia and flank friction from a healthy recording where it shows them.
    module_mm : float
    motor_torque_nm, brake_torque_nm : float
        With the valve open; in a stop.
    load_friction_nm : float
        On the driven shaft.
    top_speed_rad_s : float
        Of the driver.
    on_s, off_s : float
        Of a cycle.
    """

    path: PathOfContact
    contact: ToothContact
    module_mm: float
    motor_torque_nm: float
    brake_torque_nm: float
    load_friction_nm: float
    top_speed_rad_s: float
    on_s: float
    off_s: float


class DriveTwin(Protocol):
    """A simulated drive that is set to one rig and driven as a recording shows it; its runs have no sensor noise."""

    @property
    def point(self) -> OperatingCondition:
        """Torque of the open valve, and the driver's speed that the flow allows."""
        ...

    def run(self, added: Sequence[AddedEffect] = ()) -> Recording:
        """Return a recording of some cycles, always with the same seed."""
        ...

    def at_torque(self, factor: float) -> DriveTwin:
        """Return the drive with another torque of the motor, and so another top speed."""
        ...

    def worn_curve_um(self, deflection_um: float, depth_um: float, n_places: int) -> FloatArray:
        """Return how much further the driver turns at each place of the mesh cycle with worn teeth, (n_places,).

        Parameters
        ----------
        deflection_um : float
            Of one pair under the ordinary load.
        depth_um : float
            Where the wear is greatest.
        n_places : int
        """
        ...

    def crack_stiffness_loss(self, crack: AddedEffect) -> float:
        """Return which part of its stiffness a cracked tooth loses."""
        ...

    def preset_toml(self, added: AddedEffect, notes: Sequence[str]) -> str:
        """Return the drive with an effect as a preset file that `gearsig simulate` runs."""
        ...


@runtime_checkable
class DriveSimulator(Protocol):
    """A simulator that takes part in the gap diagnosis of machines that start and stop."""

    @property
    def name(self) -> str:
        """As on the command line."""
        ...

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return the effects that have a meaning for this model."""
        ...

    def drive_twin_of(self, facts: DriveFacts) -> DriveTwin:
        """Return a twin of the drive."""
        ...
