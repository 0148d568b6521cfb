"""Recordings of many machines over time: a store of results, trends with limits and alarms, watched folders.

`open_fleet` opens or creates a store, a `Fleet` with `add`, `indicators`, `status`, `trend` and `export`.
`fleet_changes` returns what is new since the last report, and `watch` adds new files as they appear.
"""

from gearsig.fleet._add import AddedRecording, AddResult, AnalysisOptions
from gearsig.fleet._changes import (
    AlarmChange,
    FleetChanges,
    change_text,
    counts_text,
    diagnosis_text,
    fleet_changes,
    last_report,
    level_counts,
    mark_reported,
    series_level,
    trends_text,
)
from gearsig.fleet._fleet import TABLES, DiagnosisChange, Fleet, open_fleet
from gearsig.fleet._origin import (
    ExcludedFile,
    FilePattern,
    Origin,
    date_in_name,
    excluded_text,
    find_recordings,
    no_recordings,
    origin_rows,
    origins,
)
from gearsig.fleet._statistics import (
    ALARM,
    OK,
    WARNING,
    alarm_levels,
    change_points,
    cusum_threshold,
    prediction_limits,
    regressors,
    standardised_innovations,
)
from gearsig.fleet._trends import (
    CONDITIONS,
    AlarmEvent,
    Baseline,
    OperatingTrend,
    PointTrends,
    Trend,
    TrendSettings,
)
from gearsig.fleet._watch import WatchEvent, watch

__all__ = [
    "ALARM",
    "CONDITIONS",
    "OK",
    "TABLES",
    "WARNING",
    "AddResult",
    "AddedRecording",
    "AlarmChange",
    "AlarmEvent",
    "AnalysisOptions",
    "Baseline",
    "DiagnosisChange",
    "ExcludedFile",
    "FilePattern",
    "Fleet",
    "FleetChanges",
    "OperatingTrend",
    "Origin",
    "PointTrends",
    "Trend",
    "TrendSettings",
    "WatchEvent",
    "alarm_levels",
    "change_points",
    "change_text",
    "counts_text",
    "cusum_threshold",
    "date_in_name",
    "diagnosis_text",
    "excluded_text",
    "find_recordings",
    "fleet_changes",
    "last_report",
    "level_counts",
    "mark_reported",
    "no_recordings",
    "open_fleet",
    "origin_rows",
    "origins",
    "prediction_limits",
    "regressors",
    "series_level",
    "standardised_innovations",
    "trends_text",
    "watch",
]
