"""The KR210 with four states: axis 1 and one tilt of the link arm."""

import dataclasses

import numpy as np

from ..drivetrain import CoulombViscousFriction, DriveTrain, Motor
from ..dynamics import (
    Axis,
    ElasticJoint,
    ElasticRobot,
    JointLimits,
    Offset,
    Part,
    assemble,
    dh_link,
)
from ._kr210 import BASE, denavit_hartenberg, kr210, link_bodies


# 1e-6 of the arm's inertia: the drive train counts as none
ROTOR = 1e-3


def simplified_kr210(
    stiffness: float = 1e6, damping: float = 1e3, *, payload_height: float = 0.3
) -> ElasticRobot:
    """The stretched KR210 that turns about axis 1 and tilts about one axis.

    All other axes are locked, the drive train is left out: the torque of axis 1 acts on
    the carousel. The spring and damper of the tilt sit at axis 2 and turn the arm about
    the vertical. Bodies and lengths are those of `kr210`.

    Args:
        stiffness: c_e of the tilt [N m/rad].
        damping: d_e of the tilt [N m s/rad].
        payload_height: of the payload's centre of mass above the flange [m].

    References:
        [Reiner2010] section 3.3, figure 3.1, with c_e and d_e of the example; the text
        prints no geometry.
    """
    parts: list[Part] = [Offset(BASE)]
    for k, (row, body) in enumerate(zip(denavit_hartenberg(), link_bodies())):
        theta, d, a, alpha = (float(x) for x in row)
        link = dh_link(f"A{k + 1}", theta, d, a, alpha, body)
        if k == 1:
            # the row leads to axis 2, whose frame has -y upward
            tilt = ElasticJoint("tilt 2", (0.0, -1.0, 0.0), stiffness, damping)
            link = [tilt if isinstance(part, Axis) else part for part in link]
        elif k > 1:
            link = [part for part in link if not isinstance(part, Axis)]
        parts += link
    whole = kr210()
    load = np.array([payload_height, 0.0, 0.24])  # x of the flange points upward
    one = np.ones(1)
    none = CoulombViscousFriction(0.0 * one, 0.0 * one, one)
    limits = whole.limits
    robot = assemble(
        "simplified_kr210",
        parts,
        DriveTrain(
            ratio=one,
            motor=Motor(np.full(1, ROTOR)),
            stiffness=None,
            damping=one,
            motor_friction=none,
            joint_friction=none,
        ),
        JointLimits(*(getattr(limits, f.name)[:1] for f in dataclasses.fields(limits))),
        axis_signs=[-1.0],
        axis_zeros=np.zeros(1),
        poses={"stretched": np.zeros(1)},
        counterbalanced_axis=0,
        sources=("structure: [Reiner2010] figure 3.1", *whole.sources[:1]),
        assumptions=(
            f"tilt of {stiffness:.3g} N m/rad and {damping:.3g} N m s/rad: the example "
            "of the text, no data of KUKA",
            f"payload of 210 kg {payload_height:g} m above the flange; the text says "
            "above it",
        ),
    )
    return robot.with_payload(210.0, load, np.diag([9.6, 3.8, 9.6]))
