"""How many poses does the numeric inverse reach, and how fast, restarts included?

Targets are poses of joint vectors uniform within the limits. A target is solved when
the tool is within 1e-6 m and 1e-6 rad of it and all joints are within their limits,
with up to 32 starts. The Robotics Toolbox searches the same targets with as many starts
of its own choice and the same tolerance, in C++, called once per target from Python.
Both sides are judged by the toolbox's forward kinematics.
"""

import importlib.util
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from elastax import over_devices
from elastax.kinematics import Arm, find_pose, forward_kinematics
from elastax.robots import iiwa14, kr210, ur10e

from ._rows import Check, row
from ._timing import Effort, compile_timed, measure


TARGETS = 10_000
STARTS = 32
TOLERANCE = 1e-6  # m and rad
# damping of the toolbox that solves its searches fastest, of those it documents
PEER = {"method": "chan", "k": 0.1}


def run(case: str, effort: Effort) -> Iterator[dict]:
    """Rows of one case: an arm, on one thread or, with `_2`, on two."""
    name, _, threads = case.partition("_")
    arms = {"kr210": kr210_arm, "ur10e": ur10e, "iiwa14": iiwa14}
    yield from searched(arms[name](), int(threads or 1), effort)


def kr210_arm() -> Arm:
    """Chain and limits of the rigid KR210."""
    robot = kr210().rigid()
    ends = [robot.from_maker(x) for x in (robot.limits.lower, robot.limits.upper)]
    return Arm(
        chain=robot.chain,
        lower=jnp.minimum(*ends),
        upper=jnp.maximum(*ends),
        velocity=robot.limits.velocity,
        signs=robot.axis_signs,
        zeros=robot.axis_zeros,
        poses={},
        name="kr210",
        axis_names=tuple(f"A{k}" for k in range(1, 7)),
    )


def random_targets(arm: Arm, count: int, seed: int = 0) -> np.ndarray:
    """Poses of joint vectors uniform within the limits, (count, 4, 4)."""
    rng = np.random.default_rng(seed)
    shape = count, arm.chain.number
    q = rng.uniform(np.asarray(arm.lower), np.asarray(arm.upper), shape)
    every = jax.jit(lambda c, q: jax.vmap(lambda x: forward_kinematics(c, x))(q))
    return np.asarray(every(arm.chain, jnp.asarray(q)))


def pose_errors(actual: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Distance [m] and angle [rad] of poses from their targets, (2, samples)."""
    distance = np.linalg.norm(actual[:, :3, 3] - targets[:, :3, 3], axis=1)
    # the chord 2 sqrt(2) sin(angle / 2): exact for small angles, unlike the trace
    chord = np.linalg.norm(actual[:, :3, :3] - targets[:, :3, :3], axis=(1, 2))
    angle = 2 * np.arcsin(np.minimum(1.0, chord / np.sqrt(8.0)))
    return np.stack([distance, angle])


def solved(arm: Arm, q: np.ndarray, actual: np.ndarray, targets) -> np.ndarray:
    """Which targets are reached within the limits."""
    inside = (q >= np.asarray(arm.lower)) & (q <= np.asarray(arm.upper))
    near = pose_errors(actual, targets) <= TOLERANCE * (1 + 1e-6)
    return inside.all(axis=1) & near.all(axis=0)


def searched(arm: Arm, threads: int, effort: Effort) -> Iterator[dict]:
    """All targets in one call, against the toolbox one after another."""
    targets = random_targets(arm, TARGETS)
    batch = jnp.asarray(targets)

    def find(starts):
        one = lambda a, t: find_pose(a, t, starts=starts, throw=False)
        axes = (None, 0)
        many = jax.vmap(one, axes) if threads == 1 else over_devices(one, axes)
        return compile_timed(many, arm, batch)

    ours, once = find(STARTS), find(1)
    found = jax.device_get(ours.call(arm, batch))
    single = jax.device_get(once.call(arm, batch))
    every = jax.jit(lambda c, q: jax.vmap(lambda x: forward_kinematics(c, x))(q))
    pose_of = lambda q: np.asarray(every(arm.chain, jnp.asarray(q)))
    peer_row: dict = {"note": "the Robotics Toolbox is not installed"}
    call = lambda: ours.call(arm, batch)
    if importlib.util.find_spec("roboticstoolbox") is None:
        (here,) = measure(effort, call)
    else:
        from .peers import roboticstoolbox as peer

        ets = peer.sequence(arm)
        pose_of = lambda q: peer.poses(ets, q)
        theirs = peer.searches(ets, targets, STARTS, TOLERANCE, **PEER)
        here, there = measure(effort, call, lambda: theirs().q)
        result = theirs()
        first = peer.searches(ets, targets, 1, TOLERANCE, **PEER)()
        rate = lambda s: float(solved(arm, s.q, pose_of(s.q), targets).mean())
        peer_row = {
            "peer": "roboticstoolbox ik_LM, 1 thread, from Python",
            "peer_value": 1e6 * there.best / TARGETS,
            "peer_solved": rate(result),
            "peer_solved_single": rate(first),
            "peer_starts": float(result.searches.mean()),
            "note": f"the toolbox solves {100 * rate(result):.2f} %, with one start "
            f"{100 * rate(first):.1f} %",
        }
    reached = solved(arm, found.value, pose_of(found.value), targets)
    alone = solved(arm, single.value, pose_of(single.value), targets)
    errors = pose_errors(pose_of(found.value), targets)[:, reached]
    note = (
        f"{arm.name}: solved {100 * reached.mean():.2f} %, with one start "
        f"{100 * alone.mean():.1f} %, {found.starts.mean():.2f} starts and "
        f"{found.steps.mean():.1f} corrections on average; " + peer_row.pop("note")
    )
    yield row(
        "inverse_kinematics",
        1e6 * here.best / TARGETS,
        "us",
        batch=TARGETS,
        threads=threads,
        max_difference=float(errors.max()),
        compile_s=ours.seconds,
        checks=(
            Check("unsolved", 1e-3, 8),
            Check("max_difference", TOLERANCE * (1 + 1e-6), 8),
        ),
        variant=arm.name,
        unsolved=float(1 - reached.mean()),
        solved_single=float(alone.mean()),
        mean_starts=float(found.starts.mean()),
        most_starts=int(found.starts.max()),
        mean_steps=float(found.steps.mean()),
        disagreement=int(np.sum(reached != np.asarray(found.reached))),
        program_mib=ours.program_mib,
        median=1e6 * here.median / TARGETS,
        note=note,
        **peer_row,
    )
