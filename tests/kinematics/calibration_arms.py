"""Arms and problems of the calibration tests. Dimensions are illustrative."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.kinematics import (
    CalibrationProblem,
    ChainParameters,
    DHJoints,
    HayatiJoints,
    Measurements,
    MixedJoints,
    SerialChain,
    estimate_parameters,
    random_joints,
    rotation_y,
    transform,
)


QUARTER = np.pi / 2
TOOL = transform(rotation_y(jnp.array(0.4)), jnp.array([0.1, 0.05, 0.25]))
REFLECTORS = np.array([[0.0, 0, 0], [0.2, 0, 0.05], [0, 0.25, -0.1]])


def heavy(alpha_2: float = 0.0) -> SerialChain:
    """Large arm with a spherical wrist, as a KR210; axes 2 and 3 parallel."""
    lengths = np.array([0.35, 1.15, 0.041, 0, 0, 0])
    offsets = np.array([0.675, 0, 0, 1.2, 0, 0.215])
    twists = np.array([1, 0, 1, -1, 1, 0]) * QUARTER
    twists[1] = alpha_2
    return SerialChain.from_dh(np.zeros(6), offsets, lengths, twists, tool=TOOL)


def heavy_hayati() -> SerialChain:
    """The same arm with Hayati's parameters for the joint between parallel axes."""
    dh = heavy().joints
    part = lambda k: DHJoints(dh.theta[k], dh.d[k], dh.a[k], dh.alpha[k])
    parallel = HayatiJoints(np.zeros(1), np.array([1.15]), np.zeros(1), np.zeros(1))
    joints = MixedJoints((part(slice(0, 1)), parallel, part(slice(2, 6))))
    return SerialChain.from_joints(joints, tool=TOOL)


def light() -> SerialChain:
    """Light arm with three parallel axes, as a UR10; DH leaves their offsets open."""
    return SerialChain.from_dh(
        np.zeros(6),
        np.array([0.1273, 0, 0, 0.1639, 0.1157, 0.0922]),
        np.array([0.0, -0.612, -0.5723, 0, 0, 0]),
        np.array([1, 0, 0, 1, -1, 0]) * QUARTER,
        tool=TOOL,
    )


def poses(number: int, seed: int = 0):
    """Joint coordinates [rad] within the limits of the heavy arm."""
    upper = jnp.array([2.0, 2.2, 1.2, 2.5, 2.0, 2.5])
    lower = jnp.array([-2.0, 0.3, -1.2, -2.5, -2.0, -2.5])
    return random_joints(lower, upper, number, key=jax.random.key(seed))


def deviations(units, seed: int = 1, size: float = 5e-4):
    """Random deviations of `size` [m] and [rad]."""
    return size * jax.random.normal(jax.random.key(seed), (len(units),))


def problem_of(chain, instrument, q, names=None, joint_deviation=None, **options):
    """Problem with readings of the nominal arm."""
    parameters = ChainParameters.of(chain)
    if names is not None:
        parameters = parameters.select(names)
    measured = Measurements.simulated(
        instrument, chain, q, joint_deviation=joint_deviation
    )
    return CalibrationProblem(parameters, measured, **options)


def true_problem(problem, x, key=None):
    """The problem with readings of the arm that deviates by x."""
    (nominal,) = problem.measurements
    measured = Measurements.simulated(
        nominal.instrument, problem.chain(x), nominal.q, key, nominal.joint_deviation
    )
    return CalibrationProblem(
        problem.parameters, measured, problem.prior, problem.encoders
    )


# one program per structure of a problem
estimate = eqx.filter_jit(estimate_parameters)
measure = eqx.filter_jit(true_problem)
