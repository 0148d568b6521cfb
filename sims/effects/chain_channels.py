"""What the effects on the measurement chain share: the same change to each acceleration channel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sims.machine import Machine
from sims.measure import MeasuredChannel


def with_each_channel(machine: Machine, change: Callable[[MeasuredChannel], MeasuredChannel]) -> Machine:
    """Return the machine with every acceleration channel changed."""
    channels = tuple(change(channel) for channel in machine.chain.channels)
    return replace(machine, chain=replace(machine.chain, channels=channels))
