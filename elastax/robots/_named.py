"""Robots by name or by file."""

import pathlib

from ..dynamics import ElasticRobot
from ..io import load_robot
from ._kr16 import kr16
from ._kr210 import kr210
from ._kr300 import kr300
from ._manutec_r3 import manutec_r3


ROBOTS = {
    "kr210": kr210,
    "kr300": kr300,
    "kr16": kr16,
    "manutec_r3": manutec_r3,
}


def named_robot(name: str | pathlib.Path) -> ElasticRobot:
    """The robot of a built-in name or of a robot file.

    Args:
        name: a key of `ROBOTS`, or the path of a file that ends in `.toml`.

    Raises:
        ValueError: there is no such name, or the file is refused.
    """
    if str(name) in ROBOTS:
        return ROBOTS[str(name)]()
    if pathlib.Path(name).suffix == ".toml":
        return load_robot(name)
    raise ValueError(
        f"the robot `{name}` is unknown: take one of {', '.join(ROBOTS)}, or the path "
        "of a file that ends in `.toml`"
    )
