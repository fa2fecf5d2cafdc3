"""Parameters of chains by name."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    DHJoints,
    MixedJoints,
    SerialChain,
    forward_kinematics,
    parameter_jacobian,
    rotation_from_vector,
    stacked_jacobian,
    transform,
)

from tests.helpers import assert_close, assert_gradient
from tests.kinematics.arms import fanuc, kuka, mixed, puma
from tests.kinematics.geometries import kr210
from tests.kinematics.test_link_conventions import KINDS, chain_of, parts


Q = jnp.array([0.4, -0.3, 1.1])
CHAINS = {name: chain_of(name) for name in ("dh", "modified", "hayati")}
CHAINS["mixed"] = SerialChain.from_joints(
    MixedJoints((chain_of("veitschegger_wu").joints, parts()[1])), kinds=KINDS * 2
)
CHAINS["rpy"] = mixed()
CHAINS["frames"] = kuka()
each_chain = pytest.mark.parametrize("name", CHAINS)


def coordinates(chain):
    return jnp.asarray(np.random.default_rng(4).uniform(-2, 2, chain.number))


def test_names_and_units():
    parameters = ChainParameters.of(fanuc(1e-3))
    assert parameters.names[:5] == ("theta_1", "d_1", "a_1", "alpha_1", "theta_2")
    assert parameters.units[:4] == ("rad", "m", "m", "rad")
    assert parameters.names[24:27] == ("base_x", "base_y", "base_z")
    assert parameters.names[-1] == "tool_rz" and parameters.units[-4] == "m"
    assert parameters.number == 36
    assert ChainParameters.of(fanuc(), base=False, tool=False).number == 24
    # joints count on through the groups; axes are no parameters
    names = ChainParameters.of(CHAINS["mixed"], base=False).names
    assert "beta_3" in names and "alpha_4" in names and "beta_4" not in names
    names = ChainParameters.of(mixed(), base=False, tool=False).names
    assert names[:4] == ("position_1_x", "position_1_y", "position_1_z", "rpy_1_x")
    assert len(names) == 30
    joints = [entry.joint for entry in ChainParameters.of(CHAINS["mixed"]).entries]
    assert (
        joints
        == [k for k in (1, 2, 3) for _ in range(5)]
        + [k for k in (4, 5, 6) for _ in range(4)]
        + [0] * 12
    )


def test_moved_is_the_changed_table():
    chain = puma()
    table = [np.array(getattr(chain.joints, n)) for n in ("theta", "d", "a", "alpha")]
    parameters = ChainParameters.of(chain).select(["alpha_2", "d_5"])
    assert_close(parameters.values(), [table[3][1], table[1][4]], rtol=0.0)
    table[3][1] += 0.01
    table[1][4] -= 0.02
    moved = parameters.moved(jnp.array([0.01, -0.02]))
    assert_close(moved.joints, DHJoints(*table), rtol=0.0)
    assert_close((moved.base, moved.tool), (chain.base, chain.tool), rtol=0.0)


def test_ends_and_rotations_move_in_their_own_frames():
    chain = CHAINS["frames"]
    twist = jnp.array([0.1, 0.2, -0.3, 0.4, -0.5, 0.6])
    pose = transform(rotation_from_vector(twist[3:]), twist[:3])
    names = [f"tool_{c}" for c in ("x", "y", "z", "rx", "ry", "rz")]
    moved = ChainParameters.of(chain).select(names).moved(twist)
    assert_close(moved.tool, chain.tool @ pose, rtol=1e-15, atol=1e-16)
    names = [f"rotation_3_{c}" for c in "xyz"]
    moved = ChainParameters.of(chain).select(names).moved(twist[3:])
    turned = chain.joints.rotation[2] @ pose[:3, :3]
    assert_close(moved.joints.rotation[2], turned, rtol=1e-15, atol=1e-16)
    assert_close(moved.joints.rotation[1], chain.joints.rotation[1], rtol=0.0)


@pytest.mark.slow
@each_chain
def test_jacobian_by_differences(name):
    chain = CHAINS[name]
    parameters, q, step = ChainParameters.of(chain), coordinates(chain), 1e-3
    points = (
        step * np.array([-2.0, -1, 1, 2])[:, None, None] * np.eye(parameters.number)
    )
    pose = jax.vmap(lambda x: forward_kinematics(parameters.moved(x), q))
    poses = np.asarray(jax.jit(jax.vmap(pose))(jnp.asarray(points)))
    stencil = np.array([1.0, -8, 8, -1]) / (12 * step)
    slopes = np.einsum("s,spij->pij", stencil, poses)
    turns = slopes[:, :3, :3] @ np.asarray(forward_kinematics(chain, q))[:3, :3].T
    vee = np.stack([turns[:, 2, 1], turns[:, 0, 2], turns[:, 1, 0]])
    expected = np.concatenate([slopes[:, :3, 3].T, vee])
    # fourth power of the step, and rounding over the step
    assert_close(parameter_jacobian(parameters, q), expected, rtol=0.0, atol=2e-11)


@pytest.mark.slow
def test_gradient():
    chain = CHAINS["mixed"]
    q, zero = coordinates(chain), jnp.zeros(ChainParameters.of(chain).number)
    pose = lambda chain, x, q: forward_kinematics(ChainParameters.of(chain).moved(x), q)
    assert_gradient(pose, chain, zero, q)


@pytest.mark.slow
def test_gradient_of_the_jacobian():
    some = ChainParameters.of(CHAINS["hayati"]).select(["beta_1", "a_2", "tool_rx"])
    assert_gradient(parameter_jacobian, some, Q)


@pytest.mark.slow
def test_jit_vmap_and_loop_agree():
    parameters = ChainParameters.of(CHAINS["rpy"]).select(["rpy_2_x", "tool_rz"])
    poses = jnp.asarray(np.random.default_rng(0).uniform(-2, 2, (3, 5)))
    loop = jnp.concatenate([parameter_jacobian(parameters, q) for q in poses])
    stack = jax.jit(stacked_jacobian)(parameters, poses)
    assert stack.shape == (18, 2)
    assert_close(stack, loop, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
def test_selection():
    parameters = ChainParameters.of(puma())
    some = parameters.select(["tool_z", "a_2"])
    assert some.names == ("tool_z", "a_2")
    rest = parameters.without(["a_2"])
    assert rest.number == 35 and "a_2" not in rest.names
    columns = parameter_jacobian(parameters, jnp.ones(6))
    both = columns[:, [parameters.names.index(n) for n in some.names]]
    assert_close(parameter_jacobian(some, jnp.ones(6)), both, rtol=1e-13, atol=1e-15)


def test_refusals():
    parameters = ChainParameters.of(puma())
    with pytest.raises(ValueError, match="no parameters .*'beta_2'"):
        parameters.select(["beta_2", "a_1"])
    with pytest.raises(ValueError, match="named once"):
        parameters.select(["a_1", "a_1"])
    with pytest.raises(ValueError, match="at least one parameter"):
        parameters.select([])
    with pytest.raises(ValueError, match="one number per parameter of 36"):
        parameters.moved(jnp.zeros(35))
    with pytest.raises(ValueError, match="as structure"):
        ChainParameters.of(kr210())
    nested = MixedJoints((MixedJoints((puma().joints,)),))
    with pytest.raises(ValueError, match="must not be mixed"):
        ChainParameters.of(SerialChain.from_joints(nested))
    assert eqx.tree_equal(parameters.moved(jnp.zeros(36)).joints, puma().joints)
