"""Zeros, frequencies and damping of a robot over many poses."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..dynamics import ElasticRobot
from ._linear_model import LinearModel
from ._robot_model import RobotChannel, linear_robot, model_and_locked_motors
from ._transmission_zeros import transmission_zeros


# smallest over largest singular value of a decoupling matrix: a tenth of what elastic
# arms have in the middle of their workspace
_SINGULAR = 1e-4


class PoseFigures(eqx.Module):
    """What the linear model of a robot says, at one pose or stacked over poses.

    Attributes:
        zeros: transmission zeros [1/s], (..., zeros).
        poles: [1/s], (..., states).
        largest_real: largest real part of a zero [1/s].
        right_zeros: number of zeros in the right half-plane.
        slowest_right: magnitude of that of them which is nearest to the origin, and so
            limits a motion most [1/s]; infinite without one.
        frequency: first eigenfrequency with the motors locked [Hz].
        damping_ratio: of that mode.
        decoupling: smallest over largest singular value of the decoupling matrix.
        regular: whether that is large enough for the zeros to count.
    """

    zeros: Complex[Array, "*poses zeros"]
    poles: Complex[Array, "*poses states"]
    largest_real: Float[Array, "*poses"]
    right_zeros: Float[Array, "*poses"]
    slowest_right: Float[Array, "*poses"]
    frequency: Float[Array, "*poses"]
    damping_ratio: Float[Array, "*poses"]
    decoupling: Float[Array, "*poses"]
    regular: Bool[Array, "*poses"]


def pose_figures(
    robot: ElasticRobot,
    theta,
    channel: RobotChannel,
    degrees: tuple[int, ...],
    *,
    singular: float = _SINGULAR,
) -> PoseFigures:
    """Figures of one pose; jittable, vmapped over poses and robots.

    Its eigenvalues and factorisations are computed one after the other: on a processor,
    batched ones at the same time can wait for each other for ever (jaxlib 0.10).

    Args:
        robot: the robot.
        theta: motor angles at rest [rad].
        channel: whose zeros are looked at.
        degrees: relative degrees of its outputs.
        singular: below which a decoupling matrix counts as singular.
    """
    model, locked = model_and_locked_motors(robot, theta, channel)
    zeros = transmission_zeros(model.A, model.B, model.C, model.D, degrees)
    still = jnp.linalg.eigvals(_after(locked, zeros))
    swinging = still.imag > 0
    size = jnp.where(swinging, jnp.abs(still), jnp.inf)
    first = jnp.argmin(size)
    matrices = _after((model.A, model.B, model.C, model.D), still)
    share = conditioning(LinearModel(*matrices, names=model.names), degrees)
    right = zeros.real > 1e-9 * jnp.max(jnp.abs(zeros), initial=0.0)
    return PoseFigures(
        zeros=zeros,
        poles=LinearModel(_after(model.A, share), model.B, model.C).poles(),
        largest_real=jnp.max(zeros.real, initial=-jnp.inf),
        right_zeros=jnp.sum(right).astype(size.dtype),
        slowest_right=jnp.min(jnp.abs(zeros), where=right, initial=jnp.inf),
        frequency=size[first] / (2.0 * jnp.pi),
        damping_ratio=-still.real[first] / size[first],
        decoupling=share,
        regular=share > singular,
    )


def _after(values, earlier):
    """The values, not before something else is known."""
    return jax.lax.optimization_barrier((values, earlier))[0]


def conditioning(model: LinearModel, degrees: tuple[int, ...]):
    """Smallest over largest singular value of the decoupling matrix.

    Its columns are scaled to length one, so that units and sizes of the inputs do not
    count; the outputs are taken to be of one kind.
    """
    rows = []
    for i, degree in enumerate(degrees):
        row = model.C[i]
        if degree == 0:
            rows.append(model.D[i])
            continue
        for _ in range(degree - 1):
            row = row @ model.A
        rows.append(row @ model.B)
    matrix = jnp.stack(rows)
    length = jnp.linalg.norm(matrix, axis=0, keepdims=True)
    matrix = matrix / jnp.where(length > 0, length, 1.0)
    values = jnp.linalg.svd(matrix, compute_uv=False)
    return values[-1] / values[0]


class ZeroMap(eqx.Module):
    """Figures over poses.

    Attributes:
        poses: the maker's angles [rad], shape (poses, axes).
        figures: stacked over the poses.
        degrees: relative degrees of the outputs.
    """

    poses: Float[Array, "poses axes"]
    figures: PoseFigures
    degrees: tuple[int, ...] = eqx.field(static=True)

    @property
    def masked(self) -> int:
        """Number of poses whose decoupling matrix is singular."""
        return int(np.sum(~np.asarray(self.figures.regular)))

    @property
    def unstable(self) -> int:
        """Number of regular poses with a zero in the right half-plane."""
        regular = np.asarray(self.figures.regular)
        return int(np.sum(regular & (np.asarray(self.figures.right_zeros) > 0)))


def zero_map(
    robot: ElasticRobot,
    poses,
    channel: RobotChannel = RobotChannel(),
    *,
    batch: int = 256,
    progress=None,
) -> ZeroMap:
    """Zeros, first frequency and damping over poses.

    One compiled program runs over batches of poses, one pose after the other. The
    relative degrees are told at the first regular pose and hold for all; poses at which
    the decoupling matrix is singular are marked.

    Args:
        robot: the robot.
        poses: the maker's angles [rad], shape (poses, axes).
        channel: inputs and outputs.
        batch: poses at once.
        progress: called with the number of poses done.

    Raises:
        ValueError: as many inputs as outputs are needed, or no pose is regular.
    """
    poses = jnp.asarray(poses)
    if poses.ndim != 2 or poses.shape[1] != robot.axes:
        raise ValueError(f"`poses` must be (poses, {robot.axes}), but is {poses.shape}")
    if not robot.has_elastic_gears and not robot.elastic:
        raise ValueError("a rigid robot has no eigenfrequencies and no zeros to map")
    inputs, outputs = len(channel.inputs.axes), len(channel.outputs.names(robot))
    if inputs != outputs:
        raise ValueError(
            "a map of zeros needs as many outputs as inputs, but there are "
            f"{outputs} outputs and {inputs} inputs: drive other axes, or measure "
            "other directions"
        )
    degrees = _degrees(robot, poses, channel)

    parts = []
    for start in range(0, len(poses), batch):
        some = poses[start : start + batch]
        missing = batch - len(some) if len(poses) > batch else 0
        filled = jnp.concatenate([some, jnp.repeat(some[-1:], missing, axis=0)])
        found = jax.device_get(_figures(robot, filled, channel, degrees))
        parts.append(jax.tree.map(lambda x: x[: len(some)], found))
        if progress is not None:
            progress(start + len(some))
    joined = jax.tree.map(lambda *x: jnp.asarray(np.concatenate(x)), *parts)
    return ZeroMap(poses, joined, degrees)


@eqx.filter_jit
def _figures(robot, poses, channel, degrees):
    def at(pose):
        theta = robot.from_maker(pose)
        return pose_figures(robot, theta, channel, degrees)

    # one by one: on single matrices LAPACK never waits
    return jax.lax.map(at, poses)


def _degrees(robot: ElasticRobot, poses, channel: RobotChannel) -> tuple[int, ...]:
    """Relative degrees at the first of some poses at which they are defined."""
    some = np.unique(np.linspace(0, len(poses) - 1, 12).astype(int))
    problem = None
    for k in some:
        try:
            model = linear_robot(robot, robot.from_maker(poses[k]), channel)
            degrees = model.relative_degree()
        except ValueError as error:
            problem = error
            continue
        if float(conditioning(model, degrees)) > _SINGULAR:
            return degrees
    if problem is not None:
        raise problem
    raise ValueError(
        "the decoupling matrix is singular at all poses that were tried: choose other "
        "inputs or outputs"
    )
