"""How fast is the forward dynamics of the elastic robot, against Pinocchio?

The KR210 without end slopes has 14 joints with a coordinate of their own: Pinocchio's
articulated-body algorithm takes the same tree. The default robot has three more joints,
which follow elastic coordinates; Pinocchio refuses them there, so it is given mass
matrix, bias forces and a Cholesky solve.

What elastax computes contains gears, springs, dampers, friction, counterbalance and
motors. Pinocchio gets their torques as an input and is not charged for them.
"""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np
import pinocchio as pin
import scipy.linalg
from elastax import over_devices
from elastax.dynamics import ElasticRobot, forward_dynamics
from elastax.robots import kr210

from . import _reference as reference
from ._rows import Check, relative_difference, row
from ._systems import BATCH, random_states, spread, tree_robot
from ._timing import Effort, compile_timed, measure
from ._uses import mapped, scanned
from .peers import pinocchio as peer


NAME = "elastic_forward_dynamics"
NOTE = "ours includes gears, springs, friction, counterbalance, motors; ABA does not"
INPUTS = ("q", "eta", "theta", "qd", "etad", "thetad", "tau_m")


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: batched on 1 or 2 threads, in a scan, the default robot."""
    if case.startswith("default_robot"):
        yield from default_robot(case.removeprefix("default_robot_"), effort)
        return
    robot = tree_robot()
    states = random_states(robot, BATCH)
    model = peer.robot_model(robot, weld_end_slopes=True)
    x, xd, tau = reference.applied_torques(robot, states, model)
    batch = [jnp.asarray(states[name]) for name in INPUTS]
    threads = 2 if case == "batched_2" else 1
    ours, args = compiled(case, robot, batch)
    call, theirs = peer.batched(pin.abaInParallel, model, threads, x, xd, tau)
    here, there = measure(effort, lambda: ours.call(*args), call)
    qdd, etadd, _ = ours.call(*args)
    sorting = peer.coupling(robot, weld_end_slopes=True)
    found = np.hstack([qdd, etadd]) @ sorting.T
    scan = case == "scan"
    yield row(
        f"{NAME}_scan" if scan else f"{NAME}_batched",
        1e6 * here.best / BATCH,
        "us",
        batch=BATCH,
        threads=threads,
        peer="pinocchio aba, 1 thread" if scan else "pinocchio abaInParallel",
        peer_value=1e6 * there.best / BATCH,
        max_difference=relative_difference(found, theirs.T),
        compile_s=ours.seconds,
        checks=(
            Check("ratio", 2.0 if scan else 1.0, 2),
            Check("max_difference", 1e-9, 7),
        ),
        variant="scan" if scan else "vmap",
        program_mib=ours.program_mib,
        median=1e6 * here.median / BATCH,
        note=NOTE,
    )


def compiled(case: str, robot: ElasticRobot, batch: list):
    """The program of a case, and its arguments."""
    if case == "batched_2":
        robot, batch = spread(robot, batch)
        split = over_devices(forward_dynamics, (None, *(0 for _ in batch)))
        return compile_timed(split, robot, *batch), (robot, *batch)
    use = scanned if case == "scan" else mapped
    return compile_timed(use(forward_dynamics), robot, *batch), (robot, *batch)


def default_robot(case: str, effort: Effort) -> Iterator[dict]:
    """With end slopes: against `crba`, `rnea` and a Cholesky solve from Python."""
    robot, few = kr210(), 64
    states = random_states(robot, BATCH)
    batch = [jnp.asarray(states[name]) for name in INPUTS]
    ours, args = compiled(case, robot, batch)
    qdd, etadd, thetadd = ours.call(*args)
    part = {k: v[:few] for k, v in states.items()}
    expected = reference.accelerations(robot, part)
    theirs = cholesky_loop(robot, part)
    here, there = measure(effort, lambda: ours.call(*args), theirs)
    difference = relative_difference(
        np.hstack([qdd, etadd])[:few], np.hstack(expected[:2])
    )
    yield row(
        f"{NAME}_default_robot",
        1e6 * here.best / BATCH,
        "us",
        batch=BATCH,
        threads=2 if case == "batched_2" else 1,
        peer="pinocchio crba + rnea + Cholesky, 1 thread, from Python",
        peer_value=1e6 * there.best / few,
        max_difference=max(difference, relative_difference(thetadd[:few], expected[2])),
        compile_s=ours.seconds,
        checks=(Check("max_difference", 1e-9, 7),),
        variant="scan" if case == "scan" else "vmap",
        program_mib=ours.program_mib,
        median=1e6 * here.median / BATCH,
        note="17 joints, 14 coordinates; the peer's calls and products cost Python",
    )


def cholesky_loop(robot: ElasticRobot, states: dict):
    """Function that solves for the accelerations of all samples with Pinocchio."""
    model = peer.robot_model(robot)
    data, matrix = model.createData(), peer.coupling(robot)
    x, xd = reference.tree_coordinates(robot, states)
    h = np.hstack(reference.lagrange(robot, states, at_rest=True)[:2])
    _, bias = reference.multibody(robot, states)
    tau, zero = bias - h, np.zeros(model.nv)

    def run() -> np.ndarray:
        found = np.empty_like(tau)
        for k in range(len(x)):
            mass = matrix.T @ peer.mass_matrix(model, data, x[k]) @ matrix
            force = tau[k] - matrix.T @ pin.rnea(model, data, x[k], xd[k], zero)
            factor = scipy.linalg.cho_factor(mass, check_finite=False)
            found[k] = scipy.linalg.cho_solve(factor, force, check_finite=False)
        return found

    return run
