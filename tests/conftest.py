"""Settings of every test: precision, strictness, type checks, compilation cache."""

import gc
import os
import pathlib

import jax
import jaxtyping
import pytest


ROOT = pathlib.Path(__file__).resolve().parent.parent

# Before the first import of the package. Not by the option of jaxtyping's pytest
# plugin: the workers of pytest-xdist never see it.
# The inner loops of `_kernel` handle single numbers: there every check would be felt.
CHECKED = [
    f"elastax.{path.stem}"
    for path in sorted((ROOT / "elastax").iterdir())
    if path.stem not in ("__init__", "_kernel") and path.suffix in ("", ".py")
]
jaxtyping.install_import_hook(CHECKED, "beartype.beartype")

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    jax.config.update("jax_compilation_cache_dir", str(ROOT / ".pytest_cache" / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


_MAPS = pathlib.Path("/proc/self/maps")
_MANY_MAPS = 10_000


@pytest.fixture(scope="module", autouse=True)
def _programs_are_let_go():
    """Forget what was compiled once a process holds much of it.

    A program takes several memory maps; where a process comes to 65,530 of them, the
    limit of Linux, it is aborted.
    """
    yield
    if _MAPS.exists() and len(_MAPS.read_bytes().splitlines()) > _MANY_MAPS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(scope="session")
def data_dir() -> pathlib.Path:
    """The folder of recordings, which are no part of the project."""
    places = [ROOT.parent / "shared" / "data"]
    if "ELASTAX_DATA" in os.environ:
        places.insert(0, pathlib.Path(os.environ["ELASTAX_DATA"]))
    for place in places:
        if place.is_dir():
            return place
    pytest.skip(
        "recordings are absent: set ELASTAX_DATA to the folder that holds kuka_kr300, "
        "modelica_reference, quanser_2dsfl and sid_examples"
    )
