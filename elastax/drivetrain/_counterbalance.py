r"""Counterbalance: a spring or gas cylinder that relieves the motor of axis 2.

The cylinder is hinged on the carrier at the distance $b$ from the axis and on the
rocker at the distance $a$. With $\psi = \varphi + \varphi_0$, zero where the hinges lie
on one side of the axis and in line with it (the dead point, shortest cylinder), its
length is

$$L = \sqrt{a^2 + b^2 - 2ab\cos\psi} = \sqrt{(a - b)^2 + 4ab\sin^2(\psi/2)}.$$

Signs: `force` is a pull, positive where the cylinder draws its ends together; `torque`
is what the counterbalance exerts on the joint in the direction of `angle`,
$\tau = -\mathrm dV/\mathrm d\varphi = -F\,\mathrm dL/\mathrm d\varphi$: a pull drives
back to the dead point. The mass of the cylinder and its place beside the plane of
motion are options, see `CylinderBody`. The text describes the device, but gives no
equation.
"""

import abc
import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import Scalar, as_real
from ._cylinder_body import CylinderBody


class AbstractCounterbalance(eqx.Module):
    """Conservative element between the carrier and the rocker of one axis."""

    @abc.abstractmethod
    def force(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Pull of the cylinder [N] at the joint `angle` [rad]."""

    @abc.abstractmethod
    def torque(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Torque [N m] on the joint in the direction of `angle`, minus dV/dangle."""

    @abc.abstractmethod
    def potential(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Stored energy [J], zero at the reference length."""

    @abc.abstractmethod
    def damping_torque(
        self, angle: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        r"""Torque [N m] of the rod's viscous friction, $-d\,L'(\varphi)^2\dot\varphi$.

        Args:
            angle: joint angle [rad].
            speed: joint speed [rad/s].
        """

    @abc.abstractmethod
    def inertia(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        r"""Inertia [kg m^2] of the cylinder's mass about the axis, carrier at rest.

        $J(\varphi) = m\,|\mathrm d r/\mathrm d\varphi|^2$. The joint needs the torque
        $J\ddot\varphi + \tfrac12 J'(\varphi)\dot\varphi^2$ for it: Lagrange's term
        $-\tfrac12 J'\dot\varphi^2$ acts on the joint. A mass at a fixed share of the
        way runs on a circle of the radius $\lambda a$ about a point of the carrier, so
        that $J = m\lambda^2 a^2$ is the same at every angle and the term vanishes.

        Dynamics and energy of a robot do not count the cylinder's mass.
        """

    @abc.abstractmethod
    def gravity_torque(
        self, angle: Float[Array, "..."], down: Float[Array, "2"]
    ) -> Float[Array, "..."]:
        r"""Torque [N m] of the cylinder's weight on the joint.

        $\tau = m\,g\cdot\mathrm dr/\mathrm d\varphi$, in the direction of `angle`.

        Args:
            angle: joint angle [rad].
            down: $g$ in the plane of motion [m/s^2], in the frame of the carrier: x
                from the axis to the carrier's hinge, y a quarter turn on in the
                direction of `angle`.
        """

    @abc.abstractmethod
    def lateral_moment(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        r"""Moment [N m] orthogonal to the axis that the pull puts on the rocker, $F e$.

        The pull acts along $u$, from the rocker's hinge to the carrier's, beside the
        plane of motion at $e\,n$ with the axis of rotation $n$. Its moment about the
        point of the axis in the plane is $F e\,(n \times u)$ besides `torque`, with

        $$n \times u = \frac1L \begin{pmatrix} a\sin\psi \\ b - a\cos\psi
          \end{pmatrix}$$

        in the frame of `gravity_torque`: orthogonal to the cylinder. The carrier is
        under the opposite moment.
        """


class SpringCounterbalance(AbstractCounterbalance):
    r"""Preloaded spring, $F = F_0 + c\,(L - L_0)$.

    Attributes:
        base_distance: $b > 0$, from the axis to the hinge on the carrier [m].
        lever: $a > 0$, $a \ne b$, from the axis to the hinge on the rocker [m].
        angle_offset: $\varphi_0$; the dead point is at the joint angle $-\varphi_0$
            [rad].
        spring_rate: $c > 0$ [N/m].
        reference_length: $L_0 > 0$, the length at which the preload holds [m].
        preload: $F_0$ [N].
        damping: viscous damping of the rod, not negative [N s/m].
        body: mass of the cylinder and its lateral offset, or `None` for none of both.

    Raises:
        ValueError: a parameter is outside its range, or `lever` equals
            `base_distance`, so that the length could vanish.

    References:
        [Reiner2010] sec. 2.5, without an equation; the geometry is ours.
    """

    base_distance: Scalar = eqx.field(converter=as_real)
    lever: Scalar = eqx.field(converter=as_real)
    angle_offset: Scalar = eqx.field(converter=as_real)
    spring_rate: Scalar = eqx.field(converter=as_real)
    reference_length: Scalar = eqx.field(converter=as_real)
    preload: Scalar = eqx.field(converter=as_real)
    damping: Scalar = eqx.field(converter=as_real, default=0.0)
    body: CylinderBody | None = None

    def __check_init__(self):
        check_fields(self)
        _check_geometry(self)
        check_values(
            "`spring_rate` must be positive", self.spring_rate, self.spring_rate > 0
        )

    def length(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Length of the spring [m] at the joint `angle` [rad]."""
        return _length(self, angle)

    def force(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        extension = _length(self, angle) - self.reference_length
        return self.preload + self.spring_rate * extension

    def torque(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return -self.force(angle) * _arm(self, angle)

    def potential(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        extension = _length(self, angle) - self.reference_length
        return (self.preload + 0.5 * self.spring_rate * extension) * extension

    def damping_torque(
        self, angle: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        return -self.damping * _arm(self, angle) ** 2 * speed

    def inertia(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return _inertia(self, angle)

    def gravity_torque(
        self, angle: Float[Array, "..."], down: Float[Array, "2"]
    ) -> Float[Array, "..."]:
        return _gravity_torque(self, angle, down)

    def lateral_moment(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return _lateral_moment(self, angle)


class GasCounterbalance(AbstractCounterbalance):
    r"""Hydraulic cylinder that compresses the gas of a bladder accumulator.

    Pulling the rod out by $L - L_0$ drives the oil of the ring chamber, of the area
    $A = \pi(D_p^2 - D_r^2)/4$, into the accumulator:

    $$p = \frac{p_0 V_0}{V_0 - A\,(L - L_0)},\quad F = p\,A,\quad
      V = -p_0 V_0 \ln\Bigl(1 - \frac{A\,(L - L_0)}{V_0}\Bigr).$$

    Isothermal gas of constant compressibility. Ambient pressure on the piston, the
    friction of the seals and the flow losses of the oil are left out.

    Attributes:
        base_distance: $b > 0$, from the axis to the hinge on the carrier [m].
        lever: $a > 0$, $a \ne b$, from the axis to the hinge on the rocker [m].
        angle_offset: $\varphi_0$; the dead point is at the joint angle $-\varphi_0$
            [rad].
        reference_length: $L_0$, at which the gas fills `volume` [m].
        pressure: $p_0$ at the reference length [Pa].
        volume: $V_0$ of the gas at the reference length [m^3].
        piston_diameter: $D_p$ [m].
        rod_diameter: $D_r < D_p$ [m].
        damping: viscous damping of the rod, not negative [N s/m].
        body: mass of the cylinder and its lateral offset, or `None` for none of both.

    Raises:
        ValueError: a parameter is outside its range, `lever` equals `base_distance`,
            or the longest stroke would empty the gas volume.

    References:
        [Weigand2021], the counterbalance of the KUKA KR300 in the program.
    """

    base_distance: Scalar = eqx.field(converter=as_real)
    lever: Scalar = eqx.field(converter=as_real)
    angle_offset: Scalar = eqx.field(converter=as_real)
    reference_length: Scalar = eqx.field(converter=as_real)
    pressure: Scalar = eqx.field(converter=as_real)
    volume: Scalar = eqx.field(converter=as_real)
    piston_diameter: Scalar = eqx.field(converter=as_real)
    rod_diameter: Scalar = eqx.field(converter=as_real)
    damping: Scalar = eqx.field(converter=as_real, default=0.0)
    body: CylinderBody | None = None

    def __check_init__(self):
        check_fields(self)
        _check_geometry(self)
        for name in ("pressure", "volume"):
            value = getattr(self, name)
            check_values(f"`{name}` must be positive", value, value > 0)
        check_values(
            "`rod_diameter` must not be negative and be below `piston_diameter`",
            self.rod_diameter,
            (self.rod_diameter >= 0) & (self.rod_diameter < self.piston_diameter),
        )
        stroke = self.lever + self.base_distance - self.reference_length
        check_values(
            "`volume` must be above the oil of the longest stroke",
            self.volume,
            self.volume > self.area() * stroke,
        )

    @classmethod
    def from_gas(
        cls,
        *,
        mass,
        gas_constant,
        temperature,
        compressibility,
        volume,
        **geometry,
    ) -> "GasCounterbalance":
        r"""From the filling, $p_0 V_0 = Z R T m$.

        The four numbers only act through their product, and `pressure` replaces them.

        Args:
            mass: mass $m$ of the gas [kg].
            gas_constant: specific gas constant $R$ [J/(kg K)].
            temperature: $T$ [K].
            compressibility: $Z$ [-].
            volume: $V_0$ [m^3].
            geometry: the other attributes.

        References:
            [Weigand2021]: for the KUKA KR300 $m$ = 0.159 kg of nitrogen, $R$ = 296.8
            J/(kg K), $T$ = 328 K, $Z$ = 1.01, $V_0$ = 0.96e-3 m^3, diameters 55 and
            30 mm, $b$ = 0.8 m, $a$ = 0.2 m, $L_0 = b - a$, dead point at -95 deg of the
            maker's angle. The diameter of the piston and the filling are estimates
            there. The nine pressures measured from -120 to -40 deg, 162 to 200 bar, are
            met within 3.3 bar (1.7 bar rms). The ring chamber is the only area that
            does: the full piston would give 220 bar at -40 deg, the rod 176 bar. Moving
            the dead point and the filling gains little (1.4 bar rms).
        """
        energy = compressibility * gas_constant * temperature * mass
        return cls(pressure=energy / volume, volume=volume, **geometry)

    def area(self) -> Scalar:
        """Area of the ring chamber [m^2]."""
        return 0.25 * math.pi * (self.piston_diameter**2 - self.rod_diameter**2)

    def length(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Length of the cylinder [m] at the joint `angle` [rad]."""
        return _length(self, angle)

    def gas_pressure(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """Pressure of the gas [Pa] at the joint `angle` [rad]."""
        return self.pressure / (1.0 - _compression(self, angle))

    def force(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return self.gas_pressure(angle) * self.area()

    def torque(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return -self.force(angle) * _arm(self, angle)

    def potential(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return -self.pressure * self.volume * jnp.log1p(-_compression(self, angle))

    def damping_torque(
        self, angle: Float[Array, "..."], speed: Float[Array, "..."]
    ) -> Float[Array, "..."]:
        return -self.damping * _arm(self, angle) ** 2 * speed

    def inertia(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return _inertia(self, angle)

    def gravity_torque(
        self, angle: Float[Array, "..."], down: Float[Array, "2"]
    ) -> Float[Array, "..."]:
        return _gravity_torque(self, angle, down)

    def lateral_moment(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        return _lateral_moment(self, angle)


def _check_geometry(cylinder) -> None:
    for name in ("base_distance", "lever", "reference_length"):
        value = getattr(cylinder, name)
        check_values(f"`{name}` must be positive", value, value > 0)
    check_values(
        "`damping` must not be negative", cylinder.damping, cylinder.damping >= 0
    )
    if is_concrete(cylinder.lever, cylinder.base_distance):
        lever, distance = float(cylinder.lever), float(cylinder.base_distance)
        check_values(
            "`lever` must differ from `base_distance`, or the length vanishes at the "
            "dead point",
            lever,
            abs(lever - distance) > 1e-6 * distance,
        )


def _length(cylinder, angle):
    a, b = cylinder.lever, cylinder.base_distance
    half = 0.5 * (angle + cylinder.angle_offset)
    # The square root is of at least (a - b)^2, so that it stays differentiable.
    return jnp.sqrt((a - b) ** 2 + 4.0 * a * b * jnp.sin(half) ** 2)


def _arm(cylinder, angle):
    """Lever arm dL/dangle [m]."""
    a, b = cylinder.lever, cylinder.base_distance
    sine = jnp.sin(angle + cylinder.angle_offset)
    return a * b * sine / _length(cylinder, angle)


def _compression(cylinder, angle):
    """Share of the gas volume that the oil has taken."""
    stroke = _length(cylinder, angle) - cylinder.reference_length
    return stroke * cylinder.area() / cylinder.volume


def _inertia(cylinder, angle):
    if cylinder.body is None:
        return jnp.zeros_like(angle)
    radius = cylinder.body.mass_position * cylinder.lever
    return cylinder.body.mass * radius**2 * jnp.ones_like(angle)


def _gravity_torque(cylinder, angle, down):
    if cylinder.body is None:
        return jnp.zeros_like(angle)
    psi = angle + cylinder.angle_offset
    along = down[1] * jnp.cos(psi) - down[0] * jnp.sin(psi)
    return cylinder.body.mass * cylinder.body.mass_position * cylinder.lever * along


def _lateral_moment(cylinder, angle):
    if cylinder.body is None:
        return jnp.zeros_like(angle)
    return cylinder.force(angle) * cylinder.body.lateral_offset
