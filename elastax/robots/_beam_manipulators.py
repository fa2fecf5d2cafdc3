"""Manipulators of slender beams, for zeros and the choice of outputs."""

import dataclasses

import numpy as np

from ..drivetrain import CoulombViscousFriction, DriveTrain, Motor
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
    AbstractSupport,
    BeamSection,
    LinearStiffness,
    Material,
    ModeCounts,
    SupportedFree,
    TipMass,
    UniformBeam,
    modal_beam,
)


STEEL = Material(young=2.1e11, shear=8.1e10, density=7850.0)
# assumed: a solid rod of 20 mm, 1 m long
ROD = UniformBeam(STEEL, BeamSection.circular_tube(diameter=0.020, wall=0.010), 1.0)
# assumed: damping ratio of every mode
DAMPING_RATIO = 0.005
# of motors that count as none: 1e-6 of the rod's inertia of 0.8 kg m^2
ROTOR = 1e-6


def beam_on_joint(
    modes: int = 3,
    *,
    tip_mass: float = 0.5,
    beam: UniformBeam = ROD,
    support: AbstractSupport = SupportedFree(),
    loaded_modes: bool = True,
    outputs: tuple[float, ...] = (),
    gravity=(0.0, 0.0, 0.0),
) -> ElasticRobot:
    """A beam on one joint that bends in the plane of its rotation.

    The torque of the joint acts on the root of the beam, which its modes turn. Without
    gravity unless given.

    Args:
        modes: number of bending modes.
        tip_mass: point mass at the end [kg].
        beam: uniform beam.
        support: of the modes; those of a supported beam as in the text.
        loaded_modes: whether the modes are those of the beam with its tip mass; else of
            the bare beam, to whose end a point mass is attached, as in the text.
        outputs: further nodes, as fractions of the length.
        gravity: [m/s^2].

    References:
        [Reiner2010] section 3.5.1, figure 3.3; the text gives no parameters, all are
        assumed.
    """
    body = _bending_beam(beam, modes, loaded_modes * tip_mass, support, outputs)
    parts: list[Part] = [Axis("A1"), _link("beam", body, support)]
    parts += _load(0.0 if loaded_modes else tip_mass, "load")
    return _assembled("beam_on_joint", parts, 1, gravity)


def two_beams(
    modes: int = 3,
    *,
    tip_mass: float = 0.5,
    beam: UniformBeam = ROD,
    support: AbstractSupport = SupportedFree(),
    loaded_modes: bool = True,
    outputs: tuple[float, ...] = (),
    gravity=(0.0, -9.81, 0.0),
) -> ElasticRobot:
    """Two beams in a vertical plane, the second on a joint at the end of the first.

    Args:
        modes: bending modes of each beam.
        tip_mass: point mass at the end of each beam [kg].
        beam: both beams.
        support: of the modes.
        loaded_modes: whether the modes are those of the beam with its tip mass; else of
            the bare beam, to whose end a point mass is attached, as in the text.
        outputs: further nodes of both, as fractions of the length.
        gravity: [m/s^2].

    References:
        [Reiner2010] section 3.5.1, figure 3.6; the text gives no parameters, all are
        assumed.
    """
    body = _bending_beam(beam, modes, loaded_modes * tip_mass, support, outputs)
    apart = 0.0 if loaded_modes else tip_mass
    parts: list[Part] = [
        Axis("A1"),
        _link("first", body, support),
        *_load(apart, "first load"),
        Axis("A2"),
        _link("second", body, support),
        *_load(apart, "second load"),
    ]
    return _assembled("two_beams", parts, 2, gravity)


def one_link_arm(
    modes: int = 3, *, payload: float = 0.0, stiffness: float = 100.0
) -> ElasticRobot:
    """De Luca's arm: a flexible link in a horizontal plane on an elastic joint.

    Args:
        modes: number of clamped bending modes.
        payload: point mass at the end [kg]; 0 or 2 in the source.
        stiffness: of the joint [N m/rad].

    References:
        Numbers of a public file of De Luca's group on rest-to-rest motions.
    """
    # EI = 0.6 N m^2 and 4 kg/m; the section itself is of no importance
    material = Material(young=6e9, shear=2e9, density=400.0)
    section = BeamSection(1e-2, 1e-10, 1e-10, 2e-10)
    beam = UniformBeam(material, section, 0.7)
    tip = TipMass(payload, np.zeros(3)) if payload else None
    body = modal_beam(beam, ModeCounts(modes), tip=tip, rotary_inertia=False)
    drives = DriveTrain(
        ratio=np.ones(1),
        motor=Motor(np.ones(1)),
        stiffness=LinearStiffness(np.full(1, stiffness)),
        damping=np.full(1, 1e-6 * stiffness),
        motor_friction=_none(1),
        joint_friction=_none(1),
    )
    parts: list[Part] = [Axis("A1"), FlexibleLink("link", body, "tip")]
    return assemble(
        "one_link_arm",
        parts,
        drives,
        _limits(1),
        axis_signs=np.ones(1),
        axis_zeros=np.zeros(1),
        poses={"zero": np.zeros(1)},
        counterbalanced_axis=0,
        gravity=(0.0, 0.0, 0.0),
        sources=(
            "rotor 1 kg m^2, joint 100 N m/rad, link 0.7 m, 4 kg/m, EI 0.6 N m^2: "
            "public file of rest-to-rest motions of a one-link arm with elastic joint",
        ),
        assumptions=(
            "no damping in the source: 1e-6 s times the stiffness of the joint here, "
            "none in the link",
            "no hub behind the joint: its inertia there is the link's",
        ),
    )


def _bending_beam(beam, modes, tip_mass, support, outputs):
    tip = TipMass(tip_mass, np.zeros(3)) if tip_mass else None
    return modal_beam(
        beam,
        ModeCounts(modes),
        tip=tip,
        support=support,
        rotary_inertia=False,
        damping_ratio=DAMPING_RATIO,
        nodes=outputs,
    )


def _load(mass: float, name: str) -> list[Part]:
    """A point mass at the current frame, or nothing."""
    return [Body(name, mass, np.zeros(3), np.zeros((3, 3)))] if mass else []


def _link(name: str, body, support: AbstractSupport) -> FlexibleLink:
    """The beam clamped to its joint, or floating where its modes turn the root."""
    if support.holds_slope:
        return FlexibleLink(name, body, "tip")
    nodes = body.nodes
    if support.holds_deflection:  # exactly
        nodes = dataclasses.replace(nodes, phi=nodes.phi.at[0].set(0.0))
    body = dataclasses.replace(body, nodes=nodes)
    return FlexibleLink(name, body, "tip", "base", floating=True)


def _none(number: int) -> CoulombViscousFriction:
    zero = np.zeros(number)
    return CoulombViscousFriction(zero, zero, np.ones(number))


def _limits(number: int) -> JointLimits:
    one = np.ones(number)
    return JointLimits(-np.pi * one, np.pi * one, 3.0 * one, 20.0 * one, 200.0 * one)


def _assembled(name: str, parts: list[Part], number: int, gravity) -> ElasticRobot:
    drives = DriveTrain(
        ratio=np.ones(number),
        motor=Motor(np.full(number, ROTOR)),
        stiffness=None,
        damping=np.ones(number),
        motor_friction=_none(number),
        joint_friction=_none(number),
    )
    return assemble(
        name,
        parts,
        drives,
        _limits(number),
        axis_signs=np.ones(number),
        axis_zeros=np.zeros(number),
        poses={"zero": np.zeros(number)},
        counterbalanced_axis=0,
        gravity=gravity,
        sources=("structure: [Reiner2010] section 3.5.1",),
        assumptions=(
            "all numbers: steel rods of 20 mm and 1 m, tip mass 0.5 kg, damping ratio "
            "0.005 unless given; the text has none",
            "torque drives: motors of 1e-6 kg m^2 without gears",
        ),
    )


def three_axis_arm(
    counts: ModeCounts = ModeCounts(2, 2, 2), *, load: float = 8.0
) -> ElasticRobot:
    """Three axes, a rigid link and a flexible beam with an eccentric load.

    Axis 1 stands upright, axes 2 and 3 lie parallel; at zero the arm is stretched
    along x. Rigid gears: the angles of the axes are inputs.

    Args:
        counts: modes of the beam behind axis 3, `bending_xy` in the plane of the arm.
        load: mass beside the end of the beam [kg].

    References:
        [Reiner2010] figure 3.16; the text gives no parameters, all are assumed.
    """
    tube = UniformBeam(
        Material(young=7e10, shear=2.6e10, density=2700.0),
        BeamSection.circular_tube(diameter=0.06, wall=0.003),
        0.9,
    )
    shape = TipMass(load, np.zeros(3), belongs=False)
    body = modal_beam(tube, counts, tip=shape, damping_ratio=0.01)
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    box = lambda x: np.diag([0.01, x, x])
    aside = (0.0, 0.05, 0.10)
    parts: list[Part] = [
        Offset((0.0, 0.0, 0.5)),
        Axis("A1"),
        Body("column", 20.0, (0.0, 0.0, 0.1), 0.2 * np.eye(3)),
        Offset(rotation=upright),
        Axis("A2"),
        Body("link", 12.0, (0.35, 0.0, 0.0), box(0.5)),
        Offset((0.7, 0.0, 0.0)),
        Axis("A3"),
        FlexibleLink("beam", body, "tip"),
        Body("load", load, aside, 0.005 * load * np.eye(3)),
    ]
    number = 3
    drives = DriveTrain(
        ratio=np.full(number, 100.0),
        motor=Motor(np.full(number, 1e-4)),
        stiffness=None,
        damping=np.ones(number),
        motor_friction=_none(number),
        joint_friction=_none(number),
    )
    tool = np.eye(4)
    tool[:3, 3] = aside
    return assemble(
        "three_axis_arm",
        parts,
        drives,
        _limits(number),
        axis_signs=np.ones(number),
        axis_zeros=np.zeros(number),
        poses={"stretched": np.zeros(number), "bent": np.array([0.0, 0.6, -1.0])},
        tool=tool,
        sources=("structure: [Reiner2010] figure 3.16",),
        assumptions=(
            "all numbers: aluminium tube 60 x 3 mm of 0.9 m, damping ratio 0.01, load "
            "of 8 kg at 0.05 m and 0.10 m beside its axis; the text has none",
        ),
    )
