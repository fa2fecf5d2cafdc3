"""Robots by name or by file."""

import pathlib
from collections.abc import Callable

from ..dynamics import ElasticRobot
from ..io import arm_from_urdf, load_robot, robot_from_urdf
from ..kinematics import Arm
from ._arm_structure import LumpedArm, ModalArm, TiltedArm
from ._fanuc import fanuc
from ._iiwa14 import iiwa14
from ._kr16 import kr16
from ._kr210 import kr210
from ._kr300 import kr300
from ._manutec_r3 import manutec_r3
from ._modal_manipulator import modal_manipulator
from ._planar_2r import planar_2r
from ._ur10e import ur10e


ROBOTS = {
    "kr210": kr210,
    "kr210_tilted": lambda: kr210(TiltedArm()),
    "kr210_lumped": lambda: kr210(LumpedArm()),
    "kr210_modal": lambda: kr210(ModalArm()),
    "kr300": kr300,
    "kr16": kr16,
    "manutec_r3": manutec_r3,
    "modal_manipulator": modal_manipulator,
}
# records of arms without dynamics
ARMS: dict[str, Callable[[], Arm]] = {
    "fanuc": fanuc,
    "iiwa14": iiwa14,
    "planar_2r": planar_2r,
    "ur10e": ur10e,
}


def named_robot(name: str | pathlib.Path) -> ElasticRobot:
    """The robot of a built-in name, of a robot file, or of a URDF.

    Args:
        name: a key of `ROBOTS`, the path of a file that ends in `.toml`, or that of a
            URDF, with the file of its gears beside it: `arm.toml` beside `arm.urdf`.

    Raises:
        ValueError: there is no such name, or the file is refused.
    """
    if str(name) in ROBOTS:
        return ROBOTS[str(name)]()
    path = pathlib.Path(name)
    if path.suffix == ".toml":
        return load_robot(name)
    if path.suffix == ".urdf":
        beside = path.with_suffix(".toml")
        if not path.is_file():
            raise ValueError(f"{path}: cannot be read: there is no such file")
        if not beside.is_file():
            raise ValueError(
                f"{path}: a URDF holds no gears, springs or friction: write them into "
                f"{beside} as in `examples/urdf_robot.toml`"
            )
        return _read(lambda: robot_from_urdf(path, beside))
    if str(name) in ARMS:
        raise ValueError(
            f"`{name}` is an arm without dynamics, which `elastax info {name}` shows: "
            f"take one of {', '.join(ROBOTS)}"
        )
    raise ValueError(
        f"the robot `{name}` is unknown: take one of {', '.join(ROBOTS)}, or the path "
        "of a file that ends in `.toml` or `.urdf`"
    )


def named_model(
    name: str | pathlib.Path, *, base: str | None = None, tip: str | None = None
) -> ElasticRobot | Arm:
    """The robot of a name or file, or the arm where there are no dynamics.

    Args:
        name: as for `named_robot`, or a key of `ARMS`; a URDF without a file beside it
            is an arm.
        base, tip: links of a URDF between which the arm lies.

    Raises:
        ValueError: there is no such name, or the file is refused.
    """
    if str(name) in ARMS:
        return ARMS[str(name)]()
    path = pathlib.Path(name)
    if path.suffix != ".urdf":
        return named_robot(name)
    if base is None and tip is None and path.with_suffix(".toml").is_file():
        return named_robot(name)
    return _read(lambda: arm_from_urdf(path, base=base, tip=tip))


def _read(read: Callable):
    """A missing reader is bad input as well: the message says what to install."""
    try:
        return read()
    except ImportError as error:
        raise ValueError(str(error)) from None
