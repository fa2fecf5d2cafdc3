"""What a robot file may hold: every key with its range."""

import numpy as np

from ._toml import (
    Key,
    array_of,
    choice,
    flag,
    integer,
    named,
    not_negative,
    number,
    positive,
    table,
    text,
    vector,
)


DEFORMATIONS = ("torsion", "bending_y", "bending_z")


def inertia_tensor(value, where) -> np.ndarray:
    """Positive definite tensor of xx, yy, zz or xx, yy, zz, xy, yz, xz [kg m^2]."""
    if not isinstance(value, list) or len(value) not in (3, 6):
        raise ValueError(
            f"`{where}` must be a list of 3 numbers (xx, yy, zz) or 6 (and xy, yz, xz) "
            f"[kg m^2], but is {value}"
        )
    xx, yy, zz, xy, yz, xz = (*vector(len(value))(value, where), 0.0, 0.0, 0.0)[:6]
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] <= 0:
        raise ValueError(
            f"`{where}` must have positive principal moments [kg m^2], but they are "
            f"{', '.join(f'{m:.4g}' for m in moments)}"
        )
    return tensor


POSE = {"position": Key(vector(3), [0.0] * 3), "rpy_deg": Key(vector(3), [0.0] * 3)}
_FRICTION = table(
    {
        "viscous": Key(not_negative, 0.0),
        "coulomb": Key(not_negative, 0.0),
        "steepness": Key(positive, 500.0),
    }
)
_NO_FRICTION = {"viscous": 0.0, "coulomb": 0.0, "steepness": 500.0}
GEAR = table(
    {
        "ratio": Key(number, meaning="the gear ratio, motor over output"),
        "motor_inertia": Key(positive, meaning="that of the rotor [kg m^2]"),
        "stiffness": Key(
            positive, meaning="the spring constant at the output [N m/rad]"
        ),
        "hardening": Key(not_negative, 0.0),
        "damping": Key(
            positive, meaning="the damper constant at the output [N m s/rad]"
        ),
        "motor_friction": Key(_FRICTION, _NO_FRICTION),
        "joint_friction": Key(_FRICTION, _NO_FRICTION),
    }
)
_LIMITS = table(
    {
        "lower": Key(number),
        "upper": Key(number),
        "velocity": Key(positive),
        "acceleration": Key(positive),
        "jerk": Key(positive),
    }
)
HINGE = table(
    {
        "name": Key(text),
        "axis": Key(vector(3)),
        "stiffness": Key(positive, None),
        "beam": Key(text, None),
        "deformation": Key(choice(*DEFORMATIONS), None),
        "hardening": Key(not_negative, 0.0),
        "damping": Key(positive, None),
        "damping_time": Key(positive, None),
        "end_slope": Key(number, None),
    }
)
BEAM = table(
    {
        "section": Key(choice("rectangular_tube", "circular_tube")),
        "height": Key(positive, None),
        "width": Key(positive, None),
        "diameter": Key(positive, None),
        "wall": Key(positive),
        "length": Key(positive),
        "young": Key(positive),
        "shear": Key(positive),
        "density": Key(positive),
    }
)
MASS = {
    "mass": Key(positive, meaning="the mass [kg]"),
    "com": Key(vector(3), meaning="the centre of mass [m]"),
    "inertia": Key(
        inertia_tensor,
        meaning="the inertia tensor about the centre of mass: xx, yy, zz, and maybe "
        "xy, yz, xz [kg m^2]",
    ),
}
FLEXIBLE = table(
    {
        "file": Key(text, meaning="the path of the SID file, from the robot file on"),
        "base": Key(text, meaning="the node at the axis"),
        "tip": Key(text, meaning="the node that carries the next link"),
        "modes": Key(integer, None),
        "damping_ratio": Key(positive, None),
        "dialect": Key(choice("FEMBS", "PY_SID", "MatMorembs", "FEMBeam"), None),
    }
)
_AXIS = table(
    {
        "name": Key(text),
        "theta_deg": Key(number, 0.0),
        "d": Key(number, 0.0),
        "a": Key(number, 0.0),
        "alpha_deg": Key(number, 0.0),
        "sign": Key(choice(1, -1), 1),
        "zero_deg": Key(number, 0.0),
        "wrist_centre": Key(flag, False),
        "limits_deg": Key(_LIMITS),
        "body": Key(table(MASS), None),
        "flexible": Key(FLEXIBLE, None),
        "gear": Key(GEAR),
        "hinges": Key(array_of(HINGE), []),
    }
)
_CYLINDER = {
    "axis": Key(text),
    "base_distance": Key(positive),
    "lever": Key(positive),
    "angle_offset_deg": Key(number),
    "reference_length": Key(positive),
    "damping": Key(not_negative, 0.0),
}
_CYLINDERS = {
    "spring": table(
        {
            "kind": Key(text),
            **_CYLINDER,
            "spring_rate": Key(positive),
            "preload": Key(number),
        }
    ),
    "gas": table(
        {
            "kind": Key(text),
            **_CYLINDER,
            "pressure": Key(positive),
            "volume": Key(positive),
            "piston_diameter": Key(positive),
            "rod_diameter": Key(not_negative),
        }
    ),
}


def cylinder(value, where):
    """A counterbalance; the keys depend on `kind`."""
    kind = value.get("kind", "") if isinstance(value, dict) else ""
    choice(*_CYLINDERS)(kind, f"{where}.kind")
    return _CYLINDERS[kind](value, where)


ROBOT = table(
    {
        "name": Key(text),
        "sources": Key(array_of(text), []),
        "assumptions": Key(array_of(text), []),
        "gravity": Key(vector(3), [0.0, 0.0, -9.81]),
        "base": Key(table(POSE), None),
        "axes": Key(array_of(_AXIS, at_least=1)),
        "beams": Key(named(BEAM), {}),
        "counterbalance": Key(cylinder, None),
        "payload": Key(table(MASS), None),
        "tool": Key(table(POSE), None),
        "poses_deg": Key(named(array_of(number)), {}),
    }
)
