"""Rotational.Examples.LossyGearDemo1 and 2: a gear of efficiency one half that sticks.

Modelica Standard Library 4.1.0, Modelica.Mechanics.Rotational.Examples, whose
parameters these are: inertias 1 and 1.5 kg m^2, ratio 2, both efficiencies 0.5, a
sinusoidal drive and a slowly falling load; in the second example a bearing with 0.5 to
1 N m beside the gear. Of two elements that stick on one shaft the torques are not
unique, as the library says itself; which of them counts as moving was read from the
reference at both stops (the bearing pushes on forwards), and so was that a flag is
dropped in a step of its own; the motion and all times follow from the laws.
"""

import pathlib
import sys

import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import ExactEfficiency, FrictionContact
from elastax.dynamics import AbstractSwitchingSystem, simulate_switching


sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import _reference as reference


EDGE = 1e-12  # rad/s, a shaft that has turned back
RATIO, J1, J2 = 2.0, 1.0, 1.5  # -, kg m^2


class LossyTrain(AbstractSwitchingSystem):
    """State: angle and speed of the first shaft.

    Modes: direction in which the bearing pushes; whether it merely starts to (its own
    mode is 0 then); mode of the gear.
    """

    gear: ExactEfficiency
    bearing: FrictionContact

    def drive(self, t):
        """Torques on the two inertias."""
        return 10.0 * jnp.sin(2 * jnp.pi * t), -10.0 + 2.5 * t

    def rates(self, t, x, mode):
        push, starting, direction = mode
        moving = (direction != 0) & (push != 0)
        tau1, tau2 = self.drive(t)
        held = self.bearing.torque(x[1], direction, jnp.ones(()))

        def excess(a):  # piecewise linear and increasing in the acceleration
            load = (J2 * a / RATIO - tau2) / RATIO
            return J1 * a + held + self.gear.drive_torque(load, x[1], direction) - tau1

        a = jnp.zeros(())
        for _ in range(3):  # Newton's steps end on the right one of two pieces
            value, slope = jax.jvp(excess, (a,), (jnp.ones(()),))
            a = a - value / slope
        return jnp.where(moving, jnp.stack([x[1], a]), jnp.zeros(2))

    def guards(self, t, x, mode):
        push, _, direction = mode
        tau1, tau2 = self.drive(t)
        one = jnp.ones(())
        load, zero = -tau2 / RATIO, jnp.zeros(())
        forwards = self.gear.drive_torque(load, zero, one)
        backwards = self.gear.drive_torque(load, zero, -one)
        offered = tau1 - self.bearing.breakaway(push, one)
        stuck = jnp.stack([forwards - offered, offered - backwards])
        moving = jnp.stack([direction * x[1] + EDGE, one])
        # the gear is free to roll back, and the bearing holds it
        start = self.bearing.breakaway(-one, one)
        held = jnp.stack([tau1 - start - backwards, one])
        rolling = jnp.where(push == 0, held, moving)
        return jnp.where(direction == 0, stuck, rolling)

    def switched(self, t, x, mode, hit):
        push, starting, direction = mode
        away = jnp.where(hit[0], 1.0, -1.0)
        # a stuck gear starts: with the bearing if that pushes the same way
        along = away == push
        started = jnp.stack([jnp.where(along, push, 0.0), 0.0 * push, away])
        # a moving one stops: the bearing pushes forwards from then on
        stopped = jnp.stack(
            [jnp.ones(()), jnp.where(direction > 0, 1.0, 0.0), jnp.zeros(())]
        )
        rolling = jnp.where(push == 0, jnp.array([-1.0, 0.0, -1.0]), stopped)
        return x.at[1].set(0.0), jnp.where(direction == 0, started, rolling)

    def accepted(self, t, x, mode):
        return x


def discrete(result, start, with_bearing: bool) -> list[tuple[float, tuple]]:
    """Signals of the reference from the event log: mode and flags of the bearing, gear.

    Where a flag is dropped just after the gear starts the library needs an event of its
    own; ours is one.
    """

    def signals(push, starting, direction):
        shown = 0 if starting else push
        flags = (int(starting and push < 0), int(starting and push > 0))
        return (int(shown), *flags, int(direction)) if with_bearing else (direction,)

    count = int(result.events)
    log = [(0.0, tuple(int(v) for v in start))]
    modes = np.asarray(result.event_modes)[:count].astype(int)
    log += [
        (float(t), tuple(int(v) for v in mode))
        for t, mode in zip(np.asarray(result.event_times), modes)
    ]
    found = [(0.0, signals(*log[0][1]))]
    for (_, before), (t, mode) in zip(log, log[1:]):
        if with_bearing and before[1] and mode[0] == 0:
            found.append((t, signals(before[0], before[1], mode[2])))
        found.append((t, signals(*mode)))
    return [e for k, e in enumerate(found) if k == 0 or e[1] != found[k - 1][1]]


def demo(number: int, data: pathlib.Path | None):
    """One example: deviations, and what to draw."""
    theirs = reference.load(data, f"Rotational_LossyGearDemo{number}")
    times, index = reference.grid(theirs["time"])
    with_bearing = number == 2
    table = (np.array([0.0, 1.0]), np.array([0.5, 1.0]))
    bearing = FrictionContact(*table) if with_bearing else FrictionContact([0.0], [0.0])
    train = LossyTrain(ExactEfficiency(0.5, 0.5), bearing)
    start = jnp.array([-1.0, 1.0, 0.0])
    run = jax.jit(
        lambda x0: simulate_switching(
            train, x0, start, jnp.asarray(times), step=1e-3, rtol=1e-9, atol=1e-14
        )
    )
    result = run(jnp.zeros(2))
    x = np.asarray(result.x)[index].T / RATIO
    ours = {"Inertia2.phi": x[0], "Inertia2.w": x[1]}
    figures = {name: reference.deviation(ours[name], theirs[name]) for name in ours}
    flags = [f"bearingFriction.{n}" for n in ("mode", "startBackward", "startForward")]
    names = [*flags, "gear.mode"] if with_bearing else ["gear.mode"]
    expected = reference.changes(theirs["time"], [theirs[name] for name in names])
    events = discrete(result, start, with_bearing)
    figures["switching times"] = reference.switching_error(events, expected)
    shown = {
        name: tuple([(t, (v[k],)) for t, v in log] for log in (expected, events))
        for k, name in enumerate(names)
        if name.endswith("mode")
    }
    panels = [
        ("angle [rad]", {"Inertia2.phi": (theirs["Inertia2.phi"], x[0])}),
        ("speed [rad/s]", {"Inertia2.w": (theirs["Inertia2.w"], x[1])}),
        ("mode [-]", shown),
    ]
    return figures, panels, theirs["time"]


def main(
    path: pathlib.Path | None = None, data: pathlib.Path | None = None
) -> dict[str, float]:
    """Deviations over the range of each signal, and of the switching times [s].

    Args:
        path: folder of the figures; none are drawn without.
        data: folder that holds `modelica_reference`.
    """
    everything = {}
    print(f"{'signal':<26} {'deviation':>10}")
    for number in (1, 2):
        figures, panels, times = demo(number, data)
        for name, value in figures.items():
            unit = " s" if name == "switching times" else ""
            print(f"Demo{number} {name:<20} {value:10.2e}{unit}")
            everything[f"Demo{number} {name}"] = value
        if path is not None:
            path.mkdir(parents=True, exist_ok=True)
            reference.draw(
                path / f"lossy_gear_demo{number}.png",
                f"Rotational.Examples.LossyGearDemo{number}",
                panels,
                times,
                float(times[-1]),
            )
    return everything


if __name__ == "__main__":
    reference.command_line(main, __doc__)
