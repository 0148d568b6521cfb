"""What the gap diagnosis asks of a simulator: a twin of one rig that runs at any point, with effects switched on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from gearsig.recording import Recording
from gearsig.rig import Rig


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
    """

    name: str
    group: str
    title: str
    severity_name: str
    unit: str
    signature: str = ""
    shows_in: tuple[str, ...] = ()
    is_nuisance: bool = False


@dataclass(frozen=True)
class Added:
    """An effect that is switched on: severity in the effect's unit, and its options (gear, tooth, bearing, order)."""

    name: str
    severity: float
    options: Mapping[str, float | str] = field(default_factory=dict)


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
        added: Sequence[Added] = (),
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
        noise: int = 0,
    ) -> Recording:
        """Return a recording with the rig's geometry; another `noise` is another run of the same machine."""
        ...

    def candidates(self, effect: str) -> Sequence[Added]:
        """Return settings of an effect worth a try on this machine, from barely noticeable to strong."""
        ...

    def preset_toml(self, point: OperatingCondition, added: Sequence[Added], notes: Sequence[str]) -> str:
        """Return the machine with the effects as a preset file that `gearsig simulate` runs."""
        ...


@runtime_checkable
class CanBeQuiet(Protocol):
    """A twin that can also run where nothing vibrates but what an effect adds."""

    def quiet(self) -> Twin:
        """Return the machine without the noise of its surroundings, its own vibration as small as may be."""
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
