r"""Eigenfunctions of a bar in torsion or extension.

$c\,u'' + \mu\,\omega^2 u = 0$ with the stiffness $c = GI_t$ or $EA$ and the inertia per
length $\mu$. Held at the base, $u = \sin(\beta x/l)$; free, $u = \cos(\beta x/l)$. With
a mass $m_t$ at the end both give $\cos y = \kappa\,\beta\,\sin y$,
$\kappa = m_t/(\mu l)$, for $\beta = (k - 1)\pi + y$ or $(k - \tfrac12)\pi + y$ with $y$
in $(0, \pi/2]$: one root each.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_values
from .._custom_types import Scalar, as_real
from ._beam import UniformBeam
from ._beam_supports import AbstractSupport, ClampedFree


_BISECTIONS = 54


class BarModes(eqx.Module):
    r"""Eigenfrequencies and eigenfunctions, of unit modal mass, $\phi_k(l) > 0$.

    Attributes:
        frequencies: $\omega_k$ in ascending order [rad/s].
        amplitudes: signed, shape (modes,).
        wave_numbers: [1/m].
        held: whether the base is; the sine has a phase of a quarter turn if not.
    """

    frequencies: Float[Array, " modes"]
    amplitudes: Float[Array, " modes"]
    wave_numbers: Float[Array, " modes"]
    held: bool = eqx.field(static=True)

    def value(self, x: Float[Array, " points"]) -> Float[Array, "modes points"]:
        """Eigenfunctions at x from the base [m]."""
        argument = self.wave_numbers[:, None] * x[None] + _phase(self.held)
        return self.amplitudes[:, None] * jnp.sin(argument)

    def slope(self, x: Float[Array, " points"]) -> Float[Array, "modes points"]:
        """First derivatives by x."""
        argument = self.wave_numbers[:, None] * x[None] + _phase(self.held)
        size = self.amplitudes * self.wave_numbers
        return size[:, None] * jnp.cos(argument)


def bar_modes(
    stiffness,
    inertia_per_length,
    length,
    number: int,
    *,
    support: AbstractSupport = ClampedFree(),
    tip: Scalar | float = 0.0,
) -> BarModes:
    r"""The first eigenmodes of a uniform bar.

    Args:
        stiffness: $GI_t$ [N m^2] or $EA$ [N].
        inertia_per_length: $\rho I_p$ [kg m] or $\rho A$ [kg/m].
        length: [m].
        number: of modes; the rigid-body motion of a free bar is not counted.
        support: a base that stays in place holds the bar, also against torsion.
        tip: inertia [kg m^2] or mass [kg] at the end.

    Raises:
        ValueError: stiffness, inertia or length are not positive, the tip is negative,
            or `number` is below 1.

    References:
        [Blevins1979] tables 8-16 and 8-19.
    """
    c, mu, l = as_real(stiffness), as_real(inertia_per_length), as_real(length)
    tip = as_real(tip)
    for name, value in (
        ("stiffness", c),
        ("inertia_per_length", mu),
        ("length", l),
    ):
        check_values(f"`{name}` must be positive", value, value > 0)
    check_values("`tip` must not be negative", tip, tip >= 0)
    if number < 1:
        raise ValueError(f"`number` of modes must be at least 1, but is {number}")
    kappa = tip / (mu * l)
    held = support.holds_deflection
    start = jnp.asarray(np.pi * (np.arange(number) + (0.0 if held else 0.5)))

    def residual(y):
        return jnp.cos(y) - kappa * (start + y) * jnp.sin(y)

    def bisect(bounds, _):
        lower, upper = bounds
        middle = 0.5 * (lower + upper)
        above = residual(middle) > 0.0
        return (jnp.where(above, middle, lower), jnp.where(above, upper, middle)), None

    bounds = jnp.zeros_like(start), jnp.full_like(start, 0.5 * np.pi)
    (lower, upper), _ = jax.lax.scan(bisect, bounds, None, length=_BISECTIONS)
    y = jax.lax.stop_gradient(0.5 * (lower + upper))
    # one step of Newton's method for the last digits and for the derivatives
    value, slope = jax.jvp(residual, (y,), (jnp.ones_like(y),))
    beta = start + y - value / slope
    phase = _phase(held)
    end = jnp.sin(beta + phase)
    ripple = (jnp.sin(2.0 * (beta + phase)) - np.sin(2.0 * phase)) / (4.0 * beta)
    mass = mu * l * (0.5 - ripple) + tip * end**2
    return BarModes(
        beta * jnp.sqrt(c / mu) / l, jnp.sign(end) / jnp.sqrt(mass), beta / l, held
    )


def _phase(held: bool) -> float:
    return 0.0 if held else 0.5 * np.pi


def torsion_modes(
    beam: UniformBeam,
    number: int,
    *,
    support: AbstractSupport = ClampedFree(),
    tip_inertia: Scalar | float = 0.0,
) -> BarModes:
    """Modes of a beam in torsion; its polar inertia is that of the section."""
    section, material = beam.section, beam.material
    polar = section.second_moment_y + section.second_moment_z
    return bar_modes(
        beam.rigidity()[0],
        material.density * polar,
        beam.length,
        number,
        support=support,
        tip=tip_inertia,
    )


def extension_modes(
    beam: UniformBeam,
    number: int,
    *,
    support: AbstractSupport = ClampedFree(),
    tip_mass: Scalar | float = 0.0,
) -> BarModes:
    """Modes of a beam along its axis."""
    section, material = beam.section, beam.material
    return bar_modes(
        material.young * section.area,
        material.density * section.area,
        beam.length,
        number,
        support=support,
        tip=tip_mass,
    )
