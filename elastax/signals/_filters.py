"""Low-pass filters that deliver their output together with its time derivatives."""

import abc
import functools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np
import scipy.optimize
import scipy.signal
from jax.typing import ArrayLike
from jaxtyping import Array, Complex, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real


class FirstOrderHold(eqx.Module):
    r"""One sample of a filter, exact for an input that is linear in between.

    $x_{k+1} = \Phi\,x_k + g_0\,u_k + g_1\,u_{k+1}$

    Attributes:
        transition: $\Phi$, shape (order, order).
        previous: $g_0$, weight of the input at the start of the sample.
        current: $g_1$, weight of the input at its end.
    """

    transition: Float[Array, "order order"]
    previous: Float[Array, " order"]
    current: Float[Array, " order"]

    def __call__(self, state: Array, u_previous: ArrayLike, u: ArrayLike) -> Array:
        """State (order, channels) at the end of the sample.

        Args:
            state: at its start.
            u_previous: input at its start, shape (channels).
            u: input at its end.
        """
        u_previous, u = as_real(u_previous), as_real(u)
        return (
            jnp.tensordot(self.transition, state, axes=1)
            + jnp.tensordot(self.previous, u_previous, axes=0)
            + jnp.tensordot(self.current, u, axes=0)
        )


class AbstractFilter(eqx.Module):
    """Low-pass filter of unit static gain whose state holds derivatives of its output.

    Derivatives up to the `order` of the filter are exact derivatives of the *filtered*
    signal; the highest one contains the input itself and is therefore only as smooth
    as the input is. For samples of a curved input, which count as joined by straight
    lines, it is off by rate^order dt^2 / 12 times the second derivative of the input;
    where it matters, take one order more. A state has the shape (order, channels) with
    any trailing shape of channels, the shape of the input; it can be the carry of
    another algorithm.

    Attributes:
        order: number of poles.
        cutoff: frequency at which the gain has fallen by 3 dB, to 1 / sqrt(2) [Hz].
    """

    order: eqx.AbstractVar[int]
    cutoff: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def rate(self) -> Scalar:
        """Inverse time scale of the states [rad/s]."""

    @abc.abstractmethod
    def delay(self) -> Scalar:
        """Delay of slow signals [s]: the group delay at frequency zero."""

    @abc.abstractmethod
    def init(self, value: ArrayLike) -> Array:
        """State (order, channels) at rest under the constant input `value`."""

    @abc.abstractmethod
    def vector_field(self, state: Array, u: ArrayLike) -> Array:
        """Time derivative of the state at the input `u`."""

    @abc.abstractmethod
    def discretise(self, dt: ArrayLike) -> FirstOrderHold:
        """Step over `dt` [s], to be computed once and used for all samples."""

    @abc.abstractmethod
    def step(
        self, state: Array, u_previous: ArrayLike, u: ArrayLike, dt: ArrayLike
    ) -> Array:
        """State after `dt` [s] in which the input runs linearly to `u`.

        In a loop, call the result of `discretise` instead: it does the same without
        a matrix exponential per sample.
        """

    @abc.abstractmethod
    def derivatives(self, state: Array, u: ArrayLike, order: int) -> Array:
        """Output and its derivatives up to `order`, shape (order + 1, channels).

        Raises:
            ValueError: more derivatives are asked than the order of the filter.
        """

    @abc.abstractmethod
    def apply(self, samples: ArrayLike, dt: ArrayLike, order: int) -> Array:
        """Filter a whole recording, starting at rest at the first sample.

        Args:
            samples: input, shape (times, channels).
            dt: sampling time [s].
            order: highest derivative to deliver.

        Returns:
            Output and derivatives, shape (order + 1, times, channels): what `step`
            and `derivatives` give sample by sample.

        Raises:
            ValueError: more derivatives are asked than the order of the filter.
        """

    @abc.abstractmethod
    def frequency_response(self, omega: ArrayLike) -> Complex[Array, "..."]:
        """Complex gain at the angular frequencies `omega` [rad/s]."""


class CriticallyDampedFilter(AbstractFilter):
    r"""Cascade of equal first-order lags, the output without overshoot.

    $\dot x_1 = (u - x_1)\,\omega_c,\quad
    \dot x_i = (x_{i-1} - x_i)\,\omega_c,\quad y = x_n$

    [Reiner2010] (3.32). As printed, $\omega_c = 2\pi f_c$ and the gain at $f_c$ is
    $2^{-n/2}$ (use `from_corner`). The caption of figure 3.2 asks for 3 dB at $f_c$:
    $\omega_c = 2\pi f_c / \sqrt{2^{1/n} - 1}$, which is what `cutoff` means here.

    Attributes:
        order: number of lags $n$.
        cutoff: frequency of the gain $1/\sqrt 2$ [Hz].

    Raises:
        ValueError: `order` is not a positive whole number, `cutoff` is not positive.

    References:
        [Reiner2010] (3.32), (3.33).
    """

    order: int = eqx.field(static=True)
    cutoff: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        _check_filter(self)

    @classmethod
    def from_corner(cls, order: int, corner: ArrayLike) -> "CriticallyDampedFilter":
        """Filter as printed, [Reiner2010] (3.32a), $\\omega_c = 2\\pi f_c$.

        Args:
            order: number of lags.
            corner: corner frequency $f_c$ of every single lag [Hz].
        """
        _check_order(order)
        return cls(order, _cascade_ratio(order) * as_real(corner))

    def rate(self) -> Scalar:
        # [Reiner2010] (3.32a), normalised as in the caption of figure 3.2
        return (2 * math.pi / _cascade_ratio(self.order)) * self.cutoff

    def delay(self) -> Scalar:
        return self.order / self.rate()

    def init(self, value: ArrayLike) -> Array:
        value = as_real(value)
        return jnp.broadcast_to(value, (self.order, *value.shape))

    def vector_field(self, state: Array, u: ArrayLike) -> Array:
        # [Reiner2010] (3.32b, c)
        inputs = jnp.concatenate([as_real(u)[None], state[:-1]])
        return (inputs - state) * self.rate()

    def discretise(self, dt: ArrayLike) -> FirstOrderHold:
        system = np.eye(self.order, k=-1) - np.eye(self.order)
        return _first_order_hold(system, np.eye(self.order)[0], self.rate(), dt)

    def step(
        self, state: Array, u_previous: ArrayLike, u: ArrayLike, dt: ArrayLike
    ) -> Array:
        return self.discretise(dt)(state, u_previous, u)

    def derivatives(self, state: Array, u: ArrayLike, order: int) -> Array:
        # [Reiner2010] (3.33): y^(k) = w^k times the k-th difference along the cascade
        return _outputs(self, _cascade_rows(self.order), state, as_real(u), order)

    def apply(self, samples: ArrayLike, dt: ArrayLike, order: int) -> Array:
        _check_delivered(self, order)
        return _apply(self, as_real(samples), dt, order)

    def frequency_response(self, omega: ArrayLike) -> Complex[Array, "..."]:
        return _response(-np.ones(self.order), as_real(omega) / self.rate())


class BesselFilter(AbstractFilter):
    r"""Bessel filter: constant delay in the pass band, hardly any overshoot.

    $y^{(n)} = \omega^n\,(u - \sum_{i=0}^{n-1} a_i\,y^{(i)}/\omega^i)$ with the
    reverse Bessel polynomial, scaled to $a_0 = a_n = 1$. The states are
    $x_i = y^{(i)}/\omega^i$, which keeps them at the size of the input.

    Attributes:
        order: number of poles $n$, at most 25.
        cutoff: frequency of the gain $1/\sqrt 2$ [Hz].

    Raises:
        ValueError: `order` is not a whole number from 1 to 25, `cutoff` is not
            positive.

    References:
        [Reiner2010] section 3.5, figure 3.2. The dissertation normalises to 3 dB;
        `from_asymptote` and `from_delay` are the other two usual normalisations.
    """

    order: int = eqx.field(static=True)
    cutoff: Scalar = eqx.field(converter=as_real)

    def __check_init__(self):
        _check_bessel_order(self.order)
        _check_filter(self)

    @classmethod
    def from_asymptote(cls, order: int, frequency: ArrayLike) -> "BesselFilter":
        """Filter whose gain tends to that of a Butterworth filter of `frequency` [Hz].

        The normalisation "phase" of `scipy.signal.bessel`.
        """
        _check_bessel_order(order)
        return cls(order, _bessel(order).half_power * as_real(frequency))

    @classmethod
    def from_delay(cls, order: int, delay: ArrayLike) -> "BesselFilter":
        """Filter that delays slow signals by `delay` [s].

        The normalisation "delay" of `scipy.signal.bessel`.
        """
        _check_bessel_order(order)
        bessel = _bessel(order)
        scale = bessel.coefficients[1] * bessel.half_power / (2 * math.pi)
        return cls(order, scale / as_real(delay))

    def rate(self) -> Scalar:
        return (2 * math.pi / _bessel(self.order).half_power) * self.cutoff

    def delay(self) -> Scalar:
        return float(_bessel(self.order).coefficients[1]) / self.rate()

    def init(self, value: ArrayLike) -> Array:
        value = as_real(value)
        rest = jnp.zeros((self.order - 1, *value.shape), value.dtype)
        return jnp.concatenate([value[None], rest])

    def vector_field(self, state: Array, u: ArrayLike) -> Array:
        coefficients = _bessel(self.order).coefficients[:-1].astype(state.dtype)
        highest = as_real(u) - jnp.tensordot(coefficients, state, axes=1)
        return jnp.concatenate([state[1:], highest[None]]) * self.rate()

    def discretise(self, dt: ArrayLike) -> FirstOrderHold:
        rows = _bessel(self.order).rows
        return _first_order_hold(rows[1:, :-1], rows[1:, -1], self.rate(), dt)

    def step(
        self, state: Array, u_previous: ArrayLike, u: ArrayLike, dt: ArrayLike
    ) -> Array:
        return self.discretise(dt)(state, u_previous, u)

    def derivatives(self, state: Array, u: ArrayLike, order: int) -> Array:
        return _outputs(self, _bessel(self.order).rows, state, as_real(u), order)

    def apply(self, samples: ArrayLike, dt: ArrayLike, order: int) -> Array:
        _check_delivered(self, order)
        return _apply(self, as_real(samples), dt, order)

    def frequency_response(self, omega: ArrayLike) -> Complex[Array, "..."]:
        return _response(_bessel(self.order).poles, as_real(omega) / self.rate())


class _Bessel:
    """What depends on the order of a Bessel filter only, at a_0 = a_n = 1."""

    def __init__(self, order: int):
        # Reverse Bessel polynomial of unit delay, from the constant to s^n: integers.
        unit_delay = [
            math.factorial(2 * order - k)
            // (2 ** (order - k) * math.factorial(k) * math.factorial(order - k))
            for k in range(order + 1)
        ]
        scale = unit_delay[0] ** (1 / order)
        self.coefficients = np.array(
            [a * scale ** (k - order) for k, a in enumerate(unit_delay)]
        )
        self.poles = scipy.signal.besselap(order, norm="phase")[1]
        # Rows of y^(k) / rate^k in terms of the states and the input.
        self.rows = np.eye(order + 1)
        self.rows[order, :order] = -self.coefficients[:order]
        powers = 1j ** np.arange(order + 1) * self.coefficients

        def attenuation(omega):
            return abs(np.polyval(powers[::-1], omega)) ** 2 - 2

        root = scipy.optimize.root_scalar(attenuation, bracket=(0.0, 2.0), xtol=1e-15)
        self.half_power = float(root.root)


@functools.lru_cache
def _bessel(order: int) -> _Bessel:
    return _Bessel(order)


def _cascade_ratio(order: int) -> float:
    """Frequency of 3 dB of the cascade over the corner of one lag, sqrt(2^(1/n)-1)."""
    return math.sqrt(math.expm1(math.log(2.0) / order))


@functools.lru_cache
def _cascade_rows(order: int) -> np.ndarray:
    """Rows of y^(k) / rate^k in terms of the states x_1 to x_n and the input."""
    rows = np.zeros((order + 1, order + 1))
    for k in range(order + 1):
        for j in range(k + 1):
            # x_0 is the input, which comes last
            rows[k, order - k + j - 1] = (-1) ** j * math.comb(k, j)
    return rows


def _first_order_hold(
    system: np.ndarray, inlet: np.ndarray, rate: Scalar, dt: ArrayLike
) -> FirstOrderHold:
    """Exact step of x' = rate (system x + inlet u) for an input linear in time."""
    n = len(inlet)
    grown = np.zeros((n + 2, n + 2))
    grown[:n, :n] = system
    grown[:n, n] = inlet
    ramp = np.zeros((n + 2, n + 2))
    ramp[n, n + 1] = 1.0
    angle = (rate * as_real(dt)).astype(rate.dtype)
    generator = angle * grown.astype(rate.dtype) + ramp.astype(rate.dtype)
    # Squarings for a cutoff far above the sampling frequency, too.
    exponential = jax.scipy.linalg.expm(generator, max_squarings=64)
    held, rise = exponential[:n, n], exponential[:n, n + 1]
    return FirstOrderHold(exponential[:n, :n], held - rise, rise)


def _outputs(
    filter: AbstractFilter, rows: np.ndarray, state: Array, u: Array, order: int
) -> Array:
    """Derivatives 0 to `order` from the states (order of the filter, channels)."""
    _check_delivered(filter, order)
    rate = filter.rate()
    powers = jnp.stack([jnp.ones_like(rate)] + [rate**k for k in range(1, order + 1)])
    weights = powers[:, None] * rows[: order + 1].astype(rate.dtype)
    return jnp.tensordot(weights, jnp.concatenate([state, u[None]]), axes=1)


def _apply(filter: AbstractFilter, samples: Array, dt: ArrayLike, order: int) -> Array:
    """Scan over the states; the outputs of all samples at once."""
    hold = filter.discretise(dt)
    start = filter.init(samples[0])

    def advance(state, inputs):
        state = hold(state, *inputs)
        return state, state

    _, states = jax.lax.scan(advance, start, (samples[:-1], samples[1:]))
    states = jnp.moveaxis(jnp.concatenate([start[None], states]), 0, 1)
    return filter.derivatives(states, samples, order)


def _response(poles: np.ndarray, omega: Array) -> Array:
    """Product of pole / (pole - j omega), without overflow at any omega."""
    gain = jnp.ones_like(jax.lax.complex(omega, omega))
    for pole in poles.astype(gain.dtype):
        distance = jax.lax.complex(jnp.full_like(omega, pole.real), pole.imag - omega)
        gain = gain * (pole / distance)
    return gain


def _check_order(order: int) -> None:
    if isinstance(order, bool) or not isinstance(order, int) or order < 1:
        raise ValueError(f"`order` must be a positive whole number, but is {order!r}")


def _check_bessel_order(order: int) -> None:
    _check_order(order)
    if order > 25:
        raise ValueError(
            "`order` of a Bessel filter must not be above 25, where its poles are no "
            f"longer known to full precision, but is {order}"
        )


def _check_filter(filter: AbstractFilter) -> None:
    _check_order(filter.order)
    check_fields(filter)
    cutoff = filter.cutoff
    check_values(
        "`cutoff` must be positive and finite",
        cutoff,
        (cutoff > 0) & jnp.isfinite(cutoff),
    )


def _check_delivered(filter: AbstractFilter, order: int) -> None:
    if order < 0:
        raise ValueError(f"`order` must not be negative, but is {order}")
    if order > filter.order:
        raise ValueError(
            f"filter of too low an order: derivative {order} is asked of a filter of "
            f"order {filter.order}; take a filter of order {order} or higher"
        )
