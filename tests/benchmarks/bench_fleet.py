"""Questions to a fleet of a million recordings, and its tables written whole; seconds as a user waits, least of three.

    python tests/benchmarks/bench_fleet.py [N_INDICATORS]

The store is written as `docs/fleet.md` describes it, with texts as long and as different from each other as real ones.
"""

import json
import sys
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import duckdb

from gearsig.fleet import Fleet, open_fleet

N_RECORDINGS, PER_POINT, N_POINTS = 1_000_000, 1000, 2
RECORDINGS = f"""
    SELECT sha256('key' || i) AS key, printf('machine %03d', i // {PER_POINT * N_POINTS}) AS machine,
        CASE (i // {PER_POINT}) % 2 WHEN 0 THEN 'DE' ELSE 'NDE' END AS point,
        TIMESTAMP '2025-01-01' + INTERVAL 1 HOUR * (i % {PER_POINT}) AS date,
        printf('/data/%03d/%d.wav', i // {PER_POINT * N_POINTS}, i % {PER_POINT}) AS source,
        sha256('file' || i) AS sha256, 512044::BIGINT AS n_bytes,
        (1700000000000000000 + hash(i) % 1000000000000000)::BIGINT AS mtime_ns, 'all from the pattern' AS origin,
        'gearbox' AS rig, sha256('setup') AS setup, '0.1.0' AS version,
        TIMESTAMP '2026-01-01' + INTERVAL 1 MICROSECOND * (1000000 * i + hash(i) % 1000000) AS added,
        1::BIGINT AS n_channels, 10.0::DOUBLE AS duration_s, 25600.0::DOUBLE AS sampling_rate_hz,
        1500 + 10 * random() AS speed_rpm, NULL::DOUBLE AS load_nm, 'no fault' AS outcome,
        'No fault was found.' AS verdict, random() AS confidence, NULL::DOUBLE AS crack_mm, NULL::BIGINT AS iso_group,
        '' AS iso_mounting, printf('[{{"code": "tooth", "title": "Tooth %d", "confidence": %.2f}}]', i % 30, random())
        AS findings, '' AS reason, 0.7 + 0.1 * random() AS cpu_s, '' AS replaces
    FROM range({N_RECORDINGS}) AS numbers(i)
"""  # noqa: S608 - of our own constants
INDICATORS = """
    SELECT key, machine, point, date, 'indicator ' || j AS name, exp(0.1 * random()) AS value, 'm/s²' AS unit,
        'a1' AS channel, '' AS place, 'signal' AS computed_on, '' AS band
    FROM recordings, range({}) AS numbers(j)
"""


def make_store(folder: Path, n_indicators: int) -> Fleet:
    open_fleet(folder, create=True)
    segment = folder / "segments" / "00000000000000000001-00000000"
    segment.mkdir()
    form = "(FORMAT parquet, COMPRESSION zstd, ROW_GROUP_SIZE 60000)"
    with duckdb.connect() as connection:
        connection.execute(f"CREATE TABLE recordings AS {RECORDINGS}")
        for name, query, order in (
            ("recordings", "FROM recordings", "machine, point, date"),
            ("indicators", INDICATORS.format(n_indicators), "machine, point, name, date"),
        ):
            rows = f"SELECT * FROM ({query}) ORDER BY {order}"  # noqa: S608
            connection.execute(f"COPY ({rows}) TO '{segment / name}.parquet' {form}")
    manifest = json.loads((folder / "store.json").read_text())
    (folder / "store.json").write_text(json.dumps(manifest | {"segments": [segment.name]}))
    return open_fleet(folder)


def main() -> None:
    n_indicators = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    with TemporaryDirectory() as name:
        folder = Path(name)
        fleet = make_store(folder / "fleet", n_indicators)
        machine, indicator = "machine 007", "indicator 2"
        questions: dict[str, Callable[[], object]] = {
            "trend of an indicator of a machine": lambda: fleet.trend(machine, indicator),
            "recordings of a machine": lambda: fleet.recordings(machine),
            "indicators of a point": lambda: fleet.indicators(machine, "DE"),
            "an indicator of all over a day": lambda: fleet.indicators(
                name=indicator, start=datetime(2025, 1, 2), end=datetime(2025, 1, 3)
            ),
            "export: recordings of a machine, CSV": lambda: fleet.export(folder / "x.csv", "recordings", machine),
            "export: an indicator of all, CSV": lambda: fleet.export(folder / "x.csv", name=indicator),
            "export: an indicator of all, Parquet": lambda: fleet.export(folder / "x.parquet", name=indicator),
            "export: all recordings, Parquet": lambda: fleet.export(folder / "x.parquet", "recordings"),
            "export: all recordings, CSV": lambda: fleet.export(folder / "x.csv", "recordings"),
        }
        for label, ask in questions.items():
            seconds = []
            for _ in range(3):
                start = time.perf_counter()
                ask()
                seconds.append(time.perf_counter() - start)
            print(f"{label:40} {min(seconds):6.2f} s   ({', '.join(f'{s:.2f}' for s in seconds)})", flush=True)


if __name__ == "__main__":
    main()
