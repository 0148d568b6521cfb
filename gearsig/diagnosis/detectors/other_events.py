"""Local events that are no tooth: single shocks, several per revolution, or not in every revolution."""

from __future__ import annotations

from math import log10

import numpy as np

from gearsig.diagnosis.events import LocalEvent
from gearsig.diagnosis.signals import ShaftSignals, Signals
from gearsig.diagnosis.types import Finding, Kind, Strength, Where


def event_strength(shaft: ShaftSignals, event: LocalEvent) -> Strength:
    """Return the event's rms against the median window's."""
    unit = shaft.averages[event.channel].unit
    ratio_db = 20 * log10(event.rms / event.median_rms) if event.rms > 0 and event.median_rms > 0 else None
    return Strength(
        event.rms, unit, event.median_rms, f"median tooth of the difference signal in {event.channel}", ratio_db
    )


def single_shock(shaft: ShaftSignals, event: LocalEvent) -> Finding:
    """Report an event that one revolution alone has."""
    first_whole = np.ceil(shaft.signal.start_revolution - 1e-9)
    revolution = first_whole + (event.single_revolution or 0) + event.place.angle_rev
    time = float(np.interp(revolution, shaft.angle.revolutions, shaft.angle.time_s))
    return Finding(
        "single-shock",
        Kind.NOTICE,
        f"A single shock near {time:.3g} s, in one of {shaft.averages[event.channel].n_revolutions} revolutions.",
        Where((event.channel,), shaft=shaft.shaft, time_s=(time, time)),
        event_strength(shaft, event),
        confidence=0.95,
        confidence_basis="more than half of what the average shows comes from that revolution",
        surer="Another recording: what the machine does comes back.",
    )


def event_in_some_revolutions(signals: Signals, shaft: ShaftSignals, event: LocalEvent) -> Finding:
    """Report an event that only every second, third, … revolution has."""
    own = signals.rig.ratio(shaft.shaft) or 1.0
    share = 100 * event.share_of_revolutions
    slower = [n for n, order in signals.known_shaft_orders.items() if order < own * (1 - 1e-9)]
    return Finding(
        "event-in-some-revolutions",
        Kind.CANNOT_TELL,
        f"A local event on shaft {shaft.shaft}, but only in {share:.0f} % of its revolutions.",
        Where((event.channel,), shaft=shaft.shaft),
        event_strength(shaft, event),
        confidence=0.95,
        confidence_basis="revolutions sorted by their number",
        evidence=(
            "A machine that works every second revolution does this.",
            "So does a tachometer whose pulses per revolution are stated too low: then speed and teeth are wrong too.",
            *(f"It may belong to a slower shaft ({', '.join(slower)})." for _ in slower[:1]),
        ),
        surer="Check pulses_per_revolution and the teeth.",
    )


def several_events(shaft: ShaftSignals, event: LocalEvent) -> Finding:
    """Report equally spaced events."""
    n = len(event.peaks_rev)
    return Finding(
        "several-events-per-revolution",
        Kind.NOTICE,
        f"{n} equally spaced local events per revolution of shaft {shaft.shaft}: not a single tooth.",
        Where((event.channel,), shaft=shaft.shaft, angle_deg=360 * event.place.angle_rev),
        event_strength(shaft, event),
        confidence=0.9,
        confidence_basis="equal distances and similar energy",
        evidence=("Couplings, pumps, presses, pistons and faster shafts of a whole ratio do this.",),
        surer="A recording at another load, or one with a sensor nearer to the suspected cause.",
    )
