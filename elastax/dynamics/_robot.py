"""The elastic robot: chain, bodies, springs, drive trains and what its maker says."""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import PerElastic, PerJoint, Transform, Vector3, as_real
from .._taylor import concatenate, product
from ..drivetrain import AbstractCounterbalance, DriveTrain
from ..kinematics import Arm, DeformableArm, SerialChain
from ..structure import AbstractStiffness, BodyDetail
from ._bodies import RigidBodies
from ._modal_links import ModalLink, undeformed_bodies
from ._reduce import locked_chain


@dataclasses.dataclass(frozen=True)
class AxisRole:
    """The joint is the driven axis `index`."""

    index: int


@dataclasses.dataclass(frozen=True)
class ElasticRole:
    """The joint is the elastic coordinate `index`."""

    index: int


@dataclasses.dataclass(frozen=True)
class SlopeRole:
    """The joint follows the elastic coordinate `index` by the end slope `slope`."""

    index: int
    slope: int


@dataclasses.dataclass(frozen=True)
class NodeRole:
    """The joint is a direction in which a node of a modal body moves.

    Its coordinate is the sum of the elastic coordinates `indices` times `slopes`.
    """

    indices: tuple[int, ...]
    slopes: tuple[int, ...]


JointRole = AxisRole | ElasticRole | SlopeRole | NodeRole


class JointLimits(eqx.Module):
    """What the axes may do, in the maker's angles.

    Attributes:
        lower, upper: angles [rad], shape (axes,).
        velocity: [rad/s].
        acceleration: [rad/s^2].
        jerk: [rad/s^3].
    """

    lower: PerJoint = eqx.field(converter=as_real)
    upper: PerJoint = eqx.field(converter=as_real)
    velocity: PerJoint = eqx.field(converter=as_real)
    acceleration: PerJoint = eqx.field(converter=as_real)
    jerk: PerJoint = eqx.field(converter=as_real)

    def __check_init__(self):
        check_fields(self)
        check_values(
            "`upper` limits must lie above `lower`", self.upper, self.upper > self.lower
        )
        for name in ("velocity", "acceleration", "jerk"):
            value = getattr(self, name)
            check_values(f"`{name}` limits must be positive", value, value > 0)


class ElasticRobot(eqx.Module):
    r"""Serial robot with elastic gears and an elastic structure.

    The generalised position is $(q, \eta, \theta)$: joint angles on the output side,
    structural elastic coordinates, motor angles referred to the output side. The joints
    of `chain` are driven by $q$ and $\eta$; those at the end of a bending link follow
    an elastic coordinate by a constant factor (section 2.4.3, second variant).

    Attributes:
        chain: axes, elastic joints and end-slope joints in their order.
        bodies: rigid bodies behind the joints.
        payload: bodies carried by the last link.
        flange: pose of the flange in the frame behind the last joint's motion [m].
        slopes: end-slope factors and mode shapes at nodes, shape (slopes,).
        structure_stiffness: spring laws of the elastic coordinates.
        structure_damping: damping of the elastic coordinates [N m s/rad]; those of
            modal bodies are in the units of their modes.
        drives: one drive train per axis.
        counterbalance: acts on the axis `counterbalanced_axis`, or `None`.
        gravity: gravity vector in the base frame [m/s^2].
        limits: of the axes, in the maker's angles.
        axis_signs: +1 or -1, shape (axes,): q = sign * maker's angle + zero.
        axis_zeros: chain angle at the maker's zero [rad].
        poses: named poses in the maker's angles [rad].
        roles: what moves each joint of the chain.
        wrist: joint of the chain whose origin is the wrist centre.
        counterbalanced_axis: index of the axis.
        name, axis_names, elastic_names: for tables and messages.
        sources: where the numbers come from.
        assumptions: what was assumed, where no source gives a number.
        modal_links: flexible bodies between the joints.

    References:
        [Reiner2010] (2.38), sections 2.4.1 to 2.4.3, 2.5, 3.7.
    """

    chain: SerialChain
    bodies: RigidBodies
    payload: RigidBodies
    flange: Transform = eqx.field(converter=as_real)
    slopes: Float[Array, " slopes"] = eqx.field(converter=as_real)
    structure_stiffness: AbstractStiffness | None
    structure_damping: PerElastic = eqx.field(converter=as_real)
    drives: DriveTrain
    counterbalance: AbstractCounterbalance | None
    gravity: Vector3 = eqx.field(converter=as_real)
    limits: JointLimits
    axis_signs: PerJoint = eqx.field(converter=as_real)
    axis_zeros: PerJoint = eqx.field(converter=as_real)
    poses: dict[str, PerJoint]
    roles: tuple[JointRole, ...] = eqx.field(static=True)
    wrist: int = eqx.field(static=True)
    counterbalanced_axis: int = eqx.field(static=True)
    name: str = eqx.field(static=True)
    axis_names: tuple[str, ...] = eqx.field(static=True)
    elastic_names: tuple[str, ...] = eqx.field(static=True)
    sources: tuple[str, ...] = eqx.field(static=True, default=())
    assumptions: tuple[str, ...] = eqx.field(static=True, default=())
    modal_links: tuple[ModalLink, ...] = ()

    def __check_init__(self):
        check_fields(self)
        if len(self.roles) != self.chain.number:
            raise ValueError(
                "`roles` must name what moves every joint of the chain: there are "
                f"{self.chain.number} joints, but {len(self.roles)} roles"
            )
        if self.drives.number != self.axes:
            raise ValueError(
                "`drives` must hold one drive train per axis: there are "
                f"{self.axes} axes, but {self.drives.number} drive trains"
            )
        check_values(
            "`structure_damping` must not be negative [N m s/rad]",
            self.structure_damping,
            self.structure_damping >= 0,
        )

    @property
    def axes(self) -> int:
        """Number of driven axes $n_a$."""
        return sum(isinstance(role, AxisRole) for role in self.roles)

    @property
    def elastic(self) -> int:
        """Number of structural elastic coordinates $n_e$."""
        hinges = sum(isinstance(role, ElasticRole) for role in self.roles)
        return hinges + sum(link.body.modes for link in self.modal_links)

    @property
    def modal_coordinates(self) -> tuple[int, ...]:
        """Elastic coordinates that are amplitudes of modes, not angles."""
        spans = (range(x.first, x.first + x.body.modes) for x in self.modal_links)
        return tuple(k for span in spans for k in span)

    @property
    def has_elastic_gears(self) -> bool:
        """Whether the motors have coordinates of their own."""
        return self.drives.stiffness is not None

    def all_bodies(self) -> RigidBodies:
        """Rigid bodies of the robot and of its payload."""
        return self.bodies.joined(self.payload)

    def coupling(self) -> Float[Array, "joints coordinates"]:
        r"""Matrix $G$ of the chain's joints: $s = G\,(q, \eta)$."""
        constant = np.zeros((len(self.roles), self.axes + self.elastic))
        rows, columns, slopes = [], [], []
        for joint, role in enumerate(self.roles):
            match role:
                case AxisRole(index):
                    constant[joint, index] = 1.0
                case ElasticRole(index):
                    constant[joint, self.axes + index] = 1.0
                case SlopeRole(index, slope):
                    rows.append(joint)
                    columns.append(self.axes + index)
                    slopes.append(slope)
                case NodeRole(indices, weights):
                    rows += [joint] * len(indices)
                    columns += [self.axes + index for index in indices]
                    slopes += weights
        matrix = jnp.asarray(constant, self.gravity.dtype)
        if not rows:
            return matrix
        return matrix.at[np.array(rows), np.array(columns)].set(
            self.slopes[np.array(slopes)]
        )

    def axis_joint(self, axis: int) -> int:
        """Index of an axis among the joints of the chain."""
        return self.roles.index(AxisRole(axis))

    def joint_coordinates(self, q, eta):
        """Coordinates of all joints of the chain, of arrays or series."""
        stacked = concatenate([q, eta]) if self.elastic else q
        return product("jn,n->j", self.coupling(), stacked)

    def from_maker(self, angles: PerJoint) -> PerJoint:
        """Chain angles q [rad] of the maker's angles [rad]."""
        return self.axis_signs * angles + self.axis_zeros

    def to_maker(self, q: PerJoint) -> PerJoint:
        """The maker's angles [rad] of chain angles q [rad]."""
        return self.axis_signs * (q - self.axis_zeros)

    def flexible_joint(self) -> "ElasticRobot":
        """The same robot with elastic gears and a rigid structure."""
        return _without_structure(self, self.drives)

    def rigid(self) -> "ElasticRobot":
        """The same robot with rigid gears and a rigid structure."""
        return _without_structure(self, self.drives.rigid())

    def arm(self) -> Arm:
        """The kinematics of the rigid robot, limits in the chain's own angles."""
        limits = self.limits
        # an axis that the maker counts backwards swaps its limits
        ends = jnp.stack([self.from_maker(limits.lower), self.from_maker(limits.upper)])
        return Arm(
            chain=self.rigid().chain,
            lower=jnp.min(ends, axis=0),
            upper=jnp.max(ends, axis=0),
            velocity=limits.velocity,
            signs=self.axis_signs,
            zeros=self.axis_zeros,
            poses=self.poses,
            name=self.name,
            axis_names=self.axis_names,
            sources=self.sources,
            assumptions=self.assumptions,
        )

    def deformable_arm(self) -> DeformableArm:
        """The chain with its elastic joints, for the inverse of the deformed arm."""
        joints = {
            role.index: joint
            for joint, role in enumerate(self.roles)
            if isinstance(role, AxisRole)
        }
        axis_joints = tuple(joints[k] for k in range(self.axes))
        return DeformableArm(self.chain, self.coupling(), axis_joints)

    def with_drives(self, **parts: Any) -> "ElasticRobot":
        """The same robot with other parts in its drive trains.

        Args:
            parts: attributes of `DriveTrain` by name.

        Examples:
            >>> stribeck = StribeckFriction(viscous, coulomb, steepness, a, c)
            >>> robot = kr210().with_drives(motor_friction=stribeck)
        """
        return dataclasses.replace(
            self, drives=dataclasses.replace(self.drives, **parts)
        )

    def with_body_detail(self, detail: BodyDetail) -> "ElasticRobot":
        """The same robot with other terms in the equations of its flexible links."""
        links = tuple(
            dataclasses.replace(link, body=link.body.with_detail(detail))
            for link in self.modal_links
        )
        return dataclasses.replace(self, modal_links=links)

    def with_payload(self, mass, com, inertia) -> "ElasticRobot":
        """The same robot with another payload.

        Args:
            mass: [kg]; zero takes the payload off.
            com: centre of mass in the frame of the flange, shape (3,) [m].
            inertia: about the centre of mass, in the axes of the flange, shape (3, 3)
                [kg m^2].

        Raises:
            ValueError: a positive mass without inertia, or a negative one.
        """
        mass, com, inertia = as_real(mass), as_real(com), as_real(inertia)
        payload = RigidBodies(
            mass[None], com[None], inertia[None], (self.chain.number - 1,), ("payload",)
        )
        return dataclasses.replace(self, payload=payload.moved(self.flange))


def _without_structure(robot: ElasticRobot, drives: DriveTrain) -> ElasticRobot:
    keep = tuple(k for k, role in enumerate(robot.roles) if isinstance(role, AxisRole))
    chain, placement = locked_chain(robot.chain, keep)
    wrist = sum(k <= robot.wrist for k in keep) - 1
    return dataclasses.replace(
        robot,
        chain=chain,
        bodies=robot.bodies.joined(undeformed_bodies(robot.modal_links)).attached(
            placement
        ),
        payload=robot.payload.attached(placement),
        flange=placement[1][-1] @ robot.flange,
        slopes=jnp.zeros((0,)),
        structure_stiffness=None,
        structure_damping=jnp.zeros((0,)),
        drives=drives,
        roles=tuple(robot.roles[k] for k in keep),
        wrist=wrist,
        elastic_names=(),
        modal_links=(),
    )
