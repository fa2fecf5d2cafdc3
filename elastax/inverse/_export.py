"""A streamed inverse as a file that runs without this package."""

import io
import json
import zipfile
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.export
import jax.numpy as jnp

from .._custom_types import Scalar
from ..dynamics import ElasticRobot
from ._base import AbstractInverse
from ._stream import step_program


SCHEMA = "elastax.step/1"


def export_step(
    inverse: AbstractInverse,
    model: ElasticRobot,
    dt: Scalar | float,
    *,
    platforms: Sequence[str] = ("cpu",),
) -> bytes:
    r"""`init` and `step` of an inverse as a ZIP archive, for machines without elastax.

    The archive holds the two programs in StableHLO (`init.bin`, `step.bin`, written by
    `jax.export`) and `layout.json`: the time between samples, the values of all
    parameters, and what the entries of the vectors are. Nothing in it is pickled. All
    arrays are doubles; `init(parameters, sample, dt)` gives the state and
    `step(parameters, state, sample)` the output and the next state, where a sample is
    the reference with its derivatives, shape (order + 1, axes). Where a parameter
    appears in the list of `layout.json`, its value in the vector may be changed.

    Args:
        inverse: the feed-forward.
        model: the robot as the inverse knows it.
        dt: time between samples [s].
        platforms: where it is to run: "cpu", "cuda", ...

    Raises:
        ImportError: the package `flatbuffers`, which `jax.export` writes and reads
            with, is not there.

    Examples:
        Reading takes JAX, NumPy and flatbuffers:

        >>> import json, zipfile, jax, numpy as np
        >>> from jax import export
        >>> jax.config.update("jax_enable_x64", True)
        >>> with zipfile.ZipFile("asim.zip") as archive:
        ...     layout = json.loads(archive.read("layout.json"))
        ...     read = lambda name: export.deserialize(bytearray(archive.read(name)))
        ...     init, step = (jax.jit(read(f"{n}.bin").call) for n in ("init", "step"))
        >>> parameters = np.array(layout["parameters"]["values"])
        >>> state = init(parameters, samples[0], layout["dt"])
        >>> for sample in samples:
        ...     output, state = step(parameters, state, sample)
        ...     for entry in layout["output"]["entries"]:  # theta, tau_m, ...
        ...         size = np.prod(entry["shape"], dtype=int)
        ...         part = output[entry["start"] : entry["start"] + size]
        ...         motors[entry["name"]] = np.reshape(part, entry["shape"])
    """
    program = step_program(inverse, model)
    arrays, _ = eqx.partition({"inverse": inverse, "model": model}, eqx.is_array)
    parameters, state, sample = (
        jax.ShapeDtypeStruct(shape, jnp.float64)
        for shape in ((program.parameters.size,), (program.state.size,), program.shape)
    )
    interval = jax.ShapeDtypeStruct((), jnp.float64)
    export = lambda function, *shapes: _bytes(
        jax.export.export(jax.jit(function), platforms=platforms)(*shapes)
    )
    layout = {
        "schema": SCHEMA,
        "inverse": type(inverse).__name__,
        "robot": model.name,
        "axis_names": list(model.axis_names),
        "elastic_names": list(model.elastic_names),
        "jax": jax.__version__,
        "platforms": list(platforms),
        "dt": float(dt),
        "sample": {"shape": list(program.shape)},
        "parameters": {
            "size": program.parameters.size,
            "entries": program.parameters.table(),
            "values": program.parameters.numbers(arrays).tolist(),
        },
        "state": {"size": program.state.size, "entries": program.state.table()},
        "output": {"size": program.output.size, "entries": program.output.table()},
    }
    return _archive(
        {
            "init.bin": export(program.init, parameters, sample, interval),
            "step.bin": export(program.step, parameters, state, sample),
            "layout.json": json.dumps(layout, indent=1).encode(),
        }
    )


def _bytes(exported: Any) -> bytes:
    try:
        return bytes(exported.serialize())
    except ImportError as error:
        raise ImportError(
            "export_step needs flatbuffers: pip install 'elastax[export]'"
        ) from error


def _archive(files: dict[str, bytes]) -> bytes:
    """ZIP archive; the same files give the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
    return buffer.getvalue()
