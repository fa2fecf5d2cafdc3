"""Rigid inverse: neither gears nor structure give way."""

import jax
import jax.numpy as jnp

from .._custom_types import Scalar
from .._taylor import from_derivatives
from ..dynamics import ElasticRobot, MotorCommand, MotorSample, inverse_dynamics
from ..signals import Reference
from ._base import AbstractInverse, Derivatives, check_reference, samples_of
from ._drive import motors_behind


class RigidInverse(AbstractInverse):
    r"""Computed torque of the rigid robot with reflected rotor inertias.

    $\theta = q_r$, $\tau_m = (M_{aa} + \Theta)\ddot q_r + h_a + \tau_r(\dot q_r)$.

    References:
        [Reiner2010] section 6.2, the feed-forward of a rigid robot.
    """

    def order(self, model: ElasticRobot) -> int:
        return 2 + model.drives.extra_order

    def init(
        self, model: ElasticRobot, sample: Derivatives, dt: Scalar | float
    ) -> None:
        return None

    def step(
        self, model: ElasticRobot, state: None, sample: Derivatives
    ) -> tuple[MotorSample, None]:
        order = model.drives.extra_order
        q = from_derivatives(sample[: order + 3])
        motion = q.truncated(order), q.rate().truncated(order), q.rate().rate()
        load, _ = inverse_dynamics(model.rigid(), *motion)
        empty = jnp.zeros((0,), sample.dtype)
        return motors_behind(model.drives, q, q, load, empty), None

    def feedforward(self, model: ElasticRobot, reference: Reference) -> MotorCommand:
        check_reference(self, model, reference)
        samples = samples_of(self, model, reference)
        outputs, _ = jax.vmap(lambda sample: self.step(model, None, sample))(samples)
        return MotorCommand.from_samples(reference.times, outputs)
