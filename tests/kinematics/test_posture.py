"""Postures: named poses, and agreement with the rows of the closed form."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    Posture,
    SphericalWrist,
    branch_index,
    forward_kinematics,
    inverse_kinematics,
    posture_of,
    rotation_x,
    transform,
)
from elastax.robots import fanuc, kr210

from tests.kinematics.arms import planar


def answers(posture):
    return tuple(map(bool, (posture.behind, posture.elbow_up, posture.flipped)))


@pytest.fixture(scope="module")
def arms():
    return {"kr210": kr210().arm(), "fanuc": fanuc()}


each_arm = pytest.mark.parametrize("name", ["kr210", "fanuc"])
classify = eqx.filter_jit(posture_of)
row_of = eqx.filter_jit(branch_index)
solve = jax.jit(inverse_kinematics)


@pytest.mark.slow
@each_arm
def test_every_row_has_its_posture(arms, name):
    """The eight rows are the eight postures, whatever the senses of the axes."""
    arm = arms[name]
    wrist = SphericalWrist.from_chain(arm.chain)
    # near axis 1, so that the arm reaches there over its back as well
    for angles in np.random.default_rng(0).uniform(-np.pi, np.pi, (30, 6)):
        pose = forward_kinematics(arm.chain, jnp.asarray(angles))
        solutions, valid = solve(wrist, pose)
        if np.all(valid):
            break
    assert np.all(valid)
    found = set()
    for row in range(8):
        posture = classify(arm, solutions[row])
        assert int(row_of(arm, posture)) == row
        found.add(answers(posture))
    assert len(found) == 8


def test_signs_of_the_maker_do_not_matter(arms):
    """An arm whose axes 3 and 5 are counted backwards stands in the same postures."""
    arm = arms["fanuc"]
    chain = arm.chain
    joints = chain.joints
    # the same arm with axes 2, 3 and 5 reversed: frames turned about x by half a turn
    alpha = joints.alpha.at[jnp.array([0, 2, 3, 4])].multiply(-1.0)
    mirrored = eqx.tree_at(
        lambda c: (c.joints.alpha, c.joints.d), chain, (alpha, -joints.d)
    )
    other = dataclasses.replace(arm, chain=mirrored)
    wrist = SphericalWrist.from_chain(mirrored)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        posture = classify(other, jnp.asarray(q))
        pose = forward_kinematics(mirrored, jnp.asarray(q))
        solutions, _ = solve(wrist, pose)
        row = int(row_of(other, posture))
        away = np.asarray(solutions[row]) - q
        assert np.max(np.abs(away - 2 * np.pi * np.round(away / (2 * np.pi)))) < 1e-8


@each_arm
def test_named_postures(arms, name):
    """Reaching forward, elbow up, hand down; then one answer after the other."""
    arm = arms[name]
    # senses of the maker: KUKA lowers with positive angles, this arm raises
    sign = 1.0 if name == "kr210" else -1.0
    upright = -90.0 if name == "kr210" else 0.0
    forearm = 90.0 if name == "kr210" else 0.0

    def look(*degrees):
        return answers(classify(arm, arm.from_maker(jnp.deg2rad(jnp.array(degrees)))))

    usual = (0.0, upright, forearm, 0.0, sign * 45.0, 0.0)
    assert look(*usual) == (False, True, False)
    # axis 5 the other way raises the hand; half a turn of axis 4 does not count
    assert look(*usual[:4], -sign * 45.0, 0.0) == (False, True, True)
    assert look(*usual[:3], 180.0, sign * 45.0, 0.0) == (False, True, False)
    # leaning back behind axis 1
    lean = (upright - sign * 60.0, forearm - sign * 80.0)
    assert look(0.0, *lean, 0.0, sign * 45.0, 0.0)[0]
    # turning axis 1 or 6 changes nothing
    assert look(120.0, *usual[1:5], 77.0) == (False, True, False)
    # the forearm turned up past the stretched arm
    folded = forearm - sign * 130.0
    assert not look(0.0, upright, folded, 0.0, sign * 45.0, 0.0)[1]


def test_mounted_upside_down(arms):
    """Front, up and down are those of the arm's own base."""
    arm = arms["kr210"]
    base = transform(rotation_x(jnp.array(np.pi)), jnp.array([0.0, 0.0, 3.0]))
    hanging = eqx.tree_at(lambda a: a.chain.base, arm, base @ arm.chain.base)
    q = arm.from_maker(jnp.deg2rad(jnp.array([20.0, -70, 60, 10, -40, 30])))
    assert answers(classify(hanging, q)) == answers(classify(arm, q))


@pytest.mark.slow
def test_vmap_agrees_with_the_loop(arms):
    arm = arms["kr210"]
    q = jnp.asarray(np.random.default_rng(2).uniform(-3, 3, (10, 6)))
    batch = jax.jit(jax.vmap(posture_of, (None, 0)))(arm, q)
    loop = [answers(classify(arm, x)) for x in q]
    for k in range(10):
        assert answers(jax.tree.map(lambda leaf: leaf[k], batch)) == loop[k]


def test_refusals(arms):
    flat = dataclasses.replace(arms["fanuc"])
    flat = eqx.tree_at(lambda a: a.chain, flat, planar(*[1.0] * 6))
    with pytest.raises(ValueError, match="axis 1 .* perpendicular to axis 2"):
        posture_of(flat, jnp.zeros(6))
    with pytest.raises(ValueError, match="axis 1 .* perpendicular to axis 2"):
        branch_index(flat, Posture(jnp.array(False), jnp.array(True), jnp.array(True)))
