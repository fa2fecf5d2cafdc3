r"""Normal form of a nonlinear system and its zero dynamics, computed numerically.

The outputs and their derivatives below the relative degree, $\xi$, are the first
coordinates; orthonormal coordinates $\zeta$ of the directions in which none of them
changes at the point are the others. On the zero manifold $\xi = 0$, with the input that
keeps it there, the rates of $\zeta$ are the zero dynamics: no partial differential
equation has to be solved, which a normal form in the strict sense, (3.9), asks for.
`straightened` solves it all the same, along the flow of the input field.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._control_system import ControlSystem
from ._lie import lie_derivative
from ._relative_degree import RelativeDegree, decoupling_matrix, relative_degree


_NEWTON = 8  # steps of the chart's inverse; quadratic from a point near the manifold
_FLOW = 16  # Runge-Kutta steps along the input field


class NormalForm(eqx.Module):
    r"""Local coordinates $z = (\xi, \zeta)$ at a point.

    Attributes:
        system: the system.
        origin: the point, shape (states,).
        basis: orthonormal, of what $\xi$ does not see there, shape (states, zeta).
        degrees: relative degrees r_i.

    References:
        [Reiner2010] (3.7) to (3.13), (3.17) to (3.19); [Isidori1995].
    """

    system: ControlSystem
    origin: Float[Array, " states"]
    basis: Float[Array, "states zeta"]
    degrees: tuple[int, ...] = eqx.field(static=True)

    def external(self, x) -> Float[Array, " xi"]:
        r"""$\xi$: every output and its derivatives below r_i, (3.8), (3.17)."""
        values = []
        for i, degree in enumerate(self.degrees):
            output = lambda x, i=i: self.system.output(x)[i]
            for order in range(degree):
                values.append(lie_derivative(self.system.drift, output, order)(x))
        return jnp.stack(values)

    def coordinates(self, x) -> Float[Array, " states"]:
        r"""$z = (\xi, \zeta)$ of a state."""
        return jnp.concatenate([self.external(x), self.basis.T @ (x - self.origin)])

    def state(self, z, start=None) -> Float[Array, " states"]:
        r"""The state of coordinates z, $\Phi^{-1}(z)$, by Newton's method.

        Args:
            z: coordinates.
            start: first guess of the state; the origin unless given.
        """
        start = self.origin if start is None else start

        def newton(function, x):
            def step(x, _):
                slope = jax.jacfwd(function)(x)
                return x - jnp.linalg.solve(slope, function(x)), None

            return jax.lax.scan(step, x, None, length=_NEWTON)[0]

        def tangent(function, right):
            return jnp.linalg.solve(jax.jacfwd(function)(right), right)

        residual = lambda x: self.coordinates(x) - z
        return jax.lax.custom_root(residual, start, newton, tangent)

    def output_drift(self, x) -> Float[Array, " outputs"]:
        r"""b of (3.12j): $L_f^{r_i} h_i$."""
        values = []
        for i, degree in enumerate(self.degrees):
            output = lambda x, i=i: self.system.output(x)[i]
            values.append(lie_derivative(self.system.drift, output, degree)(x))
        return jnp.stack(values)

    def output_gain(self, x) -> Float[Array, "outputs inputs"]:
        """a of (3.12i), the decoupling matrix of (3.16)."""
        return decoupling_matrix(self.system, x, self.degrees)

    def holding_input(self, x) -> Float[Array, " inputs"]:
        r"""$u^0 = -a^{-1} b$: what keeps the outputs at zero; least for many inputs."""
        gain, drift = self.output_gain(x), self.output_drift(x)
        if gain.shape[0] == gain.shape[1]:
            return -jnp.linalg.solve(gain, drift)
        return -gain.T @ jnp.linalg.solve(gain @ gain.T, drift)

    def held_rate(self, x) -> Float[Array, " states"]:
        r"""Rate of the state under $u^0$; tangent to the zero manifold on it."""
        return self.system.rate(x, self.holding_input(x))

    def zero_rate(self, zeta) -> Float[Array, " zeta"]:
        r"""Zero dynamics $\dot\zeta$ in the coordinates of the manifold."""
        none = jnp.zeros((self.origin.shape[0] - zeta.shape[0],), zeta.dtype)
        x = self.state(jnp.concatenate([none, zeta]))
        return self.basis.T @ self.held_rate(x)

    def straightened(self, x) -> Float[Array, " zeta"]:
        r"""Coordinates $\phi$ with $L_g \phi = 0$ near the origin, for one input.

        $\zeta$ of the point at which the flow of $-g / (L_g \xi_r)$ from x meets
        $\xi_r = 0$: constant along g, a solution of (3.9), by Runge-Kutta steps.
        """
        if self.system.inputs != 1:
            raise ValueError(
                "coordinates that no input moves exist for several inputs only where "
                "their fields are involutive: take `coordinates`"
            )
        last = lambda x: self.external(x)[-1]

        def field(x):
            g = self.system.input_matrix(x)[:, 0]
            return -g / jax.jvp(last, (x,), (g,))[1]

        h = last(x) / _FLOW

        def step(x, _):
            k1 = field(x)
            k2 = field(x + 0.5 * h * k1)
            k3 = field(x + 0.5 * h * k2)
            k4 = field(x + h * k3)
            return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), None

        landed, _ = jax.lax.scan(step, x, None, length=_FLOW)
        return self.basis.T @ (landed - self.origin)

    def straightened_matrix(self) -> Float[Array, "zeta zeta"]:
        r"""Linearised $q(0, \phi)$ of the strict normal form, (3.12k) without u."""
        phi = self.straightened
        rates = lambda x: jax.jvp(phi, (x,), (self.system.drift(x),))[1]
        slope = jax.jacfwd(rates)(self.origin)
        both = jnp.concatenate(
            [jax.jacfwd(self.external)(self.origin), jax.jacfwd(phi)(self.origin)]
        )
        return slope @ jnp.linalg.inv(both)[:, self.origin.shape[0] - len(slope) :]


def normal_form(
    system: ControlSystem, x, degree: RelativeDegree | None = None
) -> NormalForm:
    """Normal form of a system at a state.

    Args:
        system: affine in its inputs.
        x: state at which all outputs and their derivatives below the relative degree
            are zero, such as an equilibrium with y = 0.
        degree: if it is known.

    Raises:
        ValueError: no relative degree, or the outputs do not rest at zero there.
    """
    x = jnp.asarray(x)
    degree = relative_degree(system, x) if degree is None else degree
    form = NormalForm(system, x, jnp.zeros((x.shape[0], 0)), degree.degrees)
    values, slope = map(np.asarray, _external(form, x))
    size = np.linalg.norm(slope, axis=1) * (1.0 + float(jnp.linalg.norm(x)))
    if np.any(np.abs(values) > 1e-7 * size):
        worst = int(np.argmax(np.abs(values) / size))
        raise ValueError(
            "the outputs and their derivatives below the relative degree must be zero "
            f"at the state of the normal form, but number {worst + 1} of them is "
            f"{values[worst]:.4g}: subtract the output there, or start from rest"
        )
    basis = np.linalg.svd(slope)[2][slope.shape[0] :].T
    return NormalForm(system, x, jnp.asarray(basis), degree.degrees)


@eqx.filter_jit
def _external(form: NormalForm, x):
    return form.external(x), jax.jacfwd(form.external)(x)
