"""Recordings of many machines over time: a store of results, trends with limits and alarms, a watch on folders."""

from gearsig.fleet._add import FAILED, AddedRecording, AddResult, AnalysisOptions
from gearsig.fleet._changes import (
    AlarmChange,
    DiagnosisChange,
    FleetChanges,
    change_text,
    fleet_changes,
    last_report,
    mark_reported,
    trends_text,
)
from gearsig.fleet._fleet import LEVEL_NAMES, TABLES, Fleet, Trend, open_fleet
from gearsig.fleet._origin import FilePattern, Origin, date_in_name, find_recordings, origin_rows, origins
from gearsig.fleet._statistics import (
    ALARM,
    OK,
    WARNING,
    Limits,
    alarm_levels,
    change_points,
    cusum_threshold,
    prediction_limits,
    regressors,
    standardised_innovations,
)
from gearsig.fleet._trends import AlarmEvent, Baseline, PointTrends, TrendSettings, events_of
from gearsig.fleet._watch import WatchEvent, watch

__all__ = [
    "ALARM",
    "FAILED",
    "LEVEL_NAMES",
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
    "FilePattern",
    "Fleet",
    "FleetChanges",
    "Limits",
    "Origin",
    "PointTrends",
    "Trend",
    "TrendSettings",
    "WatchEvent",
    "alarm_levels",
    "change_points",
    "change_text",
    "cusum_threshold",
    "date_in_name",
    "events_of",
    "find_recordings",
    "fleet_changes",
    "last_report",
    "mark_reported",
    "open_fleet",
    "origin_rows",
    "origins",
    "prediction_limits",
    "regressors",
    "standardised_innovations",
    "trends_text",
    "watch",
]
