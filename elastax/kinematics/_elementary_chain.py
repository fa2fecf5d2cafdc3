"""Serial chains of every convention as products of elementary transformations."""

from collections.abc import Callable, Iterator
from typing import Any

import jax
import numpy as np

from .._checks import is_concrete
from ._chain import SerialChain
from ._elementary import Element, ElementaryProduct, X, Y, Z
from ._joints import (
    AbstractJoints,
    DHJoints,
    FrameJoints,
    JointFrames,
    JointKind,
    RPYJoints,
)
from ._link_conventions import (
    HayatiJoints,
    MixedJoints,
    ModifiedDHJoints,
    VeitscheggerWuJoints,
)
from ._structured import Placement


def elementary_chain(
    chain: SerialChain, *, base: bool = True, tool: bool = True
) -> ElementaryProduct:
    """A serial chain as a product; its parameters keep the names of the chain's.

    Names are those of `ChainParameters`: `alpha_2`, `position_3_x`, `base_z`. The
    coordinate of a joint adds to its parameter (`theta_1`, of a sliding joint `d_1`); a
    joint without a parameter to add to is `q_1`. Rotation matrices (`FrameJoints`, the
    ends of the chain) stay constant; behind those of the ends come angles about z, y
    and x, `tool_rpy_z` and so on, which equal the rotation vector of `ChainParameters`
    to first order only. Other placements, such as those of `StructuredJoints`, are
    constants without parameters.

    Args:
        chain: in any convention, mixed ones included.
        base, tool: whether displacements of the mounting pose and of the tool pose are
            among the parameters.

    Raises:
        ValueError: mixed joints inside mixed joints.

    References:
        [KinModell] (3-11), tables 3-1 to 3-4.
    """
    elements = [Element.fixed(_plain(chain.base))]
    elements += _displacement("base") if base else []
    elements += _joint_elements(chain.joints, chain.kinds)
    elements.append(Element.fixed(_plain(chain.tool)))
    elements += _displacement("tool") if tool else []
    dtype = chain.base.dtype
    return jax.tree.map(lambda x: x.astype(dtype), ElementaryProduct.of(elements))


def _plain(array: Any) -> Any:
    return np.asarray(array) if is_concrete(array) else array


def _displacement(end: str) -> list[Element]:
    """Displacement of an end of the chain, in its own frame, as in (3-11)."""
    along = [Element.along(a, 0.0, f"{end}_{c}") for a, c in _LETTERS]
    about = [Element.about(a, 0.0, f"{end}_rpy_{c}") for a, c in reversed(_LETTERS)]
    return along + about


_LETTERS = ((X, "x"), (Y, "y"), (Z, "z"))


def _joint_elements(joints: AbstractJoints, kinds: tuple) -> Iterator[Element]:
    groups = joints.groups if isinstance(joints, MixedJoints) else (joints,)
    first = 0
    for part in groups:
        if isinstance(part, MixedJoints):
            raise ValueError("groups of mixed joints must not be mixed themselves")
        known = [rule for kind, rule in _CONVENTIONS if isinstance(part, kind)]
        rule: Any = known[0] if known else _by_frames
        given = part if known else part.frames()
        for k in range(part.number()):
            slides = kinds[first + k] is JointKind.PRISMATIC
            yield from rule(given, k, first + k, slides)
        first += part.number()


def _table(*steps: tuple[Callable, tuple, str | None]) -> Callable:
    """Convention whose joint variable adds to its turn about, or slide along, z.

    A step without a field slides a prismatic joint and has no parameter.
    """
    parameters = [field for _, _, field in steps]

    def rule(part, k: int, joint: int, slides: bool) -> Iterator[Element]:
        moving = "theta"
        if slides:
            moving = "d" if "d" in parameters else None
        for element, direction, field in steps:
            carries = joint if field == moving else None
            if field is None:
                if carries is not None:
                    yield element(direction, 0.0, None, joint)
                continue
            value = _plain(getattr(part, field))[k]
            yield element(direction, value, f"{field}_{joint + 1}", carries)

    return rule


def _motion(axis: Any, joint: int, slides: bool) -> Element:
    return (Element.along if slides else Element.about)(axis, 0.0, None, joint)


def _positions(part, k: int, joint: int) -> list[Element]:
    position = _plain(part.position)[k]
    return [
        Element.along(a, position[c], f"position_{joint + 1}_{letter}")
        for c, (a, letter) in enumerate(_LETTERS)
    ]


def _rpy(part, k: int, joint: int, slides: bool) -> Iterator[Element]:
    # (3-11): translations, then the turns about z, y, x
    yield from _positions(part, k, joint)
    angles = _plain(part.rpy)[k]
    for c in (2, 1, 0):
        direction, letter = _LETTERS[c]
        yield Element.about(direction, angles[c], f"rpy_{joint + 1}_{letter}")
    yield _motion(_plain(part.axis)[k], joint, slides)


def _frame(part, k: int, joint: int, slides: bool) -> Iterator[Element]:
    yield from _positions(part, k, joint)
    rotation = _plain(part.rotation)[k]
    yield Element.fixed(Placement(rotation, None, False).matrix(rotation.dtype))
    yield _motion(_plain(part.axis)[k], joint, slides)


def _by_frames(
    frames: JointFrames, k: int, joint: int, slides: bool
) -> Iterator[Element]:
    yield Element.fixed(_plain(frames.before)[k])
    yield _motion(_plain(frames.axis)[k], joint, slides)
    yield Element.fixed(_plain(frames.after)[k])


_along, _about = Element.along, Element.about
_CONVENTIONS: tuple[tuple[type, Callable], ...] = (
    (
        DHJoints,
        _table(
            (_about, Z, "theta"),
            (_along, Z, "d"),
            (_along, X, "a"),
            (_about, X, "alpha"),
        ),
    ),
    (
        ModifiedDHJoints,
        _table(
            (_about, X, "alpha"),
            (_along, X, "a"),
            (_about, Z, "theta"),
            (_along, Z, "d"),
        ),
    ),
    (
        HayatiJoints,
        _table(
            (_about, Z, "theta"),
            (_along, Z, None),
            (_along, X, "a"),
            (_about, X, "alpha"),
            (_about, Y, "beta"),
        ),
    ),
    (
        VeitscheggerWuJoints,
        _table(
            (_about, Z, "theta"),
            (_along, Z, "d"),
            (_along, X, "a"),
            (_about, X, "alpha"),
            (_about, Y, "beta"),
        ),
    ),
    (RPYJoints, _rpy),
    (FrameJoints, _frame),
)
