"""Natural frequencies, damping and participation of the modes of a linear system."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float


class Modes(eqx.Module):
    """Eigenvalues of a system, sorted by natural frequency.

    Attributes:
        poles: [1/s], shape (states,).
        frequency: natural frequency |pole| [Hz].
        damped_frequency: imaginary part [Hz].
        damping_ratio: -Re / |pole|; one for real stable poles, zero for one at 0.
        participation: share of the states in the modes, shape (states, modes), the
            magnitudes of every mode sum to one.
    """

    poles: Complex[Array, " states"]
    frequency: Float[Array, " states"]
    damped_frequency: Float[Array, " states"]
    damping_ratio: Float[Array, " states"]
    participation: Float[Array, "states states"]


def modes_of(A) -> Modes:
    r"""Modes of $\dot x = A x$; participation factors $|w_{kj} v_{kj}|$.

    References:
        [Perez1982] for participation factors.
    """
    poles, right = jnp.linalg.eig(A)
    size = jnp.abs(poles)
    order = jnp.lexsort((poles.imag, size))
    poles, right, size = poles[order], right[:, order], size[order]
    left = jnp.linalg.inv(right).T
    share = jnp.abs(right * left)
    share = share / jnp.sum(share, axis=0, keepdims=True)
    moving = size > 0
    return Modes(
        poles=poles,
        frequency=size / (2 * jnp.pi),
        damped_frequency=poles.imag / (2 * jnp.pi),
        damping_ratio=jnp.where(
            moving, -poles.real / jnp.where(moving, size, 1.0), 0.0
        ),
        participation=share,
    )
