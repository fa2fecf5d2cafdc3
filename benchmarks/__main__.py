"""`python -m benchmarks [NAME ...] [--quick] [--out FOLDER]`: run and write the table.

Every case runs in a process of its own. Writes `results.json` and `RESULTS.md`.

Exit status 0: everything holds that must; 1: it does not, or a case failed; 2: bad
input.
"""

import argparse
import datetime
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time

from ._machine import cores, machine, versions
from ._report import markdown, read_notes
from ._rows import failures
from ._suite import FOLDER, SUITE, Case, description, select


def main(argv: list[str] | None = None) -> int:
    """Run the benchmarks that the arguments name, and return the exit status."""
    options = _parser().parse_args(argv)
    try:
        chosen = select(options.names)
    except ValueError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 2
    start = time.perf_counter()
    header = {
        "machine": machine(),
        "versions": versions(),
        "date": datetime.date.today().isoformat(),
        "quick": options.quick,
        "minutes": None,
    }
    rows, problems = [], []
    total, number = sum(len(cases) for cases in chosen.values()), 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, cases in chosen.items():
            for case in cases:
                number += 1
                say(start, f"[{number}/{total}] {name}: {case.name} ...")
                file = pathlib.Path(scratch) / f"{number}.jsonl"
                problem = run_case(name, case, file, options.quick)
                found = read_rows(file)
                for entry in found:
                    entry |= {"benchmark": name, "case": case.name}
                    entry |= {key: header[key] for key in ("machine", "versions")}
                    entry |= {"date": header["date"], "quick": options.quick}
                    say(start, f"    {summary(entry)}")
                rows += found
                if problem is not None:
                    problems.append(f"{name}, {case.name}: {problem}")
                    say(start, f"    FAILED: {problem}")
    if not options.keep:  # else the rows come from several runs
        header["minutes"] = (time.perf_counter() - start) / 60
    rows, problems = merged(rows, problems, chosen, options.out, options.keep)
    write(options.out, header, rows, problems)
    say(start, f"results in {options.out / 'RESULTS.md'}")
    return judge(rows, problems, options.quick)


def _parser() -> argparse.ArgumentParser:
    questions = "\n".join(f"  {name:26}{description(name)[0]}" for name in SUITE)
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Benchmarks of elastax against other packages.",
        epilog=f"benchmarks:\n{questions}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="which; all if none")
    parser.add_argument(
        "--quick", action="store_true", help="short repeats; only differences judged"
    )
    parser.add_argument(
        "--keep",
        action="store_true",
        help="keep the rows of the other benchmarks that results.json holds",
    )
    parser.add_argument(
        "--out", type=pathlib.Path, default=FOLDER, help="folder of the results"
    )
    return parser


def run_case(name: str, case: Case, file: pathlib.Path, quick: bool) -> str | None:
    """Run one case in its process; what went wrong, or `None`."""
    command = [sys.executable, "-m", "benchmarks._worker", name, case.name, str(file)]
    command += ["--quick"] if quick else []
    allowed = cores()[-case.threads :]
    pin = [] if len(allowed) == len(cores()) else ["--cores", _list(allowed)]
    try:
        process = subprocess.run(
            command + pin,
            env=environment(case),
            cwd=FOLDER.parent,
            timeout=case.limit,
            capture_output=True,
            text=True,
        )
    except subprocess.TimeoutExpired:
        return f"no end after {case.limit:g} s"
    if process.returncode == 0:
        return None
    lines = [line for line in process.stderr.splitlines() if line.strip()]
    return f"status {process.returncode}: {lines[-1] if lines else 'no message'}"


def _list(numbers: list[int]) -> str:
    return ",".join(map(str, numbers))


def environment(case: Case) -> dict[str, str]:
    """Environment of a case: double precision, no cache of programs, its devices."""
    result = dict(os.environ)
    for name in ("JAX_COMPILATION_CACHE_DIR", "JAX_NUM_CPU_DEVICES"):
        result.pop(name, None)
    flags = result.get("XLA_FLAGS", "")
    if case.devices > 1:
        flags += f" --xla_force_host_platform_device_count={case.devices}"
    result |= {
        "JAX_ENABLE_X64": "1",
        "JAX_ENABLE_COMPILATION_CACHE": "false",
        "JAX_PLATFORMS": "cpu",
        "JAX_CPU_ENABLE_ASYNC_DISPATCH": "false" if case.inline else "true",
        "OMP_NUM_THREADS": str(case.threads),
        "XLA_FLAGS": flags.strip(),
    }
    return result


def read_rows(file: pathlib.Path) -> list[dict]:
    """Rows that a case wrote."""
    if not file.is_file():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def merged(rows, problems, chosen, folder: pathlib.Path, keep: bool):
    """New rows, and with `keep` those of benchmarks that did not run this time."""
    path = folder / "results.json"
    if not keep or not path.is_file():
        return rows, problems
    old = json.loads(path.read_text(encoding="utf-8"))
    rows = rows + [entry for entry in old if entry["benchmark"] not in chosen]
    order = list(SUITE)
    return sorted(rows, key=lambda entry: order.index(entry["benchmark"])), problems


def write(folder: pathlib.Path, header: dict, rows: list[dict], problems) -> None:
    """`results.json`, a list of rows, and `RESULTS.md`."""
    folder.mkdir(parents=True, exist_ok=True)
    finite = [_without_infinities(entry) for entry in rows]
    text = json.dumps(finite, indent=1, allow_nan=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")
    table = markdown(header, rows, problems, read_notes(FOLDER))
    (folder / "RESULTS.md").write_text(table, encoding="utf-8")


def _without_infinities(value):
    """JSON has neither infinities nor NaN: they become null."""
    if isinstance(value, dict):
        return {key: _without_infinities(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_infinities(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def summary(entry: dict) -> str:
    """One line about a row."""
    parts = [entry["name"], f"{entry['value']:.4g} {entry['unit']}"]
    if entry.get("variant"):
        parts.insert(1, f"({entry['variant']})")
    if entry["ratio"] is not None:
        parts.append(f"{entry['ratio']:.3g} of {entry['peer']}")
    if entry["holds"] is not None:
        parts.append("holds" if entry["holds"] else f"MISSES {entry['target']}")
    return ", ".join(parts)


def judge(rows: list[dict], problems: list[str], quick: bool) -> int:
    """Exit status; a quick run is judged by its differences only."""
    failed = failures(rows)
    if quick:
        failed = [text for text in failed if "max_difference" in text]
    for text in failed + problems:
        print(f"benchmarks: {text}", file=sys.stderr)
    return 1 if failed or problems else 0


def say(start: float, text: str) -> None:
    """Progress on standard error."""
    elapsed = time.perf_counter() - start
    print(f"{elapsed:7.1f} s  {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
