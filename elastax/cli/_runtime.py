"""JAX as the command line wants it: doubles, all cores, a cache of programs."""

import os
import pathlib

import jax


def configure(*, inline: bool = False) -> None:
    """Switch on double precision, a device per core and the compilation cache.

    The cache lies in `ELASTAX_CACHE`, else in `~/.cache/elastax`;
    `JAX_COMPILATION_CACHE_DIR` goes before both. A number of devices that the user
    set, by `JAX_NUM_CPU_DEVICES` or in `XLA_FLAGS`, stays.

    Args:
        inline: run programs in the thread that calls them, for short latencies.
    """
    jax.config.update("jax_enable_x64", True)
    if inline:
        jax.config.update("jax_cpu_enable_async_dispatch", False)
    _use_all_cores()
    # checks inside programs give NaN, which the job reports: a program that can call
    # back into Python would not be kept in the cache
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    default = pathlib.Path.home() / ".cache" / "elastax"
    folder = pathlib.Path(os.environ.get("ELASTAX_CACHE", default))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # a read-only home: compile every time
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)


def _use_all_cores() -> None:
    """One host device per core that the process may use, unless set already."""
    flags = os.environ.get("XLA_FLAGS", "")
    set_already = getattr(jax.config, "jax_num_cpu_devices") > 0
    if set_already or "xla_force_host_platform_device_count" in flags:
        return
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        cores = os.cpu_count() or 1
    try:
        jax.config.update("jax_num_cpu_devices", cores)
    except RuntimeError:
        pass  # JAX has computed before: its devices are fixed
