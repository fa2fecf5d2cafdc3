"""Angles of rotations: both solutions, singular cases, derivatives, refusals."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.spatial.transform
from elastax.kinematics import (
    abc_from_rotation,
    check_rotation,
    check_transform,
    rotation_about,
    rotation_from_abc,
    rotation_from_rpy,
    rotation_from_zxz,
    rpy_from_rotation,
    rpy_solutions,
    select_branch,
    zxz_from_rotation,
    zxz_solutions,
)

from tests.helpers import assert_close, assert_gradient, load_vectors


KINDS = {
    "rpy": (rotation_from_rpy, rpy_solutions, rpy_from_rotation, "xyz"),
    "zxz": (rotation_from_zxz, zxz_solutions, zxz_from_rotation, "ZXZ"),
}
each_kind = pytest.mark.parametrize("kind", KINDS)

# products of three rotations of rounding 2e-16 each
ROUNDING = 2e-15


def random_angles(samples=200):
    return jnp.asarray(np.random.default_rng(1).uniform(-np.pi, np.pi, (samples, 3)))


def special_rotations():
    """Identity, half turns about the axes and others, and both kinds of lock."""
    axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0], [0, 0.6, -0.8]]
    halves = [rotation_about(jnp.array(a, float), jnp.array(np.pi)) for a in axes]
    exact = [np.diag([1.0, 1, 1]), np.diag([1.0, -1, -1]), np.diag([-1.0, -1, 1])]
    locks = [rotation_from_rpy(jnp.array([0.4, s * np.pi / 2, 1.1])) for s in (1, -1)]
    flat = [rotation_from_zxz(jnp.array([0.3, b, -0.8])) for b in (0.0, np.pi)]
    pure = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    return jnp.stack([*map(jnp.asarray, exact), pure, *halves, *locks, *flat])


@each_kind
def test_both_solutions_give_the_rotation(kind):
    build, solutions, principal, letters = KINDS[kind]
    rotations = jax.jit(jax.vmap(build))(random_angles())
    both = jax.jit(jax.vmap(solutions))(rotations)
    again = jax.jit(jax.vmap(jax.vmap(build)))(both)
    expected = jnp.broadcast_to(rotations[:, None], again.shape)
    assert_close(again, expected, rtol=0.0, atol=ROUNDING)
    assert_close(jax.jit(jax.vmap(principal))(rotations), both[:, 0], rtol=0.0)
    # angles lose digits near gimbal lock: 200 random ones come as close as 0.01 rad
    reference = scipy.spatial.transform.Rotation.from_matrix(np.asarray(rotations))
    assert_close(both[:, 0], reference.as_euler(letters), rtol=0.0, atol=1e-12)
    assert float(jnp.min(jnp.abs(both[:, 0] - both[:, 1]).max(axis=1))) > 0.01


def test_rpy_second_solution_is_the_flip():
    """Corrected (3-18): pi + arcsin(t31), the other turns by half a turn more."""
    angles = jnp.array([0.3, -0.7, 1.9])
    first, second = rpy_solutions(rotation_from_rpy(angles))
    assert_close(first, angles, rtol=1e-14)
    flipped = jnp.array([0.3 - np.pi, -np.pi + 0.7, 1.9 - np.pi])
    assert_close(second, flipped, rtol=1e-14)
    chosen = select_branch(
        jnp.stack([first, second]), jnp.array([True, True]), flipped + 2 * np.pi
    )
    assert_close(chosen, flipped + 2 * np.pi, rtol=1e-14)


@each_kind
def test_rotation_is_kept_next_to_lock(kind):
    """Closer to lock than rounding the reconstruction is off by that distance."""
    build, _, principal, _ = KINDS[kind]
    locked = {"rpy": (np.pi / 2, -np.pi / 2), "zxz": (0.0, np.pi)}[kind]
    gaps = np.concatenate([[0.0], 10.0 ** -np.arange(3.0, 17.0)])
    angles = jnp.asarray([[0.4, m + g, 1.1] for m in locked for g in gaps])
    rotations = jax.jit(jax.vmap(build))(angles)
    again = jax.jit(jax.vmap(lambda r: build(principal(r))))(rotations)
    assert_close(again, rotations, rtol=0.0, atol=64 * 2.3e-16)


def test_published_gimbal_lock():
    case = load_vectors("003 (3-18) gimbal lock")[0]
    angles, printed = jnp.array(case["inputs"]["Theta"]), case["outputs"]["R"]
    assert_close(rotation_from_rpy(angles), printed, rtol=0.0, atol=1e-12)
    found = rpy_from_rotation(jnp.array(printed))
    expected = [case["outputs"]["Theta_x"], np.pi / 2, 0.0]
    assert_close(found, expected, rtol=case["tol"])
    kept = rpy_from_rotation(jnp.array(printed), angles)
    assert_close(kept, angles, rtol=case["tol"])


def test_lock_below_keeps_the_sum():
    lower = rotation_from_rpy(jnp.array([0.4, -np.pi / 2, 1.1]))
    found = rpy_solutions(lower)
    expected = jnp.array([1.5, -np.pi / 2, 0.0])
    assert_close(found, jnp.stack([expected, expected]), rtol=1e-14)
    assert_close(
        rpy_from_rotation(lower, jnp.array([9.0, 9.0, 0.5])),
        jnp.array([1.0, -np.pi / 2, 0.5]),
        rtol=1e-14,
    )


def test_zxz_singular_cases():
    kept = jnp.array([0.5, 0.0, 0.0])
    for b, third in ((0.0, 0.3 - 0.8 - 0.5), (np.pi, -0.8 - 0.3 + 0.5)):
        flat = rotation_from_zxz(jnp.array([0.3, b, -0.8]))
        found = zxz_from_rotation(flat, kept)
        assert_close(found, jnp.array([0.5, b, third]), rtol=1e-14, atol=1e-15)


def test_kuka_angles():
    """A turns about z, B about the new y, C about the newest x."""
    abc = jnp.array([1.9, -0.7, 0.3])
    reference = scipy.spatial.transform.Rotation.from_euler("ZYX", np.asarray(abc))
    rotation = rotation_from_abc(abc)
    assert_close(rotation, reference.as_matrix(), rtol=0.0, atol=ROUNDING)
    assert_close(abc_from_rotation(rotation), abc, rtol=1e-14)
    down = rotation_from_abc(jnp.array([1.1, np.pi / 2, 0.4]))
    assert_close(
        abc_from_rotation(down, jnp.array([1.1, 0.0, 0.0])),
        jnp.array([1.1, np.pi / 2, 0.4]),
        rtol=1e-14,
    )


@each_kind
def test_derivatives_are_finite_everywhere(kind):
    _, solutions, _, _ = KINDS[kind]
    special = special_rotations()
    forward = jax.jit(jax.vmap(jax.jacfwd(solutions)))(special)
    reverse = jax.jit(jax.vmap(jax.jacrev(solutions)))(special)
    assert np.all(np.isfinite(forward))
    assert_close(reverse, forward, rtol=1e-12, atol=1e-12)


def test_derivative_in_lock_is_that_of_kept_angles():
    """Turns about the axes that are left, with the first angle at rest."""
    rpy = jnp.array([0.4, np.pi / 2, 0.0])
    moved = lambda v: rpy_from_rotation(rotation_from_rpy(rpy + jnp.stack([*v, 0.0])))
    slopes = jax.jit(jax.jacfwd(moved))(jnp.zeros(2))
    # the cosine of pi/2 in floating point is 6e-17
    assert_close(slopes, jnp.eye(3)[:, :2], rtol=0.0, atol=1e-15)


@pytest.mark.slow
@each_kind
def test_gradient_and_batches(kind):
    build, solutions, _, _ = KINDS[kind]
    assert_gradient(
        lambda a: (build(a), solutions(build(a))), jnp.array([0.3, -0.7, 1.9])
    )
    rotations = jax.jit(jax.vmap(build))(random_angles(4))
    single = jax.jit(solutions)
    loop = jnp.stack([single(r) for r in rotations])
    mapped = jax.jit(jax.vmap(solutions))(rotations)
    assert_close(mapped, loop, rtol=1e-14, atol=1e-15)


BAD = [
    (np.diag([1.0, 1.0, 1.02]), r"deviates by 0.0404: column 3 has the length 1.02"),
    (np.array([[1.0, 0.01, 0], [0, 1, 0], [0, 0, 1]]), r"columns 1 and 2 have"),
    (np.diag([1.0, -1.0, 1.0]), "reflection with the determinant -1"),
    (np.diag([1.0, np.nan, 1.0]), "must be finite"),
]


@pytest.mark.parametrize(("matrix", "message"), BAD)
def test_refuses_what_is_no_rotation(matrix, message):
    with pytest.raises(ValueError, match=message):
        check_rotation(jnp.asarray(matrix))


def test_check_of_traced_matrices():
    check = eqx.filter_jit(check_rotation)
    good = rotation_from_rpy(jnp.array([0.3, -0.7, 1.9]))
    assert_close(check(good), good, rtol=0.0)
    assert_close(check_rotation(good), good, rtol=0.0)
    with pytest.raises(RuntimeError, match="orthogonal and right-handed"):
        check(jnp.diag(jnp.array([1.0, -1.0, 1.0])))


def test_check_of_poses():
    good = jnp.eye(4).at[:3, 3].set(jnp.array([1.0, 2.0, 3.0]))
    traced = eqx.filter_jit(check_transform)
    assert_close(check_transform(good), good, rtol=0.0)
    assert_close(traced(good), good, rtol=0.0)
    bad = [
        (good.T, r"last row of `pose` must be \(0, 0, 0, 1\)", "last row"),
        (good.at[0, 3].set(jnp.inf), "`pose` must be finite", "must be finite"),
        (good.at[0, 0].set(1.1), "must be orthogonal", "orthogonal"),
    ]
    for pose, message, traced_message in bad:
        with pytest.raises(ValueError, match=message):
            check_transform(pose)
        with pytest.raises(RuntimeError, match=traced_message):
            traced(pose)
