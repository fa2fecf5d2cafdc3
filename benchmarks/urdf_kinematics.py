"""Do arms read from a URDF move as Pinocchio says, and what does that cost?

KR210 (written by elastax, read back), UR10e and iiwa 14 of `examples/`: both sides read
the same text. Pose, Jacobian of the tool (base frame, translation above rotation;
LOCAL_WORLD_ALIGNED there) and its time derivative at random coordinates within the
limits and random speeds; vmapped on one thread, Pinocchio called from Python sample by
sample. The difference is the largest one over the largest magnitude of each sample.
"""

import pathlib
from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pinocchio as pin
from elastax.io import arm_from_urdf, urdf_from_robot
from elastax.kinematics import (
    Arm,
    forward_kinematics,
    jacobian,
    jacobian_derivatives,
)
from elastax.robots import kr210

from ._rows import Check, relative_difference, row
from ._timing import Effort, compile_timed, measure
from .peers import pinocchio as peer


EXAMPLES = pathlib.Path(__file__).resolve().parent.parent / "examples"
BATCH = 4096
FEW = 64


def pose(arm: Arm, q, qd):
    """Pose of the tool."""
    return forward_kinematics(arm.chain, q)


def columns(arm: Arm, q, qd):
    """Jacobian of the tool."""
    return jacobian(arm.chain, q)


def rate(arm: Arm, q, qd):
    """Time derivative of that Jacobian."""
    return jacobian_derivatives(arm.chain, jnp.stack([q, qd]))[1]


FUNCTIONS: dict[str, tuple[Callable, Callable]] = {
    "pose": (pose, peer.frame_pose),
    "jacobian": (columns, peer.frame_jacobian),
    "jacobian_rate": (rate, peer.frame_jacobian_rate),
}


def urdf_text(name: str) -> tuple[str, str]:
    """Text of the URDF of a robot, and the link at its tip."""
    if name == "kr210":
        return urdf_from_robot(kr210()), "tool"
    text = (EXAMPLES / f"{name}.urdf").read_text(encoding="utf-8")
    return text, {"ur10e": "tool0", "iiwa14": "flange"}[name]


def states(arm: Arm, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates within the limits and speeds, one sample per row."""
    generator = np.random.default_rng(0)
    lower, upper, speed = map(np.asarray, (arm.lower, arm.upper, arm.velocity))
    shape = (count, arm.chain.number)
    return generator.uniform(lower, upper, shape), generator.uniform(
        -speed, speed, shape
    )


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one robot."""
    text, tip = urdf_text(case)
    arm = arm_from_urdf(text)
    model = pin.buildModelFromXML(text)
    if tuple(model.names)[1:] != arm.axis_names:
        raise ValueError(
            f"both sides must have the same joints, but they are {arm.axis_names} and "
            f"{tuple(model.names)[1:]}"
        )
    data, frame = model.createData(), model.getFrameId(tip)
    q, qd = states(arm, BATCH)
    batch = jnp.asarray(q), jnp.asarray(qd)
    for name, (function, route) in FUNCTIONS.items():
        program = compile_timed(jax.vmap(function, (None, 0, 0)), arm, *batch)
        found = np.asarray(program.call(arm, *batch))[:FEW]
        wanted = np.stack([route(model, data, frame, *x) for x in zip(q[:FEW], qd)])

        def theirs(route=route) -> None:
            for k in range(FEW):
                route(model, data, frame, q[k], qd[k])

        here, there = measure(effort, lambda: program.call(arm, *batch), theirs)
        yield row(
            f"urdf_{name}",
            1e6 * here.best / BATCH,
            "us",
            batch=BATCH,
            peer="pinocchio, from Python",
            peer_value=1e6 * there.best / FEW,
            max_difference=relative_difference(found, wanted),
            compile_s=program.seconds,
            variant=case,
            median=1e6 * here.median / BATCH,
            checks=(Check("max_difference", 1e-10, 7),),
        )
