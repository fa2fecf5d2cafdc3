"""Conversion between joint conventions."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    DHJoints,
    HayatiJoints,
    MixedJoints,
    RPYJoints,
    SerialChain,
    characteristic_length,
    forward_kinematics,
    jacobian,
    rotation_from_vector,
    to_dh,
    to_hayati,
    to_mixed,
    to_modified_dh,
    to_rpy,
    to_veitschegger_wu,
    transform,
)

from tests.helpers import assert_close
from tests.kinematics.arms import fanuc, kuka, mixed, planar, puma
from tests.kinematics.geometries import (
    SLIDE,
    TURN,
    disturbed,
    gantry,
    kr210,
    scara,
    seven_axes,
    stanford,
    ur,
)


ARMS = {
    "kuka": kuka,
    "puma": puma,
    "mixed": mixed,
    "fanuc": fanuc,
    "kr210": kr210,
    "ur": ur,
    "scara": scara,
    "stanford": stanford,
    "seven_axes": seven_axes,
    "gantry": gantry,
    "real": lambda: disturbed(ur(), 1e-2),
}
EVERYWHERE = (to_dh, to_modified_dh, to_veitschegger_wu, to_rpy, to_mixed)
each_arm = pytest.mark.parametrize("name", ARMS)


@functools.cache
def reference(name):
    chain = ARMS[name]()
    uniform = np.random.default_rng(0).uniform(-3, 3, (8, chain.number))
    return chain, jnp.asarray(uniform), poses(chain, jnp.asarray(uniform))


@functools.cache
def program():
    return jax.jit(jax.vmap(forward_kinematics, (None, 0)))


def poses(chain, q):
    return program()(chain, q)


def assert_same_tool(converted, name):
    chain, q, expected = reference(name)
    assert converted.kinds == chain.kinds
    errors = np.abs(np.asarray(poses(converted, q) - expected))
    # lengths in sizes of the arm: 1e-12 is asked for, some ten products leave less
    errors[:, :3, 3] /= characteristic_length(chain)
    assert np.max(errors) < 1e-12


@pytest.mark.slow
@each_arm
@pytest.mark.parametrize("convert", EVERYWHERE, ids=lambda f: f.__name__)
def test_tool_stays_for_every_q(convert, name):
    assert_same_tool(convert(reference(name)[0]), name)


def random_chain(rng):
    """Axes and offsets along the frame's or anywhere, so that special cases abound."""

    def vector(zero):
        kind = rng.choice(["axis", "axis", "zero" if zero else "axis", "any"])
        basis = rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(3)]
        free = rng.standard_normal(3)
        return {"axis": basis, "zero": 0 * basis, "any": free / np.linalg.norm(free)}[
            kind
        ]

    joints = [np.array([vector(zero) for _ in range(5)]) for zero in (True, False)]
    turn = rotation_from_vector(jnp.asarray(rng.choice([0.0, 0.7]) * vector(True)))
    tool = transform(turn, jnp.asarray(vector(True)))
    return SerialChain.from_rpy(joints[0], np.zeros((5, 3)), joints[1], tool=tool)


@pytest.mark.slow
def test_random_chains():
    rng = np.random.default_rng(2)
    for _ in range(25):
        chain, q = random_chain(rng), jnp.asarray(rng.uniform(-3, 3, (8, 5)))
        expected = poses(chain, q)
        for convert in (to_dh, to_modified_dh, to_veitschegger_wu, to_rpy):
            assert_close(poses(convert(chain), q), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["mixed", "scara"])
def test_hayati_where_defined(name):
    converted = to_hayati(reference(name)[0])
    assert isinstance(converted.joints, HayatiJoints)
    assert_same_tool(converted, name)


def test_prismatic_hayati_with_a_perpendicular_hinge():
    # the slide has no place: its frame stands on the hinge
    position = [[0, 0, 0.3], [0.4, 0, 0], [0, 0.2, 0.5]]
    axis = [[0, 0, 1], [1, 0, 0], [0, 0, 1]]
    chain = SerialChain.from_rpy(
        position, np.zeros((3, 3)), axis, kinds=(TURN, SLIDE, TURN)
    )
    converted, q = to_hayati(chain), jnp.array([[0.3, -0.4, 0.7], [2.0, 0.1, -1.0]])
    assert_close(poses(converted, q), poses(chain, q), rtol=0.0, atol=1e-14)


def test_round_trip_keeps_tables():
    for chain in (fanuc(), scara()):
        back = to_dh(to_rpy(chain))
        again = to_dh(to_modified_dh(chain))
        for name in ("theta", "d", "a", "alpha"):
            values = getattr(back.joints, name)
            if chain.number == 6:
                expected = getattr(chain.joints, name)
                assert_close(values, expected, rtol=1e-12, atol=1e-10)
            assert_close(getattr(again.joints, name), values, rtol=1e-12, atol=1e-10)
    assert_close((back.base, again.base), (np.eye(4),) * 2, rtol=0.0, atol=1e-14)


def test_table_of_the_planar_arm():
    # lengths of a planar arm are the same in all conventions
    chain = planar(1.0, 0.7, 0.2)
    assert_close(to_dh(chain).joints, chain.joints, rtol=1e-15, atol=1e-15)
    modified = to_modified_dh(chain)
    assert_close(modified.joints.a, [0.0, 1.0, 0.7], rtol=1e-15)
    assert_close(modified.tool[0, 3], 0.2, rtol=1e-14)
    assert_close(to_hayati(chain).joints.a, [1.0, 0.7, 0.0], rtol=1e-15)
    assert_close(to_rpy(chain).joints.position[1:, 0], [1.0, 0.7], rtol=1e-15)


def test_jacobian_stays():
    chain, q, _ = reference("stanford")
    expected = jacobian(chain, q[0])
    for convert in (to_mixed, to_modified_dh):
        assert_close(jacobian(convert(chain), q[0]), expected, rtol=0.0, atol=1e-13)


def groups(chain):
    joints = chain.joints
    parts = joints.groups if isinstance(joints, MixedJoints) else (joints,)
    return [(type(part), part.number()) for part in parts]


def test_mixed_chooses_by_the_angle():
    assert groups(to_mixed(ur())) == [(DHJoints, 1), (HayatiJoints, 2), (DHJoints, 3)]
    assert groups(to_mixed(seven_axes())) == [(DHJoints, 7)]
    tilted = [(DHJoints, 6)]
    # the axes 2 and 3 are 1e-3 rad off parallel
    chain = puma()
    moved = chain.joints.alpha.at[1].add(1e-3)
    joints = DHJoints(chain.joints.theta, chain.joints.d, chain.joints.a, moved)
    chain = SerialChain.from_joints(joints)
    assert groups(to_mixed(chain, parallel=0.9e-3)) == tilted
    assert groups(to_mixed(chain, parallel=1.1e-3))[1] == (HayatiJoints, 1)


def coaxial(gap=0.0):
    """Two hinges on nearly one line, and a third one across."""
    position = [[0, 0, 0.5], [0, gap, 0.2], [0.3, 0, 0.1]]
    axis = [[0, 0, 1], [0, 0, 1], [1, 0, 0]]
    tool = transform(jnp.eye(3), jnp.array([0.1, 0.2, 0.3]))
    return SerialChain.from_rpy(position, np.zeros((3, 3)), axis, tool=tool)


@pytest.mark.parametrize("gap", [0.0, 1e-7, 1e-2])
def test_coaxial_hinges(gap):
    chain = coaxial(gap)
    converted = to_mixed(chain)
    second = HayatiJoints if gap > 1e-3 else DHJoints
    assert groups(converted)[0][0] is second
    assert (groups(converted)[-1] == (RPYJoints, 2)) is (gap < 1e-3)
    q = jnp.array([[0.3, -0.4, 0.7], [2.0, 0.1, -1.0]])
    for other in (converted, to_dh(chain), to_veitschegger_wu(chain)):
        assert_close(poses(other, q), poses(chain, q), rtol=0.0, atol=1e-14)


def test_nearly_parallel_axes():
    # 0.01 degrees: the common normal of Denavit and Hartenberg lies far off
    chain = nearly_parallel(np.deg2rad(0.01))
    q = jnp.asarray(np.random.default_rng(1).uniform(-3, 3, (5, 6)))
    converted = to_dh(chain)
    assert np.max(np.abs(converted.joints.d)) > 1e2
    # rounding times the distance
    assert_close(poses(converted, q), poses(chain, q), rtol=0.0, atol=1e-11)
    assert_close(poses(to_mixed(chain), q), poses(chain, q), rtol=0.0, atol=1e-14)


def nearly_parallel(angle):
    """An arm whose axis 3 leans in the plane of the axes 2 and 3, so that they meet."""
    frames = ur().joints.frames()
    tilt = rotation_from_vector(jnp.array([0.0, angle, 0.0]))
    after = frames.after.at[1, :3, :3].set(frames.after[1, :3, :3] @ tilt)
    fixed = jnp.concatenate([frames.before[:1], after[:-1] @ frames.before[1:]])
    return SerialChain.from_frames(
        fixed[:, :3, :3], fixed[:, :3, 3], frames.axis, tool=after[-1]
    )


def test_refusals():
    with pytest.raises(ValueError, match="joint 1 has no Hayati.*perpendicular"):
        to_hayati(kuka())
    with pytest.raises(ValueError, match="joint 1 has no Hayati.*are one"):
        to_hayati(coaxial())
    with pytest.raises(ValueError, match="joint 2 has no usable Denavit.*to_mixed"):
        to_dh(nearly_parallel(1e-7))
    with pytest.raises(ValueError, match="outside of `jit`"):
        jax.jit(to_dh)(puma())
