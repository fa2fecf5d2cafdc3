"""How fast is rigid inverse dynamics of six axes, against Pinocchio and MuJoCo?

The KR210 without its elasticities. What elastax computes contains friction and the
counterbalance, which the peers leave out: they are switched off for the comparison.
"""

import dataclasses
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pinocchio as pin
from elastax import over_devices
from elastax.dynamics import ElasticRobot, inverse_dynamics
from elastax.robots import kr210

from ._rows import Check, relative_difference, row
from ._systems import BATCH, random_states, spread
from ._timing import Effort, compile_timed, measure
from ._uses import scanned
from .peers import pinocchio as peer


NAME = "rigid_inverse_dynamics"


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: batched on 1 or 2 threads, in a scan, a single call, MuJoCo."""
    robot = rigid_robot()
    motion = {k: random_states(robot, BATCH)[k] for k in ("q", "qd", "qdd")}
    cases = {
        "batched_2": lambda: batched(robot, motion, 2, effort),
        "batched_1": lambda: batched(robot, motion, 1, effort),
        "scan": lambda: sequential(robot, motion, effort),
        "single": lambda: single(robot, motion, effort),
        "mujoco": lambda: against_mujoco(robot, motion, effort),
    }
    yield from cases[case]()


def rigid_robot() -> ElasticRobot:
    """Six axes with bodies, without counterbalance."""
    return dataclasses.replace(kr210().rigid(), counterbalance=None)


def torque(robot: ElasticRobot, q, qd, qdd):
    """What is measured."""
    return inverse_dynamics(robot, q, qd, qdd)[0]


def _program(robot, threads: int, batch):
    """Compiled batch evaluation on one or several host devices, and its arguments."""
    axes = (None, *(0 for _ in batch))
    if threads == 1:
        return compile_timed(jax.vmap(torque, axes), robot, *batch), (robot, *batch)
    robot, batch = spread(robot, batch)
    return compile_timed(over_devices(torque, axes), robot, *batch), (robot, *batch)


def batched(robot, motion, threads: int, effort: Effort) -> Iterator[dict]:
    """All samples in one call, against `rneaInParallel`."""
    batch = [jnp.asarray(x) for x in motion.values()]
    ours, args = _program(robot, threads, batch)
    model = peer.robot_model(robot)
    call, theirs = peer.batched(pin.rneaInParallel, model, threads, *motion.values())
    here, there = measure(effort, lambda: ours.call(*args), call)
    yield row(
        f"{NAME}_batched",
        1e6 * here.best / BATCH,
        "us",
        batch=BATCH,
        threads=threads,
        peer="pinocchio rneaInParallel",
        peer_value=1e6 * there.best / BATCH,
        max_difference=relative_difference(ours.call(*args), theirs.T),
        compile_s=ours.seconds,
        checks=(Check("ratio", 0.5, 1), Check("max_difference", 1e-9, 7)),
        variant="vmap",
        program_mib=ours.program_mib,
        median=1e6 * here.median / BATCH,
        note="friction evaluated as well, with zero coefficients",
    )


def sequential(robot, motion, effort: Effort) -> Iterator[dict]:
    """One after another inside a scan, against the same algorithm on one thread."""
    batch = [jnp.asarray(x) for x in motion.values()]
    ours = compile_timed(scanned(torque), robot, *batch)
    model = peer.robot_model(robot)
    call, theirs = peer.batched(pin.rneaInParallel, model, 1, *motion.values())
    here, there = measure(effort, lambda: ours.call(robot, *batch), call)
    yield row(
        f"{NAME}_scan",
        1e6 * here.best / BATCH,
        "us",
        batch=BATCH,
        peer="pinocchio rnea, 1 thread",
        peer_value=1e6 * there.best / BATCH,
        max_difference=relative_difference(ours.call(robot, *batch), theirs.T),
        compile_s=ours.seconds,
        checks=(Check("max_difference", 1e-9, 7),),
        variant="scan",
        program_mib=ours.program_mib,
        median=1e6 * here.median / BATCH,
    )


def single(robot, motion, effort: Effort) -> Iterator[dict]:
    """One call from Python; dispatch is most of it on both sides."""
    sample = [jnp.asarray(x[0]) for x in motion.values()]
    plain = [x[0] for x in motion.values()]
    ours = compile_timed(torque, robot, *sample)
    model = peer.robot_model(robot)
    data = model.createData()
    here, there = measure(
        effort,
        lambda: ours.call(robot, *sample),
        lambda: pin.rnea(model, data, *plain),
    )
    theirs = pin.rnea(model, data, *plain)
    yield row(
        f"{NAME}_single",
        1e6 * here.best,
        "us",
        threads=2,
        peer="pinocchio rnea, from Python",
        peer_value=1e6 * there.best,
        max_difference=relative_difference(
            np.asarray(ours.call(robot, *sample))[None], theirs[None]
        ),
        compile_s=ours.seconds,
        checks=(Check("max_difference", 1e-9, 7),),
        variant="single",
        program_mib=ours.program_mib,
        median=1e6 * here.median,
    )


def against_mujoco(robot, motion, effort: Effort) -> Iterator[dict]:
    """MJX vmapped on all threads, and MuJoCo in C one call after another."""
    from .peers import mujoco as other

    batch = [jnp.asarray(x) for x in motion.values()]
    model = other.robot_model(robot)
    ours, args = _program(robot, 2, batch)
    theirs = compile_timed(other.mjx_inverse(model), *batch)
    here, there = measure(
        effort,
        lambda: ours.call(*args),
        lambda: theirs.call(*batch),
    )
    result = np.asarray(ours.call(*args))
    common = dict(batch=BATCH, compile_s=ours.seconds, program_mib=ours.program_mib)
    yield row(
        f"{NAME}_batched",
        1e6 * here.best / BATCH,
        "us",
        threads=2,
        peer="mjx inverse, vmapped",
        peer_value=1e6 * there.best / BATCH,
        max_difference=relative_difference(result, theirs.call(*batch)),
        checks=(Check("ratio", 0.02, 1), Check("max_difference", 1e-9, 7)),
        variant="vmap",
        median=1e6 * here.median / BATCH,
        peer_compile_s=theirs.seconds,
        **common,
    )
    count = 512
    loop = other.inverse_loop(model, *(x[:count] for x in motion.values()))
    here, there = measure(effort, lambda: ours.call(*args), loop)
    yield row(
        f"{NAME}_batched",
        1e6 * here.best / BATCH,
        "us",
        threads=2,
        peer="mujoco mj_inverse, 1 thread, from Python",
        peer_value=1e6 * there.best / count,
        max_difference=relative_difference(result[:count], loop()),
        checks=(Check("max_difference", 1e-9, 7),),
        variant="vmap",
        note="MuJoCo on one thread, ours on two",
        **common,
    )
