r"""Frames of a joint convention put on the axes of a chain, one behind the other.

Conventions whose joints turn about the z axis of the frame in front are rows of
$R_z(\theta)\,T_z(d)\,T_x(a)\,R_x(\alpha)\,R_y(\beta)$, Veitschegger and Wu's; those of
Denavit and Hartenberg have $\beta = 0$, those of Hayati and Mirmirani $d = 0$.
"""

from typing import NamedTuple

import numpy as np

from ._axis_lines import AxisLines, axis_lines, characteristic_length, distance
from ._chain import SerialChain


_ROUNDING = 1e-12  # sine of an angle [rad], or share of the arm's size, that is none
_FARTHEST = 1e5  # sizes of the arm; further off double precision leaves 1e-11 of it
_ROUNDED = 4e-15  # what trigonometric functions leave of a zero


class Row(NamedTuple):
    """Parameters of a joint [m] and [rad]."""

    theta: float = 0.0
    d: float = 0.0
    a: float = 0.0
    alpha: float = 0.0
    beta: float = 0.0

    def matrix(self) -> np.ndarray:
        st, ct, sa, ca, sb, cb = (
            f(x) for x in (self.theta, self.alpha, self.beta) for f in (np.sin, np.cos)
        )
        turn = np.array([[ct, -st, 0], [st, ct, 0], [0, 0, 1.0]])
        tilt_x = np.array([[1.0, 0, 0], [0, ca, -sa], [0, sa, ca]])
        tilt_y = np.array([[cb, 0, sb], [0, 1.0, 0], [-sb, 0, cb]])
        pose = np.eye(4)
        pose[:3, :3] = turn @ tilt_x @ tilt_y
        pose[:3, 3] = self.a * ct, self.a * st, self.d
        return pose


class Line(NamedTuple):
    """The next axis in the frame in front of a joint."""

    point: np.ndarray
    direction: np.ndarray

    @property
    def sine(self) -> float:
        return float(np.hypot(self.direction[0], self.direction[1]))

    @property
    def off_axis(self) -> float:
        """Distance from the z axis."""
        z = np.array([0.0, 0.0, 1.0])
        return distance(np.zeros(3), z, self.point, self.direction)


class Walk:
    """Frames along a chain, from axis to axis."""

    def __init__(self, chain: SerialChain):
        self.lines: AxisLines = axis_lines(chain)
        self.size = characteristic_length(chain)
        self.number = chain.number
        self.first = self.frame = self._first_frame()
        self.rows: list[Row] = []

    def place(self, k: int) -> np.ndarray:
        """A point for axis k: a prismatic one is drawn where the next hinge is."""
        for j in range(k, self.number):
            if self.lines.turns[j]:
                return self.lines.points[j]
        return self.lines.tool[:3, 3]

    def _first_frame(self) -> np.ndarray:
        """On axis 1, as near to the frame of the base as can be."""
        base, z = self.lines.base, self.lines.directions[0]
        across = [c - z * (z @ c) for c in base[:3, :2].T]
        x = next(c for c in across if np.linalg.norm(c) > 0.5)
        x = x / np.linalg.norm(x)
        point, origin = self.place(0), base[:3, 3]
        if self.lines.turns[0]:
            point = point + z * (z @ (origin - point))
        frame = np.eye(4)
        frame[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        frame[:3, 3] = point
        return frame

    def local(self, point: np.ndarray, direction: np.ndarray) -> Line:
        rotation, origin = self.frame[:3, :3], self.frame[:3, 3]
        return Line(rotation.T @ (point - origin), rotation.T @ direction)

    def next_line(self, k: int) -> Line:
        """Axis k + 1, counted from zero."""
        return self.local(self.place(k + 1), self.lines.directions[k + 1])

    def step(self, row: Row) -> None:
        lengths = self.size * _ROUNDED
        small = (_ROUNDED, lengths, lengths, _ROUNDED, _ROUNDED)
        row = Row(*(0.0 if abs(x) <= s else float(x) for x, s in zip(row, small)))
        if row.theta < _ROUNDED - np.pi:
            row = row._replace(theta=np.pi)
        self.rows.append(row)
        self.frame = self.frame @ row.matrix()

    def column(self, name: str) -> np.ndarray:
        return np.array([getattr(row, name) for row in self.rows])

    def rest(self) -> np.ndarray:
        """The tool in the last frame."""
        return np.linalg.solve(self.frame, self.lines.tool)


def denavit_row(walk: Walk, line: Line, k: int) -> Row:
    """Along the common normal of the z axis and `line`."""
    point, z = line
    if line.sine <= _ROUNDING:
        foot = point - z * (point[2] / z[2])
        a = float(np.hypot(foot[0], foot[1]))
        meet = a <= walk.size * _ROUNDING
        theta = 0.0 if meet else np.arctan2(foot[1], foot[0])
        return Row(theta, 0.0, 0.0 if meet else a, 0.0 if z[2] > 0 else np.pi)
    along = np.array([z[0], z[1], 0.0]) / line.sine
    normal = np.array([-along[1], along[0], 0.0])
    a, shift = normal @ point, -(along @ point) / line.sine
    d = point[2] + shift * z[2]
    if max(abs(d), abs(shift)) > _FARTHEST * walk.size:
        raise ValueError(
            f"joint {k + 1} has no usable Denavit-Hartenberg form: the axes {k + 1} "
            f"and {k + 2} must be parallel or clearly not, but are "
            f"{np.arcsin(min(line.sine, 1.0)):.2g} rad off, so that their common "
            f"normal lies {max(abs(d), abs(shift)):.2g} m away; use `to_mixed`"
        )
    # axes that meet leave the sign of x open: the smaller turn is taken
    meet = abs(a) <= walk.size * _ROUNDING
    if normal[0] < -_ROUNDING if meet else a < 0:
        normal, a = -normal, -a
    theta = np.arctan2(normal[1], normal[0])
    across = np.array([-normal[1], normal[0], 0.0])
    alpha = np.arctan2(-(z @ across), z[2])
    return Row(float(theta), float(d), float(a), float(alpha))


def tool_row(walk: Walk) -> Row:
    """To the z axis of the tool."""
    tool = walk.lines.tool
    line = walk.local(tool[:3, 3], tool[:3, 2])
    if line.sine > 1e-3:
        return denavit_row(walk, line, walk.number - 1)
    if line.sine > _ROUNDING:
        return Row()
    row = denavit_row(walk, line, walk.number - 1)._replace(d=line.point[2])
    if row.a > 0:
        return row
    x = walk.frame[:3, :3].T @ tool[:3, 0]
    return row._replace(theta=np.arctan2(x[1], x[0]))


def hayati_row(walk: Walk, k: int, determined: bool = True) -> Row:
    """To the point where axis k + 1 (from zero) pierces the x-y plane."""
    line, turns = walk.next_line(k), walk.lines.turns
    if turns[k + 1]:
        foot = _pierced(walk, line, k, determined and turns[k])
    else:
        foot = _pierced_behind(walk, k)
    a = float(np.hypot(foot[0], foot[1]))
    if a <= walk.size * _ROUNDING:
        foot, a = np.array([1.0, 0.0]), 0.0
    theta = np.arctan2(foot[1], foot[0])
    x, y, z = line.direction
    x, y = x * np.cos(theta) + y * np.sin(theta), y * np.cos(theta) - x * np.sin(theta)
    return Row(theta, 0.0, a, np.arctan2(-y, z), np.arctan2(x, np.hypot(y, z)))


def _pierced(walk: Walk, line: Line, k: int, determined: bool) -> np.ndarray:
    point, z = line
    through = np.linalg.norm(np.cross(point, z)) <= walk.size * _ROUNDING
    slope = abs(z[2])
    what = f"joint {k + 1} has no Hayati-Mirmirani form: the axes {k + 1} and {k + 2} "
    if determined and through and line.sine <= _ROUNDING:
        raise ValueError(
            f"{what}must be two lines, but are one, so that its turn is undetermined; "
            "use `to_mixed` or `to_rpy`"
        )
    if through and not walk.lines.turns[k]:
        return np.zeros(2)
    if slope <= _ROUNDING or abs(point[2]) / slope > _FARTHEST * walk.size:
        raise ValueError(
            f"{what}must not be perpendicular, but are by {slope:.2g} rad, so that "
            f"axis {k + 2} does not pierce the x-y plane of the frame in front in one "
            "point within reach; use `to_mixed`"
        )
    return (point - z * (point[2] / z[2]))[:2]


def _pierced_behind(walk: Walk, k: int) -> np.ndarray:
    """A place for a prismatic axis: under the next hinge, if it stands upright."""
    lines = walk.lines
    hinges = [j for j in range(k + 1, walk.number) if lines.turns[j]]
    direction = lines.directions[hinges[0]] if hinges else lines.tool[:3, 2]
    point, z = walk.local(walk.place(k + 1), direction)
    if abs(z[2]) < 0.1:
        return np.zeros(2)
    return (point - z * (point[2] / z[2]))[:2]
