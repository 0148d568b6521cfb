"""Scripts that are run on demand, `python tests/benchmarks/bench_….py`: some set the number of threads as they load."""

collect_ignore_glob = ["*.py"]
