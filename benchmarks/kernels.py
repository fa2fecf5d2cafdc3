"""What does each kernel cost in every use that a user makes of it?

A single call, one evaluation after another in a scan, vmapped, and vmapped derivatives:
`jvp` along a direction of robot and state, `jacfwd` by the state, `vjp` the gradient of
the sum of all results by all parameters of the robot and all states. The KR210 with end
slopes, one thread but for the single call, each use in a process of its own, so that
its compile time is that of a program nothing of which was compiled before.
"""

from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pinocchio as pin
from elastax.dynamics import (
    ElasticRobot,
    forward_dynamics,
    inverse_dynamics,
    multibody,
)
from elastax.kinematics import forward_kinematics, jacobian
from elastax.robots import kr210

from . import _reference as reference
from ._rows import Check, relative_difference, row
from ._systems import random_states
from ._timing import Effort, compile_timed, measure
from ._uses import PROGRAMS, direction
from .peers import pinocchio as peer


# samples per call, and samples that the reference route computes
BATCH = {"single": 1, "scan": 4096, "vmap": 4096, "jvp": 1024, "jacfwd": 256}
FEW = 32


def pose(robot: ElasticRobot, q, eta):
    """Pose of the tool."""
    return forward_kinematics(robot.chain, robot.joint_coordinates(q, eta))


def tool_jacobian(robot: ElasticRobot, q, eta):
    """Jacobian of the tool by all joints of the chain."""
    return jacobian(robot.chain, robot.joint_coordinates(q, eta))


def torques(robot: ElasticRobot, q, qd, qdd, eta, etad, etadd):
    """Inverse dynamics."""
    return inverse_dynamics(robot, q, qd, qdd, eta, etad, etadd)


KERNELS: dict[str, tuple[Callable, tuple[str, ...]]] = {
    "pose": (pose, ("q", "eta")),
    "jacobian": (tool_jacobian, ("q", "eta")),
    "inverse_dynamics": (torques, ("q", "qd", "qdd", "eta", "etad", "etadd")),
    "multibody": (multibody, ("q", "eta", "qd", "etad")),
    "forward_dynamics": (
        forward_dynamics,
        ("q", "eta", "theta", "qd", "etad", "thetad", "tau_m"),
    ),
}


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one kernel in one use, such as "multibody_scan"."""
    name, use = case.rsplit("_", 1)
    function, inputs = KERNELS[name]
    robot = kr210()
    count = BATCH.get(use, 1024)
    states = random_states(robot, max(count, FEW))
    columns = [jnp.asarray(states[k]) for k in inputs]
    batch = [x[0] for x in columns] if use == "single" else [x[:count] for x in columns]
    program = compile_timed(PROGRAMS[use](function), robot, *batch)
    yield compile_row(name, use, program.seconds)
    call = lambda: program.call(robot, *batch)
    common = dict(
        batch=count,
        threads=2 if use == "single" else 1,
        compile_s=program.seconds,
        variant=use,
        program_mib=program.program_mib,
    )
    if use in ("single", "scan", "vmap"):
        theirs = peer_loop(name, robot, {k: v[:FEW] for k, v in states.items()})
        here, there = measure(effort, call, theirs)
        common |= dict(
            peer="pinocchio, from Python",
            peer_value=1e6 * there.best / FEW,
            max_difference=value_difference(name, use, robot, states, call()),
        )
        limit = 1e-9
    else:
        value = compile_timed(PROGRAMS["vmap"](function), robot, *batch)
        here, there = measure(effort, call, lambda: value.call(robot, *batch))
        common |= dict(
            peer="own value, vmapped",
            peer_value=1e6 * there.best / count,
            max_difference=derivative_difference(function, use, robot, batch, call()),
        )
        limit = 1e-6 if use == "jvp" else 1e-9
    yield row(
        f"kernel_{name}",
        1e6 * here.best / count,
        "us",
        median=1e6 * here.median / count,
        checks=(Check("max_difference", limit, 7),),
        note=NOTES.get(use),
        **common,
    )


NOTES = {
    "jvp": "difference: to central differences of the value",
    "jacfwd": "difference: its product with a direction to jvp",
    "vjp": "difference: its product with a direction to jvp",
}


def compile_row(name: str, use: str, seconds: float) -> dict:
    """The compile time as a row of its own."""
    derivative = use in ("jvp", "jacfwd", "vjp")
    return row(
        f"compile_{name}",
        seconds,
        "s",
        threads=2 if use == "single" else 1,
        compile_s=seconds,
        variant=use,
        checks=(Check("value", 20.0 if derivative else 5.0, 5),),
    )


def peer_loop(name: str, robot: ElasticRobot, states: dict) -> Callable[[], None]:
    """Pinocchio's counterpart on the 17 joints, one sample after another."""
    model = peer.robot_model(robot)
    data = model.createData()
    x, xd = reference.tree_coordinates(robot, states)
    xdd = 0.1 * x
    calls = {
        "pose": lambda k: peer.tool_pose(model, data, x[k]),
        "jacobian": lambda k: peer.tool_jacobian(model, data, x[k]),
        "inverse_dynamics": lambda k: pin.rnea(model, data, x[k], xd[k], xdd[k]),
        "multibody": lambda k: (
            pin.crba(model, data, x[k]),
            pin.nonLinearEffects(model, data, x[k], xd[k]),
        ),
        "forward_dynamics": lambda k: pin.aba(model, data, x[k], xd[k], xdd[k]),
    }
    call = calls[name]

    def run() -> None:
        for k in range(len(x)):
            call(k)

    return run


def value_difference(name: str, use: str, robot, states, result) -> float:
    """Largest relative difference to an independent route."""
    few = 1 if use == "single" else FEW
    states = {k: v[:few] for k, v in states.items()}
    found = [np.asarray(x) for x in jax.tree.leaves(result)]
    found = [x[None] if use == "single" else x[:few] for x in found]
    return _largest(found, expected(name, robot, states))


def expected(name: str, robot: ElasticRobot, states: dict) -> list[np.ndarray]:
    """What a kernel must give, by Pinocchio and Lagrange."""
    if name in ("pose", "jacobian"):
        model = peer.robot_model(robot)
        data = model.createData()
        route = peer.tool_pose if name == "pose" else peer.tool_jacobian
        x, _ = reference.tree_coordinates(robot, states)
        return [np.stack([np.array(route(model, data, xk)) for xk in x])]
    if name == "multibody":
        return list(reference.multibody(robot, states))
    if name == "forward_dynamics":
        return list(reference.accelerations(robot, states))
    # motors that follow the joints: their gears transmit nothing
    still = {"theta": states["q"], "thetad": states["qd"]}
    return list(reference.lagrange(robot, states | still)[:2])


def derivative_difference(function, use, robot, batch, result) -> float:
    """Relative difference of a derivative to another way to it."""
    moving = direction(robot)
    if use == "jacfwd":
        moving = jax.tree.map(jnp.zeros_like, robot)
    steps = [0.1 * x for x in batch]

    def push(state, step):
        return jax.jvp(function, (robot, *state), (moving, *step))[1]

    if use == "jvp":
        few = [x[:FEW] for x in batch]
        quotient = jax.jit(central_differences(function))(robot, *few)
        return _largest(jax.tree.map(lambda x: x[:FEW], result), quotient)
    pushed = jax.jit(jax.vmap(push))(batch, steps)
    if use == "jacfwd":
        # one leaf per result and input; the last axis is that of the input
        found = [
            sum(np.einsum("k...i,ki->k...", b, d) for b, d in zip(blocks, steps))
            for blocks in jacobian_blocks(result, len(batch))
        ]
        return _largest(found, jax.tree.leaves(pushed))
    terms = [
        np.ravel(np.asarray(cotangent) * np.asarray(step))
        for cotangent, step in zip(
            jax.tree.leaves(result), jax.tree.leaves((moving, *steps)), strict=True
        )
    ]
    terms = np.concatenate(terms)
    total = sum(np.sum(x) for x in jax.tree.leaves(pushed))
    return float(np.abs(np.sum(terms) - total) / np.sum(np.abs(terms)))


def _largest(actual, desired) -> float:
    pairs = zip(jax.tree.leaves(actual), jax.tree.leaves(desired), strict=True)
    return max(relative_difference(*pair) for pair in pairs)


def jacobian_blocks(result, inputs: int) -> list[list[np.ndarray]]:
    """For every array of the result its derivatives by each input."""
    leaves = [np.asarray(x) for x in jax.tree.leaves(result)]
    return [leaves[k : k + inputs] for k in range(0, len(leaves), inputs)]


def central_differences(function: Callable, step: float = 1e-2) -> Callable:
    """Derivative along the direction of `_uses.pushed` by differences of six points."""
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}

    def run(robot, *states):
        moving = direction(robot)

        def at(length, state):
            moved = jax.tree.map(lambda x, d: x + length * d, robot, moving)
            return function(moved, *((1.0 + 0.1 * length) * x for x in state))

        def one(*state):
            total = []
            for k, weight in weights.items():
                ahead, behind = (
                    jax.tree.leaves(at(s * k * step, state)) for s in (1, -1)
                )
                total.append([weight / step * (a - b) for a, b in zip(ahead, behind)])
            return [sum(parts) for parts in zip(*total)]

        return jax.vmap(one)(*states)

    return run
