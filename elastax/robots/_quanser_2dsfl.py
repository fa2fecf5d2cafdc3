"""Quanser's serial arm with two flexible links, as its maker's file describes it."""

import numpy as np

from ..drivetrain import CoulombViscousFriction, DriveTrain, Motor
from ..dynamics import (
    Axis,
    Body,
    ElasticJoint,
    ElasticRobot,
    JointLimits,
    Offset,
    Part,
    assemble,
)


LINK_STIFFNESS = (39.957, 6.858)  # N m/rad, E X T^3 / (4 L)
HUB_INERTIA = (0.06353616, 0.00301955)  # kg m^2, with rotor and gear
LINK_INERTIA = (0.170434272, 0.0064387)  # kg m^2; of the first with the second stage
HUB_DAMPING = (4.0, 1.5)  # N m s/rad
LINK_DAMPING = (0.0, 0.085608)  # N m s/rad
GEAR = (100.0, 50.0)
ROTOR = (6.28e-6, 1.03e-6)  # kg m^2
LENGTH = (0.202, 0.20185)  # m


def quanser_2dsfl() -> ElasticRobot:
    """Two stages of a harmonic drive and a flexible link, in a horizontal plane.

    Every link is a spring at its hub, as the maker models it; joint angles are the
    hubs', elastic coordinates the deflections that the strain gauges measure. The
    inertia of the first link contains the second stage, which stands still in the
    maker's decoupled model; here the second stage turns with the first.

    References:
        Parameters: Quanser, config_2dslf.m of 2011; its recordings are in the data set
        of the same name.
    """
    z = (0.0, 0.0, 1.0)
    disc = lambda inertia: np.diag([inertia, inertia, inertia])
    rotors = [GEAR[k] ** 2 * ROTOR[k] for k in range(2)]
    # of the second stage all but its rotor turns with the first link
    first = LINK_INERTIA[0] - (HUB_INERTIA[1] - rotors[1]) - LINK_INERTIA[1]
    parts: list[Part] = [
        Axis("A1"),
        Body("hub 1", 0.0, (0.0, 0.0, 0.0), disc(HUB_INERTIA[0] - rotors[0])),
        ElasticJoint("link 1", z, LINK_STIFFNESS[0], LINK_DAMPING[0]),
        Body("link 1", 0.0, (0.0, 0.0, 0.0), disc(first)),
        Offset((LENGTH[0], 0.0, 0.0)),
        Axis("A2"),
        Body("hub 2", 0.0, (0.0, 0.0, 0.0), disc(HUB_INERTIA[1] - rotors[1])),
        ElasticJoint("link 2", z, LINK_STIFFNESS[1], LINK_DAMPING[1]),
        Body("link 2", 0.0, (0.0, 0.0, 0.0), disc(LINK_INERTIA[1])),
        Offset((LENGTH[1], 0.0, 0.0)),
    ]
    zero = np.zeros(2)
    drives = DriveTrain(
        ratio=np.array(GEAR),
        motor=Motor(np.array(ROTOR), torque_constant=np.array([0.119, 0.0232])),
        stiffness=None,
        damping=np.ones(2),
        motor_friction=CoulombViscousFriction(zero, zero, np.ones(2)),
        joint_friction=CoulombViscousFriction(np.array(HUB_DAMPING), zero, np.ones(2)),
    )
    reach = np.deg2rad([90.0, 90.0])
    return assemble(
        "quanser_2dsfl",
        parts,
        drives,
        JointLimits(-reach, reach, [3.0, 3.0], [20.0, 20.0], [200.0, 200.0]),
        axis_signs=np.ones(2),
        axis_zeros=zero,
        poses={"zero": zero},
        counterbalanced_axis=0,
        gravity=(0.0, 0.0, 0.0),
        sources=(
            "Quanser, config_2dslf.m (2011): springs, inertias, dampers, gears, motors",
        ),
        assumptions=(
            "masses of the second stage are not given: it turns with the first link, "
            "but the first link's inertia does not change with the second angle",
            "link 1 has no damper in the source",
            "gear losses (the source's 0.75 and 0.87) are left out; limits are assumed",
        ),
    )
