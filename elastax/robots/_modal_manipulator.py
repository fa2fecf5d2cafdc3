"""Three-axis manipulator with elastic gears, a finite-element link and a beam."""

import functools

import numpy as np

from ..drivetrain import CoulombViscousFriction, DriveTrain, LinearStiffness, Motor
from ..dynamics import (
    Axis,
    Body,
    ElasticRobot,
    FlexibleLink,
    JointLimits,
    Offset,
    Part,
    assemble,
)
from ..structure import (
    BeamSection,
    FiniteElementModel,
    Material,
    ModalBody,
    ModeCounts,
    TipMass,
    UniformBeam,
    beam_frame,
    eigenmodes,
    modal_beam,
    modal_body,
)


ALUMINIUM = Material(young=7e10, shear=2.6e10, density=2700.0)
# assumed: ladder of two rails, 0.8 m long and 0.2 m apart, rungs every 0.16 m
LINK_LENGTH, LINK_WIDTH, BAYS = 0.8, 0.2, 5
BEAM = UniformBeam(ALUMINIUM, BeamSection.circular_tube(diameter=0.05, wall=0.003), 0.8)
DAMPING_RATIO = 0.01  # assumed, of every mode


def ladder_link() -> FiniteElementModel:
    """Link between axes 2 and 3: a ladder of beam elements along x.

    Node `base` in the middle of the first rung, `tip` in the middle of the last.
    """
    along = np.linspace(0.0, LINK_LENGTH, BAYS + 1)
    half = 0.5 * LINK_WIDTH
    rails = [(x, 0.0, z) for x in along for z in (-half, half)]
    ends = [(0.0, 0.0, 0.0), (LINK_LENGTH, 0.0, 0.0)]
    base, tip = len(rails), len(rails) + 1
    bars = [(k, k + 2) for k in range(2 * BAYS)]
    bars += [(2 * k, 2 * k + 1) for k in range(1, BAYS)]
    for middle, first in ((base, 0), (tip, 2 * BAYS)):
        bars += [(first, middle), (middle, first + 1)]
    return beam_frame(
        np.array(rails + ends),
        bars,
        BeamSection.rectangular_tube(height=0.04, width=0.05, wall=0.003),
        ALUMINIUM,
        upright=(0.0, 1.0, 0.0),
        labels=[str(k + 1) for k in range(len(rails))] + ["base", "tip"],
    )


@functools.cache
def _link_body(modes: int) -> ModalBody:
    model = ladder_link()
    return modal_body(
        model,
        eigenmodes(model, modes, ["base"]),
        "base",
        nodes=model.labels,
        damping_ratio=DAMPING_RATIO,
        name="link",
    )


def modal_manipulator(
    link_modes: int = 10,
    beam_modes: int = 3,
    *,
    link: ModalBody | None = None,
    load: float = 5.0,
) -> ElasticRobot:
    """Three axes with elastic gears, a finite-element link and a beam with a load.

    Gravity acts along -y. Axis 1 stands upright, axes 2 and 3 are horizontal and
    parallel; at zero the arm is stretched along x. The link between axes 2 and 3 is a
    frame of finite elements in its lowest modes, the arm behind axis 3 a beam that
    bends in the plane of the arm, a load at its end.

    Args:
        link_modes: of the finite-element link.
        beam_modes: bending modes of the beam.
        link: another link of the same length in modes, such as SID data, with nodes
            `base` and `tip` 0.8 m along x.
        load: mass at the end of the beam [kg].

    References:
        [Reiner2010] figure 3.19; the text gives no parameters, all are assumed.
    """
    body = _link_body(link_modes) if link is None else link
    nodes = body.nodes
    place = np.asarray(nodes.position)
    reach = place[nodes.index("tip")] - place[nodes.index("base")]
    if np.abs(reach - np.array([LINK_LENGTH, 0.0, 0.0])).max() > 1e-6:
        raise ValueError(
            f"the link must reach by {LINK_LENGTH} m along x from `base` to `tip`, but "
            f"does by {reach} m"
        )
    beam = modal_beam(
        BEAM,
        ModeCounts(beam_modes),
        tip=TipMass(load, np.zeros(3)),
        damping_ratio=DAMPING_RATIO,
    )
    raised = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    parts: list[Part] = [
        Offset(rotation=raised),
        Axis("A1"),
        Body("column", 40.0, (0.0, 0.0, 0.3), np.diag([1.5, 1.5, 0.6])),
        Offset((0.0, 0.0, 0.6), raised.T),
        Axis("A2"),
        Body("hub of A2", 10.0, (0.0, 0.0, 0.0), 0.10 * np.eye(3)),
        FlexibleLink("link", body, "tip", "base"),
        Body("motor of A3", 8.0, (0.0, 0.0, 0.0), 0.03 * np.eye(3)),
        Axis("A3"),
        Body("hub of A3", 3.0, (0.0, 0.0, 0.0), 0.01 * np.eye(3)),
        FlexibleLink("beam", beam, "tip"),
    ]
    stiffness = np.array([6.0e4, 6.0e4, 2.0e4])
    one = np.ones(3)
    drives = DriveTrain(
        ratio=100.0 * one,
        motor=Motor(np.array([8e-4, 8e-4, 3e-4])),
        stiffness=LinearStiffness(stiffness),
        damping=1e-3 * stiffness,
        motor_friction=_viscous([40.0, 40.0, 15.0]),
        joint_friction=_viscous(np.zeros(3)),
    )
    return assemble(
        "modal_manipulator",
        parts,
        drives,
        JointLimits(-np.pi * one, np.pi * one, 3.0 * one, 20.0 * one, 200.0 * one),
        axis_signs=one,
        axis_zeros=np.zeros(3),
        poses={"stretched": np.zeros(3), "bent": np.array([0.0, 0.9, -1.3])},
        gravity=(0.0, -9.81, 0.0),
        sources=("structure: [Reiner2010] figure 3.19",),
        assumptions=(
            "all numbers; the text has none",
            "link: aluminium ladder of 0.8 m, rails and rungs 40 x 50 x 3 mm; beam: "
            f"aluminium tube 50 x 3 mm of 0.8 m with {load:g} kg at its end",
            "hubs of 10 and 3 kg behind the axes 2 and 3, motor of 8 kg in front of 3",
            "gears 100:1 with 6e4, 6e4, 2e4 N m/rad, damping 1 ms times that, linear "
            "friction; damping ratio of the modes 0.01",
        ),
    )


def _viscous(coefficients) -> CoulombViscousFriction:
    return CoulombViscousFriction(np.asarray(coefficients), np.zeros(3), np.ones(3))
