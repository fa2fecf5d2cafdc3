"""Arms of URDF files move as Pinocchio says that reads the same files.

Pinocchio belongs to the extra `bench`; where it is absent these tests are left out.
"""

import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.dynamics import multibody
from elastax.io import arm_from_urdf, urdf_from_robot
from elastax.kinematics import forward_kinematics, jacobian, jacobian_derivatives
from elastax.robots import kr210


pin = pytest.importorskip("pinocchio", reason="needs Pinocchio: the extra `bench`")

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
COUNT = 50


def text_of(name: str) -> tuple[str, str]:
    if name == "kr210":
        return urdf_from_robot(kr210()), "tool"
    text = (EXAMPLES / f"{name}.urdf").read_text(encoding="utf-8")
    return text, {"ur10e": "tool0", "iiwa14": "flange"}[name]


@pytest.mark.parametrize("name", ["kr210", "ur10e", "iiwa14"])
def test_pose_jacobian_and_its_rate(name):
    text, tip = text_of(name)
    arm, model = arm_from_urdf(text), pin.buildModelFromXML(text)
    assert tuple(model.names)[1:] == arm.axis_names
    np.testing.assert_array_equal(model.lowerPositionLimit, arm.lower)
    np.testing.assert_array_equal(model.upperPositionLimit, arm.upper)
    data, frame = model.createData(), model.getFrameId(tip)
    generator = np.random.default_rng(6)
    shape = (COUNT, arm.chain.number)
    q = generator.uniform(np.asarray(arm.lower), np.asarray(arm.upper), shape)
    qd = generator.uniform(-2.0, 2.0, shape)

    @jax.jit
    @jax.vmap
    def ours(q, qd):
        rate = jacobian_derivatives(arm.chain, jnp.stack([q, qd]))
        return forward_kinematics(arm.chain, q), jacobian(arm.chain, q), rate

    for x, xd, pose, columns, rates in zip(
        q, qd, *ours(jnp.asarray(q), jnp.asarray(qd))
    ):
        pin.framesForwardKinematics(model, data, x)
        wanted = pin.computeFrameJacobian(model, data, x, frame, WORLD)
        # rounding of a dozen products of numbers of order one
        close = lambda a, b: np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)
        close(pose, data.oMf[frame].homogeneous)
        close(columns, wanted)
        close(rates[0], wanted)
        pin.computeJointJacobiansTimeVariation(model, data, x, xd)
        pin.updateFramePlacements(model, data)
        close(rates[1], pin.getFrameJacobianTimeVariation(model, data, frame, WORLD))


def test_mass_matrix_and_gravity():
    """The bodies of the KR210 and its payload, as Pinocchio reads them."""
    robot = kr210().rigid()
    model = pin.buildModelFromXML(urdf_from_robot(robot))
    data, zero = model.createData(), np.zeros(robot.axes)
    generator = np.random.default_rng(7)
    none = jnp.zeros(0)
    program = jax.jit(lambda x, xd: multibody(robot, x, none, xd, none))
    for q in generator.uniform(-1.5, 1.5, (5, robot.axes)):
        found = [np.asarray(x) for x in jax.tree.leaves(program(jnp.asarray(q), zero))]
        upper = np.triu(pin.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        # rounding of some 1000 kg m^2 and 10 kN m
        (ours,) = [x for x in found if x.shape == mass.shape]
        np.testing.assert_allclose(ours, mass, rtol=0, atol=1e-9)
        (gravity,) = [x for x in found if x.shape == zero.shape]
        bias = pin.nonLinearEffects(model, data, q, zero)
        np.testing.assert_allclose(gravity, bias, rtol=0, atol=1e-8)
