"""Rotational.Examples.Friction: a drive train with a clutch and a brake.

Modelica Standard Library 4.1.0, Modelica.Mechanics.Rotational.Examples.Friction, whose
parameters these are. Motor and inertia 3, clutch (80 N m), inertia 2, spring and
damper, inertia 1 with a brake (800 N m) that closes at 0.5 s, when the motor is
switched off.
"""

import pathlib
import sys

import jax
import jax.numpy as jnp
import numpy as np
from elastax.drivetrain import FrictionContact
from elastax.dynamics import AbstractSwitchingSystem, simulate_switching


sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import _reference as reference


FREE = 2.0  # mode of a contact without a normal force
SWITCH = 0.5  # s, the brake closes and the motor stops
EDGE = 1e-9  # rad/s, a slip that has turned


class Train(AbstractSwitchingSystem):
    """State: angles and speeds of inertias 3, 2, 1; modes of clutch and brake."""

    clutch: FrictionContact
    brake: FrictionContact

    def forces(self, t, x, mode):
        """Torques on the inertias besides those of clutch and brake."""
        motor = jnp.where(mode[1] == FREE, 200.0 * jnp.sin(100.0 * t), 0.0)
        spring = 160.0 * (x[2] - x[1]) + 1.0 * (x[5] - x[4])
        return motor, spring, -spring

    def rates(self, t, x, mode):
        f3, f2, f1 = self.forces(t, x, mode)
        slip = x[4] - x[3]
        c = self.clutch.torque(slip, mode[0], jnp.asarray(160.0))
        together = (f3 + f2) / 1.05
        a3 = jnp.where(mode[0] == 0, together, f3 + c)
        a2 = jnp.where(mode[0] == 0, together, (f2 - c) / 0.05)
        held = self.brake.torque(x[5], mode[1], jnp.asarray(1600.0))
        sliding = jnp.where(mode[1] == FREE, f1, f1 - held)
        a1 = jnp.where(mode[1] == 0, 0.0, sliding)
        return jnp.concatenate([x[3:], jnp.stack([a3, a2, a1])])

    def guards(self, t, x, mode):
        f3, f2, f1 = self.forces(t, x, mode)
        one = jnp.ones(())
        # torque of the clutch on inertia 3 that keeps both together
        needed = (f2 - f3 / 1.0 * 0.05) / 1.05
        start = self.clutch.breakaway(one, jnp.asarray(160.0))
        still = mode[0] == 0
        clutch = jnp.where(
            still,
            jnp.stack([start - needed, start + needed]),
            jnp.stack([mode[0] * (x[4] - x[3]) + EDGE, one]),
        )
        start = self.brake.breakaway(one, jnp.asarray(1600.0))
        stuck = jnp.stack([start - f1, start + f1])
        moving = jnp.stack([mode[1] * x[5] + EDGE, one])
        brake = jnp.where(mode[1] == 0, stuck, moving)
        free = jnp.stack([SWITCH - t, one])
        return jnp.concatenate([clutch, jnp.where(mode[1] == FREE, free, brake)])

    def switched(self, t, x, mode, hit):
        def one(now, hits, speed):
            started = jnp.where(hits[0], 1.0, jnp.where(hits[1], -1.0, 0.0))
            closed = jnp.where(now == FREE, jnp.sign(speed), 0.0)
            after = jnp.where(now == 0.0, started, closed)
            return jnp.where(jnp.any(hits), after, now)

        clutch = one(mode[0], hit[:2], x[4] - x[3])
        brake = one(mode[1], hit[2:], x[5])
        stopped = (clutch == 0) & (mode[0] != 0)
        x = x.at[4].set(jnp.where(stopped, x[3], x[4]))
        x = x.at[5].set(jnp.where((brake == 0) & (mode[1] != 0), 0.0, x[5]))
        return x, jnp.stack([clutch, brake])

    def accepted(self, t, x, mode):
        return x


def discrete(result) -> list[tuple[float, tuple]]:
    """Modes and start flags in the order of the reference, from the event log.

    The library starts a motion in two steps: a flag while the contact still counts as
    stuck, then the mode; ours is one event.
    """

    def starting(before, after):
        """Mode shown and flags of a contact that starts to slide, if it does."""
        if before == 0 and after != 0:
            return 0, int(after < 0), int(after > 0)
        return int(after), 0, 0

    found = [(0.0, (2, 0, 0, -1, 0, 0))]
    before = (2, -1)
    count = int(result.events)
    modes = np.asarray(result.event_modes)[:count]
    for t, (clutch, brake) in zip(np.asarray(result.event_times), modes.astype(int)):
        first = (*starting(before[0], brake), *starting(before[1], clutch))
        settled = (int(brake), 0, 0, int(clutch), 0, 0)
        found += [(float(t), values) for values in dict.fromkeys((first, settled))]
        before = (int(brake), int(clutch))
    return found


def main(
    path: pathlib.Path | None = None, data: pathlib.Path | None = None
) -> dict[str, float]:
    """Deviations over the range of each signal, and of the switching times [s].

    Args:
        path: folder of the figure; none is drawn without.
        data: folder that holds `modelica_reference`.
    """
    theirs = reference.load(data, "Rotational_Friction")
    times, index = reference.grid(theirs["time"])
    contact = FrictionContact(np.zeros(1), np.array([0.5]))
    start = jnp.array([0.0, 0.0, 0.0, 100.0, 90.0, 90.0])
    run = jax.jit(
        lambda x0: simulate_switching(
            Train(contact, contact),
            x0,
            jnp.array([-1.0, FREE]),
            jnp.asarray(times),
            rtol=1e-9,
            atol=1e-10,
        )
    )
    result = run(start)
    x = np.asarray(result.x)[index].T
    ours = {
        "clutch.phi_rel": x[1] - x[0],
        "clutch.w_rel": x[4] - x[3],
        "inertia3.phi": x[0],
        "inertia3.w": x[3],
        "spring.phi_rel": x[2] - x[1],
        "spring.w_rel": x[5] - x[4],
    }
    figures = {name: reference.deviation(ours[name], theirs[name]) for name in ours}
    names = (
        "brake.mode",
        "brake.startBackward",
        "brake.startForward",
        "clutch.mode",
        "clutch.startBackward",
        "clutch.startForward",
    )
    expected = reference.changes(theirs["time"], [theirs[name] for name in names])
    events = discrete(result)
    figures["switching times"] = reference.switching_error(events, expected)
    print(f"{'signal':<18} {'deviation':>10}")
    for name, value in figures.items():
        print(f"{name:<18} {value:10.2e}{' s' if name == 'switching times' else ''}")
    if path is not None:
        pick = lambda log, k: [(t, (v[k],)) for t, v in log]
        panels = [
            ("speed [rad/s]", ["inertia3.w", "clutch.w_rel", "spring.w_rel"]),
            ("angle [rad]", ["spring.phi_rel"]),
        ]
        panels = [
            (label, {n: (theirs[n], ours[n]) for n in chosen})
            for label, chosen in panels
        ]
        modes = {n: (pick(expected, k), pick(events, k)) for n, k in
                 (("clutch.mode", 3), ("brake.mode", 0))}  # fmt: skip
        panels.append(("mode [-]", modes))
        path.mkdir(parents=True, exist_ok=True)
        reference.draw(
            path / "rotational_friction.png",
            "Rotational.Examples.Friction: clutch and brake",
            panels,
            theirs["time"],
            float(times[-1]),
        )
    return figures


if __name__ == "__main__":
    reference.command_line(main, __doc__)
