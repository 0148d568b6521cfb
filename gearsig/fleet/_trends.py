"""Trends: limits, alarms and change points of a measuring point's indicators, from its stored results."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date, datetime, time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.cache import write_whole
from gearsig.checks import FloatArray, count, not_negative, within
from gearsig.errors import InputError
from gearsig.fleet._add import UNTOLD
from gearsig.fleet._statistics import (
    ALARM,
    MIN_SCATTER,
    OK,
    OUTSIDE,
    WARNING,
    BoolArray,
    IntArray,
    alarm_levels,
    change_points,
    decibels,
    prediction_limits,
    regressors,
    standardised_innovations,
)
from gearsig.fleet._store import SERIES
from gearsig.formatting import counted, moment_text, readable
from gearsig.rig import read_toml

if TYPE_CHECKING:
    from pandas import DataFrame

SETTINGS = "settings.toml"
HEALTHY = ("no fault", UNTOLD)
"""Outcomes of recordings that may belong to a baseline if none is stated."""

SERIOUS_DB = 20.0
"""A serious rise: R. B. Randall, *Vibration-based Condition Monitoring*, 2nd ed., 2021, ch. 5."""

RETURN = 0.75
"""An alarm is cleared below this part of the distance from the expected value to the limit."""

CLEARED_ZONE = 0.9
"""Part of the boundary of zone C below which an alarm by zones is cleared."""

ISO, STATISTICAL, NONE = "ISO 20816-3", "statistical", "none"
"""Basis of limits."""

LEVEL_NAMES = {OK: "ok", WARNING: "warning", ALARM: "alarm"}
STATUS_LEVELS = ("alarm", "warning", "unknown", "ok")
"""The worst first. "unknown": a measuring point without a baseline whose last recording was inconclusive, or an
indicator without limits."""


def level_name(level: int, basis: str) -> str:
    """Return the name of a level; "unknown" if there are no limits."""
    return "unknown" if basis == NONE else LEVEL_NAMES[level]


@dataclass(frozen=True)
class Baseline:
    """A period in which a machine was healthy.

    Parameters
    ----------
    machine, point : str
        An empty point means all points of the machine.
    start, end : datetime
    """

    machine: str
    point: str
    start: datetime
    end: datetime

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise InputError(
                f"the baseline of {self.machine!r} ends at {self.end}, before it starts at {self.start}",
                remedy="give the earlier date first",
            )


@dataclass(frozen=True)
class TrendSettings:
    """How trends are judged.

    Parameters
    ----------
    n_baseline : int
        Number of first healthy recordings that form the baseline if no period is stated.
    false_alarm_rate : float
        Probability that an unchanged measuring point raises a statistical alarm at one recording, over all its
        indicators (Bonferroni); for change points, one over the mean number of recordings between false ones.
    minimum_change_db : float
        Smaller changes raise no alarm, however consistent they are: two recordings of a machine in the same state
        differ by less than 6 dB (Randall).
    n_to_clear : int
        Consecutive recordings that must be below the level for clearing before an alarm is cleared.
    baselines : tuple of Baseline
    """

    n_baseline: int = 20
    false_alarm_rate: float = 1e-3
    minimum_change_db: float = 6.0
    n_to_clear: int = 3
    baselines: tuple[Baseline, ...] = ()

    def __post_init__(self) -> None:
        count(self.n_baseline, "n_baseline", minimum=7)
        within(self.false_alarm_rate, "false_alarm_rate", 1e-9, 0.2)
        not_negative(self.minimum_change_db, "minimum_change_db", "dB")
        count(self.n_to_clear, "n_to_clear")

    def baseline_of(self, machine: str, point: str) -> Baseline | None:
        """Return the latest stated baseline of a measuring point; None if there is none."""
        of_point = [b for b in self.baselines if b.machine == machine and b.point in ("", point)]
        return max(of_point, key=lambda b: (b.point != "", b.end), default=None)

    @property
    def digest(self) -> str:
        """Short hash that shows whether trends were judged by other settings."""
        return hashlib.sha256(repr(self).encode()).hexdigest()[:12]


def read_settings(folder: Path) -> TrendSettings:
    """Read a store's settings, or the defaults if it has none.

    Raises
    ------
    InputError
        If the file is damaged or a value is not allowed.
    """
    path = folder / SETTINGS
    if not path.exists():
        return TrendSettings()
    data = read_toml(path, remedy="delete it to use the default settings, or correct it")
    known = [name for name in TrendSettings.__dataclass_fields__ if name != "baselines"]
    unknown = sorted(set(data) - {*known, "baseline"})
    if unknown:
        raise InputError(f"{unknown[0]!r} is not known", where=str(path), allowed=", ".join([*known, "[[baseline]]"]))
    tables = data.get("baseline", [])
    try:
        baselines = tuple(
            Baseline(str(t["machine"]), str(t.get("point", "")), _moment(t["start"]), _moment(t["end"], ends=True))
            for t in tables
        )
        return TrendSettings(**{name: data[name] for name in known if name in data}, baselines=baselines)
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"a value is missing or of another kind ({error})",
            where=str(path),
            remedy="[[baseline]] has machine, point, start, end",
        ) from None
    except InputError as error:
        raise InputError(error.what, where=str(path), allowed=error.allowed, remedy=error.remedy) from None


def _moment(value: object, *, ends: bool = False) -> datetime:
    if isinstance(value, datetime):
        return value.replace(tzinfo=None)
    if isinstance(value, date):
        return datetime.combine(value, time.max if ends else time.min)
    raise InputError(f"{value!r} is not a date", remedy="write for example 2026-01-31")


def write_settings(folder: Path, settings: TrendSettings) -> None:
    """Write a store's settings."""
    import tomli_w

    data: dict[str, Any] = {name: value for name, value in asdict(settings).items() if name != "baselines"}
    data["baseline"] = [asdict(baseline) for baseline in settings.baselines]
    write_whole(folder / SETTINGS, lambda file: file.write(tomli_w.dumps(data).encode()))


@dataclass(frozen=True)
class AlarmEvent:
    """An alarm of a series: when it was raised and, if it was, cleared.

    Parameters
    ----------
    level : int
        The highest reached: `WARNING` or `ALARM`.
    raised : datetime
        Date of the recording.
    added : datetime
        When that recording was added to the store.
    cleared, cleared_added : datetime or None
        The same for the recording that cleared it.
    """

    level: int
    raised: datetime
    added: datetime
    cleared: datetime | None = None
    cleared_added: datetime | None = None


@dataclass(frozen=True)
class PointTrends:
    """All series of a measuring point, judged.

    Parameters
    ----------
    recordings : DataFrame
        Recordings of the point, by date: key, date, added, speed_rpm, load_nm, outcome.
    series : DataFrame
        Name, channel, place, … of each column of the arrays.
    values, expected, low, high, alarm : array, (n_recordings, n_series)
        In the indicators' units; limits are nan if there are none. Values beyond `low` and `high` are warnings.
    in_db : bool array, (n_series,)
        Whether changes are in dB.
    baseline : bool array, (n_recordings,)
    levels : int array, (n_recordings, n_series)
        Level after each recording.
    basis : tuple of str
        Of each series: `ISO`, `STATISTICAL` or `NONE`.
    began, noticed : int array, (n_series,)
        Recordings at which each series first changed, and at which this was detected; -1 if it has not.
    normalised : tuple of str
        Quantities on which the expected values depend: "speed", "load".
    false_alarm_rate : float
        For one value of one series.
    """

    recordings: DataFrame
    series: DataFrame
    values: FloatArray
    expected: FloatArray
    low: FloatArray
    high: FloatArray
    alarm: FloatArray
    in_db: BoolArray
    baseline: BoolArray
    levels: IntArray
    basis: tuple[str, ...]
    began: IntArray
    noticed: IntArray
    normalised: tuple[str, ...]
    false_alarm_rate: float

    def change(self) -> FloatArray:
        """Return the deviation of each value from the expected one, in dB or in the indicator's unit."""
        with np.errstate(invalid="ignore", divide="ignore"):
            in_db = 20.0 * np.log10(self.values / self.expected)
        is_level = self.in_db & ~_is_ratio(self.series)
        result: FloatArray = np.where(is_level, in_db, self.values - self.expected)
        return result

    def events(self, column: int) -> list[AlarmEvent]:
        """Return the alarms of a series, the earliest first."""
        levels = self.levels[:, column]
        dates, added = self.recordings["date"], self.recordings["added"]
        edges = np.flatnonzero(np.diff(np.concatenate(([0], levels > OK, [0])).astype(np.int8)))
        return [
            AlarmEvent(
                int(levels[start:end].max()),
                dates.iloc[start].to_pydatetime(),
                added.iloc[start].to_pydatetime(),
                dates.iloc[end].to_pydatetime() if end < len(levels) else None,
                added.iloc[end].to_pydatetime() if end < len(levels) else None,
            )
            for start, end in edges.reshape(-1, 2)
        ]


def judge(
    recordings: DataFrame, indicators: DataFrame, settings: TrendSettings, stated: Baseline | None
) -> PointTrends:
    """Judge all series of a measuring point.

    Parameters
    ----------
    recordings : DataFrame
        Of the point, without failures: key, date, added, speed_rpm, load_nm, outcome, iso_group, iso_mounting.
    indicators : DataFrame
        key, value and the columns of `SERIES`.
    settings : TrendSettings
    stated : Baseline or None
    """
    recordings = recordings.sort_values(["date", "added"], kind="stable").reset_index(drop=True)
    values, series = _matrix(recordings, indicators)
    baseline = _baseline(recordings, settings, stated)
    y, is_level, in_db = _scaled(values, baseline, series)
    x, inside, normalised = regressors(*_conditions(recordings), baseline)
    rate = settings.false_alarm_rate / max(len(series), 1)
    middle, reach = _limits(y, x, baseline, in_db, rate, settings)
    judged = (~baseline & inside)[:, None] & np.isfinite(y) & np.isfinite(reach)
    rise = y - middle
    with np.errstate(invalid="ignore"):
        sample = np.where(np.abs(rise) > reach, np.where(in_db & (rise >= SERIOUS_DB), ALARM, WARNING), OK)
        calm = np.abs(rise) <= RETURN * reach
    sample = np.where(judged, sample, -1)
    basis = [STATISTICAL if known else NONE for known in np.asarray(np.isfinite(reach).any(axis=0)).tolist()]
    expected, low, high, alarm = _natural_limits(middle, reach, in_db, is_level)
    zones = _zone_limits(recordings)
    is_velocity = np.asarray(series["name"] == "overall velocity", dtype=np.bool_)
    for column in np.flatnonzero(is_velocity):
        if zones is None:
            break
        _, warning, limit = zones
        velocity = values[:, column]
        with np.errstate(invalid="ignore"):
            level = (velocity > warning).astype(np.int64) + (velocity > limit)
            calm[:, column] = velocity <= CLEARED_ZONE * warning
        sample[:, column] = np.where(np.isfinite(velocity), level, -1)
        low[:, column], high[:, column], alarm[:, column] = np.nan, warning, limit
        basis[column] = ISO
    q = standardised_innovations(y, x)
    began, noticed = change_points(q, 1.0 / rate)
    return PointTrends(
        recordings,
        series,
        values,
        expected,
        low,
        high,
        alarm,
        in_db,
        baseline,
        alarm_levels(sample, calm, settings.n_to_clear),
        tuple(basis),
        began,
        noticed,
        normalised,
        rate,
    )


def _conditions(recordings: DataFrame) -> tuple[FloatArray, FloatArray]:
    """Return speed and load of each recording; nan where unknown."""
    speed, load = (recordings[name].to_numpy(np.float64) for name in ("speed_rpm", "load_nm"))
    return speed, load


def _limits(
    y: FloatArray, x: FloatArray, baseline: BoolArray, in_db: BoolArray, rate: float, settings: TrendSettings
) -> tuple[FloatArray, FloatArray]:
    """Return the expected values, and the allowed deviation, which is at least the minimum change."""
    expected, width = prediction_limits(y, x, baseline, rate, min_scatter=np.where(in_db, MIN_SCATTER, 1e-9))
    min_rise = np.where(in_db, settings.minimum_change_db, 0.0)
    return expected, np.maximum(width, min_rise)


def _natural_limits(
    expected: FloatArray, reach: FloatArray, in_db: BoolArray, is_level: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return expected values and the limits low, high and alarm in the indicators' units."""
    middle, low, high = (_natural(expected + part, is_level) for part in (0.0 * reach, -reach, reach))
    return middle, low, high, np.where(in_db, _natural(expected + np.maximum(reach, SERIOUS_DB), is_level), np.nan)


CONDITIONS = {"load": "load_nm", "speed": "speed_rpm"}
"""Quantity over which an indicator can be shown besides time → its column."""

N_STEPS = 41
"""Points of a curve over load or speed."""


def over_condition(
    trends: PointTrends, column: int, over: str, settings: TrendSettings
) -> tuple[DataFrame, DataFrame, float]:
    """Return a series over load or speed: its values, the curve of its limits, and the other quantity's held value.

    The regression of the baseline is evaluated along one of the two, with the other held at its geometric mean over the
    baseline. A value measured elsewhere is moved there along the regression together with its limits: it exceeds them
    there if and only if it does so over time.

    Parameters
    ----------
    trends : PointTrends
    column : int
        Of the series.
    over : str
        One of `CONDITIONS`.
    settings : TrendSettings

    Returns
    -------
    DataFrame
        Sorted by load or speed: load_nm or speed_rpm, date, value, adjusted, expected, low, high, alarm, level.
    DataFrame
        Load or speed over the baseline's range, widened by `OUTSIDE` at both ends, with expected, low, high and alarm;
        empty if there are no limits.
    float
        Value at which the other quantity is held; nan if nothing depends on it.
    """
    import pandas as pd

    n, baseline, is_iso = len(trends.recordings), trends.baseline, trends.basis[column] == ISO
    value, names = trends.values[:, column], ["expected", "low", "high", "alarm"]
    speed, load = (np.abs(values) for values in _conditions(trends.recordings))
    along, across = (load, speed) if over == "load" else (speed, load)
    usable = np.isfinite(along) & (along > 0)
    ends = along[usable & baseline] if (usable & baseline).any() else along[usable]
    steps = np.geomspace(ends.min() / OUTSIDE, ends.max() * OUTSIDE, N_STEPS) if len(ends) else np.ones(0)
    follows_other = any(name != over for name in trends.normalised)
    held = float(10.0 ** np.log10(across[baseline]).mean()) if follows_other else float("nan")
    # One regression for three kinds of rows: the recordings, the same with the other quantity held, the curve.
    n_added = n + len(steps)
    rows_along, rows_across = np.concatenate([along, along, steps]), np.concatenate([across, np.full(n_added, held)])
    rows = (rows_across, rows_along) if over == "load" else (rows_along, rows_across)
    is_baseline = np.concatenate([baseline, np.zeros(n_added, dtype=np.bool_)])
    x, inside, _ = regressors(*rows, is_baseline)
    y, is_level, in_db = _scaled(value[:, None], baseline, trends.series.iloc[[column]])
    y = np.concatenate([y, np.full((n_added, 1), np.nan)])
    expected, reach = _limits(y, x, is_baseline, in_db, trends.false_alarm_rate, settings)
    reach[n : 2 * n] = reach[:n]  # each value keeps its own allowed deviation
    natural = np.hstack(_natural_limits(expected, reach, in_db, is_level))
    moved = np.nan_to_num(expected[n : 2 * n, 0] - expected[:n, 0])
    if is_iso:  # zone boundaries are the same at any load
        moved[:] = 0.0
        natural[:, 1], natural[:, 2:] = np.nan, [trends.high[0, column], trends.alarm[0, column]]
    adjusted = value * 10.0 ** (moved / 20.0) if is_level[0] else value + moved
    _, low, high, alarm = natural[n : 2 * n].T
    with np.errstate(invalid="ignore"):
        level = np.select([adjusted > alarm, (adjusted < low) | (adjusted > high)], ["alarm", "warning"], "ok")
    level = level.astype(object)
    level[~np.isfinite(high) | (~inside[:n] & (not is_iso))] = "not judged"
    level[baseline] = "baseline"
    table = pd.DataFrame(
        {CONDITIONS[over]: along, "date": trends.recordings["date"], "value": value, "adjusted": adjusted}
    )
    table[names] = natural[n : 2 * n]
    table["level"] = level
    table = table[np.isfinite(value) & np.isfinite(along)].sort_values([CONDITIONS[over], "date"], kind="stable")
    curve = pd.DataFrame({CONDITIONS[over]: steps})
    curve[names] = natural[2 * n :]
    return table.reset_index(drop=True), curve[np.isfinite(curve["high"])].reset_index(drop=True), held


def _matrix(recordings: DataFrame, indicators: DataFrame) -> tuple[FloatArray, DataFrame]:
    """Return values (recordings × series), and the columns of `SERIES` for each series."""
    columns: list[str] = [*SERIES]
    groups = indicators.groupby(columns, sort=True, dropna=False)
    series = groups.size().reset_index()[columns]
    values = np.full((len(recordings), len(series)), np.nan)
    place = dict(zip(recordings["key"], range(len(recordings)), strict=True))
    rows = indicators["key"].map(place).to_numpy(np.float64)
    kept = np.isfinite(rows)
    number = groups.ngroup().to_numpy()
    values[rows[kept].astype(np.int64), number[kept]] = indicators["value"].to_numpy(np.float64)[kept]
    return values, series


def _baseline(recordings: DataFrame, settings: TrendSettings, stated: Baseline | None) -> BoolArray:
    """Return which recordings form the baseline: those of the stated period, or the first healthy ones if complete."""
    if stated is not None:
        dates = recordings["date"]
        result: BoolArray = ((dates >= stated.start) & (dates <= stated.end)).to_numpy(np.bool_)
        return result
    healthy = recordings["outcome"].isin(HEALTHY).to_numpy(np.bool_)
    first = healthy & (np.cumsum(healthy) <= settings.n_baseline)
    return first if int(first.sum()) == settings.n_baseline else np.zeros(len(healthy), dtype=np.bool_)


def _scaled(values: FloatArray, baseline: BoolArray, series: DataFrame) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Return the values to be judged, which series were converted to dB for this, and which are in dB as a result."""
    is_ratio = _is_ratio(series)
    y, is_level = decibels(values, baseline, is_ratio | _is_signed(series))
    return y, is_level, is_level | is_ratio


def _is_ratio(series: DataFrame) -> BoolArray:
    """Return which series are ratios already in dB: they may be negative, and their changes are in dB too."""
    result: BoolArray = (series["unit"] == "dB").to_numpy(np.bool_)
    return result


def _is_signed(series: DataFrame) -> BoolArray:
    """Return which other series may be negative, even if they are positive over a whole baseline by chance."""
    result: BoolArray = (series["name"] == "skewness").to_numpy(np.bool_)
    return result


def _natural(levels: FloatArray, is_level: BoolArray) -> FloatArray:
    result: FloatArray = np.where(is_level, 10.0 ** (np.clip(levels, -6000.0, 6000.0) / 20.0), levels)
    return result


def _zone_limits(recordings: DataFrame) -> tuple[float, float, float] | None:
    """Return the ISO 20816-3 zone boundaries of the last recording with a machine group in mm/s; None without one."""
    from gearsig.indicators import ZONE_LIMITS_MM_PER_S

    known = recordings[recordings["iso_group"].notna()]
    if known.empty:
        return None
    last = known.iloc[-1]
    return ZONE_LIMITS_MM_PER_S.get((int(last["iso_group"]), str(last["iso_mounting"])))


def state_rows(trends: PointTrends, machine: str, point: str, fingerprint: str) -> list[dict[str, Any]]:
    """Return a row per series for status and reports: last value, limits, alarms and change."""
    change, dates = trends.change(), trends.recordings["date"]
    reached = trends.recordings["date"][trends.baseline]
    rows: list[dict[str, Any]] = []
    known = np.isfinite(trends.values)
    for column, names in enumerate(trends.series.to_dict("records")):
        at = np.flatnonzero(known[:, column])
        last = int(at[-1])
        events, level = trends.events(column), int(trends.levels[-1, column])
        began, noticed = int(trends.began[column]), int(trends.noticed[column])
        rows.append(
            {"machine": machine, "point": point}
            | {str(key): value for key, value in names.items()}
            | {
                "n": len(at),
                "n_baseline": int((trends.baseline & known[:, column]).sum()),
                "baseline_from": reached.iloc[0] if len(reached) else None,
                "baseline_to": reached.iloc[-1] if len(reached) else None,
                "value": float(trends.values[last, column]),
                "date": dates.iloc[last],
                "expected": float(trends.expected[last, column]),
                "upper_limit": float(trends.high[last, column]),
                "change": float(change[last, column]),
                "in_db": bool(trends.in_db[column]),
                "level": level,
                "since": events[-1].raised if level > OK and events else None,
                "basis": trends.basis[column],
                "normalised": ", ".join(trends.normalised),
                "changed": dates.iloc[began] if began >= 0 else None,
                "changed_added": trends.recordings["added"].iloc[noticed] if noticed >= 0 else None,
                "changed_by": _mean(change[began:, column]) if began >= 0 else float("nan"),
                "events": json.dumps([asdict(event) for event in events], default=str),
                "fingerprint": fingerprint,
            }
        )
    return rows


def _mean(values: FloatArray) -> float:
    """Return the mean of the finite values; nan if there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def events_of(text: str) -> list[AlarmEvent]:
    """Return the alarms that `state_rows` wrote."""

    def moment(value: str | None) -> datetime | None:
        return datetime.fromisoformat(value) if value else None

    entries: Sequence[Mapping[str, Any]] = json.loads(text)
    return [
        AlarmEvent(
            int(e["level"]),
            datetime.fromisoformat(e["raised"]),
            datetime.fromisoformat(e["added"]),
            moment(e["cleared"]),
            moment(e["cleared_added"]),
        )
        for e in entries
    ]


# --------------------
# One indicator of a measuring point, over time and over load or speed.
# --------------------


@dataclass(frozen=True)
class Trend:
    """One indicator of a measuring point over time, with its limits.

    Parameters
    ----------
    machine, point, name, channel, place, computed_on, band, unit : str
    table : DataFrame
        By date: value, speed_rpm, load_nm, expected, low, high, alarm (limits), level, in_baseline.
    basis : str
        "ISO 20816-3", "statistical" or "none".
    level : str
        One of `STATUS_LEVELS`, after the last recording.
    changed : datetime or None
        When the indicator first changed; None if it has not.
    normalised : tuple of str
        Quantities on which the expected value depends: "speed", "load".
    false_alarm_rate : float
        For one value of this series, for an unchanged machine.
    """

    machine: str
    point: str
    name: str
    channel: str
    place: str
    computed_on: str
    band: str
    unit: str
    table: DataFrame
    basis: str
    level: str
    changed: datetime | None
    normalised: tuple[str, ...]
    false_alarm_rate: float

    @property
    def text(self) -> str:
        """Basis of the limits and rate of false alarms, in a few sentences."""
        n = int(self.table["in_baseline"].sum())
        if self.basis == NONE:
            n_all = len(self.table)
            parts = [f"No limits yet: {counted(n_all, 'recording')} {'is' if n_all == 1 else 'are'} not a baseline."]
        elif self.basis != STATISTICAL:
            parts = [f"Limits are the zones of {self.basis}."]
        else:
            parts = [f"Limits from the {counted(n, 'recording')} of the baseline.", _false_alarms(self)]
        if self.normalised:
            parts.append(f"The expected value depends on {' and '.join(self.normalised)}.")
        return " ".join(parts)

    def __repr__(self) -> str:
        of = " ".join(part for part in (self.machine, self.point, self.place, self.channel) if part)
        since = f", changed since {moment_text(self.changed)}" if self.changed is not None else ""
        state = "no limits yet" if self.basis == NONE else f"{self.level} ({self.basis} limits)"
        return f"Trend {self.name!r} of {of}: {counted(len(self.table), 'recording')}, {state}{since}"


@dataclass(frozen=True)
class OperatingTrend:
    """One indicator of a measuring point over load or speed, with the limits that the baseline's dependence gives.

    Parameters
    ----------
    trend : Trend
        The same over time.
    over : str
        "load" or "speed".
    table : DataFrame
        Sorted by load_nm or speed_rpm: date, value, adjusted, expected, low, high, alarm (limits), level.
        `adjusted` is the value as it would be at the other quantity's `held` value. `level` is that of the single
        value: "baseline", "ok", "warning", "alarm", or "not judged" beyond the baseline's range.
    curve : DataFrame
        load_nm or speed_rpm, expected, low, high, alarm along it; empty without a baseline.
    held : float
        Speed or load for which both hold; nan if the indicator does not depend on it.
    """

    trend: Trend
    over: str
    table: DataFrame
    curve: DataFrame
    held: float

    @property
    def follows(self) -> bool:
        """Whether the expected value depends on load or speed: the baseline must cover a sufficient range of it."""
        return self.over in self.trend.normalised

    @property
    def text(self) -> str:
        """Basis of the limits, adjustment of values and rate of false alarms, in a few sentences."""
        other = "speed" if self.over == "load" else "load"
        unit = "rpm" if other == "speed" else "N m"
        parts = []
        if self.curve.empty:
            parts.append("No limits yet: the baseline is not complete.")
        elif self.trend.basis != STATISTICAL:
            parts.append(f"Limits are the zones of {self.trend.basis}, the same at any {self.over}.")
        elif self.follows:
            parts.append(f"Limits follow the baseline's dependence on {self.over}.")
        else:
            parts.append(f"The {self.over} varies too little over the baseline: limits do not depend on it.")
        if np.isfinite(self.held) and self.trend.basis == STATISTICAL:
            parts.append(f"Values are moved to {readable(self.held, 4)} {unit} along its dependence on {other}.")
        if not self.curve.empty and self.trend.basis == STATISTICAL:
            parts.append(_false_alarms(self.trend, "at most one"))
        n = int((self.table["level"] == "not judged").sum())
        if n and not self.curve.empty:
            parts.append(f"{counted(n, 'recording')} too far beyond the baseline's range: not judged.")
        return " ".join(parts)

    def __repr__(self) -> str:
        n = int(self.table["level"].isin(["warning", "alarm"]).sum())
        beyond = "no limits yet" if self.curve.empty else f"{n} beyond the limits"
        return f"{self.trend!r}; over {self.over}: {counted(len(self.table), 'recording')}, {beyond}"


def _false_alarms(trend: Trend, how_often: str = "one") -> str:
    return f"An unchanged machine is outside them in {how_often} of {readable(1 / trend.false_alarm_rate)} recordings."


def last_level(trends: PointTrends, column: int) -> str:
    """Return the level of an indicator after the last recording, one of `STATUS_LEVELS`."""
    return level_name(int(trends.levels[-1, column]), trends.basis[column])


def trend_of(trends: PointTrends, column: int, machine: str, point: str) -> Trend:
    """Return one indicator of a measuring point over time."""
    import pandas as pd

    known = np.isfinite(trends.values[:, column])
    dates = trends.recordings["date"]
    table = pd.DataFrame(
        {
            "date": dates,
            "value": trends.values[:, column],
            "speed_rpm": trends.recordings["speed_rpm"],
            "load_nm": trends.recordings["load_nm"],
            **{name: getattr(trends, name)[:, column] for name in ("expected", "low", "high", "alarm")},
            "level": [level_name(int(level), trends.basis[column]) for level in trends.levels[:, column]],
            "in_baseline": trends.baseline,
        }
    )[known].reset_index(drop=True)
    row = {str(key): str(value) for key, value in trends.series.iloc[column].items()}
    began = int(trends.began[column])
    return Trend(
        machine,
        point,
        **row,
        table=table,
        basis=trends.basis[column],
        level=last_level(trends, column),
        changed=dates.iloc[began].to_pydatetime() if began >= 0 else None,
        normalised=trends.normalised,
        false_alarm_rate=trends.false_alarm_rate,
    )
