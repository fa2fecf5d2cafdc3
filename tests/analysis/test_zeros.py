"""Zeros: the text's example, random systems against the peer, derivatives."""

import control
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.analysis import (
    LinearModel,
    linearise,
    transmission_zeros,
    zero_structure,
    zeros_along_link,
)
from elastax.robots import beam_on_joint

from tests.analysis.two_link import two_link
from tests.helpers import assert_close, load_vectors


def matched(found, expected) -> float:
    """Largest relative distance of a one-to-one assignment by nearness."""
    left, worst = list(expected), 0.0
    for z in found:
        k = int(np.argmin(np.abs(np.array(left) - z)))
        worst = max(worst, abs(left.pop(k) - z) / max(abs(z), 1e-3))
    return worst


# ------------------------------------------------------------------ the text's example


def jittable(model, degrees=(2,)):
    return transmission_zeros(model.A, model.B, model.C, model.D, degrees)


@pytest.mark.parametrize("vector", load_vectors("Reiner 3.40"))
def test_zeros_of_the_two_link(vector):
    model = linearise(two_link(**vector["inputs"]), jnp.zeros(4), jnp.zeros(1))
    expected = [z["re"] + 1j * z["im"] for z in vector["outputs"]["zeros"]]
    tol = vector["tol"]
    assert_close(model.zeros(), np.sort_complex(expected), rtol=tol, atol=tol)
    assert matched(np.asarray(jittable(model)), expected) < tol


def test_zeros_that_cancel_the_poles():
    """At x_l = J_z / (m l): invariant zeros that are no transmission zeros."""
    model = linearise(two_link(x_l=0.05), jnp.zeros(4), jnp.zeros(1))
    assert model.zeros().size == 2
    assert model.transmission_zeros().size == 0
    assert model.minimal().A.shape == (2, 2)


def test_critical_tip_length():
    """x_l* = J_z / (m l (1 - xi)) = 0.0625 m: one right zero beyond, none before."""
    zeros = lambda x_l: linearise(two_link(x_l=x_l), jnp.zeros(4), jnp.zeros(1)).zeros()
    assert np.sum(zeros(0.0624).real > 0) == 0
    assert np.sum(zeros(0.0626).real > 0) == 1
    # at it one zero is infinite: the relative degree is three
    at = linearise(two_link(x_l=0.0625), jnp.zeros(4), jnp.zeros(1))
    assert at.zero_structure().infinite == (3,)
    # where the pair becomes real, c = 1e6, d = 150
    assert np.abs(zeros(0.062318).imag).max() > 1.0
    assert np.abs(zeros(0.062319).imag).max() == 0.0


# ------------------------------------------------------------------ random systems


def random_system(seed: int, direct: float = 0.3):
    """Square, with a direct term in some."""
    generator = np.random.default_rng(seed)
    n = int(generator.integers(3, 13))
    m = int(generator.integers(1, min(4, n // 2 + 1)))
    draw = generator.standard_normal
    A, B, C = draw((n, n)), draw((n, m)), draw((m, n))
    D = draw((m, m)) if generator.random() < direct else np.zeros((m, m))
    return A * 10.0 ** generator.uniform(-1, 2), B, C, D


def test_random_square_systems_against_control():
    """200 of them, one to one to 1e-8; the counts are those of the infinite zeros."""
    for seed in range(200):
        A, B, C, D = random_system(seed)
        found = zero_structure(A, B, C, D)
        assert len(found.finite) + sum(found.infinite) == len(A)
        assert found.normal_rank == B.shape[1]
        peer = control.ss(A, B, C, D).zeros()
        peer = peer[np.abs(peer) < 1e6 * np.linalg.norm(A)]
        assert len(peer) == len(found.finite), seed
        assert matched(found.finite, peer) < 1e-8, seed
        # ranks are decided by orders of magnitude
        assert found.kept > 1e4 and found.dropped < 0.1


@pytest.mark.parametrize("degree", [2, 3])
def test_infinite_zeros_of_higher_order(degree):
    """Where a plain QZ smears them: known zeros, one output at the end of a chain.

    Parallel chains of integrators with zero dynamics of their own behind them.
    """
    generator = np.random.default_rng(degree)
    inner = generator.standard_normal((4, 4))
    m, k = 2, degree
    n = m * k + 4
    A, B, C = np.zeros((n, n)), np.zeros((n, m)), np.zeros((m, n))
    for i in range(m):
        for j in range(k - 1):
            A[i * k + j, i * k + j + 1] = 1.0
        A[i * k + k - 1] = generator.standard_normal(n)
        B[i * k + k - 1, i] = 1.0 + i
        C[i, i * k] = 1.0
    A[m * k :, m * k :] = inner
    A[m * k :, 0] = 1.0
    turn = generator.standard_normal((n, n))
    back = np.linalg.inv(turn)
    model = LinearModel(turn @ A @ back, turn @ B, C @ back)
    found = model.zero_structure()
    assert found.infinite == (k, k)
    assert matched(found.finite, np.linalg.eigvals(inner)) < 1e-8
    assert matched(np.asarray(jittable(model, (k, k))), found.finite) < 1e-6


def test_systems_that_are_not_square():
    """Known zeros: those of a square factor before a tall one, or behind a wide one."""
    for seed in range(20):
        generator = np.random.default_rng(seed)
        draw = generator.standard_normal
        A, B, C, D = random_system(seed, direct=1.0)
        # as fast as the other factor: the ranks of systems with fast and slow parts,
        # to which outputs are added, drown in rounding
        A = 2.0 * A / np.linalg.norm(A, 2)
        m = B.shape[1]
        inner = zero_structure(A, B, C, D).finite
        n, p = 4, m + 1 + seed % 2
        A_2, B_2, C_2, D_2 = draw((n, n)), draw((n, m)), draw((p, n)), draw((p, m))
        # the second follows the first: outputs are more than inputs
        zero = np.zeros((len(A), n))
        tall = (
            np.block([[A, zero], [B_2 @ C, A_2]]),
            np.concatenate([B, B_2 @ D]),
            np.concatenate([D_2 @ C, C_2], axis=1),
            D_2 @ D,
        )
        for system in (tall, (tall[0].T, tall[2].T, tall[1].T, tall[3].T)):
            found = zero_structure(*system)
            assert found.normal_rank == m
            assert len(found.finite) == len(inner)
            assert matched(found.finite, inner) < 1e-6


def test_a_singular_transfer_matrix_is_told():
    """Two equal outputs: the normal rank is one, whatever the numbers."""
    A, B, C, _ = random_system(3, direct=0.0)
    B = np.random.default_rng(0).standard_normal((len(A), 2))
    C = np.stack([C[0], C[0]])
    found = zero_structure(A, B, C, np.zeros((2, 2)))
    assert found.normal_rank == 1


def test_scaling_changes_nothing():
    """Units of states, inputs and outputs, in powers of ten."""
    A, B, C, D = random_system(11)
    generator = np.random.default_rng(1)
    s = 10.0 ** generator.uniform(-6, 6, len(A))
    u = 10.0 ** generator.uniform(-4, 4, B.shape[1])
    y = 10.0 ** generator.uniform(-4, 4, len(C))
    plain = zero_structure(A, B, C, D)
    scaled = zero_structure(
        A * s / s[:, None], B * u / s[:, None], C * s / y[:, None], D * u / y[:, None]
    )
    assert scaled.infinite == plain.infinite
    assert matched(scaled.finite, plain.finite) < 1e-7


def test_degenerate_sizes():
    assert (
        zero_structure(
            np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]]
        ).finite.size
        == 0
    )
    none = zero_structure(
        -np.eye(2), np.ones((2, 1)), np.zeros((0, 2)), np.zeros((0, 1))
    )
    assert none.normal_rank == 0
    with pytest.raises(ValueError, match="must be finite"):
        zero_structure([[np.inf]], [[1.0]], [[1.0]], [[0.0]])


# ---------------------------------------------------------- the differentiable route


CASES = {"direct": (0, 0), "degree 1": (1, 1), "degree 2": (2, 2), "mixed": (0, 2)}

# of A, B, C, D, for C and D by output
MOVING = {
    "direct": (1.0, 1.0, 1.0, 1.0),
    "degree 1": (1.0, 1.0, 1.0, 0.0),
    "degree 2": (1.0, 0.0, 0.0, 0.0),
    "mixed": (1.0, 0.0, (1.0, 0.0), (1.0, 0.0)),
}


def structured(degrees, seed=2, n=8):
    """A random system with these degrees."""
    draw = np.random.default_rng(seed).standard_normal
    A, B, C, D = draw((n, n)), draw((n, 2)), draw((2, n)), np.zeros((2, 2))
    for i, degree in enumerate(degrees):
        if degree == 0:
            D[i] = draw(2)
        if degree == 2:
            C[i] -= C[i] @ B @ np.linalg.pinv(B)
    return A, B, C, D


@pytest.mark.parametrize("name", CASES)
def test_jittable_route_and_its_derivative(name):
    """Values as QZ, derivatives as differences of QZ, forward and reverse."""
    degrees = CASES[name]
    A, B, C, D = structured(degrees)
    found = zero_structure(A, B, C, D)
    # what can move without another degree
    draw = np.random.default_rng(9).standard_normal
    moves = [draw(x.shape) for x in (A, B, C, D)]
    for move, moving in zip(moves, MOVING[name], strict=True):
        move *= np.reshape(moving, (-1, 1))
    system = lambda t: [x + t * move for x, move in zip((A, B, C, D), moves)]
    zeros = lambda t: transmission_zeros(*system(t), degrees)
    value, slope = jax.jit(lambda t: jax.jvp(zeros, (t,), (jnp.ones(()),)))(
        jnp.zeros(())
    )
    value, slope = np.asarray(value), np.asarray(slope)
    assert matched(value, found.finite) < 1e-9
    h = 1e-5
    ends = [zero_structure(*system(k * h)).finite for k in (1, -1, 2, -2)]
    for z, dz in zip(value, slope):
        near = [end[np.argmin(np.abs(end - z))] for end in ends]
        # of four points: truncation h^4, rounding 1e-13 / h
        ahead, wide = near[0] - near[1], near[2] - near[3]
        assert abs((8 * ahead - wide) / (12 * h) - dz) < 1e-6 * abs(dz)
    total = jax.jit(jax.grad(lambda t: jnp.sum(zeros(t).real ** 2)))(jnp.zeros(()))
    assert_close(total, np.sum(2 * value.real * slope.real), rtol=1e-9)


def test_jittable_route_under_vmap():
    A, B, C, D = structured((2, 2))
    scale = jnp.array([0.5, 1.0, 3.0])
    one = lambda k: transmission_zeros(k * A, B, C, D, (2, 2))
    loop = jnp.stack([jax.jit(one)(k) for k in scale])
    assert_close(jax.jit(jax.vmap(one))(scale), loop, rtol=1e-10, atol=1e-10)


def test_jittable_route_refuses():
    A, B, C, D = structured((2, 2))
    with pytest.raises(ValueError, match="as many outputs as inputs"):
        transmission_zeros(A, B, C[:1], D[:1], (2,))
    with pytest.raises(ValueError, match="sum to more than the 8 states"):
        transmission_zeros(A, B, C, D, (5, 4))


# ------------------------------------------------------------- outputs along a beam


POSITIONS = tuple(np.arange(1, 200) / 200.0)
ROD_MASS = 7850.0 * np.pi * 0.01**2  # of the beam of `beam_on_joint` [kg]


def critical(modes: int, ratio: float):
    """Over 200 places in one call; point mass on the bare beam's modes, as the text."""
    robot = beam_on_joint(
        modes, tip_mass=ratio * ROD_MASS, loaded_modes=False, outputs=POSITIONS
    )
    found = zeros_along_link(robot, jnp.zeros(1))
    assert found.positions.shape == (200,)
    assert found.zeros.shape == (200, 2 * modes)
    assert found.poles.shape == (2 * modes + 2,)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("vector", load_vectors("Reiner 3.5.1"))
def test_critical_position_of_one_mode(vector):
    """With three modes and tip masses: the script of figure 3.4, in test_papers."""
    found = critical(1, 0.0)
    place = found.critical_position()
    assert_close(place, vector["outputs"]["xi_crit_n1"], rtol=vector["tol"])
    # stable before, unstable from there on to the tip
    worst = np.asarray(found.largest_real)
    beyond = np.asarray(found.positions) > place
    assert np.all(worst[~beyond] < 0)
    assert worst[-1] > 0
