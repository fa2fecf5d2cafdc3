"""Pictures of the kinematics of a KR210: reach, dexterity, branches.

python examples/gallery_kinematics.py --out out/gallery [--samples 240]

Writes `reach.png`, `dexterity.png`, `branches.png` and `branch_path.png` and prints a
few figures. Angles are KUKA's; limits are those of `elastax.robots.kr210`.
"""

import argparse
import pathlib

import jax
import jax.numpy as jnp
import numpy as np
from elastax.dynamics import ElasticRobot
from elastax.kinematics import (
    SphericalWrist,
    forward_kinematics,
    inverse_kinematics,
    inverse_kinematics_path,
    jacobian,
    moving_frames,
    rotation_x,
    rotation_y,
    rotation_z,
    transform,
)
from elastax.plotting import (
    plot_branch_path,
    plot_branches,
    plot_dexterity_section,
    plot_reach_section,
    save_figure,
)
from elastax.robots import kr210


LENGTH = 1.0  # m over rad: makes rows of metres and radians of one unit
BRANCHES = [
    f"shoulder {b}, elbow {e}, wrist {w}" for b in "+-" for e in "+-" for w in "+-"
]


def main(out: pathlib.Path, samples: int = 240) -> dict[str, float]:
    """Draw everything into a folder, and return the figures that are printed."""
    out.mkdir(parents=True, exist_ok=True)
    robot = kr210().rigid()
    edges = boundaries(robot, samples)
    figures: dict[str, float] = {}

    points = sweep(robot, *ranges(robot, samples))
    figures["farthest wrist centre from axis 1 [m]"] = float(
        np.abs(points[..., 0]).max()
    )
    sticks = {
        f"arm, {name}": stick(robot, robot.poses[name])[:, ::2]
        for name in ("stretched", "cannon")
    }
    save_figure(plot_reach_section(points, edges, sticks=sticks), out / "reach.png")

    x, z, value = dexterity(robot, samples)
    figures["largest smallest singular value [-]"] = float(np.nanmax(value))
    figures["part of the section that is reached [-]"] = float(
        np.isfinite(value).mean()
    )
    figure = plot_dexterity_section(
        x,
        z,
        value,
        notes={
            "arm stretched": (-2.66, 0.22),
            "wrist centre on axis 1": (0.0, 1.7),
            "axes 4 and 6 in line": (1.42, -0.9),
        },
        label=f"smallest singular value of the Jacobian [-], length {LENGTH:g} m",
        title="Dexterity, tool pointing down, y = 0; white: out of reach or of limits",
    )
    save_figure(figure, out / "dexterity.png")

    points, arrows, angles, allowed = branches(robot)
    figures["branches within the limits [-]"] = float(np.sum(allowed))
    figure = plot_branches(
        points,
        arrows,
        angles,
        allowed,
        names=BRANCHES,
        title="Eight ways to hold one pose (A1 to A6 below)",
    )
    save_figure(figure, out / "branches.png")

    way, angles, allowed = path(robot, samples)
    steps = np.abs(np.diff(np.rad2deg(angles), axis=1))
    figures["largest step along the path [deg]"] = float(np.nanmax(steps))
    limits = np.stack([robot.limits.lower, robot.limits.upper])
    figure = plot_branch_path(
        way,
        angles,
        allowed,
        limits,
        axis_names=robot.axis_names,
        branch_names=BRANCHES,
        title="Branches along a straight path; dotted where a limit is broken",
    )
    save_figure(figure, out / "branch_path.png")
    return figures


def ranges(robot: ElasticRobot, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles of A2 and A3 over their limits [rad]."""
    lower, upper = np.asarray(robot.limits.lower), np.asarray(robot.limits.upper)
    return tuple(np.linspace(lower[k], upper[k], count) for k in (1, 2))


def wrist_centre(robot: ElasticRobot, second, third):
    """x and z of the wrist centre [m] for angles of A2 and A3, all others zero."""
    angles = jnp.zeros(robot.axes).at[1].set(second).at[2].set(third)
    frames = moving_frames(robot.chain, robot.from_maker(angles))
    return frames.position[robot.wrist][::2]


def sweep(robot: ElasticRobot, second, third) -> np.ndarray:
    """Wrist centres for all pairs of angles, shape (n, m, 2) [m]."""
    program = jax.jit(
        jax.vmap(jax.vmap(wrist_centre, (None, None, 0)), (None, 0, None))
    )
    return np.asarray(program(robot, jnp.asarray(second), jnp.asarray(third)))


def boundaries(robot: ElasticRobot, count: int) -> dict[str, np.ndarray]:
    """Curves that bound the reach: stretched, and the limits of A2 and A3."""
    second, third = ranges(robot, count)
    stretched = stretched_angle(robot)
    degrees = np.rad2deg
    return {
        f"stretched, A3 = {degrees(stretched):.2f}°": sweep(robot, second, [stretched])[
            :, 0
        ],
        f"folded, A3 = {degrees(third[-1]):.0f}°": sweep(robot, second, third[-1:])[
            :, 0
        ],
        f"folded, A3 = {degrees(third[0]):.0f}°": sweep(robot, second, third[:1])[:, 0],
        f"A2 = {degrees(second[0]):.0f}°": sweep(robot, second[:1], third)[0],
        f"A2 = {degrees(second[-1]):.0f}°": sweep(robot, second[-1:], third)[0],
    }


def stretched_angle(robot: ElasticRobot) -> float:
    """A3 at which elbow and wrist centre are farthest apart from axis 2 [rad]."""
    position = np.asarray(moving_frames(robot.chain, jnp.zeros(robot.axes)).position)
    arm, fore = position[2] - position[1], position[robot.wrist] - position[2]
    # about y; the chain's axis 3 is that of KUKA
    return float(np.arctan2(fore[2], fore[0]) - np.arctan2(arm[2], arm[0]))


def downwards(robot: ElasticRobot):
    """Orientation of the tool pointing down, from that of the stretched arm."""
    zero = forward_kinematics(robot.chain, robot.from_maker(robot.poses["stretched"]))
    return rotation_y(jnp.array(np.pi / 2)) @ zero[:3, :3]


def within(robot: ElasticRobot, q):
    """Whether chain angles keep the limits."""
    angles = robot.to_maker(q)
    return jnp.all((angles >= robot.limits.lower) & (angles <= robot.limits.upper))


def dexterity(
    robot: ElasticRobot, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smallest singular value over tool positions, NaN where no branch is allowed."""
    arm = SphericalWrist.from_chain(robot.chain)
    rotation = downwards(robot)
    rows = jnp.array([1 / LENGTH] * 3 + [1.0] * 3)

    def smallest(q):
        scaled = rows[:, None] * jacobian(robot.chain, q)
        return jnp.linalg.svd(scaled, compute_uv=False)[-1]

    def best(x, z):
        target = transform(rotation, jnp.stack([x, jnp.zeros_like(x), z]))
        solutions, valid = inverse_kinematics(arm, target)
        allowed = valid & jax.vmap(within, (None, 0))(robot, solutions)
        value = jnp.where(allowed, jax.vmap(smallest)(solutions), -1.0)
        return jnp.max(value)

    x = np.linspace(-2.9, 2.9, count)
    z = np.linspace(-1.5, 2.3, max(2, round(count * 3.8 / 5.8)))
    program = jax.jit(jax.vmap(jax.vmap(best, (0, None)), (None, 0)))
    value = np.asarray(program(jnp.asarray(x), jnp.asarray(z)))
    return x, z, np.where(value >= 0, value, np.nan)


def stick(robot: ElasticRobot, angles) -> np.ndarray:
    """Points along the arm, from the floor to the tool, shape (k, 3) [m]."""
    q = robot.from_maker(jnp.asarray(angles))
    frames = moving_frames(robot.chain, q)
    position = np.asarray(frames.position)
    axis = np.asarray(frames.axis)[0]
    # the shoulder stands on axis 1 at the height of axis 2
    foot = position[0] - axis * position[0][2] / axis[2]
    shoulder = position[0] + axis * (axis @ (position[1] - position[0]))
    return np.stack(
        [foot, shoulder, position[1], position[2], position[3], position[robot.wrist],
         np.asarray(frames.tool_position)]
    )  # fmt: skip


def branches(robot: ElasticRobot):
    """Sticks, axis 5, KUKA's angles and permission of the branches of one pose."""
    arm = SphericalWrist.from_chain(robot.chain)
    # low, to the side, tool down and turned: all eight branches reach it
    rotation = rotation_z(jnp.array(0.5)) @ downwards(robot)
    pose = transform(rotation, jnp.array([0.95, 0.6, 0.7]))
    solutions, valid = jax.jit(inverse_kinematics)(arm, pose)
    if not np.all(valid):
        raise ValueError("the pose must be within reach of all branches")
    allowed = np.asarray(jax.vmap(within, (None, 0))(robot, solutions))
    angles = np.asarray(jax.vmap(robot.to_maker)(solutions))
    points = np.stack([stick(robot, row) for row in angles])
    axes = jax.jit(jax.vmap(lambda q: moving_frames(robot.chain, q).axis[4]))
    return points, np.asarray(axes(solutions)), angles, allowed


def path(robot: ElasticRobot, count: int):
    """Way, KUKA's angles and permission of every branch along a straight line."""
    arm = SphericalWrist.from_chain(robot.chain)
    start, end = np.array([1.5, -1.0, 0.9]), np.array([1.2, 1.2, 1.3])
    share = np.linspace(0.0, 1.0, count)[:, None]
    positions = start + share * (end - start)
    tilted = rotation_x(jnp.array(0.5)) @ rotation_y(jnp.array(-0.3))
    rotation = tilted @ downwards(robot)
    poses = jax.vmap(transform, (None, 0))(rotation, jnp.asarray(positions))
    first, _ = inverse_kinematics(arm, poses[0])
    follow = jax.jit(jax.vmap(inverse_kinematics_path, (None, None, 0)))
    q, reached = follow(arm, poses, first)
    allowed = jax.vmap(jax.vmap(within, (None, 0)), (None, 0))(robot, q) & reached
    angles = np.asarray(jax.vmap(jax.vmap(robot.to_maker))(q))
    angles = np.where(np.asarray(reached)[..., None], angles, np.nan)
    way = share[:, 0] * np.linalg.norm(end - start)
    return way, angles, np.asarray(allowed)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder")
    parser.add_argument("--samples", type=int, default=240, help="per direction")
    options = parser.parse_args()
    for label, number in main(options.out, options.samples).items():
        print(f"{label:45}{number:.4f}")
