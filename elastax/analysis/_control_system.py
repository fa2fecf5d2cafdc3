"""Nonlinear systems with inputs and outputs, their equilibria and linearisation."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._custom_types import require_float64
from ._linear_model import LinearModel, OperatingPoint, SignalNames


_STEPS = 50  # Newton steps
_HALVINGS = 20  # of a step that does not help


class ControlSystem(eqx.Module):
    r"""$\dot x = F(x, u)$, $y = h(x)$.

    Attributes:
        rate: F, a function of x (states,) and u (inputs,).
        output: h, a function of x to (outputs,).
        names: of states, inputs and outputs.

    References:
        [Reiner2010] (3.4), (3.14).

    Examples:
        >>> pendulum = ControlSystem(
        ...     lambda x, u: jnp.array([x[1], -9.81 * jnp.sin(x[0]) + u[0]]),
        ...     lambda x: x[:1],
        ...     SignalNames(("angle", "speed"), ("torque",), ("angle",)),
        ... )
        >>> linearise(pendulum, jnp.zeros(2), jnp.zeros(1)).poles()
    """

    rate: Callable[[Any, Any], Any]
    output: Callable[[Any], Any]
    names: SignalNames = eqx.field(static=True)

    @staticmethod
    def affine(drift, input_matrix, output, names: SignalNames) -> "ControlSystem":
        """The system f(x) + g(x) u of a drift f (states,) and g (states, inputs)."""
        rate = lambda x, u: drift(x) + input_matrix(x) @ u
        return ControlSystem(rate, output, names)

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self.names.states)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.names.inputs)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return len(self.names.outputs)

    def drift(self, x) -> Float[Array, " states"]:
        """f(x) = F(x, 0)."""
        return self.rate(x, jnp.zeros((self.inputs,), x.dtype))

    def input_matrix(self, x) -> Float[Array, "states inputs"]:
        """g(x), the derivative of F by u at u = 0."""
        rest = jnp.zeros((self.inputs,), x.dtype)
        return jax.jacfwd(lambda u: self.rate(x, u))(rest)

    def check(self, x) -> None:
        """Refuse wrong shapes, NaN, and rates that are not affine in the input.

        Args:
            x: state at which it is looked at.
        """
        require_float64("the analysis of a nonlinear system")
        x = jnp.asarray(x)
        one = np.ones((self.inputs,), x.dtype)
        for name, size, shape_of in (
            ("the state", self.states, lambda: x),
            ("`rate`", self.states, lambda: jax.eval_shape(self.rate, x, one)),
            ("`output`", self.outputs, lambda: jax.eval_shape(self.output, x)),
        ):
            shape = shape_of().shape
            if shape != (size,):
                raise ValueError(
                    f"{name} must have the shape ({size},), one entry per name, "
                    f"but has {shape}"
                )
        rate, drift, output, gain = map(np.asarray, _values(self, x))
        values = np.concatenate([rate, output, np.asarray(x)])
        if not np.isfinite(values).all():
            raise ValueError(f"the system is not finite at x = {np.asarray(x)}")
        straight = drift + gain @ one
        size = np.abs(straight) + np.abs(drift)
        off = np.abs(rate - straight)
        if np.any(off > 1e-9 * (size + off)):
            k = int(np.argmax(off))
            raise ValueError(
                "the rates must be affine in the inputs, f(x) + g(x) u, but that of "
                f"`{self.names.states[k]}` is not: put an integrator before the input"
            )


@eqx.filter_jit
def _values(system: ControlSystem, x):
    """Rate under unit inputs and under none, output and input matrix."""
    one = jnp.ones((system.inputs,), x.dtype)
    drift = system.drift(x)
    return system.rate(x, one), drift, system.output(x), system.input_matrix(x)


def linearise(system: ControlSystem, x, u) -> LinearModel:
    """Linear model of a system about a state and an input, at rest or in motion.

    Args:
        system: the system.
        x: state, shape (states,).
        u: input, shape (inputs,).

    References:
        [Reiner2010] (3.38); (3.47a) with the term of the input that is missing there.
    """
    require_float64("linearisation")
    return _linearised(system, jnp.asarray(x), jnp.asarray(u))


@eqx.filter_jit
def _linearised(system: ControlSystem, x, u) -> LinearModel:
    A, B = jax.jacfwd(system.rate, argnums=(0, 1))(x, u)
    C = jax.jacfwd(system.output)(x)
    point = OperatingPoint(x, u, system.output(x), system.rate(x, u))
    D = jnp.zeros((system.outputs, system.inputs), x.dtype)
    return LinearModel(A, B, C, D, system.names, point)


def find_equilibrium(
    system: ControlSystem, x, u, *, output=None, tolerance: float = 1e-9
):
    """State and input at which a system rests, near a first guess.

    Damped Newton steps of least norm: where equilibria fill a curve, the nearest.

    Args:
        system: the system.
        x, u: first guess.
        output: that the system must have there; without it `u` stays as it is.
        tolerance: of rates and outputs, over their size.

    Returns:
        x (states,) and u (inputs,).

    Raises:
        ValueError: the steps end where the system does not rest.
    """
    require_float64("an equilibrium")
    x, u = jnp.asarray(x), jnp.asarray(u)
    system.check(x)
    n = system.states

    def residual(z):
        if output is None:
            return system.rate(z, u)
        wanted = jnp.asarray(output, x.dtype)
        return jnp.concatenate(
            [system.rate(z[:n], z[n:]), system.output(z[:n]) - wanted]
        )

    z = x if output is None else jnp.concatenate([x, u])
    value_and_slope = jax.jit(lambda z: (residual(z), jax.jacfwd(residual)(z)))
    value, slope = map(np.asarray, value_and_slope(z))
    for _ in range(_STEPS):
        step = np.linalg.lstsq(slope, -value, rcond=1e-12)[0]
        if np.linalg.norm(step) <= 1e-14 * (1.0 + np.linalg.norm(z)):
            break
        for _ in range(_HALVINGS):
            new, new_slope = map(np.asarray, value_and_slope(z + step))
            if np.linalg.norm(new) < np.linalg.norm(value):
                break
            step = 0.5 * step
        else:
            break
        z, value, slope = z + step, new, new_slope
    size = 1.0 + np.abs(slope) @ np.abs(np.asarray(z))
    if not np.all(np.abs(value) <= tolerance * size):
        raise ValueError(
            "there is no equilibrium near the first guess: the rates stay at "
            f"{np.abs(value).max():.3g} (x = {np.asarray(z)[:n]}); start elsewhere, or "
            "give an input that can hold the system"
        )
    return (z, u) if output is None else (z[:n], z[n:])
