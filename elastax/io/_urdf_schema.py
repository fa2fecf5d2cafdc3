"""What the file beside a URDF may hold: every key with its range."""

from ._robot_schema import BEAM, GEAR, HINGE, MASS, POSE, cylinder
from ._toml import (
    Key,
    array_of,
    choice,
    flag,
    named,
    number,
    positive,
    table,
    text,
    vector,
)


_LIMITS = table({"acceleration": Key(positive), "jerk": Key(positive)})
_AXIS = table(
    {
        "name": Key(text, meaning="the joint of the URDF"),
        "sign": Key(choice(1, -1), 1),
        "zero_deg": Key(number, 0.0),
        "wrist_centre": Key(flag, False),
        "limits_deg": Key(_LIMITS),
        "gear": Key(GEAR),
        "hinges": Key(array_of(HINGE), []),
    }
)

ELASTIC = table(
    {
        "name": Key(text, None),
        "sources": Key(array_of(text), []),
        "assumptions": Key(array_of(text), []),
        "gravity": Key(vector(3), [0.0, 0.0, -9.81]),
        "base_link": Key(text, None),
        "tip_link": Key(text, None),
        "axes": Key(array_of(_AXIS, at_least=1)),
        "beams": Key(named(BEAM), {}),
        "counterbalance": Key(cylinder, None),
        "payload": Key(table(MASS), None),
        "tool": Key(table(POSE), None),
        "poses_deg": Key(named(array_of(number)), {}),
    }
)
