"""Fit of gears with memory: springs that slip or creep, from torque along a motion."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import (
    DelayedPlay,
    HysteresisBranch,
    PadeDelay,
    RateIndependentPlay,
    RelaxationBranch,
    StopBranch,
)
from elastax.identification import fit_law
from elastax.structure import CubicStiffness

from tests.drivetrain.hysteresis.motion import follow
from tests.helpers import assert_close


SPRING = CubicStiffness(jnp.array([2e5]), jnp.array([4e4]))
END = jnp.array([0.75])  # of the motion [s]
STEPS = 1500

rate_independent = lambda r, s=1e4: RateIndependentPlay(
    r[:, None], jnp.array([s]), jnp.array([1e-4])
)
delayed = lambda r, s=1e4: DelayedPlay(
    r[:, None], jnp.array([s]), PadeDelay(jnp.array(2e-3), 3)
)


def motion(t):
    """Torsion of 3 to 10 mrad at 4 Hz."""
    amplitude = 1e-2 * (0.65 + 0.35 * jnp.cos(4.0 * t))
    return jnp.array([amplitude * jnp.sin(8.0 * jnp.pi * t)])


def torque(branch, end):
    """Torque of the branch along the motion."""
    x, memory = follow(branch, motion, end, STEPS)
    return jax.vmap(lambda x, memory: branch.torque(SPRING, x, memory))(x, memory)


THRESHOLDS = jnp.array([1e-3, 2.5e-3])
SPRINGS = jnp.array([[2e4], [1.5e4]])
WEIGHTS = jnp.array([[-0.2], [-0.1]])

CASES = {
    "slipping springs": (
        lambda: StopBranch(SPRINGS, rate_independent(THRESHOLDS)),
        lambda law: (law.play.sharpness, law.play.reversal_speed),
    ),
    "slipping springs, delayed": (
        lambda: StopBranch(SPRINGS, delayed(THRESHOLDS)),
        lambda law: (law.play.sharpness, law.play.delay),
    ),
    "gear of the text": (
        lambda: HysteresisBranch(jnp.array([1.1]), WEIGHTS, delayed(THRESHOLDS)),
        lambda law: (law.play.sharpness, law.play.delay),
    ),
    "creeping spring": (
        lambda: RelaxationBranch(
            jnp.array([1e5]),
            CubicStiffness(jnp.array([8e4]), jnp.array([3e4])),
            jnp.array([4e3]),
        ),
        lambda law: (),
    ),
}


def moved(law, held, factors):
    """The law with every free entry multiplied by a factor of its own."""
    frozen = {id(leaf) for leaf in jax.tree.leaves(held(law))}
    factors = iter(factors)

    def start(leaf):
        if id(leaf) in frozen:
            return leaf
        return leaf * np.reshape([next(factors) for _ in range(leaf.size)], leaf.shape)

    return jax.tree.map(start, law)


def in_order(law):
    """The same law with its plays in the order of their thresholds."""
    if not hasattr(law, "play"):
        return law
    order = jnp.argsort(law.play.thresholds[:, 0])
    sort = lambda leaf: leaf[order] if leaf.ndim == 2 else leaf
    return jax.tree.map(sort, law)


@pytest.mark.slow
@pytest.mark.parametrize(("build", "held"), CASES.values(), ids=CASES)
@pytest.mark.parametrize("factors", [[0.5] * 5, [1.5] * 5, [0.5, 1.5, 1.5, 0.5, 1.5]])
def test_recovery_from_half_off(build, held, factors):
    # From one start a threshold may end where no reversal reaches it; from several
    # the springs may end in another order.
    law = build()
    torques = jax.vmap(lambda end: torque(law, end))(END)
    start = moved(law, held, factors)
    fit = jitted_fit(start, torque, END, torques, held=held, starts=8)
    assert fit.unidentifiable() == ()
    # Without noise only rounding is left, and how the parameters pass it on.
    assert_close(in_order(fit.law), law, rtol=1e-9)


jitted_fit = eqx.filter_jit(fit_law)


def test_stiffness_of_a_slipping_spring():
    # linear in the stiffness: one step from anywhere
    law = StopBranch(SPRINGS, rate_independent(THRESHOLDS))
    torques = jax.vmap(lambda end: torque(law, end))(END)
    start = dataclasses.replace(law, stiffness=0.5 * SPRINGS)
    fit = jitted_fit(start, torque, END, torques, held=lambda law: law.play)
    assert fit.names == ("stiffness[0, 0]", "stiffness[1, 0]")
    assert_close(fit.law.stiffness, SPRINGS, rtol=1e-9)
