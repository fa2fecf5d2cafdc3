"""Friction, counterbalance and springs in the equations of motion."""

import functools

import jax
import jax.numpy as jnp
from elastax._taylor import from_derivatives
from elastax.dynamics import dissipated_power, inverse_dynamics

from tests import systems
from tests.helpers import assert_close


def _pair():
    """The same arm with and without damping of the counterbalance's rod."""
    arm = lambda damping: systems.elastic_2r(
        counterbalance=systems.spring_counterbalance(damping)
    )
    return arm(250.0), arm(0.0)


def test_rod_of_the_counterbalance_resists():
    damped, free = _pair()
    q, qd = jnp.array([0.4, -0.7]), jnp.array([1.3, 0.6])
    zero = jnp.zeros((2,))

    def torque(robot):
        return inverse_dynamics(robot, q, qd, zero)[0]

    def power(robot):
        return dissipated_power(robot, q, q, qd, zero, qd)

    more = systems.run(torque, damped) - systems.run(torque, free)
    # the rod's speed is that of its length
    length = free.counterbalance.length
    slope = jax.grad(length)(q[0])
    assert_close(more, [250.0 * slope**2 * qd[0], 0.0], rtol=1e-11, atol=1e-11)
    lost = systems.run(power, damped) - systems.run(power, free)
    assert_close(lost, 250.0 * (slope * qd[0]) ** 2, rtol=1e-11)


def test_rod_along_a_motion():
    """Series and nested `jvp` give the same rates of the damping."""
    damped, free = _pair()
    rows = jnp.array([[0.4, -0.7], [1.3, 0.6], [0.8, -0.9], [2.0, 1.5], [3.0, 1.0]])

    def position(t):
        return rows[0] + t * (
            rows[1] + t * (rows[2] / 2 + t * (rows[3] / 6 + t * rows[4] / 24))
        )

    def rod(t):
        q, qd = jax.jvp(position, (t,), (jnp.ones_like(t),))
        return -damped.counterbalance.damping_torque(q[0], qd[0])

    def by_jvp(t):
        rate = lambda f: lambda t: jax.jvp(f, (t,), (jnp.ones_like(t),))[1]
        return jnp.stack([rod(t), rate(rod)(t), rate(rate(rod))(t)])

    def by_series(robot):
        q = from_derivatives(rows)
        qd, qdd = q.rate(), q.rate().rate()
        tau, _ = inverse_dynamics(robot, q.truncated(2), qd.truncated(2), qdd)
        return tau.derivatives()[:, 0]

    route = functools.partial(systems.run, by_series)
    assert_close(
        route(damped) - route(free), systems.run(by_jvp, jnp.zeros(())), rtol=1e-9
    )
