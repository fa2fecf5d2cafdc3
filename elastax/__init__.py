"""Modelling, inverting and simulating structurally elastic industrial robots.

The names of the README stand here; they are imported from their packages on first use,
so that the command line can speak before JAX is loaded.
"""

import importlib
from typing import Any


_NAMES = {
    "ASIM": "inverse",
    "BesselFilter": "signals",
    "CascadeMotorControl": "control",
    "FlexibleJointInverse": "inverse",
    "PointToPoint": "trajectory",
    "Reference": "signals",
    "RigidInverse": "inverse",
    "SerialChain": "kinematics",
    "forward_kinematics": "kinematics",
    "kr16": "robots",
    "kr210": "robots",
    "kr300": "robots",
    "over_devices": "_devices",
    "run_feedforward": "control",
    "simulate": "dynamics",
}


def __getattr__(name: str) -> Any:
    if name in _NAMES:
        module = importlib.import_module(f".{_NAMES[name]}", __name__)
        return getattr(module, name)
    raise AttributeError(f"module `elastax` has no attribute `{name}`")


def __dir__() -> list[str]:
    return sorted([*globals(), *_NAMES])
