"""Zero dynamics: stability with its margin, and simulation on the zero manifold."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from .._custom_types import Scalar, Times
from ._control_system import ControlSystem
from ._normal_form import NormalForm, normal_form


# of eigenvalues that count as on the imaginary axis, over the largest magnitude
_AXIS = 1e-8


class ZeroDynamics(eqx.Module):
    """Zero dynamics linearised at a point.

    Attributes:
        form: the local coordinates.
        matrix: of the linearised zero dynamics, shape (zeta, zeta).
        eigenvalues: [1/s], the zeros of the linearised system, sorted by real part.
        margin: distance to the imaginary axis, least -Re of the eigenvalues [1/s];
            infinite without zero dynamics.
        tolerance: margins below it do not decide.
    """

    form: NormalForm
    matrix: Float[Array, "zeta zeta"]
    eigenvalues: Complex[Array, " zeta"]
    margin: Scalar
    tolerance: Scalar

    @property
    def is_stable(self) -> bool:
        """Asymptotically stable by the linearisation: an exact inverse exists."""
        return float(self.margin) > float(self.tolerance)

    @property
    def is_unstable(self) -> bool:
        """Unstable by the linearisation: there is no stable exact inverse."""
        return float(self.margin) < -float(self.tolerance)

    @property
    def verdict(self) -> str:
        """In one line."""
        if not self.eigenvalues.size:
            return "no zero dynamics: the relative degree is the number of states"
        if self.is_stable:
            return f"stable zero dynamics, margin {float(self.margin):.4g} 1/s"
        if self.is_unstable:
            count = int(np.sum(np.real(self.eigenvalues) > float(self.tolerance)))
            return (
                f"unstable zero dynamics, {count} of {self.eigenvalues.size} "
                f"eigenvalues to the right, up to {-float(self.margin):.4g} 1/s"
            )
        return "eigenvalues on the imaginary axis: the linearisation does not decide"


def zero_dynamics(system: ControlSystem, x) -> ZeroDynamics:
    """Zero dynamics of a system at an equilibrium, with the outputs held there.

    Args:
        system: affine in its inputs; as outputs count the deviations from those at x.
        x: equilibrium, or a state whose outputs rest.

    Raises:
        ValueError: no relative degree, or the outputs do not rest.

    References:
        [Reiner2010] sections 3.2 and 3.3; that the linearisation decides where no
        eigenvalue lies on the axis: [Isidori1995].
    """
    x = jnp.asarray(x)
    rest = system.output(x)
    held = ControlSystem(system.rate, lambda x: system.output(x) - rest, system.names)
    form = normal_form(held, x)
    matrix, rate, slope = eqx.filter_jit(_linearised)(form)
    size = 1.0 + np.abs(slope) @ np.abs(np.asarray(x))
    if np.any(np.abs(rate) > 1e-7 * size):
        raise ValueError(
            "the zero dynamics must rest at the state, but with the outputs held it "
            f"moves (largest rate {np.abs(rate).max():.4g}): take an equilibrium, see "
            "`find_equilibrium`"
        )
    values = np.sort_complex(np.linalg.eigvals(np.asarray(matrix)))
    size = max(np.linalg.norm(matrix, 2) if matrix.size else 0.0, 1e-300)
    return ZeroDynamics(
        form,
        matrix,
        jnp.asarray(values),
        jnp.asarray(-values.real.max(initial=-np.inf)),
        jnp.asarray(_AXIS * size),
    )


def _linearised(form: NormalForm):
    slope = jax.jacfwd(form.held_rate)(form.origin)
    return form.basis.T @ slope @ form.basis, form.held_rate(form.origin), slope


def simulate_zero_dynamics(
    form: NormalForm, x, times: Times, *, rtol=1e-8, atol=1e-10, settle: float = 50.0
) -> Float[Array, "times states"]:
    r"""Motion of the state with the outputs held at zero.

    Jittable. The deviation of the outputs that errors of the integration leave decays
    by $(s + \lambda)^{r_i}$.

    Args:
        form: normal form whose system is simulated.
        x: start; taken to the zero manifold first, along the coordinates
            $\xi$ at fixed $\zeta$.
        times: at which the state is returned, ascending [s]; infinite where the motion
            has left the range of the coordinates.
        rtol, atol: of the integrator.
        settle: $\lambda$ [1/s].
    """
    zeta = form.coordinates(x)[sum(form.degrees) :]
    none = jnp.zeros((sum(form.degrees),), zeta.dtype)
    start = form.state(jnp.concatenate([none, zeta]), x)

    def rate(t, x, _):
        xi, push, k = form.external(x), [], 0
        for degree in form.degrees:
            weights = np.poly([-settle] * degree)[:0:-1]
            push.append(-jnp.asarray(weights, x.dtype) @ xi[k : k + degree])
            k += degree
        gain = form.output_gain(x)
        aim = jnp.stack(push) - form.output_drift(x)
        if gain.shape[0] == gain.shape[1]:
            u = jnp.linalg.solve(gain, aim)
        else:
            u = gain.T @ jnp.linalg.solve(gain @ gain.T, aim)
        return form.system.rate(x, u)

    solution = dfx.diffeqsolve(
        dfx.ODETerm(rate),
        dfx.Kvaerno5(),
        times[0],
        times[-1],
        None,
        start,
        saveat=dfx.SaveAt(ts=times),
        stepsize_controller=dfx.PIDController(rtol=rtol, atol=atol),
        max_steps=100_000,
        throw=False,
    )
    return jnp.asarray(solution.ys)
