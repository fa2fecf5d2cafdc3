"""Independent routes to what the kernels compute: energies and Pinocchio."""

import jax
import numpy as np
import pinocchio as pin
from elastax.dynamics import ElasticRobot, lagrange_forces

from .peers import pinocchio as peer


States = dict[str, np.ndarray]


def lagrange(robot: ElasticRobot, states: States, *, at_rest: bool = False) -> tuple:
    """Forces of joints, structure and motors by differentiated energies.

    Args:
        robot: the robot.
        states: one sample per row.
        at_rest: whether all accelerations are zero; the forces are `h` then.
    """
    motion = [states[k] for k in ("q", "eta", "theta", "qd", "etad", "thetad")]
    accelerations = [states["qdd"], states["etadd"], states["thetadd"]]
    if at_rest:
        accelerations = [0.0 * a for a in accelerations]
    function = jax.jit(jax.vmap(lambda *x: lagrange_forces(robot, *x)))
    return jax.device_get(function(*motion, *accelerations))


def tree_coordinates(robot: ElasticRobot, states: States, **options) -> tuple:
    """Angles and rates of the tree of Pinocchio, one sample per row."""
    matrix = peer.coupling(robot, **options)
    both = lambda a, b: np.hstack([states[a], states[b]]) @ matrix.T
    return both("q", "eta"), both("qd", "etad")


def multibody(robot: ElasticRobot, states: States) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrices and bias forces of the bodies by Pinocchio."""
    model = peer.robot_model(robot)
    data, matrix = model.createData(), peer.coupling(robot)
    masses, biases = [], []
    for x, xd in zip(*tree_coordinates(robot, states)):
        masses.append(matrix.T @ peer.mass_matrix(model, data, x) @ matrix)
        biases.append(matrix.T @ pin.nonLinearEffects(model, data, x, xd))
    return np.stack(masses), np.stack(biases)


def accelerations(robot: ElasticRobot, states: States) -> tuple:
    """Accelerations of joints, structure and motors: h by Lagrange, M by Pinocchio."""
    n = robot.axes
    h_a, h_e, h_m = lagrange(robot, states, at_rest=True)
    mass, _ = multibody(robot, states)
    found = np.linalg.solve(mass, -np.hstack([h_a, h_e])[..., None])[..., 0]
    inertia = np.asarray(robot.drives.reflected_inertia())
    return found[:, :n], found[:, n:], (states["tau_m"] - h_m) / inertia


def applied_torques(robot: ElasticRobot, states: States, model: pin.Model) -> tuple:
    """Angles, rates and torques for Pinocchio that stand for springs and drives.

    The torques at the tree's joints are those of gravity, Coriolis and centrifugal
    forces less `h` by Lagrange: the rest is springs, dampers, gears and cylinder.

    Args:
        robot: without end slopes.
        states: one sample per row.
        model: its tree, the end-slope joints welded.
    """
    options = {"weld_end_slopes": True}
    x, xd = tree_coordinates(robot, states, **options)
    data, matrix = model.createData(), peer.coupling(robot, **options)
    h = np.hstack(lagrange(robot, states, at_rest=True)[:2])
    bias = [pin.nonLinearEffects(model, data, *pair) for pair in zip(x, xd)]
    # one coordinate per joint: the coupling only sorts them
    return x, xd, np.stack(bias) - h @ matrix.T
