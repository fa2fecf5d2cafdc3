"""The JAX primitive of kernels: batching, derivatives, evaluation.

A kernel is bound to a program and to the sizes of its batch axes, outermost first. Each
operand carries all of these axes in front, with length one where it is not batched.
"""

import functools
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir, partial_eval

from ._emit import emit_kernel, kernels_supported
from ._graph import NotScalarError
from ._program import Program


kernel_p = Primitive("elastax_kernel")
kernel_p.multiple_results = True


def _abstract(*operands, program: Program, levels: tuple[int, ...]):
    return [jax.core.ShapedArray(levels + a.shape, a.dtype) for a in program.outputs]


def _written_out(*operands, program: Program, levels: tuple[int, ...]):
    """The program as it is written, vectorised over the batch."""
    if not levels:
        return program(*operands)
    size, inner = levels[0], levels[1:]
    mapped = [x.shape[0] == size for x in operands]
    function = lambda *xs: _written_out(*xs, program=program, levels=inner)
    if not any(mapped):
        results = function(*(x[0] for x in operands))
        return [jnp.broadcast_to(y, (size, *y.shape)) for y in results]
    return jax.vmap(function, in_axes=tuple(0 if m else None for m in mapped))(
        *(x if m else x[0] for x, m in zip(operands, mapped))
    )


@functools.cache
def _compiled(program: Program, levels: tuple[int, ...]):
    return jax.jit(lambda *xs: kernel_p.bind(*xs, program=program, levels=levels))


def _evaluate(*operands, program, levels):
    config: Any = jax.config
    if config.jax_disable_jit or config.jax_debug_nans or config.jax_debug_infs:
        return _written_out(*operands, program=program, levels=levels)
    return _compiled(program, levels)(*operands)


def _batch(operands, axes, *, program, levels):
    size = next(x.shape[axis] for x, axis in zip(operands, axes) if axis is not None)
    moved = [
        jnp.expand_dims(x, 0) if axis is None else jnp.moveaxis(x, axis, 0)
        for x, axis in zip(operands, axes)
    ]
    outputs = kernel_p.bind(*moved, program=program, levels=(size, *levels))
    return outputs, [0] * len(outputs)


def _zeros_of(x):
    return type(x) is ad.Zero


def _push(primals, tangents, *, program, levels):
    outputs = kernel_p.bind(*primals, program=program, levels=levels)
    moving = tuple(not _zeros_of(t) for t in tangents)
    moved = [t for t in tangents if not _zeros_of(t)]
    derived = program.tangent(moving)
    arguments = derived.select([*primals, *moved])
    if not arguments:
        return outputs, [ad.Zero(jax.typeof(x).to_tangent_aval()) for x in outputs]
    pushed = kernel_p.bind(*arguments, program=derived.program, levels=levels)
    return outputs, pushed


def _pull(cotangents, *operands, program, levels):
    linear = tuple(ad.is_undefined_primal(x) for x in operands)
    fixed = [x for x, yes in zip(operands, linear) if not yes]
    back = [ad.instantiate_zeros(ct) for ct in cotangents]
    derived = program.transposed(linear)
    arguments = derived.select([*fixed, *back])
    if not arguments:
        return [ad.Zero(x.aval) if yes else None for x, yes in zip(operands, linear)]
    pulled = iter(kernel_p.bind(*arguments, program=derived.program, levels=levels))
    results = []
    for x, yes in zip(operands, linear):
        if not yes:
            results.append(None)
            continue
        cotangent = next(pulled)
        shared = tuple(
            k for k, size in enumerate(levels) if x.aval.shape[k] == 1 and size != 1
        )
        if shared:
            cotangent = jnp.sum(cotangent, axis=shared, keepdims=True)
        results.append(cotangent)
    return results


_lower_written_out = mlir.lower_fun(_written_out, multiple_results=True)


def _runs_alone(axis_context) -> bool:
    """Whether XLA does not split the program over devices: it cannot split a kernel."""
    if isinstance(axis_context, mlir.ShardingContext):
        return axis_context.num_devices == 1
    mesh = getattr(axis_context, "mesh", None)  # within `jax.shard_map`
    return mesh is not None and all(
        size == 1 or axis in axis_context.manual_axes
        for axis, size in mesh.shape.items()
    )


def _lower(ctx, *operands, program, levels):
    context = ctx.module_context
    on_cpu = tuple(ctx.platforms or context.platforms) == ("cpu",)
    exported = context.lowering_parameters.for_export
    empty = 0 in levels or not any(a.size for a in program.outputs)
    alone = _runs_alone(context.axis_context)
    if kernels_supported() and on_cpu and alone and not exported and not empty:
        try:
            return emit_kernel(ctx, operands, program, levels)
        except NotScalarError:
            pass
    return _lower_written_out(ctx, *operands, program=program, levels=levels)


def _leave_out(wanted, equation):
    """Equation without results that nobody reads, as `jax.jit` asks for it."""
    if not any(wanted):
        return [False] * len(equation.invars), None
    if all(wanted):
        return [True] * len(equation.invars), equation
    derived = equation.params["program"].pruned(tuple(wanted))
    fewer = equation.replace(
        invars=derived.select(equation.invars),
        outvars=[var for var, yes in zip(equation.outvars, wanted) if yes],
        params=equation.params | {"program": derived.program},
    )
    read = set(derived.read)
    return [k in read for k in range(len(equation.invars))], fewer


kernel_p.def_abstract_eval(_abstract)
kernel_p.def_impl(_evaluate)
batching.primitive_batchers[kernel_p] = _batch
ad.primitive_jvps[kernel_p] = _push
ad.primitive_transposes[kernel_p] = _pull
partial_eval.dce_rules[kernel_p] = _leave_out
# not cached: the lowering looks at how operands are computed; it shares what it makes.
# One rule for all platforms: JAX chooses among several in cached lowerings only.
mlir.register_lowering(kernel_p, _lower, cacheable=False)
