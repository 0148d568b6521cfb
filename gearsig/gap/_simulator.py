"""Interface of a simulator to the gap diagnosis: a twin of one rig that runs at any point, with effects switched on."""

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
    """An effect of the catalogue, as used by the diagnosis.

    Parameters
    ----------
    name, group, title : str
    severity_name, unit : str
    signature : str
        Where theory predicts it to show.
    shows_in : tuple of str
        Kinds of features, see `sims.effects.Effect.shows_in`.
    is_nuisance : bool
        Whether it belongs to the measurement chain: present in every real recording, and never a cause in the machine.
    signs : tuple of (str, int)
        Textbook signs: features that rise (1), fall (−1) or change either way (0); ``{side}`` is driver or driven.
    moves_pitches : float
        Maximum shift, either way, of its place within a tooth's engagement between the severities of its candidates.
    is_on_every_tooth : bool
        Whether it affects all teeth of a gear, each individually.
    profile_varies_with : str
        Name of its severity or of an option with which the profile of its change over a tooth's engagement varies
        smoothly, so that it can be interpolated; empty: there is none.
    turns_with_shaft : bool
        Whether it is a force rotating with a shaft, which excites the first order alone in a linear machine.
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
    """An effect switched on, with its severity in the effect's unit and its options (gear, tooth, bearing, order)."""

    name: str
    severity: float
    options: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def place(self) -> tuple[tuple[str, float | str], ...]:
        """The options, as part of a key."""
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
"""Relative differences within which recordings belong to the same operating condition."""


def point_text(point: OperatingCondition) -> str:
    """Format an operating point for display."""
    return f"{float(f'{point.speed_rpm:.4g}'):.6g} rpm and {point.torque_nm:.3g} N·m"


def same_condition(first: OperatingCondition, second: OperatingCondition) -> bool:
    """Whether two points belong to the same operating condition."""
    return same_speed(first, second) and same_load(first, second)


def same_speed(first: OperatingCondition, second: OperatingCondition) -> bool:
    """Whether two points have the same speed."""
    return isclose(first.speed_rpm, second.speed_rpm, rel_tol=SAME_SPEED)


def same_load(first: OperatingCondition, second: OperatingCondition) -> bool:
    """Whether two points have the same torque."""
    return isclose(first.torque_nm, second.torque_nm, rel_tol=SAME_TORQUE)


class Twin(Protocol):
    """A simulated machine set to one rig; unknown properties of the rig have the usual values for its size.

    The same `seed` gives the same flanks, tolerances and noise at every point and with every effect (common random
    numbers), so that two runs differ by the effect only.
    """

    @property
    def key(self) -> str:
        """Text that changes whenever the result of a run would change: model, version, values."""
        ...

    @property
    def point(self) -> OperatingCondition:
        """The rig's nominal operating point, or the usual one for its size where the rig does not state it."""
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
        """Return a recording with the rig's geometry; another `noise` gives another run of the same machine."""
        ...

    def candidates(self, effect: str) -> Sequence[AddedEffect]:
        """Return settings of an effect worth trying on this machine, from barely noticeable to strong."""
        ...

    def preset_toml(self, point: OperatingCondition, added: Sequence[AddedEffect], notes: Sequence[str]) -> str:
        """Return the machine with the effects as a preset file for `gearsig simulate`."""
        ...


@runtime_checkable
class CanBeQuiet(Protocol):
    """A twin that can also run without any vibration except that of an added effect."""

    def quiet(self) -> Twin:
        """Return the machine without ambient noise and with minimum vibration of its own."""
        ...


def as_tried(twin: Twin) -> Twin:
    """Return the twin for trials of effects: without noise, if possible."""
    return twin.quiet() if isinstance(twin, CanBeQuiet) else twin


@runtime_checkable
class CanRunUp(Protocol):
    """A twin whose speed can also rise, so that the path can be measured."""

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
        """Return a recording of the healthy machine whose speed rises exponentially."""
        ...


@runtime_checkable
class HasFurtherSettings(Protocol):
    """A twin with further settings of tooth faults, whose profiles over the engagement are different."""

    def further_settings(self, effect: str) -> Sequence[AddedEffect]:
        """Return these settings, in addition to the candidates; none where the candidates cover all profiles."""
        ...


@runtime_checkable
class HasFurtherPlaces(Protocol):
    """A twin that can also be measured where its rig has no sensor."""

    def with_further_sensors(self) -> tuple[Twin, Mapping[str, str]]:
        """Return the machine with an additional sensor at each place without one, and the places of those channels."""
        ...


class GapSimulator(Protocol):
    """A simulator that supports the gap diagnosis."""

    @property
    def name(self) -> str:
        """Name used on the command line."""
        ...

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return the effects that are meaningful for this model."""
        ...

    def twin_of(self, rig: Rig) -> Twin:
        """Return a twin of the rig.

        Raises
        ------
        RefusalError
            If the rig's data are insufficient, with what is missing.
        """
        ...


# --------------------
# The same for machines that start and stop, where equations of motion are compared instead of vibration.
# --------------------


@dataclass(frozen=True)
class DriveFacts:
    """Design and drive of a start–stop machine: its rig's contact, and values from its recording.

    Parameters
    ----------
    path : PathOfContact
    contact : ToothContact
        Contact of the rig; half the play and driven inertia come from a healthy recording where it shows
        them.
    module_mm : float
    motor_torque_nm, brake_torque_nm : float
        With the valve open, and during a stop.
    load_friction_nm : float
        On the driven shaft.
    top_speed_rad_s : float
        Of the driver.
    on_s, off_s : float
        Durations within a cycle.
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
    """A simulated drive set to one rig and driven as in a recording; its runs have no sensor noise."""

    @property
    def point(self) -> OperatingCondition:
        """Torque with the valve open, and the driver's speed as limited by the flow."""
        ...

    def run(self, added: Sequence[AddedEffect] = ()) -> Recording:
        """Return a recording of some cycles, always with the same seed."""
        ...

    def at_torque(self, factor: float) -> DriveTwin:
        """Return the drive with another motor torque, and hence another top speed."""
        ...

    def worn_curve_um(self, deflection_um: float, depth_um: float, n_places: int) -> FloatArray:
        """Return the driver's additional rotation at each place of the mesh cycle with worn teeth, (n_places,).

        Parameters
        ----------
        deflection_um : float
            Deflection of one pair under the ordinary load.
        depth_um : float
            Maximum depth of wear.
        n_places : int
        """
        ...

    def crack_stiffness_loss(self, crack: AddedEffect) -> float:
        """Return the fraction of its stiffness that a cracked tooth loses."""
        ...

    def preset_toml(self, added: AddedEffect, notes: Sequence[str]) -> str:
        """Return the drive with an effect as a preset file for `gearsig simulate`."""
        ...


@runtime_checkable
class DriveSimulator(Protocol):
    """A simulator that supports the gap diagnosis of machines that start and stop."""

    @property
    def name(self) -> str:
        """Name used on the command line."""
        ...

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return the effects that are meaningful for this model."""
        ...

    def drive_twin_of(self, facts: DriveFacts) -> DriveTwin:
        """Return a twin of the drive."""
        ...
