"""Minimal, complete models: counts, ranks, and geometries that they must reproduce."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from elastax.kinematics import (
    ChainParameters,
    DHJoints,
    SerialChain,
    characteristic_length,
    forward_kinematics,
    generic_poses,
    minimal_model,
    parameter_count,
    rotation_error,
    stacked_jacobian,
    to_hayati,
    to_rpy,
    to_veitschegger_wu,
)
from elastax.kinematics._singularities import scaled_jacobian

from tests.helpers import assert_close
from tests.kinematics.arms import kuka, puma
from tests.kinematics.geometries import (
    disturbed,
    gantry,
    kr210,
    scara,
    seven_axes,
    stanford,
    ur,
)


slow = pytest.mark.slow  # some seconds of compilation each
# the arm and 4 r + 2 t + 6
ARMS = {
    "kr210": (kr210, 30),
    "puma": (puma, 30),
    "ur": (ur, 30),
    "scara": (scara, 4 * 3 + 2 + 6),
    "seven_axes": (seven_axes, 34),
    "gantry": (gantry, 4 * 3 + 2 * 3 + 6),
}
FAST = "ur", "scara"
each_arm = pytest.mark.parametrize(
    "name", [name if name in FAST else pytest.param(name, marks=slow) for name in ARMS]
)


@functools.cache
def model(name):
    return minimal_model(ARMS[name][0]())


@functools.cache
def experiment(name):
    """Poses of a chain, and a program: deviate, then errors and slopes."""
    q = generic_poses(ARMS[name][0](), 20, seed=1)

    def tool(chain):
        return jax.vmap(forward_kinematics, (None, 0))(chain, q)

    @jax.jit
    def deviate(parameters, deviation, targets):
        chain = parameters.moved(deviation)
        moved, actual = ChainParameters(chain, parameters.entries), tool(chain)
        turn = jax.vmap(rotation_error)(targets[:, :3, :3], actual[:, :3, :3])
        both = jnp.concatenate([targets[:, :3, 3] - actual[:, :3, 3], turn], axis=1)
        return moved, both.reshape(-1), stacked_jacobian(moved, q)

    return tool, deviate


def errors_of_fit(name, chain, left_out=None):
    """Largest error of each Gauss-Newton step of the minimal parameters."""
    tool, deviate = experiment(name)
    parameters, targets = model(name).parameters, tool(chain)
    used = [n != left_out for n in parameters.names]
    step, largest = np.zeros(parameters.number), []
    for _ in range(7):
        parameters, error, slopes = deviate(parameters, jnp.asarray(step), targets)
        largest.append(np.max(np.abs(error)))
        step = np.zeros(parameters.number)
        step[used] = np.linalg.lstsq(
            np.asarray(slopes)[:, used], np.asarray(error), rcond=None
        )[0]
    return largest


@pytest.mark.slow
@each_arm
def test_count_and_rank(name):
    make, count = ARMS[name]
    chain, minimal = make(), model(name)
    assert parameter_count(chain) == minimal.parameters.number == count
    # other poses than those that chose the parameters
    poses = generic_poses(chain, 12, seed=5)
    length = characteristic_length(chain)
    assert minimal.length == pytest.approx(length)
    matrix, _ = scaled_jacobian(minimal.parameters, poses, length)
    values = np.linalg.svd(matrix, compute_uv=False)
    # full rank, and as well conditioned as reported, but for the choice of poses
    assert minimal.condition < 50
    assert values[0] / values[-1] < 3 * minimal.condition


@pytest.mark.parametrize("name", ["scara", pytest.param("kr210", marks=slow)])
def test_count_is_the_rank_of_all_displacements(name):
    # of every joint, base and tool, that is with the most that can be said
    make, count = ARMS[name]
    chain, poses = make(), generic_poses(make(), 12, seed=5)
    everything = ChainParameters.of(to_rpy(chain))
    matrix, _ = scaled_jacobian(everything, poses, characteristic_length(chain))
    assert everything.number == 6 * (chain.number + 2) > count
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == count


@pytest.mark.slow
@each_arm
def test_excluded_parameters_are_the_combinations(name):
    minimal = model(name)
    parameters = ChainParameters.of(minimal.parameters.chain)
    q = generic_poses(parameters.chain, 4, seed=6)
    columns = np.asarray(stacked_jacobian(parameters, q))
    column = lambda n: columns[:, parameters.names.index(n)]
    assert len(minimal.excluded) == parameters.number - minimal.parameters.number
    for name, terms in minimal.excluded:
        total = sum(factor * column(n) for n, factor in terms)
        assert_close(total, column(name), rtol=0.0, atol=1e-9)
        assert name not in minimal.parameters.names


@pytest.mark.slow
@each_arm
def test_real_geometry_is_reproduced(name):
    # every axis, base and tool displaced by millimetres and tenths of a degree
    real = disturbed(ARMS[name][0](), 3e-3)
    errors = errors_of_fit(name, real)
    assert errors[0] > 1e-3
    assert errors[-1] < 1e-12


@pytest.mark.slow
@each_arm
def test_no_parameter_can_be_spared(name):
    # without one of them a part of the real geometry stays, hence without more, too
    real = disturbed(ARMS[name][0](), 3e-3)
    for left_out in model(name).parameters.names:
        assert errors_of_fit(name, real, left_out)[-1] > 1e-7, left_out


@pytest.mark.slow
def test_conversions_are_reported():
    assert "joints 2, 3)" in model("ur").conversion
    assert "joints 1, 2, 3)" in model("scara").conversion
    text = str(model("ur"))
    assert "30 parameters of DH + Hayati + DH" in text and "base_z = +1 d_1" in text
    # frames and angles are complete: the chain stays as it is
    chain = kuka()
    assert minimal_model(chain).parameters.chain is chain


@slow
def test_other_conventions():
    assert model("seven_axes").conversion == ""
    assert "structure" in model("kr210").conversion
    for chain in (to_veitschegger_wu(ur()), to_hayati(scara()), stanford()):
        minimal = minimal_model(chain)
        assert minimal.parameters.number == parameter_count(chain)
        assert minimal.condition < 50


def coaxial():
    """Two hinges on one line: only roll-pitch-yaw can move them apart."""
    zero = np.zeros(3)
    return SerialChain.from_dh(zero, [0.3, 0.2, 0.1], [0, 0, 0.4], [0, np.pi / 2, 0])


@pytest.mark.slow
def test_coaxial_hinges():
    minimal = minimal_model(coaxial())
    assert minimal.parameters.number == 4 * 3 + 6
    assert "converted to DH + RPY" in minimal.conversion


@slow
def test_nearly_parallel_axes_are_converted():
    table = puma().joints

    def leaning(angle):
        alpha = table.alpha.at[1].add(angle)
        joints = DHJoints(table.theta, table.d, table.a, alpha)
        return SerialChain.from_joints(joints)

    # 0.01 degrees; what is left of a parameter falls with the square of the angle
    converted = minimal_model(leaning(np.deg2rad(0.01)))
    assert "(joints 2)" in converted.conversion and converted.condition < 50
    kept = minimal_model(leaning(1e-2))
    assert kept.conversion == "" and kept.condition > 1e3
    converted = minimal_model(leaning(1e-2), tolerance=1e-3)
    assert "(joints 2)" in converted.conversion and converted.condition < 50


@pytest.mark.slow
def test_kept_parameters():
    chain = model("ur").parameters.chain
    tool = [f"tool_{c}" for c in ("x", "y", "z", "rx", "ry", "rz")]
    minimal = minimal_model(chain, keep=tool)
    assert minimal.conversion == "" and minimal.parameters.number == 30
    assert set(tool) <= set(minimal.parameters.names)
    with pytest.raises(ValueError, match="leave out 1 of them"):
        minimal_model(chain, keep=[*tool, "a_6"])
    with pytest.raises(ValueError, match="no parameters"):
        minimal_model(chain, keep=["b_6"])


@pytest.mark.slow
def test_refusals():
    with jax.enable_x64(False), pytest.raises(ValueError, match="double precision"):
        minimal_model(coaxial())
    with pytest.raises(ValueError, match="tell 18 parameters apart, but these 2 tell"):
        minimal_model(coaxial(), poses=jnp.ones((2, 3)))


def test_generic_poses():
    poses = generic_poses(gantry(), 1000, seed=3)
    assert_close(poses, generic_poses(gantry(), 1000, seed=3), rtol=0.0)
    reach = np.max(np.abs(poses), axis=0)
    size = characteristic_length(gantry())
    limits = np.array([size] * 3 + [np.pi] * 3)
    assert np.all(reach < limits) and np.all(reach > 0.98 * limits)
