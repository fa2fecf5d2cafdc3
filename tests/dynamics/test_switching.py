"""Simulation from event to event: closed forms, counts, energy, bounds."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import ExactEfficiency, FrictionContact, StickSlipFriction
from elastax.dynamics import AbstractSwitchingSystem, simulate_switching

from tests.helpers import assert_close


class Block(AbstractSwitchingSystem):
    """Mass of 1 kg on a belt, on a spring, under a force, with dry friction.

    State: place and speed; mode: direction of sliding over the belt, 0 sticking to it.
    """

    friction: StickSlipFriction
    spring: jax.Array
    belt: jax.Array
    ramp: jax.Array  # rate of the force

    def force(self, t, x):
        return self.ramp * t - self.spring * x[0]

    def rates(self, t, x, mode):
        (m,) = mode
        slip = x[1] - self.belt
        a = self.force(t, x) - self.friction.torque(slip, m)
        return jnp.stack([x[1], jnp.where(m == 0, 0.0, a)])

    def guards(self, t, x, mode):
        (m,) = mode
        one, force = jnp.ones(()), self.force(t, x)
        start = self.friction.breakaway(one)
        still = jnp.stack([start - force, force + start])
        moving = jnp.stack([m * (x[1] - self.belt) + 1e-12, one])
        return jnp.where(m == 0, still, moving)

    def switched(self, t, x, mode, hit):
        stuck = mode[0] == 0
        started = jnp.where(hit[0], 1.0, -1.0)
        x = x.at[1].set(self.belt)
        return x, jnp.where(stuck, started, 0.0)[None]

    def accepted(self, t, x, mode):
        return x


def block(coulomb=2.0, peak=1.0, viscous=0.0, spring=0.0, belt=0.0, ramp=0.0):
    real = lambda value: jnp.asarray(float(value))
    friction = StickSlipFriction(real(viscous), real(coulomb), real(peak))
    return Block(friction, real(spring), real(belt), real(ramp))


@functools.partial(jax.jit, static_argnames=("max_events", "throw"))
def run(system, start, mode, times, max_events=40, throw=True):
    return simulate_switching(
        system,
        start,
        mode,
        times,
        rtol=1e-9,
        atol=1e-12,
        max_events=max_events,
        throw=throw,
    )


TIMES = jnp.linspace(0.0, 3.0, 61)


def test_coulomb_friction_stops_a_block():
    """Stopping time v / mu, distance v^2 / (2 mu), then exactly at rest."""
    result = run(block(), jnp.array([0.0, 3.0]), jnp.array([1.0]), TIMES)
    assert int(result.events) == 1
    assert_close(result.event_times[0], 1.5, rtol=1e-9)
    assert_close(result.x[-1, 0], 2.25, rtol=1e-9)
    after = np.asarray(result.times) > 1.5
    assert np.all(np.asarray(result.x)[after, 1] == 0.0)
    assert np.all(np.asarray(result.mode)[after] == 0.0)


def test_ramp_breaks_away_at_the_peak():
    """Sticking to the peak, then a motion under what is left, ramp - level."""
    result = run(block(peak=1.3, ramp=2.0), jnp.zeros(2), jnp.zeros(1), TIMES)
    assert int(result.events) == 1
    assert_close(result.event_times[0], 1.3, rtol=1e-12)
    s = float(TIMES[-1]) - 1.3
    assert_close(result.x[-1, 1], 0.6 * s + s**2, rtol=1e-9)


def test_stick_slip_on_a_belt():
    """Period of the closed form: sticking time plus the slip of a harmonic motion."""
    mu, peak, k, v = 2.0, 1.5, 9.0, 0.4
    system = block(coulomb=mu, peak=peak, spring=k, belt=v)
    times = jnp.linspace(0.0, 12.0, 241)
    result = run(system, jnp.array([0.0, v]), jnp.zeros(1), times)
    starts = np.asarray(result.event_times)[: int(result.events)][::2]
    w = np.sqrt(k)
    # slides from the peak about the level, with the belt's speed at start and end
    swing = (peak - 1) * mu / k
    slide = 2 * (np.pi - np.arctan2(swing * w, v)) / w
    stick = 2 * swing / v
    assert len(starts) > 5
    assert_close(np.diff(starts), np.full(len(starts) - 1, slide + stick), rtol=1e-7)


def test_energy_is_never_made():
    system = block(coulomb=2.5, viscous=0.1, spring=20.0)
    result = run(system, jnp.array([1.0, 0.0]), jnp.array([-1.0]), TIMES)
    x = np.asarray(result.x)
    energy = 0.5 * x[:, 1] ** 2 + 10.0 * x[:, 0] ** 2
    assert np.all(np.diff(energy) < 1e-9)
    assert np.all(x[-1:, 1] == 0.0) and int(result.events) > 3
    # where it ends, the spring is held
    assert abs(20.0 * x[-1, 0]) <= 2.5


class Clutch(AbstractSwitchingSystem):
    """Two free shafts, joined by a clutch: speeds; 1 or -1 sliding, 0 joined."""

    contact: FrictionContact

    def rates(self, t, x, mode):
        torque = self.contact.torque(x[1] - x[0], mode[0], jnp.asarray(50.0))
        return jnp.where(mode[0] == 0, 0.0, torque * jnp.array([1 / 2.0, -1 / 0.5]))

    def guards(self, t, x, mode):
        return (mode[0] * (x[1] - x[0]) + 1e-12 + 0.0 * t)[None]

    def switched(self, t, x, mode, hit):
        return x, jnp.zeros(1)

    def accepted(self, t, x, mode):
        return x


def test_clutch_synchronises():
    """Time of the slip over the torque and both inertias; momentum is kept."""
    clutch = Clutch(FrictionContact([0.0], [0.4], 0.1, 1.0))
    start = jnp.array([10.0, 90.0])
    result = run(clutch, start, jnp.array([1.0]), jnp.linspace(0.0, 30.0, 61))
    torque = 0.4 * 0.1 * 50.0
    assert int(result.events) == 1
    assert_close(result.event_times[0], 80.0 / (torque * (0.5 + 2.0)), rtol=1e-9)
    together = (2.0 * 10.0 + 0.5 * 90.0) / 2.5
    assert_close(result.x[-1], [together, together], rtol=1e-9)


def test_batch_is_the_loop():
    speeds = jnp.array([0.5, 1.0, 3.0])
    starts = jnp.stack([0.0 * speeds, speeds], axis=1)
    one = lambda start: run(block(spring=4.0), start, jnp.array([1.0]), TIMES)
    batch = jax.vmap(one)(starts)
    for k, start in enumerate(starts):
        single = one(start)
        assert int(batch.events[k]) == int(single.events)
        assert_close(batch.x[k], single.x, rtol=1e-12, atol=1e-13)


def test_wrong_mode_switches_at_once():
    """A block that slides is told to stick: the guard is negative from the start."""
    result = run(block(ramp=5.0), jnp.array([0.0, 0.0]), jnp.array([-1.0]), TIMES)
    assert int(result.events) == 2 and float(result.event_times[0]) < 1e-6


def test_too_many_events_end_the_simulation():
    system = block(coulomb=2.0, peak=1.5, spring=9.0, belt=0.4)
    start, mode = jnp.array([0.0, 0.4]), jnp.zeros(1)
    times = jnp.linspace(0.0, 12.0, 241)
    result = run(system, start, mode, times, max_events=3, throw=False)
    assert not bool(result.completed) and int(result.events) == 3
    with pytest.raises(Exception, match="ended early"):
        jax.block_until_ready(run(system, start, mode, times, max_events=3))


def test_friction_contact():
    contact = FrictionContact([0.0, 10.0], [0.5, 0.3], 0.2, 1.2)
    one, force = jnp.ones(()), jnp.asarray(100.0)
    assert_close(contact.torque(jnp.asarray(-5.0), -one, force), -8.0, rtol=1e-14)
    assert_close(contact.breakaway(one, force), 12.0, rtol=1e-14)
    assert float(contact.torque(one, one, -force)) == 0.0


def test_exact_efficiency_in_all_quadrants():
    mesh = ExactEfficiency(0.9, 0.8)
    load, direction = jnp.array([10.0, -10.0, 10.0, -10.0]), jnp.array([1, 1, -1, -1.0])
    drive = mesh.drive_torque(load, 0.0 * load, direction)
    assert_close(drive, [10 / 0.9, -8.0, 8.0, -10 / 0.9], rtol=1e-14)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: StickSlipFriction(-1.0, 1.0, 1.0), "`viscous` must not be negative"),
        (lambda: StickSlipFriction(1.0, 1.0, 0.9), "`peak` must be at least 1"),
        (lambda: ExactEfficiency(1.2, 0.9), "`driving` must be above zero"),
        (lambda: ExactEfficiency(0.9, 0.0), "`driven` must be above zero"),
        (lambda: FrictionContact([1.0, 2.0], [1.0, 1.0]), "must increase from zero"),
        (lambda: FrictionContact([0.0], [-1.0]), "`coefficients` must not be"),
    ],
)
def test_refusals(build, words):
    with pytest.raises(ValueError, match=words):
        build()
