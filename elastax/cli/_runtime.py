"""JAX as the command line wants it: double precision and a cache of programs."""

import os
import pathlib

import jax


def configure() -> None:
    """Switch on double precision and the persistent compilation cache.

    The cache lies in `ELASTAX_CACHE`, else in `~/.cache/elastax`;
    `JAX_COMPILATION_CACHE_DIR` goes before both.
    """
    jax.config.update("jax_enable_x64", True)
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
