"""How long does a user wait for the first row of the main job's table?

`elastax feedforward` in a new process, its start included: with an empty folder of
compiled programs, and again with the programs of the first time.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator

from ._rows import Check, row
from ._timing import Effort


FIRST_ROW = "rigid"  # the table's first label


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Both rows; the second needs the programs of the first."""
    with tempfile.TemporaryDirectory() as folder:
        for name, limit in (("main_job_cold", 20.0), ("main_job_warm", 10.0)):
            first, whole = first_row(pathlib.Path(folder))
            yield row(
                name,
                first,
                "s",
                threads=2,
                checks=(Check("value", limit, 5),),
                whole_job_s=whole,
                note=f"first row of the table; whole job {whole:.1f} s",
                memory_mib=None,
            )


def first_row(folder: pathlib.Path) -> tuple[float, float]:
    """Seconds to the first row of the table, and to the end of the job.

    Raises:
        RuntimeError: the job failed, or printed no table.
    """
    environment = os.environ | {"ELASTAX_CACHE": str(folder / "cache")}
    for name in ("JAX_ENABLE_COMPILATION_CACHE", "XLA_FLAGS", "JAX_NUM_CPU_DEVICES"):
        environment.pop(name, None)
    command = [sys.executable, "-u", "-c", "from elastax.cli import main; main()"]
    command += ["feedforward", "--out", str(folder / "out")]
    start, first = time.perf_counter(), None
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        for line in process.stdout or ():
            if first is None and line.split()[:1] == [FIRST_ROW]:
                first = time.perf_counter() - start
    whole = time.perf_counter() - start
    if process.returncode or first is None:
        raise RuntimeError(
            f"`elastax feedforward` must print its table, but ended with status "
            f"{process.returncode}"
        )
    return first, whole
