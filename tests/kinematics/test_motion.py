"""Motions of the tool against Taylor coefficients from Cauchy's integral."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ToolMotion,
    elementary_chain,
    elementary_jacobian,
    forward_kinematics,
    jacobian_derivatives,
    motion_from_rpy,
    product_derivatives,
    rotation_from_rpy,
    rpy_derivatives,
    tool_derivatives,
    tool_motion,
    transform,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import fanuc, kuka, mixed, planar


ORDER = 5
FACTORIALS = np.array([1.0, 1, 2, 6, 24, 120])


class Sines:
    """Joint motion of sines: entire functions of time with known derivatives."""

    def __init__(self, seed, joints=6):
        rng = np.random.default_rng(seed)
        self.amplitude = rng.uniform(0.3, 1.0, joints)
        self.rate = rng.uniform(0.5, 1.5, joints)
        self.phase = rng.uniform(-1.5, 1.5, joints)

    def __call__(self, t):
        return self.amplitude * np.sin(self.rate * t + self.phase)

    def derivatives(self):
        quarter = self.phase + np.arange(ORDER + 1)[:, None] * np.pi / 2
        powers = self.rate ** np.arange(ORDER + 1)[:, None]
        return jnp.asarray(self.amplitude * powers * np.sin(quarter))


def complex_pose(q, table):
    """Denavit-Hartenberg chain of complex coordinates, written a second time."""
    total = np.eye(4, dtype=complex)
    for angle, (d, a, alpha) in zip(q, table, strict=True):
        s, c, sa, ca = np.sin(angle), np.cos(angle), np.sin(alpha), np.cos(alpha)
        total = total @ np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )
    return total


def coefficients(function, radius=0.5, points=64):
    """Taylor coefficients at zero by Cauchy's integral over a circle of times.

    They are exact but for rounding, 1e-16 over radius^k, and terms of the order 64.
    """
    circle = radius * np.exp(2j * np.pi * np.arange(points) / points)
    values = np.array([function(t) for t in circle])
    result = np.fft.fft(values, axis=0)[: ORDER + 1].real / points
    return result / radius ** np.arange(ORDER + 1).reshape(
        -1, *(1,) * (values.ndim - 1)
    )


def spin_coefficients(rotation):
    r"""Coefficients of omega from those of R, by $\tilde\omega = \dot R R^T$."""
    result = []
    for k in range(ORDER):
        turn = sum((i + 1) * rotation[i + 1] @ rotation[k - i].T for i in range(k + 1))
        result.append([turn[2, 1], turn[0, 2], turn[1, 0]])
    return np.array(result)


@pytest.fixture(scope="module")
def fanuc_motion():
    """Joint motion and the exact coefficients of pose, spin and angles."""
    motion = Sines(3)
    twists = np.array([1, 0, 1, -1, 1, 0]) * np.pi / 2
    table = np.array(
        [[0, 0.312], [0, 1.075], [0, 0.225], [1.28, 0], [0, 0], [0.215, 0]]
    )
    table = np.column_stack([table, twists])
    pose = coefficients(lambda t: complex_pose(motion(t), table))

    def angles(t):
        T = complex_pose(motion(t), table)
        # differ from the angles of the pose by a constant
        return np.array(
            [
                np.arctan(T[2, 1] / T[2, 2]),
                -np.arcsin(T[2, 0]),
                np.arctan(T[1, 0] / T[0, 0]),
            ]
        )

    return motion, pose, spin_coefficients(pose[:, :3, :3]), coefficients(angles, 0.1)


def test_any_order_is_the_exact_motion(fanuc_motion):
    motion, pose, spin, _ = fanuc_motion
    result = tool_derivatives(fanuc(1e-3), motion.derivatives())
    # 1e-10 of the issue; relative to the largest component of each order
    assert_close(result.pose, pose[0], rtol=0, atol=1e-10)
    for k in range(ORDER):
        exact = np.concatenate(
            [
                pose[k + 1, :3, 3] * FACTORIALS[k + 1],
                spin[k] * FACTORIALS[k],
            ]
        )
        assert_close(
            result.twists[k], exact, rtol=0, atol=1e-10 * np.max(np.abs(exact))
        )


def test_angles_of_any_order_are_the_exact_motion(fanuc_motion):
    motion, _, _, angles = fanuc_motion
    derivatives = motion.derivatives()
    result = rpy_derivatives(tool_derivatives(fanuc(1e-3), derivatives))
    # the circle of times is small, as the angles are not entire: 1e-16 / 0.1^5
    for k in range(1, ORDER + 1):
        exact = angles[k] * FACTORIALS[k]
        bound = 1e-10 * np.max(np.abs(exact)) + 1e-16 * FACTORIALS[k] / 0.1**k
        assert_close(result[k, 3:], exact, rtol=0, atol=bound)
    rotation = forward_kinematics(fanuc(1e-3), derivatives[0])[:3, :3]
    assert_close(rotation_from_rpy(result[0, 3:]), rotation, rtol=0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("chain", [mixed(), kuka()], ids=["mixed", "kuka"])
def test_twists_are_derivatives_of_the_jacobian_form(chain):
    r"""(3-109), (3-112): $\dddot y = \ddot J\dot x + 2\dot J\ddot x + J\dddot x$."""
    q = Sines(7, chain.number).derivatives()[:4]
    motion = tool_derivatives(chain, q)
    J = jacobian_derivatives(chain, q)
    expected = [
        J[0] @ q[1],
        J[1] @ q[1] + J[0] @ q[2],
        J[2] @ q[1] + 2 * J[1] @ q[2] + J[0] @ q[3],
    ]
    assert_close(motion.twists, jnp.stack(expected), rtol=0, atol=1e-12)
    velocity, acceleration = tool_motion(chain, *q[:3])
    assert_close(motion.twists[:2], jnp.stack([velocity, acceleration]), rtol=1e-12)


def test_published_motion():
    case = load_vectors("003 (3-109)-(3-113),(3-131)-(3-133)")[0]
    chain = planar(case["inputs"]["l1"], case["inputs"]["l2"])
    q = jnp.array([case["inputs"][k] for k in ("x", "xd", "xdd", "xddd")])
    twists = tool_derivatives(chain, q).twists
    for k, name in enumerate(("yd", "ydd", "yddd")):
        assert_close(twists[k, :2], case["outputs"][name], rtol=case["tol"])


@pytest.mark.slow
def test_changing_parameters():
    """(3-104), (3-108) with both Jacobians; constant parameters change nothing."""
    chain = fanuc(1e-3)
    factors = elementary_chain(chain)
    q = Sines(9).derivatives()[:3]
    still = jnp.zeros((3, factors.number))
    expected = tool_derivatives(chain, q)
    assert_close(product_derivatives(factors, q, still), expected, rtol=0, atol=1e-12)

    rng = np.random.default_rng(1)
    p = jnp.asarray(rng.uniform(-0.3, 0.3, (3, factors.number))).at[0].set(0.0)
    motion = product_derivatives(factors, q, p)
    rates = p[1].at[np.array(factors.joint_variables)].add(q[1])
    accelerations = p[2].at[np.array(factors.joint_variables)].add(q[2])

    def both(values):
        moved = jax.tree.map(lambda x: x, factors)
        moved = type(factors)(
            values, factors.directions, factors.constants, factors.places
        )
        return elementary_jacobian(moved, q[0])

    J, Jd = jax.jit(lambda v, r: jax.jvp(both, (v,), (r,)))(factors.values, rates)
    assert_close(motion.twists[0], J @ rates, rtol=0, atol=1e-12)
    expected = Jd @ rates + J @ accelerations
    assert_close(motion.twists[1], expected, rtol=0, atol=1e-12)


def test_angles_and_twists_are_inverse():
    angles = np.random.default_rng(2).uniform(-1.2, 1.2, (ORDER + 1, 6))
    motion = motion_from_rpy(jnp.asarray(angles))
    assert_close(
        motion.pose[:3, :3],
        rotation_from_rpy(jnp.asarray(angles[0, 3:])),
        rtol=0,
        atol=1e-15,
    )
    # cos of the pitch is above a third: five orders lose some digits
    assert_close(rpy_derivatives(motion), angles, rtol=1e-10, atol=1e-11)
    # omega = E Theta' in its printed form
    (_, y, z), rates = angles[0, 3:], angles[1, 3:]
    E = np.array(
        [
            [np.cos(z) * np.cos(y), -np.sin(z), 0],
            [np.sin(z) * np.cos(y), np.cos(z), 0],
            [-np.sin(y), 0, 1],
        ]
    )
    assert_close(motion.twists[0, 3:], E @ rates, rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_gimbal_lock(side):
    """Exact where the lost direction is at rest; finite with its gradients anyway."""
    angles = np.random.default_rng(3).uniform(-1, 1, (ORDER + 1, 6))
    angles[:, 5] = 0.0
    angles[0, 4] = side * np.pi / 2
    motion = motion_from_rpy(jnp.asarray(angles))
    assert_close(rpy_derivatives(motion), angles, rtol=1e-12, atol=1e-13)

    # with a spin about the lost direction, the rest of omega = E Theta' holds
    lost = jnp.array([side, 0.0, 0.0])
    spun = ToolMotion(motion.pose, motion.twists.at[0, 3:].add(lost))
    result = rpy_derivatives(spun)
    assert_close(result[1], angles[1], rtol=1e-12, atol=1e-13)
    assert np.all(np.isfinite(result))
    backward = jax.jit(jax.jacrev(rpy_derivatives))(spun)
    forward = jax.jit(jax.jacfwd(rpy_derivatives))(spun)
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves((backward, forward)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chain", "pose"),
    [(kuka(), np.zeros(6)), (fanuc(1e-3), np.array([0.3, 1.2, -0.4, 0.5, 0, 0.2]))],
    ids=["stretched", "coaxial wrist"],
)
def test_singular_poses_have_gradients(chain, pose):
    q = Sines(5).derivatives()[:4].at[0].set(jnp.asarray(pose))
    assert_gradient(tool_derivatives, chain, q)


@pytest.mark.slow
def test_gradients_and_batches():
    chain, batch = fanuc(1e-3), jnp.stack([Sines(k).derivatives() for k in (3, 4, 5)])
    full = lambda chain, q: rpy_derivatives(tool_derivatives(chain, q))
    loop = jnp.stack([full(chain, q) for q in batch])
    mapped = jax.jit(jax.vmap(full, (None, 0)))(chain, batch)
    assert_close(mapped, loop, rtol=1e-11, atol=1e-12)
    assert_gradient(full, chain, batch[0][:3])


def test_refusals():
    chain = planar(0.5, 0.3)
    with pytest.raises(ValueError, match="at least a velocity"):
        tool_derivatives(chain, jnp.zeros((1, 2)))
    with pytest.raises(ValueError, match="at least a velocity"):
        motion_from_rpy(jnp.zeros((1, 6)))
    factors = elementary_chain(chain)
    with pytest.raises(ValueError, match="as many derivatives"):
        product_derivatives(factors, jnp.zeros((3, 2)), jnp.zeros((2, factors.number)))
    with pytest.raises(ValueError, match=r"\[order 6\]"):
        ToolMotion(transform(jnp.eye(3), jnp.zeros(3)), jnp.zeros((2, 5)))
