"""The machine and the versions that the figures belong to."""

import datetime
import importlib.metadata
import os
import pathlib
import platform


PACKAGES = (
    "elastax",
    "jax",
    "jaxlib",
    "diffrax",
    "equinox",
    "numpy",
    "pin",
    "mujoco",
    "mujoco-mjx",
    "roboticstoolbox-python",
)


def header() -> dict:
    """Machine, versions and date, the head of every table."""
    return {
        "machine": machine(),
        "versions": versions(),
        "date": datetime.date.today().isoformat(),
    }


def machine() -> dict[str, str | int | float]:
    """Processor, cores that may be used, memory [GiB], system."""
    return {
        "cpu": _processor(),
        "cores": len(cores()),
        "memory_gib": round(_memory(), 1),
        "system": f"{platform.system()} {platform.machine()}",
    }


def versions() -> dict[str, str | None]:
    """Versions of Python and of the packages; `None` where one is absent."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
    return found


def cores() -> list[int]:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def _processor() -> str:
    info = pathlib.Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"


def _memory() -> float:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
