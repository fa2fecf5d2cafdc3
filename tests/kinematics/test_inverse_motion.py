"""Motions of the joints from those of the tool: published numbers and round trips."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ConstantDamping,
    DampedRateInverse,
    ExactRateInverse,
    LeastSquaresRateInverse,
    SerialChain,
    SigmoidDamping,
    inverse_motion,
    jacobian,
    motion_from_rpy,
    rpy_derivatives,
    tool_derivatives,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, kuka, planar
from tests.kinematics.test_motion import ORDER, Sines


REGULAR = jnp.array([0.3, 1.2, -0.4, 0.5, 0.8, -1.1])


def seven():
    """Arm of seven joints, redundant for a pose."""
    quarter = np.pi / 2
    zero = np.zeros(7)
    offsets = np.array([0.36, 0, 0.42, 0, 0.4, 0, 0.126])
    return SerialChain.from_dh(
        zero, offsets, zero, np.array([-1, 1, 1, -1, -1, 1, 0]) * quarter
    )


@pytest.mark.slow
def test_published_motion():
    """(3-131) to (3-133); the vector names the wrong readings of (3-127), (3-128)."""
    case = load_vectors("003 (3-109)-(3-113),(3-131)-(3-133)")[0]
    inputs, outputs, tol = case["inputs"], case["outputs"], case["tol"]
    chain = planar(inputs["l1"], inputs["l2"])
    twists = jnp.array([outputs[k] for k in ("yd", "ydd", "yddd")])
    motion = inverse_motion(chain, jnp.array(inputs["x"]), twists, rows=(0, 1))
    for k, name in enumerate(("x", "xd", "xdd", "xddd")):
        # digits of the vector's twists, times the condition of the Jacobian
        assert_close(motion.derivatives[k], inputs[name], rtol=10 * tol)
    for k, name in ((2, "wrong_xdd"), (3, "wrong_xddd")):
        wrong = np.array(outputs[name])
        assert np.max(np.abs(motion.derivatives[k] - wrong)) > 0.1
    # the same by the derivatives of the inverse: (3-127), (3-128) read rightly
    inverse = jnp.linalg.inv(jacobian(chain, jnp.array(inputs["x"]))[:2])
    first, second = (jnp.array(outputs[k]) for k in ("d_dt_Jinv", "d2_dt2_Jinv"))
    xdd = inverse @ twists[1] + first @ twists[0]
    xddd = inverse @ twists[2] + 2 * first @ twists[1] + second @ twists[0]
    assert_close(motion.derivatives[2:], jnp.stack([xdd, xddd]), rtol=10 * tol)


def round_trip(chain, q):
    return inverse_motion(chain, q[0], tool_derivatives(chain, q).twists)


@pytest.mark.slow
def test_round_trip_of_any_order():
    chain, q = fanuc(1e-3), Sines(3).derivatives().at[0].set(REGULAR)
    motion = round_trip(chain, q)
    # rounding times the condition of the Jacobian, some 10
    scale = np.max(np.abs(q))
    assert_close(motion.derivatives, q, rtol=0, atol=1e-12 * scale)
    assert bool(motion.is_regular) and motion.error.shape == (ORDER, 6)
    assert np.max(np.abs(motion.error)) < 1e-11
    matrix = jacobian(chain, REGULAR)
    smallest = np.linalg.svd(matrix, compute_uv=False)[-1]
    assert_close(motion.smallest, smallest, rtol=1e-12)


@pytest.mark.slow
def test_batches_and_gradient():
    chain = fanuc(1e-3)
    batch = jnp.stack([Sines(k).derivatives().at[0].set(REGULAR) for k in (1, 2, 3)])
    solve = lambda chain, q: round_trip(chain, q).derivatives
    loop = jnp.stack([solve(chain, q) for q in batch])
    mapped = jax.jit(jax.vmap(solve, (None, 0)))(chain, batch)
    assert_close(mapped, loop, rtol=0, atol=1e-12)
    twists = tool_derivatives(chain, batch[0][:3]).twists
    answer = lambda q, twists: inverse_motion(chain, q, twists).derivatives
    assert_gradient(answer, REGULAR, twists)


@pytest.mark.slow
def test_angles_through_gimbal_lock():
    """A motion in roll-pitch-yaw angles has joint rates where E is singular."""
    chain = fanuc(1e-3)
    down = jnp.array([0.4, 1.1, 0.2, 0.0, 0.9, 0.3])
    angles = np.random.default_rng(1).uniform(-1, 1, (4, 6))
    start = rpy_derivatives(tool_derivatives(chain, jnp.stack([down, 0 * down])))[0]
    # the tool need not be there: rates are asked for, and the chain is at `down`
    angles[0] = np.asarray(start)
    motion = motion_from_rpy(jnp.asarray(angles))
    joints = inverse_motion(chain, down, motion.twists)
    back = rpy_derivatives(tool_derivatives(chain, joints.derivatives))
    assert_close(back, angles, rtol=1e-9, atol=1e-10)
    locked = motion_from_rpy(jnp.asarray(angles).at[0, 4].set(np.pi / 2))
    assert np.all(np.isfinite(inverse_motion(chain, down, locked.twists).derivatives))


@pytest.mark.slow
def test_redundant_arm():
    """The tool's motion is met; the rates are the smallest in the weighted norm."""
    chain, rng = seven(), np.random.default_rng(4)
    q = jnp.asarray(rng.uniform(-1, 1, 7))
    twists = jnp.asarray(rng.uniform(-1, 1, (3, 6)))
    weights = np.array([1.0, 4, 1, 9, 1, 1, 2])
    inverse = LeastSquaresRateInverse(weights)
    motion = inverse_motion(chain, q, twists, inverse=inverse)
    reached = tool_derivatives(chain, motion.derivatives).twists
    # rounding of the largest derivative of a joint
    scale = np.max(np.abs(motion.derivatives))
    assert_close(reached, twists, rtol=0, atol=1e-14 * scale)
    matrix = np.asarray(jacobian(chain, q))
    free = np.linalg.svd(matrix)[2][-1]
    # stationary: W x is orthogonal to the null space
    along = free @ (weights * np.asarray(motion.derivatives[1]))
    assert abs(along) < 1e-12
    plain = inverse_motion(chain, q, twists, inverse=LeastSquaresRateInverse())
    expected = np.linalg.pinv(matrix) @ np.asarray(twists[0])
    assert_close(plain.derivatives[1], expected, rtol=1e-12)


@pytest.mark.slow
def test_more_rows_than_joints():
    """Least squares: the error is orthogonal to what the joints can do."""
    chain, q = planar(0.5, 0.3), jnp.array([0.4, 0.9])
    twists = jnp.asarray(np.random.default_rng(5).uniform(-1, 1, (2, 6)))
    inverse = LeastSquaresRateInverse()
    motion = inverse_motion(chain, q, twists, inverse=inverse)
    assert np.max(np.abs(jacobian(chain, q).T @ motion.error.T)) < 1e-12
    assert np.max(np.abs(motion.error)) > 0.1


SINGULAR = {
    "stretched": (kuka(), np.zeros(6)),
    "coaxial wrist": (fanuc(1e-3), np.array([0.3, 1.2, -0.4, 0.5, 0.0, -1.1])),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chain", "pose"), SINGULAR.values(), ids=list(SINGULAR.keys())
)
def test_singular_poses(chain, pose):
    q = jnp.asarray(pose)
    twists = jnp.asarray(np.random.default_rng(6).uniform(-1, 1, (4, 6)))
    with pytest.raises(Exception, match="the pose is singular"):
        jax.block_until_ready(inverse_motion(chain, q, twists).derivatives)

    masked = lambda q, y: inverse_motion(chain, q, y, throw=False)
    motion = jax.jit(masked)(q, twists)
    assert not bool(motion.is_regular) and not np.any(motion.derivatives[1:])
    assert motion.smallest < 1e-12
    # with the damping of the text: bounded by the rates over twice the damping
    damping = SigmoidDamping.from_limits(1e-3, 0.1, 0.01, 0.1)
    damped = lambda q, y: inverse_motion(
        chain, q, y, inverse=DampedRateInverse(damping)
    )
    motion = jax.jit(damped)(q, twists)
    bound = np.linalg.norm(twists[0]) / (2 * 0.09)
    assert np.linalg.norm(motion.derivatives[1]) < bound
    for function in (masked, damped):
        slopes = jax.jit(jax.jacrev(lambda q, y: function(q, y).derivatives, (0, 1)))
        assert all(np.all(np.isfinite(s)) for s in slopes(q, twists[:2]))


@pytest.mark.slow
def test_little_damping_is_none():
    chain, q = fanuc(1e-3), Sines(3).derivatives()[:4].at[0].set(REGULAR)
    twists = tool_derivatives(chain, q).twists
    inverse = DampedRateInverse(ConstantDamping(1e-7))
    damped = inverse_motion(chain, REGULAR, twists, inverse=inverse)
    # the square of the damping over that of the smallest singular value
    assert_close(damped.derivatives, q, rtol=0, atol=1e-10)


def test_refusals():
    chain, q = planar(0.5, 0.3), jnp.array([0.4, 0.9])
    with pytest.raises(ValueError, match="as many rows as joints"):
        inverse_motion(chain, q, jnp.zeros((2, 6)))
    with pytest.raises(ValueError, match=r"shape \(order, 2\)"):
        inverse_motion(chain, q, jnp.zeros((2, 3)), rows=(0, 1))
    with pytest.raises(ValueError, match="distinct indices from 0 to 5"):
        inverse_motion(chain, q, jnp.zeros((2, 2)), rows=(0, 0))
    with pytest.raises(ValueError, match="`weights` must be positive"):
        LeastSquaresRateInverse(np.array([1.0, 0.0]))
    assert not ExactRateInverse().is_bounded()
