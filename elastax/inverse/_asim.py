r"""ASIM, the approximate inverse model of the structurally elastic robot.

The exact inverse of the elastic robot is unstable. Figure 3.21 of the text replaces it
by a chain of stable steps:

1. a rigid parallel model on the reference gives the torques $\hat\tau_e$ in the
   structure,
2. the structure's springs and dampers answer with the deformations $\hat\eta$,
3. one damped least-squares step corrects the joint angles for the displaced tool,
4. the equations of motion of the deformed, corrected robot give the torques behind the
   gears,
5. the drive trains are inverted exactly.

Steps 1, 3, 4 and 5 are functions of one sample and its derivatives; only the
deformations, the torsions of the gears and the filtered damping factor have a memory.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_values
from .._custom_types import PerElastic, Scalar
from .._kernel import kernel
from .._taylor import Series, from_derivatives
from ..dynamics import ElasticRobot, MotorCommand, MotorSample, inverse_dynamics
from ..kinematics import CorrectionLimiter, SigmoidDamping
from ..signals import Reference
from ._base import AbstractInverse, Derivatives, check_reference, samples_of
from ._correction import AbstractCorrection, PositionCorrection, correct
from ._damping_signal import AbstractDampingSignal, FilteredDamping
from ._drive import (
    DriveState,
    advance_gear,
    gear_spring,
    gears_along,
    motor_motion,
    resting_gear,
)
from ._response import advance, response


def default_damping() -> FilteredDamping:
    """Damping for position Jacobians of arms of a few metres [m]; the limits are ours.

    At the stretched pose the tool cannot move along the arm. The largest damping keeps
    that direction quiet and costs 1 % where the singular values are near 3 m.
    """
    return FilteredDamping(SigmoidDamping.from_limits(1e-3, 0.3, 0.1, 0.6))


class _State(eqx.Module):
    eta: PerElastic
    forcing: Float[Array, "terms elastic"]
    drive: DriveState
    damping: object
    dt: Scalar
    elapsed: Scalar  # time since the last sample: zero before the first


class ASIM(AbstractInverse):
    r"""Approximate structurally elastic inverse model.

    Attributes:
        correction: error of the tool that is corrected, and the axes that do it.
        damping: damping factor of the least squares over time.
        limiter: bounds the correction, or `None`.
        iterations: damped steps per sample; the text takes one.

    References:
        [Reiner2010] section 3.8, (3.76) to (3.94), figure 3.21.
    """

    correction: AbstractCorrection = PositionCorrection()
    damping: AbstractDampingSignal = eqx.field(default_factory=default_damping)
    limiter: CorrectionLimiter | None = None
    iterations: int = eqx.field(static=True, default=1)

    def order(self, model: ElasticRobot) -> int:
        return 4 + model.drives.extra_order

    def init(
        self, model: ElasticRobot, sample: Derivatives, dt: Scalar | float
    ) -> _State:
        _check_damped(model)
        forcing = structure_torque(model, sample)
        eta = resting_deformation(model, forcing)
        dt = jnp.asarray(dt, sample.dtype)
        smallest = self._smallest(model, sample[0], eta)
        damping = self.damping.init(smallest, dt)
        order = 3 + model.drives.extra_order
        factor, _ = self.damping.step(damping, smallest, jnp.zeros_like(dt), order)
        _, load = self._loaded(model, sample, forcing, eta, factor)
        drive = DriveState(resting_gear(model.drives, load), load.coefficients)
        return _State(eta, forcing.coefficients, drive, damping, dt, jnp.zeros_like(dt))

    def step(
        self, model: ElasticRobot, state: _State, sample: Derivatives
    ) -> tuple[MotorSample, _State]:
        forcing = structure_torque(model, sample)
        eta = advance_deformation(
            model, state.eta, Series(state.forcing), forcing, state.elapsed
        )
        factor, damping = self.damping.step(
            state.damping,
            self._smallest(model, sample[0], eta),
            state.elapsed,
            3 + model.drives.extra_order,
        )
        q, load = self._loaded(model, sample, forcing, eta, factor)
        before = Series(state.drive.load)
        gear = advance_gear(model.drives, state.drive.gear, before, load, state.elapsed)
        output = motor_motion(model.drives, q, load, gear, eta)
        drive = DriveState(gear, load.coefficients)
        return output, _State(
            eta, forcing.coefficients, drive, damping, state.dt, state.dt
        )

    def feedforward(self, model: ElasticRobot, reference: Reference) -> MotorCommand:
        check_reference(self, model, reference)
        _check_damped(model)
        gear_spring(model.drives)
        samples, dt = samples_of(self, model, reference), reference.dt
        forcing = jax.vmap(lambda s: structure_torque(model, s).coefficients)(samples)
        eta = deformations_along(model, forcing, dt)
        smallest = jax.vmap(lambda s, e: self._smallest(model, s[0], e))(samples, eta)
        factors = self.damping.along(smallest, dt, 3 + model.drives.extra_order)

        def loaded(sample, torque, eta, factor):
            q, load = self._loaded(model, sample, Series(torque), eta, Series(factor))
            return q.coefficients, load.coefficients

        q, loads = jax.vmap(loaded)(samples, forcing, eta, factors)
        gears = gears_along(model.drives, loads, dt)
        outputs = jax.vmap(
            lambda q, f, g, e: motor_motion(model.drives, Series(q), Series(f), g, e)
        )(q, loads, gears, eta)
        return MotorCommand.from_samples(reference.times, outputs)

    def _smallest(self, model: ElasticRobot, q, eta) -> Scalar:
        """Smallest singular value of the deformed robot's Jacobian."""
        return self.correction.smallest(_jacobian(self.correction, model, q, eta))

    def _loaded(self, model: ElasticRobot, sample, forcing, eta, factor):
        return _loaded_motion(
            (self.correction, self.limiter, self.iterations),
            model,
            sample,
            forcing,
            eta,
            factor,
        )


@kernel
def _check_damped(model: ElasticRobot) -> None:
    check_values(
        "the deformations of ASIM need damping: `structure_damping` of "
        f"`{model.name}` must be positive",
        model.structure_damping,
        model.structure_damping > 0,
    )


def _jacobian(correction: AbstractCorrection, model: ElasticRobot, q, eta):
    return correction.linearised(model, q, eta, correction.target(model, q))[0]


@kernel
def _loaded_motion(how, model: ElasticRobot, sample, forcing, eta, factor):
    """Corrected joint angles (order 3) and torques behind the gears (order 1).

    Both orders are higher by one where the motors have a lag.
    """
    correction, limiter, iterations = how
    order = 1 + model.drives.extra_order
    reference = from_derivatives(sample[: order + 3])
    deformation = deformation_series(model, eta, forcing)
    q = reference + correct(
        correction, model, reference, deformation, factor, limiter, iterations
    )
    motion, bending = (
        (x.truncated(order), x.rate().truncated(order), x.rate().rate())
        for x in (q, deformation)
    )
    load, _ = inverse_dynamics(model, *motion, *bending)  # [Reiner2010] (3.91)
    return q, load


@kernel
def structure_torque(model: ElasticRobot, sample: Derivatives) -> Series:
    r"""Torques in the structure of the rigid parallel model, with two derivatives.

    Three where the motors have a lag.

    $-\hat\tau_e = M_{ea}\ddot q_r + h_e^*$ at $\eta = \dot\eta = 0$;
    $M_{ee}\ddot\eta$ is neglected.

    References:
        [Reiner2010] (3.76); its sign is that of (3.78), conventions 8 and 10 of the
        errata.
    """
    order = 2 + model.drives.extra_order
    q = from_derivatives(sample[: order + 3])
    qd, qdd = q.rate(), q.rate().rate()
    _, force = inverse_dynamics(model, q.truncated(order), qd.truncated(order), qdd)
    return -force


def resting_deformation(model: ElasticRobot, forcing: Series) -> PerElastic:
    """Deformations under the constant torque in the structure [rad]."""
    if model.structure_stiffness is None:
        return forcing.coefficients[0]
    return model.structure_stiffness.torsion(forcing.coefficients[0])


@kernel
def advance_deformation(
    model: ElasticRobot,
    eta: PerElastic,
    before: Series,
    after: Series,
    dt: Scalar | float,
) -> PerElastic:
    """Deformations one sample later [rad].

    References:
        [Reiner2010] (3.79), and for nonlinear springs (3.80).
    """
    if model.structure_stiffness is None:
        return eta
    spring = model.structure_stiffness.torque
    return advance(spring, model.structure_damping, eta, before, after, dt)


def deformation_series(model: ElasticRobot, eta: PerElastic, forcing: Series) -> Series:
    """Deformations with one derivative more than the forcing has, three or four.

    References:
        [Reiner2010] (3.78), (3.79).
    """
    if model.structure_stiffness is None:
        return Series(jnp.zeros((forcing.order + 2, 0), eta.dtype))
    spring = model.structure_stiffness.torque
    return response(spring, model.structure_damping, eta, forcing)


def deformations_along(
    model: ElasticRobot,
    forcing: Float[Array, "times terms elastic"],
    dt: Scalar | float,
) -> Float[Array, "times elastic"]:
    """Deformations [rad] over a whole motion that starts at rest."""

    def step(eta, pair):
        eta = advance_deformation(model, eta, Series(pair[0]), Series(pair[1]), dt)
        return eta, eta

    start = resting_deformation(model, Series(forcing[0]))
    pairs = jnp.stack([forcing[:-1], forcing[1:]], axis=1)
    _, rest = jax.lax.scan(step, start, pairs)
    return jnp.concatenate([start[None], rest])
