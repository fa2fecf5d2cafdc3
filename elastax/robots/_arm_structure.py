"""How a KUKA arm's two long members bend: nothing, hinges, segments or modes.

The members are uniform tubes inside of the bodies of the links: what a tube has of a
link's mass is taken off the link, so that the undeformed robot is the same at every
detail.
"""

import abc
import dataclasses
from typing import NamedTuple

import equinox as eqx
import numpy as np

from ..dynamics import (
    Body,
    FlexibleLink,
    Offset,
    Part,
    segmented_beam_parts,
)
from ..structure import (
    BeamSegments,
    GaussHinges,
    ModalBody,
    ModeCounts,
    SlenderBody,
    UniformBeam,
    modal_beam,
)


class Member(NamedTuple):
    """A long member: its parts from clamp to tip, and the mass that they hold.

    It runs beside the x axis of the link, through the link's centre of mass.

    Attributes:
        parts: in the frame of the clamp, x along the member.
        mass: [kg]; zero where the link's body keeps all of it.
        com: centre of mass from the clamp [m], shape (3,).
        inertia: about the centre of mass, shape (3, 3) [kg m^2].
    """

    parts: list[Part]
    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def taken_off(self, body: Body) -> Body:
        """What is left of a link's body, given in the frame of the clamp.

        Raises:
            ValueError: the member is heavier, or turns heavier, than the link.
        """
        mass = float(np.asarray(body.mass)) - self.mass
        com = np.asarray(body.com, float)
        if mass <= 0:
            raise ValueError(
                f"the member in `{body.name}` has {self.mass:.4g} kg, the whole link "
                f"only {float(np.asarray(body.mass)):.4g} kg"
            )
        left = (body.mass * com - self.mass * self.com) / mass
        inertia = np.asarray(body.inertia, float) + _steiner(body.mass, com - left)
        inertia = inertia - self.inertia - _steiner(self.mass, self.com - left)
        return Body(body.name, mass, tuple(left), inertia)


def _steiner(mass, shift: np.ndarray) -> np.ndarray:
    return float(np.asarray(mass)) * (
        shift @ shift * np.eye(3) - np.outer(shift, shift)
    )


class AbstractArmStructure(abc.ABC):
    """Detail of the link arm and of the arm between axes 3 and 4."""

    @property
    @abc.abstractmethod
    def has_hinges(self) -> bool:
        """Whether the links' own bodies hang on hinges of section 2.4.3."""

    @abc.abstractmethod
    def member(self, name: str, tube: UniformBeam, damping_time: float) -> Member:
        """A member along x from its clamp.

        Args:
            name: of the link.
            tube: assumed tube.
            damping_time: damper over spring [s].
        """


def _rigid(tube: UniformBeam) -> Member:
    step = Offset((float(tube.length), 0.0, 0.0))
    return Member([step], 0.0, np.zeros(3), np.zeros((3, 3)))


@dataclasses.dataclass(frozen=True)
class TiltedArm(AbstractArmStructure):
    """Tilting bearings at the axes 1 and 3 only; rigid members."""

    @property
    def has_hinges(self) -> bool:
        return False

    def member(self, name: str, tube: UniformBeam, damping_time: float) -> Member:
        return _rigid(tube)


@dataclasses.dataclass(frozen=True)
class HingedArm(AbstractArmStructure):
    """Tilting bearings, and links on hinges with end slopes: eight coordinates.

    References:
        [Reiner2010] sections 2.4.1 and 2.4.3, second variant.
    """

    @property
    def has_hinges(self) -> bool:
        return True

    def member(self, name: str, tube: UniformBeam, damping_time: float) -> Member:
        return _rigid(tube)


@dataclasses.dataclass(frozen=True)
class LumpedArm(AbstractArmStructure):
    """Tilting bearings, and both members as four segments with five hinges.

    References:
        [Reiner2010] (2.23), (2.24), per axis.
    """

    @property
    def has_hinges(self) -> bool:
        return False

    def member(self, name: str, tube: UniformBeam, damping_time: float) -> Member:
        mass, com, inertia = tube_inertia(tube)
        body = SlenderBody(mass, tube.length, com[0], np.diag(inertia))
        segments = BeamSegments.of(body, per_axis=True)
        hinges = GaussHinges.of(tube)
        damping = damping_time * np.asarray(hinges.stiffness)
        parts = segmented_beam_parts(name, segments, hinges, damping)
        return Member(parts, mass, com, inertia)


@dataclasses.dataclass(frozen=True)
class ModalArm(AbstractArmStructure):
    """Tilting bearings, and both members as beams in their eigenmodes.

    Attributes:
        counts: modes of each member; `bending_xy` of the link arm is in its plane.
        damping_ratio: of every mode, 1 % as the hinges have at 10 Hz.

    References:
        [Reiner2010] section 2.4.2.
    """

    counts: ModeCounts = ModeCounts(1, 1, 1)
    damping_ratio: float = 0.01

    @property
    def has_hinges(self) -> bool:
        return False

    def member(self, name: str, tube: UniformBeam, damping_time: float) -> Member:
        body = modal_beam(tube, self.counts, damping_ratio=self.damping_ratio)
        body = dataclasses.replace(body, nodes=_exact_base(body))
        return modal_member(name, body, "tip", None)


@dataclasses.dataclass(frozen=True)
class BodiesArm(AbstractArmStructure):
    """Tilting bearings, and both members as given modal bodies, such as SID data.

    Attributes:
        link_arm, arm: the bodies, x along the member; with damping.
        base, tip: nodes at which both are attached.

    References:
        [Reiner2010] section 3.7.

    Examples:
        >>> body = load_sid("link_arm.SID_FEM").modal_body().with_damping_ratio(0.01)
        >>> robot = kr210(BodiesArm(body, other, base="1", tip="2"))
    """

    link_arm: ModalBody
    arm: ModalBody
    base: str = "base"
    tip: str = "tip"

    @property
    def has_hinges(self) -> bool:
        return False

    def member(self, name: str, tube: UniformBeam, damping_time: float) -> Member:
        body = self.link_arm if name == "link arm" else self.arm
        nodes = body.nodes
        position = np.asarray(nodes.position)
        reach = position[nodes.index(self.tip)] - position[nodes.index(self.base)]
        expected = np.array([float(tube.length), 0.0, 0.0])
        if np.linalg.norm(reach - expected) > 1e-6 * expected[0]:
            raise ValueError(
                f"the body of `{name}` must reach from `{self.base}` to `{self.tip}` "
                f"by {expected} m, but does by {reach}: turn it with `moved`, and "
                "check its units"
            )
        return modal_member(name, body, self.tip, self.base)


def modal_member(name: str, body: ModalBody, tip: str, base: str | None) -> Member:
    """A member from a modal body."""
    mass, com = float(body.mass), np.asarray(body.first_moment / body.mass)
    inertia = np.asarray(body.J_0) - _steiner(mass, com)
    if base is not None:
        com = com - np.asarray(body.nodes.position)[body.nodes.index(base)]
    return Member([FlexibleLink(name, body, tip, base)], mass, com, inertia)


def tube_inertia(tube: UniformBeam):
    """Mass, centre of mass and inertia of a uniform tube along x."""
    mass, length = float(tube.mass()), float(tube.length)
    section, density = tube.section, float(tube.material.density)
    about_y = density * float(section.second_moment_y) * length
    about_z = density * float(section.second_moment_z) * length
    rod = mass * length**2 / 12.0
    inertia = np.diag([about_y + about_z, rod + about_y, rod + about_z])
    return mass, np.array([0.5 * length, 0.0, 0.0]), inertia


def _exact_base(body: ModalBody):
    """Nodes with exact zeros at the clamp, where rounding left some."""
    still = lambda x: x.at[0].set(0.0)
    return eqx.tree_at(
        lambda nodes: (nodes.phi, nodes.psi), body.nodes, replace_fn=still
    )
