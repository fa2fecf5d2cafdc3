"""Tool centre point, tool frame and mounting pose: exact, with noise, degenerate."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    CalibrationProblem,
    ChainParameters,
    Measurements,
    PointInstrument,
    PoseInstrument,
    estimate_parameters,
    forward_kinematics,
    frame_from_points,
    inverse_transform,
    mounting_pose,
    rotation_from_vector,
    tool_centre_point,
    tool_frame,
    tool_orientation,
    transform,
    transform_from_twist,
)

from ..helpers import assert_close, assert_gradient
from .calibration_arms import REFLECTORS, TOOL, heavy, poses


TIP = jnp.array([0.08, -0.03, 0.21])
POINT = jnp.array([1.4, 0.3, 0.9])


def touching(vectors, tip=TIP, point=POINT):
    """Flange poses turned by `vectors` [rad] whose `tip` touches `point`."""
    rotations = jax.vmap(rotation_from_vector)(jnp.asarray(vectors))
    positions = point[None] - rotations @ tip
    return transform(rotations, positions)


FOUR = np.array([[0.1, 0, 0], [0.9, 0.2, 0], [-0.3, 0.8, 0.4], [0, -0.7, 1.0]])


# ------------------------------------------------------------------- tool centre point


@pytest.mark.slow
def test_four_points_give_the_tool_centre():
    found = tool_centre_point(touching(FOUR))
    assert_close(found.position, TIP, rtol=0, atol=1e-14)
    assert_close(found.point, POINT, rtol=0, atol=1e-14)
    assert_close(found.residuals, np.zeros((4, 3)), rtol=0, atol=1e-14)


def test_tool_centre_is_the_least_squares_solution():
    noise = 1e-4 * np.random.default_rng(0).standard_normal((4, 3))
    poses = touching(FOUR).at[:, :3, 3].add(noise)
    found = tool_centre_point(poses, deviation=1e-4)
    design = np.concatenate(
        [np.hstack([pose[:3, :3], -np.eye(3)]) for pose in np.asarray(poses)]
    )
    both = np.linalg.lstsq(design, -np.asarray(poses[:, :3, 3]).reshape(-1))[0]
    assert_close(found.position, both[:3], rtol=0, atol=1e-14)
    assert_close(found.point, both[3:], rtol=0, atol=1e-14)
    covariance = 1e-8 * np.linalg.inv(design.T @ design)
    assert_close(found.covariance, covariance, rtol=1e-10)
    estimated = tool_centre_point(poses)
    rest = both @ design.T + np.asarray(poses[:, :3, 3]).reshape(-1)
    assert_close(estimated.covariance, covariance * 1e8 * (rest @ rest) / 6, rtol=1e-9)


@pytest.mark.slow
def test_uncertainty_of_the_tool_centre():
    def run(key):
        noise = 1e-4 * jax.random.normal(key, (4, 3))
        return tool_centre_point(touching(FOUR).at[:, :3, 3].add(noise), deviation=1e-4)

    found = jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(0), 2000))
    error = np.asarray(found.position - TIP[None])
    # entries of a covariance from 2000 samples scatter by 3 %
    expected = np.asarray(found.covariance[0])[:3, :3]
    size = np.sqrt(np.diag(expected))
    unit = np.outer(size, size)
    assert_close(np.cov(error.T) / unit, expected / unit, rtol=0, atol=0.12)
    deviation = jax.vmap(lambda f: f.standard_deviation())(found)[0]
    assert_close(deviation, size, rtol=1e-12)


@pytest.mark.slow
def test_tool_centre_gradient():
    assert_gradient(lambda p: tool_centre_point(p).position, touching(FOUR))


@pytest.mark.slow
def test_degenerate_touches_are_refused():
    with pytest.raises(ValueError, match="different orientations, but have one"):
        tool_centre_point(touching(np.zeros((4, 3))))
    about_z = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, -1], [0, 0, 2]])
    with pytest.raises(ValueError, match="turned about one"):
        tool_centre_point(touching(about_z))
    with pytest.raises(ValueError, match="three poses at least"):
        tool_centre_point(touching(FOUR[:2]))
    run = jax.jit(lambda p: tool_centre_point(p).position)
    with pytest.raises(Exception, match="different orientations"):
        jax.block_until_ready(run(touching(np.zeros((4, 3)))))


# ------------------------------------------------------------------------- orientation


def test_frame_from_points():
    frame = transform_from_twist(jnp.array([0.3, -0.2, 0.5, 0.4, 1.0, -0.8]))
    point = lambda *x: (frame @ jnp.array([*x, 1.0]))[:3]
    found = frame_from_points(point(0.0, 0, 0), point(0.4, 0, 0), point(-0.2, 0.3, 0))
    assert_close(found, frame, rtol=0, atol=1e-14)
    with pytest.raises(ValueError, match="`on_x` must not coincide"):
        frame_from_points(POINT, POINT, TIP)
    with pytest.raises(ValueError, match="`in_xy` must not lie on the line"):
        frame_from_points(point(0.0, 0, 0), point(0.4, 0, 0), point(-0.2, 0, 0))


@pytest.mark.slow
def test_tool_frame_from_three_touches():
    tips = jnp.array([[0.0, 0, 0], [0.1, 0, 0], [0.05, 0.2, 0]])
    in_flange = tips @ TOOL[:3, :3].T + TOOL[None, :3, 3]
    flange = jnp.stack([touching(FOUR[k : k + 1], in_flange[k])[0] for k in range(3)])
    assert_close(tool_frame(flange, POINT), TOOL, rtol=0, atol=1e-14)


def test_tool_orientation_and_its_spread():
    flange = jax.vmap(rotation_from_vector)(jnp.asarray(FOUR))
    noise = jnp.asarray(1e-3 * np.random.default_rng(1).standard_normal((4, 3)))
    exact = TOOL[:3, :3]
    tool = jax.vmap(lambda r, n: r @ rotation_from_vector(n) @ exact)(flange, noise)
    found = tool_orientation(flange, tool)
    # small rotations: the mean of their vectors, products of 1e-6 left out
    mean = jnp.mean(noise, axis=0)
    assert_close(found.rotation, rotation_from_vector(mean) @ exact, rtol=0, atol=3e-6)
    rest = np.asarray(noise - mean[None])
    assert_close(found.residuals, rest, rtol=0, atol=3e-6)
    spread = np.sqrt(np.sum(rest**2, axis=0) / 12)
    assert_close(found.standard_deviation(), spread, rtol=0.01)


# ------------------------------------------------------------------------ mounting pose

mount = eqx.filter_jit(mounting_pose)
simulate = eqx.filter_jit(Measurements.simulated)


@pytest.mark.slow
def test_mounting_pose():
    pose = transform_from_twist(jnp.array([3.0, -1, 0.4, 0.3, -2.0, 1.0]))
    arm = heavy()
    placed = type(arm)(arm.joints, pose, arm.tool, arm.kinds)
    instrument = PointInstrument(5e-5, REFLECTORS)
    exact = simulate(instrument, placed, poses(6))
    found = mount(arm, exact)
    assert_close(found.pose, pose, rtol=0, atol=1e-11)
    noisy = simulate(instrument, placed, poses(6), jax.random.key(0))
    found = mount(arm, noisy)
    # equal deviations everywhere: closed form and refinement minimise the same sum
    assert_close(found.pose, found.fit.pose, rtol=0, atol=1e-10)
    error = inverse_transform(pose) @ found.pose
    size = found.estimate.standard_deviation()
    assert np.all(np.abs(error[:3, 3]) < 4 * size[:3])
    assert np.all(size < 5e-5)
    # unequal ones: the refinement is the better fit
    uneven = PointInstrument([1e-5, 1e-5, 1e-3], REFLECTORS)
    noisy = simulate(uneven, placed, poses(6), jax.random.key(0))
    found = mount(arm, noisy)
    first = CalibrationProblem(found.estimate.problem.parameters, noisy)
    start = first.residuals(first.zero(), first.whitening())
    assert np.sum(start**2) > 2 * found.estimate.chi_square()


@pytest.mark.slow
def test_mounting_pose_is_a_calibration_of_the_base():
    arm = heavy()
    measured = simulate(
        PointInstrument(5e-5, REFLECTORS), arm, poses(6), jax.random.key(3)
    )
    found = mount(arm, measured)
    names = [f"base_{c}" for c in ("x", "y", "z", "rx", "ry", "rz")]
    base = ChainParameters.of(arm).select(names)
    direct = eqx.filter_jit(estimate_parameters)(CalibrationProblem(base, measured))
    assert_close(found.pose, direct.chain().base, rtol=0, atol=1e-10)
    q = poses(1, seed=5)[0]
    shift = forward_kinematics(direct.chain(), q) - forward_kinematics(arm, q)
    assert np.max(np.abs(shift)) < 2e-4


def test_mounting_needs_points():
    measured = simulate(PoseInstrument(1e-4, 1e-4), heavy(), poses(3))
    with pytest.raises(TypeError, match="PointInstrument, but are those of a PoseIns"):
        mounting_pose(heavy(), measured)
