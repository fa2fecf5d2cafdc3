"""Batches over all devices: the cores of the processor or the graphics cards."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.sharding import AbstractMesh, AxisType, Mesh, PartitionSpec

from ._kernel import Program, kernels_supported


_AXIS = "elastax_batch"

# on a processor: LAPACK calls, FFT, and the linear solves of lineax that hide them
_WAITING = frozenset(
    "cholesky lu geqrf geqp3 qr householder_product ormqr svd eig eigh schur "
    "hessenberg tridiagonal tridiagonal_solve triangular_solve fft linear_solve".split()
)


def over_devices(
    function: Callable[..., Any],
    in_axes: Any = 0,
    devices: Sequence[Any] | None = None,
) -> Callable[..., Any]:
    """`jax.vmap` whose batch is split over devices.

    Every device computes an equal part of the batch; where the batch does not divide,
    its last sample is computed more than once and cut off. Iterations that depend on
    the data, such as the steps of a simulation, end on each device on their own. On one
    device it is `jax.vmap`. Call it under `jax.jit`, as any batch, and outside of other
    `jax.vmap`; the result lies distributed over the devices, `np.asarray` fetches it.

    JAX sees the cores of a processor as one device unless told before its first
    computation: `jax.config.update("jax_num_cpu_devices", cores)`.

    Args:
        function: of one sample; takes and returns pytrees of arrays.
        in_axes: as for `jax.vmap`: what is mapped over which axis, `None` for what all
            samples share.
        devices: those that take part; all local ones of the default platform unless
            given.

    Returns:
        Function of batched arguments; the batch is the leading axis of its results.

    Raises:
        ValueError: of the returned function, if no argument is batched or the batches
            differ in size.

    Examples:
        >>> batched = jax.jit(over_devices(lambda a, x: a * x, in_axes=(None, 0)))
        >>> batched(2.0, jnp.arange(3.0)).tolist()
        [0.0, 2.0, 4.0]
    """

    def mapped(*args):
        taking_part = _default_devices() if devices is None else list(devices)
        if len(taking_part) == 1:
            return jax.vmap(function, in_axes)(*args)
        leaves, structure = jax.tree.flatten(args)
        axes = _axis_of_leaves(in_axes, args)
        batch = _batch_size(leaves, axes)
        mesh = Mesh(np.array(taking_part), (_AXIS,))

        # traced once for one sample: what it calls decides how a device maps it
        one = lambda *leaves: function(*jax.tree.unflatten(structure, leaves))
        samples = [_sample(leaf, axis) for leaf, axis in zip(leaves, axes)]
        with jax.sharding.use_abstract_mesh(_manual(mesh)):
            program, shapes = jax.make_jaxpr(one, return_shape=True)(*samples)
        map_part = _map_part(program.jaxpr, taking_part)
        is_mapped = [axis is not None for axis in axes]

        def part(constants, leaves):
            shared = [leaf for leaf, m in zip(leaves, is_mapped) if not m]

            def evaluate(batched):
                batched, rest = iter(batched), iter(shared)
                own = [next(batched if m else rest) for m in is_mapped]
                return jax.core.eval_jaxpr(program.jaxpr, constants, *own)

            return map_part(evaluate, [x for x, m in zip(leaves, is_mapped) if m])

        surplus = 0
        if not _within_devices():
            surplus = -batch % len(taking_part)
            everywhere, split = PartitionSpec(), PartitionSpec(_AXIS)
            part = jax.shard_map(
                part,
                mesh=mesh,
                in_specs=(everywhere, [split if m else everywhere for m in is_mapped]),
                out_specs=split,
                # each device works for itself: there is nothing to check, and loops
                # would have to mark what they carry
                check_vma=False,
            )
        batches = [
            leaf if axis is None else _lengthened(leaf, axis, surplus)
            for leaf, axis in zip(leaves, axes)
        ]
        results = [leaf[:batch] for leaf in part(program.consts, batches)]
        return jax.tree.unflatten(jax.tree.structure(shapes), results)

    return mapped


def _map_part(jaxpr: Any, devices: Sequence[Any]) -> Callable[..., Any]:
    """How a device maps its part of the batch: `jax.vmap`, or sample by sample.

    LAPACK and FFT calls on a batch wait, inside a thread of the processor's pool, for
    tasks that they queue to the same pool (jaxlib 0.10). Once every thread of the pool
    holds such a call, as with one device per core, they wait for ever. On a single
    matrix they queue nothing.
    """
    on_processor = devices[0].platform == "cpu"
    if on_processor and not _WAITING.isdisjoint(_primitives(jaxpr)):
        return jax.lax.map
    return lambda function, batch: jax.vmap(function)(batch)


def _primitives(jaxpr: Any) -> set[str]:
    """Names of the primitives in a program and in the programs that it calls."""
    names, waiting = set(), [jaxpr]
    while waiting:
        item = waiting.pop()
        if isinstance(item, tuple | list):
            waiting.extend(item)
        elif hasattr(item, "eqns"):
            names.update(equation.primitive.name for equation in item.eqns)
            waiting.extend(v for e in item.eqns for v in e.params.values())
        elif hasattr(item, "jaxpr"):
            waiting.append(item.jaxpr)
        elif isinstance(item, Program) and not kernels_supported():
            waiting.append(item.closed)  # runs as it is written, LAPACK included
    return names


def _axis_of_leaves(in_axes: Any, args: tuple) -> list[int | None]:
    """Mapped axis of every leaf of `args`, from a prefix of its structure."""
    if isinstance(in_axes, list):
        in_axes = tuple(in_axes)
    axes = []

    def spread(axis, subtree):
        axes.extend([axis] * len(jax.tree.leaves(subtree)))

    jax.tree.map(spread, in_axes, args, is_leaf=lambda axis: axis is None)
    return axes


def _default_devices() -> list[Any]:
    """Local devices of the platform that the user chose."""
    chosen = getattr(jax.config, "jax_default_device")
    if chosen is None:
        return jax.local_devices()
    return jax.local_devices(backend=getattr(chosen, "platform", chosen))


def _manual(mesh: Mesh) -> AbstractMesh:
    """What a function mapped over the devices sees of them."""
    return mesh.abstract_mesh.update_axis_types({_AXIS: AxisType.Manual})


def _within_devices() -> bool:
    """Whether this is traced for one device of many already."""
    return bool(jax.sharding.get_abstract_mesh().manual_axes)


def _sample(leaf, axis: int | None) -> jax.ShapeDtypeStruct:
    """Shape and type of one sample of a leaf."""
    kind = jax.typeof(leaf)
    shape = list(kind.shape)
    if axis is not None:
        del shape[axis]
    return jax.ShapeDtypeStruct(shape, kind.dtype, weak_type=kind.weak_type)


def _batch_size(leaves: list, axes: list[int | None]) -> int:
    sizes = {
        jnp.shape(leaf)[axis] for leaf, axis in zip(leaves, axes) if axis is not None
    }
    if len(sizes) != 1:
        found = ", ".join(map(str, sorted(sizes))) or "none"
        raise ValueError(
            "the batched arguments must have one size along `in_axes`, but have "
            f"{found}"
        )
    return sizes.pop()


def _lengthened(leaf, axis: int, surplus: int):
    """The batch in front, its last sample repeated."""
    batch = jnp.moveaxis(jnp.asarray(leaf), axis, 0)
    if surplus == 0:
        return batch
    return jnp.concatenate([batch, jnp.repeat(batch[-1:], surplus, axis=0)])
