r"""Chains that hold one object: a master that leads it and slaves that follow.

With the object gripped, the pose of the slave's tool in the master's tool frame is
constant, and so is the pose of the master's base in the slave's base frame. The closed
loop over both fixes the pose of the slave, $T_{s} = T_{sm}\, T_{m}\, G$, and with it
the joint rates.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, is_concrete
from .._custom_types import PerJoint, Transform, as_real
from .._kernel import kernel
from ._chain import SerialChain, forward_kinematics
from ._jacobian import jacobian, tool_motion
from ._logarithm import twist_from_transform
from ._orientation import check_transform
from ._se3 import inverse_transform


class Cooperation(eqx.Module):
    r"""A master and one slave with an object between them; of more slaves, one each.

    Attributes:
        master, slave: the chains.
        relation: pose of the master's base in the slave's base frame [m],
            $T_{A\eta}^{Am}$.
        grasp: pose of the slave's tool in the master's tool frame [m],
            $T_{TCPm}^{TCP\eta}$.

    References:
        [KinModell] (3-139), (3-140).
    """

    master: SerialChain
    slave: SerialChain
    relation: Transform = eqx.field(converter=as_real)
    grasp: Transform = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        for name in ("relation", "grasp"):
            pose = getattr(self, name)
            if is_concrete(pose):
                try:
                    check_transform(pose)
                except ValueError as error:
                    raise ValueError(f"`{name}`: {error}") from None


@kernel
def slave_pose(
    relation: Transform, master_pose: Transform, grasp: Transform
) -> Transform:
    r"""Pose of the slave's tool that the master's one asks for.

    $T_{A\eta}^{TCP\eta} = T_{A\eta}^{Am}\,T_{Am}^{TCPm}\,T_{TCPm}^{TCP\eta}$; the
    middle factor is missing in the print.

    Args:
        relation: pose of the master's base in the slave's base frame [m].
        master_pose: of the master's tool in its base frame [m].
        grasp: pose of the slave's tool in the master's tool frame [m].

    Returns:
        Pose of the slave's tool in its base frame, shape (4, 4).

    References:
        [KinModell] (3-140), corrected.
    """
    return relation @ master_pose @ grasp


@kernel
def loop_error(
    relation: Transform, master_pose: Transform, grasp: Transform, pose: Transform
) -> Float[Array, "6"]:
    r"""What is missing for the loop to close, as a twist.

    Logarithm of $(T_{A\eta}^{TCP\eta})^{-1}\,T_{A\eta}^{Am}\,T_{Am}^{TCPm}\,
    T_{TCPm}^{TCP\eta}$, the product of (3-139) started at the slave's tool: the
    displacement that the slave still has to make, in its own tool frame.

    Args:
        relation, master_pose, grasp: as for `slave_pose`.
        pose: of the slave's tool in its base frame [m].

    Returns:
        Translation [m] above rotation [rad], shape (6,); zero for a closed loop.

    References:
        [KinModell] (3-139).
    """
    wanted = slave_pose(relation, master_pose, grasp)
    return twist_from_transform(inverse_transform(pose) @ wanted)


class SlaveMotion(NamedTuple):
    """Joint motion of a slave that follows the object.

    Attributes:
        qd, qdd: velocities and accelerations, shape (joints,). Of a redundant slave
            those of least length; where it cannot follow, those that come closest.
        velocity, acceleration: of its tool in its base frame, as the master leads it,
            shape (6,).
        velocity_residual, acceleration_residual: what the slave does not follow, zero
            away from singular poses, shape (6,).
    """

    qd: PerJoint
    qdd: PerJoint
    velocity: Float[Array, "6"]
    acceleration: Float[Array, "6"]
    velocity_residual: Float[Array, "6"]
    acceleration_residual: Float[Array, "6"]


@kernel
def led_motion(
    pair: Cooperation, q: PerJoint, qd: PerJoint, qdd: PerJoint
) -> tuple[Float[Array, "6"], Float[Array, "6"]]:
    r"""Velocity and acceleration of the slave's tool, led by the master's joints.

    The slave's tool is a point r of the body that the master moves: $v + \omega\times
    r$ and $a + \alpha\times r + \omega\times(\omega\times r)$, turned into the slave's
    base frame.

    Args:
        pair: the chains with their relation.
        q, qd, qdd: of the master, shape (joints,).

    Returns:
        Velocity (6,) [m/s, rad/s] and acceleration (6,) [m/s^2, rad/s^2], translation
        above rotation.
    """
    velocity, acceleration = tool_motion(pair.master, q, qd, qdd)
    arm = forward_kinematics(pair.master, q)[:3, :3] @ pair.grasp[:3, 3]
    spin, turn = velocity[3:], pair.relation[:3, :3]
    v = velocity[:3] + jnp.cross(spin, arm)
    a = acceleration[:3] + jnp.cross(acceleration[3:], arm)
    a = a + jnp.cross(spin, jnp.cross(spin, arm))
    return (
        jnp.concatenate([turn @ v, turn @ spin]),
        jnp.concatenate([turn @ a, turn @ acceleration[3:]]),
    )


def slave_motion(
    pair: Cooperation,
    q: PerJoint,
    qd: PerJoint,
    qdd: PerJoint,
    slave_q: Float[Array, " slave_joints"],
    *,
    tolerance: float = 1e-8,
) -> SlaveMotion:
    r"""Joint velocities and accelerations with which the slave follows the master.

    $\dot x = J^{-1}\dot y$ and $\ddot x = J^{-1}(\ddot y - \dot J\dot x)$; the text
    prints $\dot J^{-1}$ in the second one, and asks for a regular $\dot J$, which is
    not needed.

    Args:
        pair: the chains with their relation.
        q, qd, qdd: of the master, shape (joints,).
        slave_q: coordinates of the slave at which the loop is closed, such as from
            `inverse_kinematics` or `solve_damped` at `slave_pose`; not checked, see
            `loop_error`.
        tolerance: singular values of the slave's Jacobian below this share of the
            largest one count as zero.

    References:
        [KinModell] (3-126), (3-127) corrected, (3-140).
    """
    velocity, acceleration = led_motion(pair, q, qd, qdd)
    matrix = jacobian(pair.slave, slave_q)
    inverse = jnp.linalg.pinv(matrix, rtol=tolerance)
    rates = inverse @ velocity
    turning = jax.jvp(lambda x: jacobian(pair.slave, x), (slave_q,), (rates,))[1]
    wanted = acceleration - turning @ rates
    second = inverse @ wanted
    return SlaveMotion(
        rates,
        second,
        velocity,
        acceleration,
        velocity - matrix @ rates,
        wanted - matrix @ second,
    )
