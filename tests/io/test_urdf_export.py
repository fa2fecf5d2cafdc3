"""Arms and robots written as URDF: the way there and back, and other readers."""

import dataclasses
import pathlib
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import yourdfpy
from elastax.dynamics import inverse_dynamics
from elastax.io import (
    UrdfWarning,
    arm_from_urdf,
    robot_from_urdf,
    urdf_from_arm,
    urdf_from_robot,
)
from elastax.kinematics import Arm, forward_kinematics
from elastax.robots import kr210, manutec_r3

from tests.helpers import assert_close
from tests.kinematics.arms import mixed, puma


EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"
forward = eqx.filter_jit(jax.vmap(forward_kinematics, (None, 0)))


@pytest.mark.parametrize("name", ["ur10e", "iiwa14", "urdf_robot"])
def test_arm_comes_back_to_the_last_digit(name):
    arm = arm_from_urdf(EXAMPLES / f"{name}.urdf")
    text = urdf_from_arm(arm)
    again = arm_from_urdf(text)
    assert (again.name, again.axis_names) == (arm.name, arm.axis_names)
    assert_close(jax.tree.leaves(again), jax.tree.leaves(arm), rtol=0)
    assert urdf_from_arm(again) == text


def arm_of(chain, **options) -> Arm:
    n = chain.number
    signs = np.where(np.arange(n) % 2, -1.0, 1.0)
    return Arm(
        chain,
        -np.linspace(1.0, 2.0, n),
        np.linspace(0.1, 3.0, n),
        np.linspace(1.0, 4.0, n) / 3,
        signs,
        0.1 * np.arange(n),
        {"zero": jnp.zeros(n)},
        "of a table",
        tuple(f"A{k + 1}" for k in range(n)),
    )


@pytest.mark.parametrize("build", [puma, mixed], ids=["dh", "rpy and prismatic"])
def test_other_conventions_keep_their_poses(build):
    """Denavit-Hartenberg, and skew joints of which some slide, with base and tool."""
    arm = arm_of(build())
    text = urdf_from_arm(arm)
    again = arm_from_urdf(text)
    assert again.chain.kinds == arm.chain.kinds
    limits = lambda arm: (arm.lower, arm.upper, arm.velocity)
    assert_close(limits(again), limits(arm), rtol=0)
    q = np.random.default_rng(2).uniform(-2, 2, (5, arm.chain.number))
    # angles from matrices, to rounding
    assert_close(forward(again.chain, q), forward(arm.chain, q), rtol=0, atol=1e-14)
    assert "A2: this angle = -1 * angle of the maker + 0.1 rad" in text


def test_limits_that_are_not_finite():
    arm = arm_of(mixed())
    free = dataclasses.replace(
        arm, lower=arm.lower.at[2].set(-jnp.inf), upper=arm.upper.at[2].set(jnp.inf)
    )
    text = urdf_from_arm(free)
    assert text.count('type="continuous"') == 1 and "inf" not in text
    with pytest.warns(UrdfWarning, match="A3.* is continuous"):
        assert_close(arm_from_urdf(text).upper[2], 2 * np.pi, rtol=1e-15)
    for changes in (
        {"upper": arm.upper.at[2].set(jnp.inf)},
        {"lower": arm.lower.at[1].set(-jnp.inf), "upper": arm.upper.at[1].set(jnp.inf)},
        {"velocity": arm.velocity.at[2].set(jnp.inf)},
    ):
        with pytest.raises(ValueError, match="must be finite in a URDF"):
            urdf_from_arm(dataclasses.replace(arm, **changes))


# gears as they may be: the rigid robot has none
GEAR = {"ratio": 100.0, "motor_inertia": 1e-3, "stiffness": 1e6, "damping": 1e2}
AXIS = {"gear": GEAR, "limits_deg": {"acceleration": 300.0, "jerk": 3000.0}}


@pytest.mark.slow
@pytest.mark.parametrize("build", [kr210, manutec_r3])
def test_rigid_robot_comes_back(build):
    """Poses and torques of the robot with its payload, from its URDF."""
    # the cylinder is not in a URDF
    robot = dataclasses.replace(build().rigid(), counterbalance=None)
    content = {"axes": [AXIS | {"name": name} for name in robot.axis_names]}
    with warnings.catch_warnings():
        # the Manutec gives one moment of its first link and 1e-3 for the others
        message = r"(?s)URDF text.*`b1` \(line 5\): no body has[^-]*$"
        warnings.filterwarnings("ignore", message=message)
        again = robot_from_urdf(urdf_from_robot(build()), content).rigid()
    # nor are the drive trains
    again = dataclasses.replace(again, drives=robot.drives)
    assert set(robot.all_bodies().names) == set(again.bodies.names)
    generator = np.random.default_rng(3)
    q, qd, qdd = (jnp.asarray(generator.uniform(-1, 1, robot.axes)) for _ in range(3))
    torques = jax.jit(lambda r, *x: inverse_dynamics(r, *x))
    none = jnp.zeros(0)
    here, there = (torques(r, q, qd, qdd, none, none, none) for r in (robot, again))
    # rounding of some 1000 N m
    assert_close(there, here, rtol=1e-11, atol=1e-9)
    pose = jax.jit(forward_kinematics)
    assert_close(pose(again.chain, q), pose(robot.chain, q), rtol=0, atol=1e-14)
    ends = lambda r: np.sort(
        [r.from_maker(r.limits.lower), r.from_maker(r.limits.upper)], axis=0
    )
    # the angles of a file pass through a product and a sum each way
    assert_close(ends(again), ends(robot), rtol=1e-14)


def test_elastic_hinges_are_joints():
    """All coordinates of the chain, the ends of bending links as mimics."""
    robot = kr210()
    text = urdf_from_robot(robot, hinges=True)
    assert text.count('type="revolute"') == robot.chain.number == 17
    assert "<!-- tilt 1 x: elastic hinge: spring 1.7e+07 N m/rad" in text
    assert '<mimic joint="forearm x" multiplier="0.5" />' in text
    model = yourdfpy.URDF.load(_file(text), load_meshes=False)
    generator = np.random.default_rng(4)
    q = generator.uniform(-1, 1, robot.axes)
    eta = generator.uniform(-0.05, 0.05, robot.elastic)
    values = dict(zip((*robot.axis_names, *robot.elastic_names), (*q, *eta)))
    model.update_cfg(values)
    wanted = jax.jit(
        lambda r, a, b: forward_kinematics(r.chain, r.joint_coordinates(a, b))
    )
    pose = wanted(robot, jnp.asarray(q), jnp.asarray(eta))
    # quaternions of yourdfpy
    assert_close(model.get_transform("tool", "base_link"), pose, rtol=0, atol=1e-12)


def test_links_have_names_of_their_own():
    robot = kr210()
    names = ("wrist",) * robot.bodies.number
    text = urdf_from_robot(
        dataclasses.replace(
            robot, bodies=dataclasses.replace(robot.bodies, names=names)
        )
    )
    links = [line for line in text.splitlines() if "<link name=" in line]
    assert len(links) == len(set(links)) == 10
    assert any("payload" in link for link in links)


def _file(text: str):
    import io

    return io.BytesIO(text.encode())
