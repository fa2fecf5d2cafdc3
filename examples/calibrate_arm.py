"""Calibrate a large arm from a tracker's readings of three reflectors at 30 poses.

The arm resembles a KUKA KR210; dimensions and errors are illustrative. Its axes 2 and 3
are parallel, hence Hayati's parameters for the joint between them.
"""

import jax
import jax.numpy as jnp
import numpy as np
from elastax.kinematics import (
    CalibrationProblem,
    ChainParameters,
    DHJoints,
    HayatiJoints,
    Measurements,
    MixedJoints,
    PointInstrument,
    SerialChain,
    calibrate,
    forward_kinematics,
    identifiability,
    random_joints,
    rotation_y,
    select_poses,
    transform,
)


jax.config.update("jax_enable_x64", True)

LOWER = jnp.radians(jnp.array([-115.0, 20, -70, -140, -110, -140]))
UPPER = jnp.radians(jnp.array([115.0, 125, 70, 140, 110, 140]))


def nominal_arm() -> SerialChain:
    first = DHJoints([0.0], [0.675], [0.35], [np.pi / 2])
    second = HayatiJoints([0.0], [1.15], [0.0], [0.0])
    twists = np.array([1.0, -1, 1, 0]) * np.pi / 2
    rest = DHJoints(np.zeros(4), [0, 1.2, 0, 0.215], [0.041, 0, 0, 0], twists)
    tool = transform(rotation_y(jnp.array(0.4)), jnp.array([0.1, 0.05, 0.25]))
    return SerialChain.from_joints(MixedJoints((first, second, rest)), tool=tool)


def main(seed: int = 0) -> dict[str, float]:
    keys = jax.random.split(jax.random.key(seed), 5)
    parameters = ChainParameters.of(nominal_arm())
    # the true arm: 0.5 mm and 0.3 mrad wrong in everything, standard deviations
    size = jnp.array([5e-4 if unit == "m" else 3e-4 for unit in parameters.units])
    arm = parameters.moved(size * jax.random.normal(keys[0], size.shape))

    # 30 of 200 poses, at which 50 um of noise disturb the parameters least
    reflectors = np.array([[0.0, 0, 0], [0.2, 0, 0.05], [0, 0.25, -0.1]])
    tracker = PointInstrument(5e-5, reflectors)
    candidates = random_joints(LOWER, UPPER, 200, key=keys[1])
    nominal = Measurements.simulated(tracker, parameters.chain, candidates)
    report = identifiability(CalibrationProblem(parameters, nominal))
    print("others do the same as:", ", ".join(report.dependent))
    free = parameters.select(report.identifiable)
    poses = jax.jit(lambda key: select_poses(free, tracker, candidates, 30, key=key))
    chosen = poses(keys[2])

    readings = Measurements.simulated(tracker, arm, chosen.q, keys[3])
    result = calibrate(CalibrationProblem(free, readings))
    print(result.table())

    others = random_joints(LOWER, UPPER, 200, key=keys[4])
    place = jax.jit(jax.vmap(lambda c, q: forward_kinematics(c, q)[:3, 3], (None, 0)))
    figures = {}
    for name, chain in (("before", nominal_arm()), ("after", result.chain())):
        error = jnp.linalg.norm(place(chain, others) - place(arm, others), axis=1)
        for kind, value in (("mean", error.mean()), ("maximum", error.max())):
            figures[f"{name}, {kind} [mm]"] = 1e3 * float(value)
    print("\nposition error of the tool at 200 other poses")
    for name, value in figures.items():
        print(f"{name:<22}{value:7.3f}")
    return figures


if __name__ == "__main__":
    main()
