"""Trees of arrays as one flat vector, and where their entries lie in it."""

import dataclasses
import functools
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


@dataclasses.dataclass(frozen=True)
class FlatLayout:
    """Place of every leaf of a tree in a vector of doubles.

    Integers and booleans travel as doubles.

    Attributes:
        structure: of the tree.
        names: of the leaves, such as `model.drives.ratio`.
        shapes, types: of the leaves.
    """

    structure: Any
    names: tuple[str, ...]
    shapes: tuple[tuple[int, ...], ...]
    types: tuple[np.dtype, ...]

    @staticmethod
    def of(tree: Any) -> "FlatLayout":
        """Layout of a tree of arrays or of their shapes.

        Raises:
            ValueError: a leaf is complex.
        """
        leaves, structure = jax.tree_util.tree_flatten_with_path(tree)
        names = tuple(_name(path) for path, _ in leaves)
        types = tuple(np.dtype(leaf.dtype) for _, leaf in leaves)
        for name, kind in zip(names, types):
            if kind.kind not in "fiub":
                raise ValueError(f"`{name}` must be real to be streamed, but is {kind}")
        return FlatLayout(
            structure, names, tuple(tuple(leaf.shape) for _, leaf in leaves), types
        )

    @property
    def size(self) -> int:
        """Length of the vector."""
        return sum(math.prod(shape) for shape in self.shapes)

    @functools.cached_property
    def places(self) -> list[slice]:
        """Part of the vector that each leaf takes."""
        ends = np.cumsum([0, *(math.prod(shape) for shape in self.shapes)]).tolist()
        return [slice(a, b) for a, b in zip(ends[:-1], ends[1:])]

    def fits(self, tree: Any) -> bool:
        """Whether a tree has this layout."""
        return FlatLayout.of(tree) == self

    def pack(self, tree: Any) -> Float[Array, " size"]:
        """The vector of a tree, in a program."""
        leaves = [jnp.ravel(x).astype(jnp.float64) for x in jax.tree.leaves(tree)]
        return jnp.concatenate([jnp.zeros((0,), jnp.float64), *leaves])

    def numbers(self, tree: Any) -> np.ndarray:
        """The vector of a tree of concrete arrays."""
        leaves = [np.ravel(x).astype(np.float64) for x in jax.tree.leaves(tree)]
        return np.concatenate([np.zeros(0), *leaves])

    def unpack(self, vector: Float[Array, " size"]) -> Any:
        """The tree of a vector, in a program."""
        parts = zip(self.places, self.shapes, self.types)
        leaves = [vector[at].reshape(shape).astype(kind) for at, shape, kind in parts]
        return jax.tree.unflatten(self.structure, leaves)

    def views(self, vector: np.ndarray) -> Any:
        """The tree of a vector of concrete doubles, without copies."""
        parts = zip(self.places, self.shapes)
        leaves = [vector[at].reshape(shape) for at, shape in parts]
        return jax.tree.unflatten(self.structure, leaves)

    def table(self) -> list[dict[str, Any]]:
        """Name, start and shape of every leaf, for a file."""
        return [
            {"name": name, "start": at.start, "shape": list(shape)}
            for name, at, shape in zip(self.names, self.places, self.shapes)
        ]


def _name(path: tuple) -> str:
    return jax.tree_util.keystr(path, simple=True, separator=".")
