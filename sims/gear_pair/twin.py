"""A model of a gear pair set to a rig, for the gap diagnosis: see `gearsig.gap.simulator`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from types import MappingProxyType
from typing import Self

import numpy as np

from gearsig.checks import count
from gearsig.errors import InputError, RefusalError
from gearsig.gap.simulator import Added, GapEffect, Point
from gearsig.recording.types import Recording
from gearsig.rig.toml import rig_to_dict
from gearsig.rig.types import OperatingPoint, Rig
from sims.effects import EffectSetting, effect, effects
from sims.effects.gear_side import GEARS
from sims.gear_pair.installed import SensorSeat
from sims.gear_pair.installed_table import table_of
from sims.gear_pair.plausible import PLAUSIBLE, Options, Plausible, Surroundings, plausible_of
from sims.gear_pair.seats import completed, further_seats, installed_of_rig
from sims.gear_pair.usual import (
    Nominal,
    as_plain,
    body_on_mounts,
    log_uniform,
    nominal_of,
    specimen_parameters,
    usual_housing,
    usual_parameters,
)
from sims.mesh import PairGeometry
from sims.presets import Preset, preset_text
from sims.simulator import ParameterValue
from sims.versions import sources_digest

LONGEST_LEAD_REV = 8.0
"""Of the driver, that another run starts later."""
EVEN = 0.01
"""Of a quiet machine's tolerances, what is left: none at all would leave lines of power 0."""
_UNEVEN = (
    "pitch_deviation_um",
    *(f"{what}_{gear}_{unit}" for what, unit in (("runout", "um"), ("unbalance", "g_mm")) for gear in GEARS),
)
_NOISES = ("noise_mps2", "sensor_noise_mps2_per_sqrt_hz")
VIBRATION_S = 0.5
"""Length of the run that tells how strongly the sound machine vibrates."""


@dataclass(frozen=True)
class PairTwin:
    """A rig's twin, whatever model runs it: its own geometry, the rest usual for its size.

    A seed is one specimen with its housing.

    Parameters
    ----------
    rig : Rig
    nominal : Nominal
    further : tuple of SensorSeat
        Sensors beside the rig's own.
    is_quiet : bool
        On soft mounts, without the vibration of the surroundings, its gears nearly even.
    """

    rig: Rig
    nominal: Nominal
    further: tuple[SensorSeat, ...] = ()
    is_quiet: bool = False

    @property
    def key(self) -> str:
        """Model, state of its code, and what is known of the rig."""
        known = {name: value for name, value in rig_to_dict(self.rig).items() if name not in ("name", "sources")}
        told = repr(known) + (repr(self.further) if self.further else "") + ("quiet" if self.is_quiet else "")
        return f"{self.model} {sources_digest()} {sha256(told.encode()).hexdigest()[:16]}"

    @property
    def model(self) -> str:
        """Name of the model whose preset the twin is."""
        raise NotImplementedError

    @property
    def point(self) -> Point:
        """The rig's nominal operating point, as is usual for its size where the rig does not tell."""
        return Point(self.nominal.speed_rpm, self.nominal.torque_nm)

    def run(
        self,
        point: Point,
        added: Sequence[Added] = (),
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
        noise: int = 0,
    ) -> Recording:
        """Return a recording that carries the rig; another `noise` is another run of the same machine.

        Flanks, tolerances and housing follow from `seed` alone. Sensor noise, tachometer jitter and where the run
        starts follow from seed and noise; run 0 starts at the driver's first tooth.
        """
        count(seed, "seed", minimum=0)
        own = self.preset(point, added, seed=seed)
        run_rng = np.random.default_rng([seed, count(noise, "noise", minimum=0)])
        skipped = 0
        if noise:
            skipped = round(run_rng.uniform(0.0, LONGEST_LEAD_REV) * 60.0 / point.speed_rpm * sampling_rate_hz)
        recording = self._simulated(
            own,
            point,
            seed,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s + skipped / sampling_rate_hz,
            noise_rng=run_rng if noise else None,
        )
        recording = replace(recording, truth={**(recording.truth or {}), "seed": seed, "noise": noise})
        return replace(recording, samples=recording.samples[:, skipped:]) if skipped else recording

    def quiet(self) -> Self:
        """Return the machine on soft mounts where nothing else vibrates and its own gears hardly do.

        What an effect adds is neither lost in noise nor, as a second unbalance would, weighed up against what the
        specimen happens to have there.
        """
        return replace(self, is_quiet=True)

    def candidates(self, name: str) -> Sequence[Added]:
        """Return settings of an effect worth a try, from barely noticeable to strong, for each option that matters."""
        found = []
        for options, (low, high) in self._reaches(name):
            found += [Added(name, float(f"{s:.4g}"), options) for s in np.geomspace(low, high, _plausible(name).n)]
        return found

    def with_further_sensors(self) -> tuple[Self, Mapping[str, str]]:
        """Return the machine with an upright sensor over each bearing that has none, and those channels' places."""
        further = further_seats(installed_of_rig(self.rig, self.nominal.size, ()))
        return replace(self, further=further), {seat.channel: seat.position for seat in further}

    def draw(self, name: str, rng: np.random.Generator, *, above: float = 0.0) -> Added:
        """Draw a setting from the range of the candidates, its options at random.

        Parameters
        ----------
        name : str
        rng : numpy.random.Generator
        above : float
            Share of the range, in logarithms, that is left out at its lower end.

        Raises
        ------
        RefusalError
            If the rig lacks what the effect needs: a bearing.
        """
        plausible, machine = _plausible(name), self._surroundings
        if not plausible.choices(machine):
            raise RefusalError(f"the rig has nothing that {name} could be in", remedy="describe its bearings")
        options = plausible.drawn(machine, rng)
        low, high = plausible.reach(name, machine, options)
        return Added(name, log_uniform(rng, low * (high / low) ** above, high), options)

    def preset(self, point: Point, added: Sequence[Added] = (), *, seed: int = 0, notes: Sequence[str] = ()) -> Preset:
        """Return the specimen `seed` with its effects as a preset."""
        drawn = np.random.default_rng([seed, 1])
        values = usual_parameters(self.nominal) | specimen_parameters(self.nominal, drawn)
        housing = usual_housing(drawn)
        if self.is_quiet:
            values |= dict.fromkeys(_NOISES, 0.0) | {name: EVEN * float(values[name]) for name in _UNEVEN}
            housing = (*body_on_mounts(self.nominal), *housing)
        used = [str(a.options["bearing"]) for a in added if "bearing" in a.options]
        installed = installed_of_rig(self.rig, self.nominal.size, housing, used)
        installed = replace(installed, sensors=(*installed.sensors, *self.further))
        title = f"Twin of {self.rig.name}" if self.rig.name else "Twin of a rig"
        return Preset(
            name="twin",
            model=self.model,
            title=f"{title}: {self.nominal.teeth[0]}/{self.nominal.teeth[1]}, module {self.nominal.module_mm:g}",
            sources=(*self.rig.sources, *notes),
            assumed=(
                "usual for its size: masses, inertias, shafts, stiffness and damping, tip relief, tolerances, oil",
                "transfer path: drawn",
                f"profiles of the flanks, and angles of its effects: those of seed {seed}",
                *(f"{name}: usual, the rig does not tell" for name in self.nominal.assumed),
            ),
            does_not_represent=("the real machine's own flanks, tolerances and housing",),
            parameters=MappingProxyType(as_plain(self._own_parameters(values))),
            speed_rpm=point.speed_rpm,
            torque_nm=point.torque_nm,
            effects=tuple(EffectSetting(a.name, a.severity, dict(a.options)) for a in added),
            installed=table_of(installed),
        )

    def preset_toml(self, point: Point, added: Sequence[Added], notes: Sequence[str], *, seed: int = 0) -> str:
        """Return the machine with the effects as a preset file for `gearsig simulate MODEL --preset FILE`."""
        comments = [f"The flanks' profiles are not in this file: simulate with --seed {seed} for those of the twin."]
        return preset_text(self.preset(point, added, seed=seed, notes=notes), comments)

    def pair_geometry(self) -> PairGeometry:
        """Return the geometry of the pair.

        Raises
        ------
        InputError
            If the model cannot have such gears.
        """
        return self._geometry(self.preset(self.point))

    @cached_property
    def _surroundings(self) -> Surroundings:
        pair = self.pair_geometry()
        shafts = (self.rig.pairs[0].driver, self.rig.pairs[0].driven)
        own = tuple(completed(b, self.nominal.size) for b in self.rig.bearings if b.shaft in shafts)
        sound = self.run(self.point, seed=0, duration_s=VIBRATION_S, sampling_rate_hz=20480.0)
        rms = np.mean([np.std(sound.values(name)) for name in sound.vibration_names()])
        return Surroundings(self.nominal, (pair.driver, pair.driven), own, float(rms))

    def _reaches(self, name: str) -> list[tuple[Options, tuple[float, float]]]:
        plausible, machine = _plausible(name), self._surroundings
        return [(o, plausible.reach(name, machine, o)) for o in plausible.choices(machine)]

    def _simulated(
        self,
        own: Preset,
        point: Point,
        seed: int,
        *,
        sampling_rate_hz: float,
        duration_s: float,
        noise_rng: np.random.Generator | None,
    ) -> Recording:
        """Run a specimen and measure it."""
        raise NotImplementedError

    def _geometry(self, own: Preset) -> PairGeometry:
        """Return the geometry of a specimen's pair."""
        raise NotImplementedError

    def _own_parameters(self, values: dict[str, ParameterValue]) -> dict[str, ParameterValue]:
        """Return what is usual in the model's own parameters."""
        return values

    def _rig_at(self, point: Point) -> Rig:
        own = OperatingPoint(self.rig.pairs[0].driver, point.speed_rpm, torque_nm=point.torque_nm)
        return replace(self.rig, operating_point=own)


@dataclass(frozen=True)
class PairGapSimulator:
    """A model of a gear pair as the gap diagnosis takes it.

    Parameters
    ----------
    name : str
        As on the command line.
    make : callable
        Makes a twin of a rig and of what it says of its pair.
    """

    name: str
    make: Callable[[Rig, Nominal], PairTwin]

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return all effects of the catalogue: each has a meaning for a gear pair."""
        return gap_effects_of(effects())

    def twin_of(self, rig: Rig) -> PairTwin:
        """Return a twin of the rig, whose machine has been built to see that it can be.

        Raises
        ------
        RefusalError
            If there is not exactly one pair, its teeth or module are not known, or the model cannot have such gears.
        """
        twin = self.make(rig, nominal_of(rig))
        try:
            twin.pair_geometry()
        except InputError as error:
            raise RefusalError(f"the model {self.name!r} cannot be set to this rig: {error}") from None
        return twin


def gap_effects_of(names: Iterable[str]) -> dict[str, GapEffect]:
    """Return effects of the catalogue as the gap diagnosis sees them."""
    return {
        e.name: GapEffect(
            e.name,
            e.group,
            e.title,
            e.severity.name,
            e.severity.unit,
            e.signature,
            e.shows_in,
            e.group == "measurement chain",
        )
        for e in map(effect, names)
    }


def _plausible(name: str) -> Plausible:
    return PLAUSIBLE.get(effect(name).name) or plausible_of(effect(name))
