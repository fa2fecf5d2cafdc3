"""Primitives that only move elements, on arrays of nodes."""

import itertools
import math
from typing import Any

import numpy as np


def pad(x: np.ndarray, fill: int, config: Any) -> np.ndarray:
    """`x` with `fill` around and between its elements; less than none cuts off."""
    for axis, (low, high, interior) in enumerate(config):
        n = x.shape[axis]
        spread = n + max(n - 1, 0) * interior
        shape = list(x.shape)
        shape[axis] = max(low, 0) + spread + max(high, 0)
        out = np.full(shape, fill, np.int64)
        at: list[Any] = [slice(None)] * x.ndim
        first = max(low, 0)
        at[axis] = slice(first, first + spread, interior + 1)
        if n:
            out[tuple(at)] = x
        at[axis] = slice(max(-low, 0), out.shape[axis] - max(-high, 0))
        x = out[tuple(at)]
    return x


def broadcast_in_dim(x: np.ndarray, shape: Any, dimensions: Any) -> np.ndarray:
    """`x` repeated along the axes of `shape` that are not among `dimensions`."""
    expanded = [1] * len(shape)
    for source, target in enumerate(dimensions):
        expanded[target] = x.shape[source]
    return np.broadcast_to(x.reshape(expanded), shape)


def _window_starts(indices: np.ndarray, index_map, batching, batch) -> dict[int, int]:
    starts = {dim: int(indices[batch + (k,)]) for k, dim in enumerate(index_map)}
    for operand_dim, index_dim in zip(*batching):
        starts[operand_dim] = batch[index_dim]
    return starts


def gather(
    x: np.ndarray, indices: np.ndarray, numbers: Any, sizes: Any, clip: bool, fill: int
) -> np.ndarray:
    """Windows of `x` at constant indices; `fill` where a window lies outside."""
    batching = (numbers.operand_batching_dims, numbers.start_indices_batching_dims)
    dropped = tuple(numbers.collapsed_slice_dims) + tuple(batching[0])
    window = tuple(s for d, s in enumerate(sizes) if d not in dropped)
    batches = indices.shape[:-1]
    rank = len(batches) + len(window)
    others = [d for d in range(rank) if d not in numbers.offset_dims]
    out = np.empty(batches + window, np.int64)
    for batch in itertools.product(*map(range, batches)):
        starts = _window_starts(indices, numbers.start_index_map, batching, batch)
        lows = [starts.get(d, 0) for d in range(x.ndim)]
        highest = [n - s for n, s in zip(x.shape, sizes)]
        if clip:
            lows = [min(max(low, 0), top) for low, top in zip(lows, highest)]
        if any(low < 0 or low > top for low, top in zip(lows, highest)):
            out[batch] = fill
            continue
        part = x[tuple(slice(low, low + s) for low, s in zip(lows, sizes))]
        out[batch] = part.reshape(window)
    return np.moveaxis(out, range(rank), others + list(numbers.offset_dims))


def scatter(
    x: np.ndarray,
    indices: np.ndarray,
    updates: np.ndarray,
    numbers: Any,
    combine: Any,
    clip: bool,
) -> np.ndarray:
    """`x` with updates combined in at constant indices.

    Windows that lie outside are moved inside with `clip`, and dropped without.
    """
    out = np.array(x)
    batching = (numbers.operand_batching_dims, numbers.scatter_indices_batching_dims)
    dropped = tuple(numbers.inserted_window_dims) + tuple(batching[0])
    others = [d for d in range(updates.ndim) if d not in numbers.update_window_dims]
    updates = np.moveaxis(
        updates, others + list(numbers.update_window_dims), range(updates.ndim)
    )
    batches = indices.shape[:-1]
    window = updates.shape[len(batches) :]
    sizes = iter(window)
    full = [1 if d in dropped else next(sizes) for d in range(x.ndim)]
    index_map = numbers.scatter_dims_to_operand_dims
    for batch in itertools.product(*map(range, batches)):
        starts = _window_starts(indices, index_map, batching, batch)
        lows = [starts.get(d, 0) for d in range(x.ndim)]
        if clip:
            lows = [min(max(low, 0), n - s) for low, s, n in zip(lows, full, x.shape)]
        if any(low < 0 or low + s > n for low, s, n in zip(lows, full, x.shape)):
            continue
        update = updates[batch].reshape(full)
        for offset in itertools.product(*map(range, full)):
            at = tuple(low + o for low, o in zip(lows, offset))
            out[at] = combine(int(out[at]), int(update[offset]))
    return out


def dynamic_slice(x: np.ndarray, starts: Any, sizes: Any) -> np.ndarray:
    """Window of `x` at constant starts, moved inside where it would lie outside."""
    lows = [min(max(int(i), 0), n - s) for i, n, s in zip(starts, x.shape, sizes)]
    return x[tuple(slice(low, low + s) for low, s in zip(lows, sizes))]


def dynamic_update_slice(x: np.ndarray, update: np.ndarray, starts: Any) -> np.ndarray:
    """`x` with such a window replaced."""
    out = np.array(x)
    lows = [
        min(max(int(i), 0), n - s) for i, n, s in zip(starts, x.shape, update.shape)
    ]
    out[tuple(slice(low, low + s) for low, s in zip(lows, update.shape))] = update
    return out


def matrices(x: np.ndarray, batch: Any, contract: Any, rows_first: bool) -> np.ndarray:
    """Operand of a product as (batch, rows, contracted), or the last two swapped."""
    free = [d for d in range(x.ndim) if d not in batch and d not in contract]
    shape = [math.prod(x.shape[d] for d in dims) for dims in (batch, free, contract)]
    y = np.transpose(x, [*batch, *free, *contract]).reshape(shape)
    return y if rows_first else np.swapaxes(y, 1, 2)
