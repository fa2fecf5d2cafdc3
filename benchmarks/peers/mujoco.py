"""Robots of elastax as models of MuJoCo, described in memory."""

from collections.abc import Callable
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from elastax.dynamics import AxisRole, ElasticRobot, ElasticRole, SlopeRole
from elastax.kinematics import JointKind


def robot_model(robot: ElasticRobot) -> mujoco.MjModel:
    """Joints, bodies and gravity; without springs, friction and motors.

    Raises:
        ValueError: an end slope is not zero; MuJoCo couples joints only softly.
    """
    root, _ = _tree(robot)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"))


def _text(values) -> str:
    return " ".join(f"{x:.17g}" for x in np.ravel(values))


def _quaternion(rotation) -> np.ndarray:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ravel(np.asarray(rotation, float)))
    return quaternion


def _tree(robot: ElasticRobot) -> tuple[ElementTree.Element, ElementTree.Element]:
    """Root of the description, and its world body."""
    if np.any(np.asarray(robot.slopes) != 0):
        raise ValueError(
            f"`robot` must have end-slope factors of zero, but they are {robot.slopes}"
        )
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(
        root, "compiler", angle="radian", inertiafromgeom="false", fusestatic="false"
    )
    option = ElementTree.SubElement(root, "option", gravity=_text(robot.gravity))
    flags = {"contact": "disable", "constraint": "disable"}
    ElementTree.SubElement(option, "flag", flags)
    world = ElementTree.SubElement(root, "worldbody")
    frames = jax.device_get(robot.chain.joints.frames())
    bodies = jax.device_get(robot.all_bodies())
    kinds = {JointKind.REVOLUTE: "hinge", JointKind.PRISMATIC: "slide"}
    pose, parent = np.asarray(robot.chain.base), world
    collected: list[list] = []  # per moving joint: element, carried masses
    for k, role in enumerate(robot.roles):
        pose = pose @ frames.before[k]
        if not isinstance(role, SlopeRole):
            parent = ElementTree.SubElement(
                parent,
                "body",
                name=f"body {k}",
                pos=_text(pose[:3, 3]),
                quat=_text(_quaternion(pose[:3, :3])),
            )
            ElementTree.SubElement(
                parent,
                "joint",
                name=f"joint {k}",
                type=kinds[robot.chain.kinds[k]],
                axis=_text(frames.axis[k]),
            )
            collected.append([parent, []])
            pose = np.eye(4)
        for i in np.flatnonzero(np.array(bodies.joint) == k):
            turn = pose[:3, :3]
            com = turn @ bodies.com[i] + pose[:3, 3]
            tensor = turn @ bodies.inertia[i] @ turn.T
            collected[-1][1].append((bodies.mass[i], com, tensor))
        pose = pose @ frames.after[k]
    for element, parts in collected:
        _add_inertia(element, parts)
    return root, world


def _add_inertia(element: ElementTree.Element, parts: list) -> None:
    """Bodies on one link, joined about their centre of mass."""
    mass = sum(m for m, _, _ in parts)
    if not mass:
        # a link without a body; MuJoCo asks for some mass on every one
        tiny = _text(1e-12)
        moments = _text([1e-12] * 3)
        ElementTree.SubElement(
            element, "inertial", pos="0 0 0", mass=tiny, diaginertia=moments
        )
        return
    com = sum(m * c for m, c, _ in parts) / mass
    tensor = sum(
        t + m * ((d := c - com) @ d * np.eye(3) - np.outer(d, d)) for m, c, t in parts
    )
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    ElementTree.SubElement(
        element,
        "inertial",
        pos=_text(com),
        mass=_text(mass),
        fullinertia=_text([tensor[i] for i in pairs]),
    )


def mjx_inverse(model: mujoco.MjModel) -> Callable:
    """`mjx.inverse` mapped over a batch of joint angles, rates and accelerations."""
    from mujoco import mjx

    there = mjx.put_model(model)
    empty = mjx.make_data(there)

    def one(q, qd, qdd):
        data = empty.replace(qpos=q, qvel=qd, qacc=qdd)
        return mjx.inverse(there, data).qfrc_inverse

    return jax.vmap(one)


def inverse_loop(model: mujoco.MjModel, q, qd, qdd) -> Callable[[], np.ndarray]:
    """`mj_inverse` of one sample after another."""
    data = mujoco.MjData(model)
    result = np.zeros_like(q)
    samples = list(zip(q, qd, qdd))

    def run() -> np.ndarray:
        for k, (position, rate, acceleration) in enumerate(samples):
            data.qpos[:], data.qvel[:], data.qacc[:] = position, rate, acceleration
            mujoco.mj_inverse(model, data)
            result[k] = data.qfrc_inverse
        return result

    return run


def elastic_model(
    robot: ElasticRobot, stiffness=None, damping=None, step: float = 1e-3
) -> mujoco.MjModel:
    """The whole robot: rotors with armature, gears, springs, dampers, motor torques.

    Args:
        robot: with linear springs, viscous friction and no counterbalance.
        stiffness, damping: springs and dampers between rotors and base, (axes,).
        step: of the integration [s].

    Raises:
        ValueError: the robot has a counterbalance, or end slopes.
    """
    if robot.counterbalance is not None:
        raise ValueError("`robot` must have no counterbalance")
    root, world = _tree(robot)
    option = root.find("option")
    assert option is not None
    option.attrib |= {"integrator": "RK4", "timestep": _text(step)}
    drives = robot.drives
    zero = jnp.zeros((robot.axes,))
    stiffness = np.zeros(robot.axes) if stiffness is None else stiffness
    damping = np.zeros(robot.axes) if damping is None else damping
    # linear laws: their slopes at zero
    slope = lambda law, x: np.diag(np.asarray(jax.jacfwd(law)(x)))
    friction = slope(drives.motor_friction.torque, zero) + damping
    behind = slope(drives.joint_friction.torque, zero)
    gear = slope(lambda x: drives.gear_torque(x, zero), zero)
    gear_damping = slope(lambda x: drives.gear_torque(zero, x), zero)
    inertia = np.asarray(drives.reflected_inertia())
    tendons = ElementTree.SubElement(root, "tendon")
    actuators = ElementTree.SubElement(root, "actuator")
    for k in range(robot.axes):
        # a rotor of no weight; its inertia is the armature
        body = ElementTree.SubElement(world, "body", name=f"rotor {k}")
        ElementTree.SubElement(
            body,
            "joint",
            name=f"rotor {k}",
            type="hinge",
            axis="0 0 1",
            armature=_text(inertia[k] - ROTOR),
            stiffness=_text(stiffness[k]),
            damping=_text(friction[k]),
        )
        moments = _text([ROTOR] * 3)
        ElementTree.SubElement(
            body, "inertial", pos="0 0 0", mass=_text(ROTOR), diaginertia=moments
        )
        tendon = ElementTree.SubElement(
            tendons,
            "fixed",
            stiffness=_text(gear[k]),
            damping=_text(gear_damping[k]),
            springlength="0",
        )
        for name, factor in ((_driven_joint(robot, k), "1"), (f"rotor {k}", "-1")):
            ElementTree.SubElement(tendon, "joint", joint=name, coef=factor)
        ElementTree.SubElement(actuators, "motor", joint=f"rotor {k}")
    structure = robot.structure_stiffness
    if structure is not None:
        springs = slope(structure.torque, jnp.zeros((robot.elastic,)))
    for joint in root.iter("joint"):
        name = joint.get("name", "")
        if not name.startswith("joint "):
            continue
        role = robot.roles[int(name.removeprefix("joint "))]
        if isinstance(role, ElasticRole):
            joint.set("stiffness", _text(springs[role.index]))
            joint.set("damping", _text(robot.structure_damping[role.index]))
        else:
            joint.set("damping", _text(behind[role.index]))
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"))


ROTOR = 1e-6  # kg m^2 of the rotors' bodies, taken off the armature


def _driven_joint(robot: ElasticRobot, axis: int) -> str:
    (joint,) = [k for k, role in enumerate(robot.roles) if role == AxisRole(axis)]
    return f"joint {joint}"


def coordinates(model: mujoco.MjModel, robot: ElasticRobot, q, eta, theta):
    """Rows of (q, eta, theta) in the order of the model's coordinates."""
    result = np.zeros((len(q), model.nv))
    for column, values in zip(_columns(model, robot), (q, eta, theta), strict=True):
        result[:, column] = values
    return result


def _columns(model: mujoco.MjModel, robot: ElasticRobot) -> list[list[int]]:
    """Columns of q, eta and theta."""
    place = lambda name: int(model.joint(name).dofadr[0])
    hinges = {
        role.index: place(f"joint {k}")
        for k, role in enumerate(robot.roles)
        if isinstance(role, ElasticRole)
    }
    return [
        [place(_driven_joint(robot, k)) for k in range(robot.axes)],
        [hinges[k] for k in range(robot.elastic)],
        [place(f"rotor {k}") for k in range(robot.axes)],
    ]


def forward_loop(model: mujoco.MjModel, positions, rates, torques):
    """`mj_forward` of one state after another, a function of no arguments."""
    data = mujoco.MjData(model)
    result = np.zeros_like(rates)

    def run() -> np.ndarray:
        for k in range(len(positions)):
            data.qpos[:], data.qvel[:], data.ctrl[:] = (
                positions[k],
                rates[k],
                torques[k],
            )
            mujoco.mj_forward(model, data)
            result[k] = data.qacc
        return result

    return run


def rollout(model: mujoco.MjModel, robot: ElasticRobot, start, torques, every: int):
    """Motion from rest under torques, a function that returns q, eta, theta.

    Args:
        model: of `elastic_model`.
        robot: the same robot.
        start: coordinates at the start.
        torques: one row per step.
        every: steps between the rows that are returned; the start is the first.
    """
    from mujoco import rollout as rollouts

    data = mujoco.MjData(model)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    initial = np.zeros(size)
    data.qpos[:] = start
    mujoco.mj_getState(model, data, initial, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    columns = _columns(model, robot)

    def run() -> list[np.ndarray]:
        states, _ = rollouts.rollout(model, data, initial[None], torques[None])
        # the state begins with the time
        motion = states[0, every - 1 :: every, 1 : 1 + model.nq]
        motion = np.vstack([start[None], motion])
        return [motion[:, column] for column in columns]

    return run
