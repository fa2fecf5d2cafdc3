"""Programs of kernels: a function of small arrays, its graph, its derivatives."""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.core
import numpy as np
from jax.extend.core import ClosedJaxpr
from jax.interpreters.partial_eval import dce_jaxpr

from ._expand import expand
from ._graph import Graph


class Program:
    """A traced function of floating-point arrays; compared by identity.

    Attributes:
        closed: the function as a jaxpr.
        name: for the names of compiled functions.
    """

    def __init__(self, closed: ClosedJaxpr, name: str):
        self.closed = closed
        self.name = name
        self._tangents: dict[tuple, Derived] = {}
        self._transposed: dict[tuple, Derived] = {}
        self._pruned: dict[tuple, Derived] = {}

    def __repr__(self) -> str:
        return f"Program({self.name})"

    @property
    def inputs(self) -> list:
        return self.closed.in_avals

    @property
    def outputs(self) -> list:
        return self.closed.out_avals

    def __call__(self, *arguments: Any) -> list:
        """The function as it is written."""
        return jax.core.eval_jaxpr(self.closed.jaxpr, self.closed.consts, *arguments)

    @functools.cached_property
    def scalars(self) -> tuple[Graph, list[int]]:
        """Scalar graph and the nodes of all elements of all results."""
        graph, arguments, first = Graph(), [], 0
        for aval in self.inputs:
            arguments.append(graph.inputs(first, aval.shape, str(aval.dtype)))
            first += math.prod(aval.shape)
        results = expand(self.closed, graph, arguments)
        return graph, [int(i) for nodes in results for i in np.ravel(nodes)]

    def tangent(self, moving: tuple[bool, ...]) -> "Derived":
        """Program of (inputs, tangents of the moving inputs) to output tangents."""
        if moving not in self._tangents:

            def pushed(*arguments):
                primals, tangents = arguments[: len(moving)], arguments[len(moving) :]

                def along(*changing):
                    new = iter(changing)
                    return self(
                        *(next(new) if m else x for m, x in zip(moving, primals))
                    )

                start = tuple(x for m, x in zip(moving, primals) if m)
                return jax.jvp(along, start, tuple(tangents))[1]

            moved = [a for a, m in zip(self.inputs, moving) if m]
            self._tangents[moving] = derive(
                pushed, [*self.inputs, *moved], self.name + "_tangent"
            )
        return self._tangents[moving]

    def pruned(self, wanted: tuple[bool, ...]) -> "Derived":
        """Program of the wanted results only."""
        if wanted not in self._pruned:
            pruned = _without_unread(self.closed, list(wanted), self.name)
            self._pruned[wanted] = pruned
        return self._pruned[wanted]

    def transposed(self, linear: tuple[bool, ...]) -> "Derived":
        """Program of (other inputs, cotangents) to the linear inputs' cotangents."""
        if linear not in self._transposed:
            others = [a for a, yes in zip(self.inputs, linear) if not yes]
            moved = [a for a, yes in zip(self.inputs, linear) if yes]

            def pulled(*arguments):
                fixed, back = arguments[: len(others)], arguments[len(others) :]

                def forward(*moving):
                    known, unknown = iter(fixed), iter(moving)
                    return self(*(next(unknown if yes else known) for yes in linear))

                return list(jax.linear_transpose(forward, *moved)(list(back)))

            self._transposed[linear] = derive(
                pulled, [*others, *self.outputs], self.name + "_transposed"
            )
        return self._transposed[linear]


def trace(function: Any, avals: Any, name: str) -> Program:
    """Program of a function of arrays with the given shapes."""
    structs = [jax.ShapeDtypeStruct(np.shape(a), a.dtype) for a in avals]
    # the program must not remember the devices over which it is first used
    with jax.sharding.use_abstract_mesh(jax.sharding.AbstractMesh((), ())):
        return Program(jax.make_jaxpr(function)(*structs), name)


class Derived(NamedTuple):
    """A program made from another one, and which arguments it really reads.

    What it does not read must not be handed to it: JAX would take its results for
    functions of that argument.
    """

    program: Program
    read: list[int]

    def select(self, arguments: Sequence[Any]) -> list[Any]:
        return [arguments[k] for k in self.read]


def derive(function: Any, avals: Any, name: str) -> Derived:
    """Program of a function, without the arguments on which it does not depend."""
    closed = trace(function, avals, name).closed
    return _without_unread(closed, [True] * len(closed.out_avals), name)


def _without_unread(closed: ClosedJaxpr, wanted: list[bool], name: str) -> Derived:
    """Program of the wanted results of a jaxpr, and what it reads."""
    jaxpr, used = dce_jaxpr(closed.jaxpr, wanted)
    read = [k for k, yes in enumerate(used) if yes]
    return Derived(Program(ClosedJaxpr(jaxpr, closed.consts), name), read)
