"""Rank of Jacobians by parameters and joints."""

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    SerialChain,
    characteristic_length,
    drive_singularity,
    generic_poses,
    jacobian,
    parameter_jacobian,
    parameter_singularity,
    stacked_jacobian,
)

from tests.helpers import assert_close
from tests.kinematics.arms import kuka, planar
from tests.kinematics.geometries import seven_axes, stanford, ur


def combination(found, name):
    return dict(next(c.terms for c in found.dependent if c.name == name))


def test_stretched_wrist():
    # the axes 4 and 6 are one line
    chain = kuka()
    found = drive_singularity(chain, jnp.zeros(6))
    assert found.is_singular and (found.rank, found.full) == (5, 6)
    assert [c.name for c in found.dependent] == ["axis_6"]
    assert found.smallest < 1e-15
    terms = combination(found, "axis_6")
    total = sum(
        factor * jacobian(chain, jnp.zeros(6))[:, int(name[-1]) - 1]
        for name, factor in terms.items()
    )
    assert_close(total, jacobian(chain, jnp.zeros(6))[:, 5], rtol=0.0, atol=1e-12)
    assert "rank 5 of 6" in str(found) and "axis_6 = " in str(found)
    regular = drive_singularity(chain, jnp.array([0.1, -0.5, 0.9, 0.3, 0.7, 0.2]))
    assert not regular.is_singular and regular.dependent == ()


def test_smallest_value_takes_lengths_over_the_size():
    chain = stanford()
    q = jnp.array([0.4, 0.7, 0.2, 0.3, 0.9, -0.4])
    size = characteristic_length(chain)
    matrix = np.array(jacobian(chain, q))
    matrix[:3] /= size
    matrix[:, 2] *= size
    expected = np.linalg.svd(matrix, compute_uv=False)[-1]
    assert drive_singularity(chain, q).smallest == pytest.approx(expected, rel=1e-12)
    other = drive_singularity(chain, q, length=1.0).smallest
    matrix[:3] *= size
    matrix[:, 2] /= size
    expected = np.linalg.svd(matrix, compute_uv=False)[-1]
    assert other == pytest.approx(expected, rel=1e-12)


def test_redundant_and_short_arms():
    # (3-40) as printed would call every pose of a redundant arm singular
    q = jnp.array([0.1, 0.5, -0.3, 1.2, 0.4, 0.8, 0.2])
    found = drive_singularity(seven_axes(), q)
    assert not found.is_singular and found.rank == 6
    assert [c.name for c in found.dependent] == ["axis_7"]
    found = drive_singularity(planar(1.0, 0.7), jnp.array([0.3, 0.8]))
    assert not found.is_singular and found.full == 2


@pytest.mark.slow
def test_parameters_of_parallel_axes():
    parameters = ChainParameters.of(ur(), base=False, tool=False)
    poses = generic_poses(ur(), 12)
    found = parameter_singularity(parameters, poses)
    # shifts along three parallel axes are one; all else is told apart
    assert [c.name for c in found.dependent] == ["d_3", "d_4"]
    assert combination(found, "d_4").keys() == {"d_2"}
    assert combination(found, "d_4")["d_2"] == pytest.approx(1.0, rel=1e-12)
    assert (found.rank, found.full, found.is_singular) == (22, 24, True)
    rank = np.linalg.matrix_rank(stacked_jacobian(parameters, poses), tol=1e-10)
    assert rank == 22
    # one pose tells six parameters apart at most
    one = parameter_singularity(parameters, poses[:1])
    rank = np.linalg.matrix_rank(parameter_jacobian(parameters, poses[0]), tol=1e-10)
    assert one.rank == rank == 6 and one.smallest == 0.0


def test_single_joint():
    zero = np.zeros(1)
    chain = SerialChain.from_dh(zero, zero, zero, zero)
    # the tool does not move, but turns
    assert not drive_singularity(chain, jnp.zeros(1)).is_singular
