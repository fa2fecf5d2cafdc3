"""Rigid inverse: neither gears nor structure give way."""

import jax
import jax.numpy as jnp

from .._custom_types import Scalar
from ..dynamics import ElasticRobot, MotorCommand, MotorSample, inverse_dynamics
from ..signals import Reference
from ._base import AbstractInverse, Derivatives, check_reference, samples_of


class RigidInverse(AbstractInverse):
    r"""Computed torque of the rigid robot with reflected rotor inertias.

    $\theta = q_r$, $\tau_m = (M_{aa} + \Theta)\ddot q_r + h_a + \tau_r(\dot q_r)$.

    References:
        [Reiner2010] section 6.2, the feed-forward of a rigid robot.
    """

    def order(self) -> int:
        return 2

    def init(
        self, model: ElasticRobot, sample: Derivatives, dt: Scalar | float
    ) -> None:
        return None

    def step(
        self, model: ElasticRobot, state: None, sample: Derivatives
    ) -> tuple[MotorSample, None]:
        q, qd, qdd = sample[:3]
        drives = model.drives
        tau_a, _ = inverse_dynamics(model.rigid(), q, qd, qdd)
        friction = drives.motor_friction.torque(qd)
        tau_m = tau_a + drives.reflected_inertia() * qdd + friction
        return MotorSample(q, qd, qdd, tau_m, tau_a, q, jnp.zeros((0,), q.dtype)), None

    def feedforward(self, model: ElasticRobot, reference: Reference) -> MotorCommand:
        check_reference(self, model, reference)
        samples = samples_of(self, reference)
        outputs, _ = jax.vmap(lambda sample: self.step(model, None, sample))(samples)
        return MotorCommand.from_samples(reference.times, outputs)
