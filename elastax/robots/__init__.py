"""Robots: functions that return records, every number with its source."""

from ._fanuc import fanuc as fanuc
from ._kr16 import kr16 as kr16
from ._kr210 import kr210 as kr210
from ._kr300 import kr300 as kr300
from ._manutec_r3 import manutec_r3 as manutec_r3
from ._named import ROBOTS as ROBOTS, named_robot as named_robot
from ._planar_2r import planar_2r as planar_2r
