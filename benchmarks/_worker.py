"""Runs one case of a benchmark in a process of its own.

`python -m benchmarks._worker NAME CASE ROWS [--quick] [--cores 0,1]` appends one JSON
row per line to the file ROWS as soon as it is there; what was measured before a crash
stays.
"""

import argparse
import importlib
import json
import os
import pathlib

from ._timing import FULL, QUICK, peak_memory, reset_peak_memory


def main(argv: list[str] | None = None) -> None:
    """Run the case that the arguments name."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks._worker")
    for name in ("name", "case", "rows"):
        parser.add_argument(name)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--cores", help="processors that may be used, such as 0,1")
    options = parser.parse_args(argv)
    if options.cores and hasattr(os, "sched_setaffinity"):
        # before JAX starts its threads
        os.sched_setaffinity(0, {int(core) for core in options.cores.split(",")})
    run = importlib.import_module(f"benchmarks.{options.name}").run
    reset_peak_memory()
    for entry in run(options.case, QUICK if options.quick else FULL):
        entry.setdefault("memory_mib", round(peak_memory(), 1))
        with pathlib.Path(options.rows).open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
        reset_peak_memory()


if __name__ == "__main__":
    main()
