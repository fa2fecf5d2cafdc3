"""Point-to-point motions: limits, shortest time, degenerate cases."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
from elastax.trajectory import PointToPoint

from tests.helpers import assert_close, assert_gradient


# Distance and limits of one axis, with the closed form of the shortest time.
CASES = {
    "all seven": ((2.0, 1.0, 2.0, 10.0), 2 / 1 + 1 / 2 + 2 / 10),
    "no constant acceleration": ((2.0, 1.0, 2.0, 2.0), 2 / 1 + 2 * (1 / 2) ** 0.5),
    "no cruise": ((1.0, 9.0, 2.0, 10.0), 0.2 + (0.04 + 4 / 2) ** 0.5),
    "jerk only": ((0.5, 9.0, 9.0, 2.0), 4 * (0.5 / 4) ** (1 / 3)),
    "long": ((1e8, 1.0, 2.0, 10.0), 1e8 / 1 + 1 / 2 + 2 / 10),
    "short": ((1e-9, 1.0, 2.0, 10.0), 4 * (1e-9 / 20) ** (1 / 3)),
}
# Speed, acceleration and jerk limits: duration over the distance 1.3.
RUCKIG = {
    (0.5, 1.0, 4.0): 3.3500000000000005,
    (0.5, 1.0, 500.0): 3.1019999999999994,
    (0.5, 20.0, 4.0): 3.307106781186548,
    (0.5, 20.0, 500.0): 2.663245553203368,
    (3.0, 1.0, 4.0): 2.5440139493908926,
    (3.0, 1.0, 500.0): 2.2823517272561267,
    (3.0, 20.0, 4.0): 2.182785766122212,
    (3.0, 20.0, 500.0): 0.6233333333333334,
}
each_case = pytest.mark.parametrize("case", CASES)
NAMES = ("velocity", "acceleration", "jerk")


def one_axis(distance, *limits):
    return PointToPoint([0.0], [distance], *([limit] for limit in limits))


def three_axes(end=(0.6, -1.5, 0.05)):
    return PointToPoint(
        [0.3, 0.2, -0.1], end, [2.0, 1.5, 3.0], [8.0, 9.0, 0.4], [90.0, 120.0, 150.0]
    )


# The motion is an argument, so that all cases share one compilation.
@eqx.filter_jit
def follow(motion, t):
    """What the motion does at the times `t`."""
    names = ("position", *NAMES)
    return {name: jax.vmap(getattr(motion, name))(t) for name in names}


@eqx.filter_jit
def slopes(motion, t):
    """Time derivatives of position, velocity and acceleration by autodiff."""
    names = ("position", *NAMES[:2])
    return {name: jax.vmap(jax.jacfwd(getattr(motion, name)))(t) for name in names}


def along(motion, count=801):
    """Times over the motion and what the motion does at them."""
    t = np.linspace(0.0, 1.0, count) * float(motion.duration)
    return t, jax.tree.map(np.asarray, follow(motion, t))


@each_case
def test_duration_closed_form(case):
    arguments, duration = CASES[case]
    assert_close(one_axis(*arguments).duration, duration, rtol=1e-14)


def farthest(duration, velocity, acceleration, jerk, count=120):
    """Largest rest-to-rest distance within `duration`, by linear programming.

    The jerk is constant on `count` intervals, limits hold at their ends.
    """
    dt = duration / count
    step = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    inlet = np.array([dt**3 / 6, dt**2 / 2, dt])
    rows, current = [], np.zeros((3, count))
    for k in range(count):
        current = step @ current
        current[:, k] += inlet
        rows.append(current)
    position, speed, force = np.stack(rows, axis=1)
    result = scipy.optimize.linprog(
        -position[-1] / jerk,
        A_ub=np.concatenate([speed, -speed, force, -force]) / acceleration,
        b_ub=np.repeat([velocity, acceleration], 2 * count) / acceleration,
        A_eq=np.stack([speed[-1], force[-1]]) / acceleration,
        b_eq=np.zeros(2),
        bounds=(-jerk, jerk),
    )
    assert result.status == 0
    return -result.fun * jerk


@pytest.mark.parametrize("case", list(CASES)[:4])
def test_duration_is_minimal(case):
    """No motion within these limits gets farther in the same time."""
    (distance, *limits), _ = CASES[case]
    reached = farthest(float(one_axis(distance, *limits).duration), *limits)
    # Between the ends of the intervals the program may exceed a limit, and it may
    # miss the best switching times, both by a fraction of one interval in 120.
    assert abs(reached / distance - 1) < 2e-3


def test_against_ruckig():
    """Durations by Ruckig 0.19.4, another algorithm."""
    limits = np.array(list(RUCKIG))
    ours = jax.vmap(lambda row: one_axis(jnp.asarray(1.3), *row).duration)(limits)
    assert_close(ours, np.array(list(RUCKIG.values())), rtol=1e-13)


@each_case
def test_limits_hold_and_are_touched(case):
    (distance, *limits), _ = CASES[case]
    _, rows = along(one_axis(distance, *limits))
    peaks = np.array([np.max(np.abs(rows[name])) for name in NAMES]) / limits
    assert np.all(peaks < 1 + 1e-12)
    # Time-minimal: the jerk is always at its limit, and the speed while cruising.
    assert_close(peaks[2], 1.0, rtol=1e-12)
    touched = {"all seven": [0, 1], "no constant acceleration": [0], "no cruise": [1]}
    for k in touched.get(case, []):
        assert peaks[k] > 1 - 1e-3, NAMES[k]


def test_axes_are_synchronous():
    motion = three_axes()
    t, rows = along(motion)
    start, end = np.asarray(motion.start), np.asarray(motion.end)
    ratio = (rows["position"] - start) / (end - start)
    assert_close(ratio, np.repeat(ratio[:, :1], 3, axis=1), rtol=0.0, atol=1e-14)
    limits = (motion.max_velocity, motion.max_acceleration, motion.max_jerk)
    use = [
        np.max(np.abs(rows[name]), axis=0) / np.asarray(limit)
        for name, limit in zip(NAMES, limits, strict=True)
    ]
    assert np.max(use) < 1 + 1e-12
    # Another axis sets each of the limits: the slow, the weak and the far one.
    assert [int(np.argmax(row)) for row in use] == [1, 2, 1]
    alone = [
        one_axis(*(float(leaf[k]) for leaf in (motion.end - motion.start, *limits)))
        for k in range(3)
    ]
    slowest = max(float(single.duration) for single in alone)
    assert motion.duration > slowest * (1 - 1e-12)


@each_case
def test_derivatives_are_consistent(case):
    arguments, _ = CASES[case]
    motion = one_axis(*arguments)
    # Irrational places, so that no switching time is met.
    t = np.sqrt(np.arange(1.0, 40.0) / 41.0) * float(motion.duration)
    actual, desired = slopes(motion, t), follow(motion, t)
    lowers = ("position", *NAMES[:2])
    for lower, upper, limit in zip(lowers, NAMES, arguments[1:], strict=True):
        miss = (actual[lower] - desired[upper]) / limit
        assert_close(miss, np.zeros_like(miss), rtol=0.0, atol=1e-12)


@each_case
def test_rest_before_and_after(case):
    (distance, *limits), _ = CASES[case]
    motion = PointToPoint([0.3], [0.3 + distance], *([limit] for limit in limits))
    duration = float(motion.duration)
    t = duration * np.array([-1.0, 0.0, 0.5, 1.0, 2.0])
    rows = follow(motion, t)
    for k, place in [(0, motion.start), (1, motion.start), (3, motion.end)]:
        assert_close(rows["position"][k], place, rtol=0.0)
    assert_close(rows["position"][4], motion.end, rtol=0.0)
    resting = rows["velocity"][np.array([0, 1, 3, 4])]
    assert_close(resting, np.zeros((4, 1)), rtol=0.0, atol=1e-14)
    assert_close(rows["position"][2], (motion.start + motion.end) / 2, rtol=1e-12)


def test_no_move():
    rest = jnp.array([0.3, 0.2, -0.1])
    motion = three_axes(rest)
    assert_close(motion.duration, 0.0, rtol=0.0)
    rows = follow(motion, np.array([-1.0, 0.0, 1.0]))
    assert_close(rows["position"], np.tile(rest, (3, 1)), rtol=0.0)
    for name in NAMES:
        assert_close(rows[name], np.zeros((3, 3)), rtol=0.0)
    build = lambda size: three_axes(rest + size * jnp.array([0.5, 0.0, 1.0])).duration
    slope = jax.jit(jax.vmap(jax.grad(build)))
    assert np.all(np.isfinite(slope(jnp.array([0.0, 1e-300, 1e-80, 1e-12]))))


@pytest.mark.slow
def test_jit_vmap_loop():
    """All kinds of motion in one batch: zero, short, middle, long."""
    scale = jnp.array([0.0, 1e-4, 0.05, 1.0, 20.0])
    start = jnp.zeros((5, 3))
    end = scale[:, None] * jnp.array([[1.0, -0.5, 0.2]])
    limits = [jnp.array([2.0, 1.5, 3.0]), jnp.full(3, 8.0), jnp.full(3, 90.0)]

    def run(start, end):
        motion = PointToPoint(start, end, *limits)
        t = jnp.array([0.2, 0.7]) * motion.duration
        return motion.duration, jax.vmap(motion.position)(t), motion.jerk(t[0])

    loop = [run(*ends) for ends in zip(start, end, strict=True)]
    loop = jax.tree.map(lambda *leaves: jnp.stack(leaves), *loop)
    mapped = jax.jit(jax.vmap(run))(start, end)
    assert_close(mapped, loop, rtol=1e-13, atol=1e-300)


@pytest.mark.slow
def test_gradient():
    motion = three_axes()
    assert_gradient(lambda m: m.duration, motion, order=2)
    run = lambda m, t: (m.position(t), m.velocity(t))
    assert_gradient(run, motion, 0.37 * motion.duration)
    slope = eqx.filter_grad(lambda m: m.duration)(one_axis(2.0, 1.0, 2.0, 10.0))
    assert_close(slope.end, jnp.array([1.0]), rtol=1e-13)


def test_refusals():
    good = [0.0, 0.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0]
    names = ("start", "end", "max_velocity", "max_acceleration", "max_jerk")
    for k, name in enumerate(names):
        for bad in (np.nan, 0.0, -1.0, np.inf)[: 1 if k < 2 else 4]:
            spoilt = [*good[:k], [1.0, bad], *good[k + 1 :]]
            with pytest.raises(ValueError, match=f"`{name}` must be"):
                PointToPoint(*spoilt)
    with pytest.raises(ValueError, match="`end`.* must have the shape"):
        PointToPoint(good[0], [1.0], *good[2:])
    with pytest.raises(ValueError, match="`max_velocity`.* must have the shape"):
        PointToPoint(*good[:2], 1.0, *good[3:])
