"""Chains as products of elementary transformations, each with one parameter."""

import enum
from collections.abc import Iterable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import check_fields, check_values, is_concrete
from .._custom_types import PerJoint, Transform, as_real
from .._kernel import kernel
from .._taylor import leading, linear, product, sin_cos, skew


Values = Float[Array, " variables"]
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


class ElementKind(enum.Enum):
    """What an elementary transformation does."""

    ALONG = "translation along a direction"
    ABOUT = "rotation about a direction"
    FIXED = "constant"


class Element(NamedTuple):
    """One elementary transformation, as it is given to `ElementaryProduct.of`.

    Attributes:
        kind: translation, rotation or constant.
        value: [m] or [rad], or the matrix of a constant one, shape (4, 4).
        direction: unit vector; a tuple of whole numbers, such as `(0, 0, 1)`, is
            structure, an array is not.
        name: of the parameter, if it is one.
        joint: index of the joint whose coordinate adds to the value.

    References:
        [KinModell] (3-12), (3-13).
    """

    kind: ElementKind
    value: Any
    direction: Any = None
    name: str | None = None
    joint: int | None = None

    @staticmethod
    def along(direction, value, name=None, joint=None) -> "Element":
        """Translation along `direction` by `value` [m]."""
        return Element(ElementKind.ALONG, value, direction, name, joint)

    @staticmethod
    def about(direction, value, name=None, joint=None) -> "Element":
        """Rotation about `direction` by `value` [rad]."""
        return Element(ElementKind.ABOUT, value, direction, name, joint)

    @staticmethod
    def fixed(matrix) -> "Element":
        """Constant transformation, shape (4, 4) [m]."""
        return Element(ElementKind.FIXED, matrix)


class _Place(NamedTuple):
    """What is structure in an element."""

    kind: ElementKind
    direction: tuple[int, ...] | None
    name: str | None
    joint: int | None


class ElementaryProduct(eqx.Module):
    r"""Product $T = \prod_j T_j$ of elementary transformations, from base to tool.

    Every translation and rotation is a *variable*: its value is a parameter of the
    product, or the coordinate of a joint, or both, where the coordinate adds to the
    parameter. All derivatives of the product follow from those of one factor each.

    Attributes:
        values: of the variables, in order, shape (variables,) [m] or [rad].
        directions: unit vectors that are no structure, shape (inclined, 3).
        constants: constant transformations, shape (constants, 4, 4) [m].
        places: what each factor is.

    References:
        [KinModell] (3-8), (3-9), (3-11) to (3-15), the last factor of (3-15) read as
        $R_x(\Theta_x)$.
    """

    values: Values = eqx.field(converter=as_real)
    directions: Float[Array, "inclined 3"] = eqx.field(converter=as_real)
    constants: Float[Array, "constants 4 4"] = eqx.field(converter=as_real)
    places: tuple[_Place, ...] = eqx.field(static=True)

    def __check_init__(self):
        check_fields(self)
        if is_concrete(self.directions):
            norm = np.linalg.norm(np.asarray(self.directions), axis=-1)
            check_values(
                "directions must be unit vectors",
                self.directions,
                np.abs(norm - 1) < 1e-6,
            )
        kinds = [p.kind for p in self.places]
        if len(self.values) != self.number or len(self.constants) != kinds.count(
            ElementKind.FIXED
        ):
            raise ValueError("`places` must name every value and every constant")
        names = [n for n in self.names if n]
        if twice := {n for n in names if names.count(n) > 1}:
            raise ValueError(f"names must differ, but {sorted(twice)} occur twice")
        joints = sorted(p.joint for p in self.places if p.joint is not None)
        if joints != list(range(len(joints))):
            raise ValueError(
                "every joint from 0 on must move one element, but the joints are "
                f"{joints}"
            )

    @staticmethod
    def of(elements: Iterable[Element]) -> "ElementaryProduct":
        """Product of elements, from left to right."""
        values, directions, constants, places = [], [], [], []
        for element in elements:
            structure = None
            if element.kind is ElementKind.FIXED:
                constants.append(element.value)
            else:
                values.append(element.value)
                if isinstance(element.direction, tuple):
                    structure = element.direction
                else:
                    directions.append(element.direction)
            places.append(_Place(element.kind, structure, element.name, element.joint))
        return ElementaryProduct(
            _stacked(values, ()),
            _stacked(directions, (3,)),
            _stacked(constants, (4, 4)),
            tuple(places),
        )

    @property
    def variables(self) -> tuple[_Place, ...]:
        """Places of the factors that are not constant."""
        return tuple(p for p in self.places if p.kind is not ElementKind.FIXED)

    @property
    def number(self) -> int:
        """Number of variables."""
        return len(self.variables)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every variable; joints without a parameter are `q_1`, ...

        A variable that is neither has the empty name.
        """
        return tuple(
            p.name or ("" if p.joint is None else f"q_{p.joint + 1}")
            for p in self.variables
        )

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every variable, "m" or "rad"."""
        along = ElementKind.ALONG
        return tuple("m" if p.kind is along else "rad" for p in self.variables)

    @property
    def joint_variables(self) -> tuple[int, ...]:
        """The variable to which the coordinate of each joint adds."""
        found = {
            p.joint: k for k, p in enumerate(self.variables) if p.joint is not None
        }
        return tuple(found[joint] for joint in range(len(found)))

    def index(self, name: str) -> int:
        """Index of a variable by the name of its parameter, or of its joint (`q_1`).

        Raises:
            ValueError: there is no such variable.
        """
        known = {f"q_{j + 1}": k for j, k in enumerate(self.joint_variables)}
        known |= {name: k for k, name in enumerate(self.names) if name}
        if name not in known:
            raise ValueError(
                f"the product has no variable `{name}`: it has {', '.join(known)}"
            )
        return known[name]

    def values_at(self, q: Any = None, deviation: Any = None) -> Any:
        """Values of the variables, the coordinates of the joints added.

        Args:
            q: coordinates of the joints, shape (joints,), array or series; zero unless
                given.
            deviation: of the values, shape (variables,), array or series.
        """
        values = self.values
        if q is not None:
            joints = self.joint_variables
            if leading(q).shape != (len(joints),):
                raise ValueError(
                    f"`q` must hold one coordinate per joint of {len(joints)}, but has "
                    f"the shape {leading(q).shape}"
                )
            chosen = np.zeros((len(joints), self.number))
            chosen[range(len(joints)), joints] = 1.0
            values = product("jv,j->v", jnp.asarray(chosen, values.dtype), q) + values
        return values if deviation is None else deviation + values

    def along_and_about(self) -> tuple[np.ndarray, np.ndarray, Any]:
        """Masks of translations and rotations, and directions, one row per variable."""
        kinds = [p.kind is ElementKind.ABOUT for p in self.variables]
        about = np.array(kinds, float).reshape(-1)
        known = np.array([p.direction or X for p in self.variables], float)
        directions = jnp.asarray(known.reshape(-1, 3), self.values.dtype)
        inclined = [k for k, p in enumerate(self.variables) if p.direction is None]
        if inclined:
            directions = directions.at[np.array(inclined)].set(self.directions)
        return 1.0 - about, about, directions

    def in_order(self, matrices: Any) -> list[Any]:
        """Factors from base to tool, constants among the given (variables, 4, 4)."""
        factors, variable, constant = [], 0, 0
        for place in self.places:
            if place.kind is ElementKind.FIXED:
                factors.append(self.constants[constant])
                constant += 1
            else:
                factors.append(matrices[variable])
                variable += 1
        return factors


def elementary_matrices(factors: ElementaryProduct, values: Any) -> Any:
    """Matrices of the variables, shape (variables, 4, 4), of values or their series.

    References:
        [KinModell] (3-12) to (3-14).
    """
    along, about, direction = factors.along_and_about()
    dtype = factors.values.dtype
    parallel = jnp.einsum("va,vb->vab", direction, direction)
    turning = jnp.asarray(about, dtype)[:, None, None]
    identity = jnp.eye(3, dtype=dtype)[None]
    across, turn = turning * (identity - parallel), turning * skew(direction)
    sine, cosine = sin_cos(values)
    rotation = (
        product("v,vab->vab", cosine, across)
        + product("v,vab->vab", sine, turn)
        + (identity - across)
    )
    slide = jnp.asarray(along, dtype)[:, None] * direction
    position = product("v,va->va", values, slide)
    corner = np.zeros((factors.number, 4, 4))
    corner[:, 3, 3] = 1.0
    return (
        linear(lambda x: jnp.pad(x, ((0, 0), (0, 1), (0, 1))), rotation)
        + linear(lambda x: jnp.pad(x[..., None], ((0, 0), (0, 1), (3, 0))), position)
        + jnp.asarray(corner, dtype)
    )


def elementary_product(factors: ElementaryProduct, values: Any) -> Any:
    """Pose (4, 4) of a product at given values of its variables, array or series.

    References:
        [KinModell] (3-8).
    """
    matrices = factors.in_order(elementary_matrices(factors, values))
    total = matrices[0]
    for matrix in matrices[1:]:
        total = product("ab,bc->ac", total, matrix)
    return total


@kernel
def elementary_pose(factors: ElementaryProduct, q: PerJoint | None = None) -> Transform:
    """Pose of the tool of a product of elementary transformations [m].

    Args:
        factors: the product.
        q: coordinates of its joints [rad] or [m], zero unless given.

    Returns:
        Homogeneous matrix, shape (4, 4).

    References:
        [KinModell] (3-8), (3-11).
    """
    return elementary_product(factors, factors.values_at(q))


def _stacked(rows: list, shape: tuple[int, ...]) -> Any:
    """Rows as one array; NumPy where all numbers are known, which compiles nothing."""
    if not rows:
        return np.zeros((0, *shape))
    if is_concrete(*rows):
        return np.stack([np.asarray(row) for row in rows])
    return jnp.stack([jnp.asarray(row) for row in rows])
