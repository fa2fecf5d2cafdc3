r"""Modal bodies of uniform beams: bending in two planes, torsion, extension.

The reference frame stands at the base of the beam with x along it. Bending in the x-y
plane turns the cross sections about z, bending in the x-z plane about -y. The
eigenfunctions are those of Rayleigh's or Euler and Bernoulli's beam; all integrals
along it are Gauss-Legendre sums.
"""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values
from .._custom_types import Scalar, as_real
from ._bar_modes import extension_modes, torsion_modes
from ._beam import UniformBeam
from ._beam_supports import AbstractSupport, ClampedFree
from ._bending_modes import bending_modes
from ._body_nodes import BodyNodes
from ._modal_body import ModalBody
from ._point_masses import point_mass_body


class TipMass(eqx.Module):
    r"""Mass at the end of a beam, which shapes its modes.

    Attributes:
        mass: [kg].
        inertia: moments about x, y, z through the end of the beam, shape (3,)
            [kg m^2].
        belongs: whether it is part of the modal body. If not it only shapes the modes,
            and the robot has a body of its own there.

    Raises:
        ValueError: a value is negative.
    """

    mass: Scalar = eqx.field(converter=as_real)
    inertia: Float[Array, "3"] = eqx.field(converter=as_real)
    belongs: bool = eqx.field(static=True, default=True)

    def __check_init__(self):
        check_fields(self)
        for name in ("mass", "inertia"):
            value = getattr(self, name)
            check_values(f"`{name}` must not be negative", value, value >= 0)


class ModeCounts(eqx.Module):
    """How many modes of each kind a beam has.

    Attributes:
        bending_xy: in the x-y plane, cross sections turn about z.
        bending_xz: in the x-z plane.
        torsion: about x.
        extension: along x.

    Raises:
        ValueError: a number is negative, or all are zero.
    """

    bending_xy: int = eqx.field(static=True, default=0)
    bending_xz: int = eqx.field(static=True, default=0)
    torsion: int = eqx.field(static=True, default=0)
    extension: int = eqx.field(static=True, default=0)

    def __check_init__(self):
        counts = (self.bending_xy, self.bending_xz, self.torsion, self.extension)
        if min(counts) < 0 or not any(counts):
            raise ValueError(f"a beam needs at least one mode, not {counts}")


def modal_beam(
    beam: UniformBeam,
    counts: ModeCounts,
    *,
    support: AbstractSupport = ClampedFree(),
    tip: TipMass | None = None,
    rotary_inertia: bool = True,
    shortening: bool = True,
    damping_ratio=0.0,
    nodes: Sequence[float] = (),
    name: str = "beam",
) -> ModalBody:
    r"""Beam in its own eigenmodes, $M_e = 1$ and $K_e = \mathrm{diag}(\omega^2)$.

    The second-order displacement is the shortening of a bent beam that keeps the length
    of its axis, $u_x = -\tfrac12\int_0^x (v'^2 + w'^2)\,dx$, the source of geometric
    stiffening. What torsion and bending do to each other in second order is left out,
    and so is the rotary inertia's share of it.

    Args:
        beam: material, section and length.
        counts: numbers of modes.
        support: of the base, for bending; torsion and extension are held there unless
            it is free.
        tip: mass at the end.
        rotary_inertia: whether the cross sections have inertia (Rayleigh) or not
            (Euler and Bernoulli); about x they always do.
        shortening: whether a bent beam is shortened. Without it there is no geometric
            stiffening, and a beam that turns fast diverges.
        damping_ratio: $\zeta$ of all modes, or one per mode.
        nodes: further nodes besides `base` and `tip`, as fractions of the length.
        name: of the body.

    Raises:
        ValueError: a fraction outside (0, 1), or a mode count that is refused.

    References:
        [Reiner2010] section 2.4.2 and (2.21).
    """
    places = np.array([*sorted(nodes)], float)
    if np.any((places <= 0.0) | (places >= 1.0)):
        raise ValueError(f"`nodes` must lie within (0, 1) of the length, not {nodes}")
    ratio = as_real(damping_ratio)
    check_values("`damping_ratio` must not be negative", ratio, ratio >= 0)
    body = _built(
        beam,
        counts,
        support,
        tip,
        tuple(places.tolist()),
        name,
        rotary_inertia=rotary_inertia,
        shortening=shortening,
    )
    damping = jnp.diag(2.0 * ratio * jnp.sqrt(jnp.diag(body.K_e)))
    return dataclasses.replace(body, D_e=damping)


@eqx.filter_jit
def _built(
    beam: UniformBeam,
    counts: ModeCounts,
    support: AbstractSupport,
    tip: TipMass | None,
    places: tuple[float, ...],
    name: str,
    *,
    rotary_inertia: bool,
    shortening: bool,
) -> ModalBody:
    """The undamped body, in one program: of hundreds of small ones it takes longer."""
    length, density, section = beam.length, beam.material.density, beam.section
    mu = density * section.area
    I_y, I_z = section.second_moment_y, section.second_moment_z
    zero = jnp.zeros_like(length)
    weight, inertia = (zero, jnp.zeros(3)) if tip is None else (tip.mass, tip.inertia)
    families = []
    if counts.bending_xy or counts.bending_xz:
        # both planes at once: the search for roots is most of the program
        both = jnp.stack([I_z, I_y])
        planes = jax.vmap(
            lambda I, turning: bending_modes(
                beam.material.young * I,
                mu,
                length,
                max(counts.bending_xy, counts.bending_xz),
                support=support,
                rotary_inertia=density * I if rotary_inertia else zero,
                tip_mass=weight,
                tip_inertia=turning,
            )
        )(both, inertia[np.array([2, 1])])
        for k, number in enumerate((counts.bending_xy, counts.bending_xz)):
            first = lambda x, k=k, n=number: x[k, :n] if x.ndim > 1 else x[k]
            families.append((number, ("xy", "xz")[k], jax.tree.map(first, planes)))
    if counts.torsion:
        modes = torsion_modes(
            beam, counts.torsion, support=support, tip_inertia=inertia[0]
        )
        families.append((counts.torsion, "torsion", modes))
    if counts.extension:
        modes = extension_modes(
            beam, counts.extension, support=support, tip_mass=weight
        )
        families.append((counts.extension, "extension", modes))
    abscissas, weights = _gauss(20 + 8 * max(n for n, _, _ in families))
    points = np.concatenate([abscissas, [0.0], places, [1.0]])
    whole = jnp.asarray(points) * length
    squares, shapes, turns, slopes, labels = [], [], [], [], []
    for number, label, modes in families:
        squares.append(modes.frequencies**2)
        labels += [f"{label} {k + 1}" for k in range(number)]
        shape, turn, slope = _fields(label, modes, whole)
        shapes.append(shape)
        turns.append(turn)
        slopes.append(slope)
    phi = jnp.concatenate(shapes, axis=2)
    psi = jnp.concatenate(turns, axis=2)
    slope = jnp.concatenate(slopes, axis=2)
    curved = _shortening(slope, _antiderivative(abscissas, places), length)
    if not shortening:
        curved = jnp.zeros_like(curved)
    count = len(abscissas)
    weights = jnp.asarray(weights)
    masses = mu * length * weights
    positions = whole[:, None] * jnp.array([[1.0, 0.0, 0.0]])
    bent = (I_y, I_z) if rotary_inertia else (zero, zero)
    polar = jnp.stack([I_y + I_z, *bent])
    spread = jnp.diag(density * polar * length)
    discs = weights[:, None, None] * spread[None]
    pick = lambda x: x[:count]
    if tip is not None and tip.belongs:
        masses = jnp.concatenate([masses, weight[None]])
        discs = jnp.concatenate([discs, jnp.diag(inertia)[None]])
        pick = lambda x: jnp.concatenate([x[:count], x[-1:]])
    stiffness = jnp.concatenate(squares)
    names = ("base", *(f"{place:g} l" for place in places), "tip")
    return point_mass_body(
        masses,
        pick(positions),
        pick(phi),
        jnp.diag(stiffness),
        curvatures=pick(curved),
        discs=discs,
        rotations=pick(psi),
        nodes=BodyNodes(
            positions[count:], phi[count:], psi[count:], curved[count:], names
        ),
        mode_names=tuple(labels),
        name=name,
    )


def _fields(label: str, modes, x):
    """Displacements, rotations (points, 3, modes) and slopes (points, 2, modes)."""
    value, slope = modes.value(x).T, modes.slope(x).T
    zero = jnp.zeros_like(value)
    along = lambda *rows: jnp.stack(rows, axis=1)
    straight = along(zero, zero)
    match label:
        case "xy":
            shape, turn = along(zero, value, zero), along(zero, zero, slope)
            return shape, turn, along(slope, zero)
        case "xz":
            shape, turn = along(zero, zero, value), along(zero, -slope, zero)
            return shape, turn, along(zero, slope)
        case "torsion":
            return along(zero, zero, zero), along(value, zero, zero), straight
        case _:
            return along(value, zero, zero), along(zero, zero, zero), straight


def _shortening(slope, antiderivative, length):
    """Second-order displacements along x, shape (points, 3, modes, modes)."""
    count = antiderivative.shape[1]
    products = jnp.einsum("pik,pil->pkl", slope[:count], slope[:count])
    integrals = jnp.einsum("qp,pkl->qkl", jnp.asarray(antiderivative), products)
    total = -length * integrals
    zero = jnp.zeros_like(total)
    return jnp.stack([total, zero, zero], axis=1)


def _gauss(number: int):
    """Abscissas and weights of Gauss-Legendre quadrature on (0, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(number)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def _antiderivative(abscissas, places: tuple[float, ...]) -> np.ndarray:
    """Integrals from 0 to all points of what is known at the abscissas, (points, n).

    By the expansion in Legendre polynomials that has the values at the abscissas.
    """
    nodes = 2.0 * np.asarray(abscissas) - 1.0
    number = len(nodes)
    ends = np.concatenate([nodes, [-1.0], 2.0 * np.array(places) - 1.0, [1.0]])
    weights = np.polynomial.legendre.leggauss(number)[1]
    legendre = np.polynomial.legendre
    degree = np.arange(number)
    coefficients = (degree[:, None] + 0.5) * legendre.legvander(nodes, number - 1).T
    coefficients = coefficients * weights[None]
    # the integral of P_n is (P_{n+1} - P_{n-1})/(2 n + 1), that of P_0 is x + 1
    values = legendre.legvander(ends, number)
    integrals = np.empty((len(ends), number))
    integrals[:, 0] = ends + 1.0
    integrals[:, 1:] = (values[:, 2:] - values[:, :-2]) / (2.0 * degree[1:] + 1.0)
    return 0.5 * integrals @ coefficients
