"""MultiBody.Examples.Systems.RobotR3.FullRobot: the Manutec r3 with all its drives.

Modelica Standard Library 4.1.0. Six axes with motors, current loops, cascades and dry
bearing friction, gears of axes 1 to 3 elastic, the others rigid (here very stiff),
along the synchronous point-to-point motion of KinematicPTP2.
"""

import pathlib
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from elastax.dynamics import (
    LoopState,
    MotorSetpoint,
    SwitchingLoop,
    simulate_switching,
    static_load,
)
from elastax.robots import manutec_r3_control, manutec_r3_plant


sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import _reference as reference


END = 1.8  # s


class SynchronousMove(eqx.Module):
    """All axes along one trapezoid of speed, which the slowest one bounds."""

    start: jax.Array
    change: jax.Array
    speed: jax.Array  # largest share of the way per second [1/s]
    acceleration: jax.Array  # [1/s^2]

    def __call__(self, t) -> MotorSetpoint:
        v, a = self.speed, self.acceleration
        ramp, cruise_end = v / a, 1.0 / v
        end = cruise_end + ramp
        rising = jnp.clip(t, 0.0, ramp)
        steady = jnp.clip(t - ramp, 0.0, cruise_end - ramp)
        falling = jnp.clip(t - cruise_end, 0.0, ramp)
        way = 0.5 * a * rising**2 + v * steady + v * falling - 0.5 * a * falling**2
        rate = a * (rising - falling)
        second = jnp.where(t < ramp, a, jnp.where(t < cruise_end, 0.0, -a))
        second = jnp.where((t < 0) | (t >= end), 0.0, second)
        change = self.change
        return MotorSetpoint(
            self.start + change * way, change * rate, change * second, 0.0 * change
        )


def path(robot) -> SynchronousMove:
    """The motion of the example, from the robot's poses and limits."""
    start, end = (robot.from_maker(robot.poses[name]) for name in ("start", "end"))
    change = end - start
    limits = robot.limits
    return SynchronousMove(
        start,
        change,
        jnp.min(limits.velocity / jnp.abs(change)),
        jnp.min(limits.acceleration / jnp.abs(change)),
    )


def first_state(robot, controller, setpoint) -> LoopState:
    """Joints at their start, gears wound up by gravity, currents that hold them."""
    q, none = setpoint.theta, jnp.zeros((0,))
    load, _ = static_load(robot, q, none)
    torsion = robot.drives.stiffness.torsion(-load)
    theta, still = q - torsion, jnp.zeros_like(q)
    # the motors of the rigid gears stand at the start as well
    memory = controller.steady_memory(setpoint, theta, load)
    return LoopState(
        q, none, theta, still, none, still, still[None][:0], still[:0], memory
    )


def simulated(times):
    """States, modes and setpoints of the example at the given times."""
    robot, controller = manutec_r3_plant(), manutec_r3_control()
    move = path(robot)
    start = first_state(robot, controller, move(jnp.zeros(())))
    loop = SwitchingLoop(robot, controller, move)
    run = eqx.filter_jit(
        lambda loop, x0: simulate_switching(
            loop,
            x0,
            jnp.zeros(6),
            jnp.asarray(times),
            step=4e-4,
            rtol=1e-7,
            atol=1e-9,
        )
    )
    return robot, controller, run(loop, start.vector())


def main(
    path: pathlib.Path | None = None, data: pathlib.Path | None = None
) -> dict[str, float]:
    """Largest differences of joint angles [rad], wind-up over its range, and more.

    Args:
        path: folder of the figure; none is drawn without.
        data: folder that holds `modelica_reference`.
    """
    theirs = reference.load(data, "RobotR3_FullRobot")
    within = theirs["time"] <= END
    theirs = {name: values[within] for name, values in theirs.items()}
    times, index = reference.grid(theirs["time"])
    robot, controller, result = simulated(times)
    x = np.asarray(result.x)[index]
    ratio = np.asarray(robot.drives.ratio)
    q, theta = x[:, :6], x[:, 6:12]
    memory = x[:, 24:].reshape(-1, 3, 6)
    ours = {}
    for k in range(6):
        ours[f"mechanics.r{k + 1}.phi"] = q[:, k]
        ours[f"axis{k + 1}.motor.La.i"] = memory[:, 2, k]
        if k < 3:
            wind_up = (q[:, k] - theta[:, k]) * ratio[k]
            ours[f"axis{k + 1}.gear.spring.phi_rel"] = wind_up
    figures = {}
    for name, values in ours.items():
        if name.endswith(".phi"):
            figures[name] = float(np.max(np.abs(values - theirs[name])))
        else:
            figures[name] = reference.deviation(values, theirs[name])
    print(f"{'signal':<28} {'deviation':>10}   joint angles [rad], others over range")
    for name, value in figures.items():
        print(f"{name:<28} {value:10.2e}")
    # the friction of axes 1 to 3 is on the motor side in the source
    sides = np.where(np.arange(6) < 3, np.sign(ratio), 1.0)
    modes = sides * np.asarray(result.mode)[index]
    agree = [
        float(np.mean(modes[:, k] == theirs[f"axis{k + 1}.gear.bearingFriction.mode"]))
        for k in range(6)
    ]
    figures["modes agree"] = min(agree)
    print(f"share of samples with equal friction mode, axes 1 to 6: {agree}")
    if path is not None:
        pick = lambda names: {name: (theirs[name], ours[name]) for name in names}
        panels = [
            ("angle [rad]", pick([f"mechanics.r{k}.phi" for k in range(1, 7)])),
            (
                "wind-up [rad]",
                pick([f"axis{k}.gear.spring.phi_rel" for k in (1, 2, 3)]),
            ),
            ("current 1-3 [A]", pick([f"axis{k}.motor.La.i" for k in (1, 2, 3)])),
            ("current 4-6 [A]", pick([f"axis{k}.motor.La.i" for k in (4, 5, 6)])),
        ]
        path.mkdir(parents=True, exist_ok=True)
        reference.draw(
            path / "robot_r3.png",
            "RobotR3.FullRobot: Manutec r3",
            panels,
            theirs["time"],
            END,
        )
    return figures


if __name__ == "__main__":
    reference.command_line(main, __doc__)
