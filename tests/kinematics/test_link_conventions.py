"""Joint conventions of the tables, and chains that mix them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    DHJoints,
    HayatiJoints,
    JointKind,
    MixedJoints,
    ModifiedDHJoints,
    RPYJoints,
    SerialChain,
    VeitscheggerWuJoints,
    forward_kinematics,
    inverse_transform,
    jacobian,
    rotation_x,
    rotation_y,
    rotation_z,
    transform,
)

from tests.helpers import assert_close, assert_gradient, load_vectors
from tests.kinematics.arms import mixed, planar


TURN, SLIDE = JointKind.REVOLUTE, JointKind.PRISMATIC
KINDS = (TURN, SLIDE, TURN)
Q = jnp.array([0.4, -0.3, 1.1])


def turn(rotation, angle):
    return transform(rotation(jnp.asarray(angle)), jnp.zeros(3))


def shift(x=0.0, y=0.0, z=0.0):
    return transform(jnp.eye(3), jnp.array([x, y, z]))


def product(*poses):
    return jnp.linalg.multi_dot(poses)


def table(columns, seed):
    return np.random.default_rng(seed).uniform(-1, 1, (columns, 3))


# every convention with three joints, and its elementary product for one of them: the
# joint's coordinate is split into a turn `v` and a slide `s`
def dh(theta, d, a, alpha, v, s):
    return (
        turn(rotation_z, theta + v),
        shift(z=d + s),
        shift(a),
        turn(rotation_x, alpha),
    )


def modified(alpha, a, theta, d, v, s):
    return (
        turn(rotation_x, alpha),
        shift(a),
        turn(rotation_z, theta + v),
        shift(z=d + s),
    )


def hayati(theta, a, alpha, beta, v, s):
    tilts = turn(rotation_x, alpha), turn(rotation_y, beta)
    return turn(rotation_z, theta + v), shift(z=s), shift(a), *tilts


def veitschegger_wu(theta, d, a, alpha, beta, v, s):
    return *dh(theta, d, a, alpha, v, s), turn(rotation_y, beta)


CASES = {
    "dh": (DHJoints, dh, table(4, 0)),
    "modified": (ModifiedDHJoints, modified, table(4, 1)),
    "hayati": (HayatiJoints, hayati, table(4, 2)),
    "veitschegger_wu": (VeitscheggerWuJoints, veitschegger_wu, table(5, 3)),
}
each_convention = pytest.mark.parametrize("name", CASES)


def chain_of(name):
    joints, _, columns = CASES[name]
    base, tool = shift(0.1, -0.2, 0.3), turn(rotation_y, 0.7)
    return SerialChain.from_joints(joints(*columns), kinds=KINDS, base=base, tool=tool)


@pytest.mark.parametrize(
    ("name", "inputs"),
    [
        ("HM", ("Theta", "a", "alpha", "beta")),
        ("VW", ("Theta", "d", "a", "alpha", "beta")),
    ],
)
def test_published_matrices(name, inputs):
    case = load_vectors("003 Tab 3-2/3-3/3-4")[0]
    columns = np.array([[case["inputs"][key]] for key in inputs])
    make = {"HM": SerialChain.from_hayati, "VW": SerialChain.from_veitschegger_wu}[name]
    # half of the turn is an offset, half the coordinate
    columns[0] /= 2
    pose = forward_kinematics(make(*columns), jnp.asarray(columns[0]))
    assert_close(pose, case["outputs"][name], rtol=case["tol"], atol=1e-11)


def test_veitschegger_wu_holds_the_others():
    theta, d, a, alpha, beta = CASES["veitschegger_wu"][2]
    zero = 0 * a
    pairs = [
        (SerialChain.from_veitschegger_wu(theta, d, a, alpha, zero, kinds=KINDS),
         SerialChain.from_dh(theta, d, a, alpha, kinds=KINDS)),
        (SerialChain.from_veitschegger_wu(theta, zero, a, alpha, beta, kinds=KINDS),
         SerialChain.from_hayati(theta, a, alpha, beta, kinds=KINDS)),
    ]  # fmt: skip
    for wide, narrow in pairs:
        # one formula, three places of rounding
        expected = forward_kinematics(narrow, Q)
        assert_close(forward_kinematics(wide, Q), expected, rtol=1e-14, atol=1e-15)


def test_modified_dh_of_a_planar_arm():
    # Craig's table of the planar arm: the last length is the tool's
    lengths = 1.0, 0.7, 0.2
    zero = np.zeros(3)
    chain = SerialChain.from_modified_dh(
        zero, np.array([0.0, *lengths[:2]]), zero, zero, tool=shift(lengths[2])
    )
    expected = forward_kinematics(planar(*lengths), Q)
    assert_close(forward_kinematics(chain, Q), expected, rtol=1e-14, atol=1e-15)


@each_convention
def test_elementary_product(name):
    _, elementary, columns = CASES[name]
    chain = chain_of(name)
    motions = zip([Q[0], 0.0, Q[2]], [0.0, Q[1], 0.0])
    factors = [elementary(*row, *motion) for row, motion in zip(columns.T, motions)]
    expected = product(chain.base, *(f for link in factors for f in link), chain.tool)
    # some twenty products of numbers of order one
    assert_close(forward_kinematics(chain, Q), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
@each_convention
def test_jacobian(name):
    chain = chain_of(name)
    pose, slopes = forward_kinematics(chain, Q), jax.jacfwd(forward_kinematics, 1)
    slopes = jnp.moveaxis(slopes(chain, Q), -1, 0)
    turns = slopes[:, :3, :3] @ pose[:3, :3].T
    vee = jnp.stack([turns[:, 2, 1], turns[:, 0, 2], turns[:, 1, 0]])
    expected = jnp.concatenate([slopes[:, :3, 3].T, vee])
    assert_close(jacobian(chain, Q), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
@each_convention
def test_gradient_by_every_parameter(name):
    assert_gradient(forward_kinematics, chain_of(name), Q)


def parts():
    rpy = RPYJoints(table(3, 5).T, table(3, 6).T, np.eye(3))
    return tuple(CASES[n][0](*CASES[n][2]) for n in ("hayati", "modified")) + (rpy,)


def test_mixed_joints_are_their_parts():
    chain = SerialChain.from_joints(MixedJoints(parts()), kinds=KINDS * 3)
    assert chain.number == chain.joints.number() == 9
    single = [SerialChain.from_joints(part, kinds=KINDS) for part in parts()]
    expected = product(*(forward_kinematics(part, Q) for part in single))
    pose = forward_kinematics(chain, jnp.tile(Q, 3))
    assert_close(pose, expected, rtol=1e-13, atol=1e-14)


def test_jit_vmap_and_loop_agree():
    chain = chain_of("hayati")
    batch = jnp.asarray(np.random.default_rng(0).uniform(-3, 3, (4, 3)))
    loop = jnp.stack([forward_kinematics(chain, q) for q in batch])
    mapped = jax.jit(jax.vmap(forward_kinematics, (None, 0)))(chain, batch)
    assert_close(mapped, loop, rtol=1e-13, atol=1e-14)


def test_prismatic_hayati_slides_in_front_of_its_length():
    joints = HayatiJoints(*(np.array([x]) for x in (0.3, 0.5, 0.2, -0.4)))
    chain = SerialChain.from_joints(joints, kinds=[SLIDE])
    start = forward_kinematics(chain, jnp.zeros(1))
    moved = forward_kinematics(chain, jnp.array([0.25])) @ inverse_transform(start)
    assert_close(moved, shift(z=0.25), rtol=0.0, atol=1e-15)


def test_refusals():
    with pytest.raises(ValueError, match="at least one group"):
        MixedJoints(())
    zero = np.zeros(2)
    with pytest.raises(ValueError, match="agreeing"):
        HayatiJoints(zero, zero, np.zeros(3), zero)
    with pytest.raises(ValueError, match="agreeing"):
        ModifiedDHJoints(zero, zero, np.zeros(3), zero)
    with pytest.raises(ValueError, match="agreeing"):
        VeitscheggerWuJoints(zero, zero, zero, zero, np.zeros(3))
    with pytest.raises(ValueError, match="one kind per joint"):
        SerialChain.from_joints(mixed().joints, kinds=KINDS)
