"""What is usual of the features in the rule table of `gearsig.gap.textbook`, for the baseline that applies it.

A feature counts by how far it is from usual, over its usual spread. With a healthy reference the change against it
counts, over the change's usual spread. Usual: the middle and the spread of 24 healthy machines of the development
cases, rounded.
"""

from __future__ import annotations

LEAST_STRENGTH = 2.0
"""In spreads: the strength at which "none" stands."""

USUAL: dict[str, tuple[float, float, float]] = {
    "mesh.total": (5.0, 16.0, 1.5),
    "mesh.share.2": (-15.0, 9.0, 1.5),
    "mesh.share.3": (-28.0, 12.0, 2.0),
    "mesh.share.4": (-35.0, 12.0, 2.0),
    "mesh.half": (-60.0, 18.0, 2.0),
    "sideband.{side}.1": (-27.0, 14.0, 3.0),
    "sideband.{side}.2": (-29.0, 14.0, 2.5),
    "sideband.{side}.3to5": (-37.0, 15.0, 2.5),
    "sideband.{side}.6to12": (-38.0, 15.0, 1.5),
    "sideband.{side}.strongest": (29.0, 7.0, 2.0),
    "shaft.{side}.1": (-38.0, 16.0, 3.5),
    "shaft.{side}.1.to_mesh": (-43.0, 20.0, 4.0),
    "shaft.{side}.2": (-30.0, 18.0, 2.0),
    "shaft.{side}.3": (-44.0, 14.0, 4.0),
    "shaft.{side}.strongest": (19.0, 7.0, 2.5),
    "shaft.{side}.low": (-40.0, 21.0, 2.0),
    "tooth.driver.elsewhere": (-16.0, 15.0, 1.0),
    "tooth.{side}.elsewhere": (-15.0, 15.0, 1.0),
    "tooth.{side}.peak": (-8.0, 16.0, 1.5),
    "tooth.{side}.prominence": (6.0, 3.0, 1.5),
    "tooth.{side}.second": (0.8, 1.4, 1.0),
    "tooth.{side}.kurtosis": (4.7, 1.3, 0.7),
    "tooth.{side}.centroid": (1.2, 4.0, 0.3),
    "envelope.outer": (4.7, 4.0, 1.6),
    "envelope.inner": (5.4, 3.6, 1.8),
    "envelope.cage": (4.7, 4.4, 1.8),
    "envelope.strange": (11.0, 5.4, 2.2),
    "line.half_mesh": (0.6, 3.2, 1.4),
    "line.strange": (13.0, 6.0, 2.9),
    "floor.band.2": (-9.0, 15.0, 3.0),
    "floor.band.3": (-11.0, 14.0, 1.5),
    "floor.band.4": (-23.0, 12.0, 1.0),
    "raw.level": (8.0, 9.0, 1.4),
    "raw.kurtosis": (3.3, 2.2, 1.0),
    "raw.near_the_extreme": (-47.0, 2.3, 2.2),
    "speed.drift": (-61.0, 11.0, 11.0),
    "speed.swing": (-60.0, 8.0, 3.7),
    "hum": (8.0, 6.0, 2.0),
}
"""Feature → usual value, its spread, and the usual spread of its change against a reference, in dB."""
