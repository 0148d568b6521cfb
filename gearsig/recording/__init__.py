"""Recordings: channels over time, readers, quality of the data.

`read_recording` reads a file of any format of `gearsig.recording.formats`, `write_recording` writes one; a
`Recording` carries samples, `Channel` names and units, its rig and its `Provenance`. `find_problems` looks for
clipping, dropouts, hum and the like.
"""

from gearsig.recording._limits import check_memory, container_free_bytes, free_memory_bytes
from gearsig.recording._quality import MAINS_HZ, MAINS_WANDER, ChannelProblem, find_problems
from gearsig.recording._read import (
    FORMAT_NAMES,
    FORMAT_OF_EXTENSION,
    RATE_GIVEN,
    WRITERS,
    is_ending,
    n_samples_of,
    read_pulse_times,
    read_recording,
    recording_target,
    sha256_of,
    speed_in_name,
    without_condition,
    write_recording,
)
from gearsig.recording._table import CONDITION_CHANNEL, SEPARATE_RUNS
from gearsig.recording._types import (
    Channel,
    Provenance,
    Recording,
    check_recording,
    metres_per_second_squared,
    names_without_number,
)
from gearsig.recording.formats._mat import variables
from gearsig.recording.formats._wav import parse_lea

__all__ = [
    "CONDITION_CHANNEL",
    "FORMAT_NAMES",
    "FORMAT_OF_EXTENSION",
    "MAINS_HZ",
    "MAINS_WANDER",
    "RATE_GIVEN",
    "SEPARATE_RUNS",
    "WRITERS",
    "Channel",
    "ChannelProblem",
    "Provenance",
    "Recording",
    "check_memory",
    "check_recording",
    "container_free_bytes",
    "find_problems",
    "free_memory_bytes",
    "is_ending",
    "metres_per_second_squared",
    "n_samples_of",
    "names_without_number",
    "parse_lea",
    "read_pulse_times",
    "read_recording",
    "recording_target",
    "sha256_of",
    "speed_in_name",
    "variables",
    "without_condition",
    "write_recording",
]
