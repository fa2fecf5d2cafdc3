"""Files of drive-train parts: what becomes of them, and what is refused."""

import pathlib

import jax.numpy as jnp
import numpy as np
import pytest
from elastax.drivetrain import (
    CoulombViscousFriction,
    LinearStiffness,
    Motor,
    RelaxationBranch,
    StopBranch,
)
from elastax.io import drives_with_parts, load_drive_parts

from tests import systems
from tests.helpers import assert_close


EXAMPLES = pathlib.Path(__file__).parents[2] / "examples" / "drive_parts"
DRIVES = systems.drive_train(2, damping=30.0)


def test_parts_of_a_table():
    content = {
        "motor_friction": {
            "kind": "coulomb_viscous",
            "viscous": 3,
            "coulomb": [1.0, 2.0],
            "steepness": 50.0,
        },
        "branch": {
            "kind": "relaxation",
            "coupling": 1e3,
            "relaxed": {"kind": "linear", "linear": [4e3, 5e3]},
            "viscosity": 20.0,
        },
        "damping": [40.0, 50.0],
    }
    drives = drives_with_parts(content, DRIVES)
    friction = CoulombViscousFriction(
        jnp.full(2, 3.0), jnp.array([1.0, 2.0]), jnp.full(2, 50.0)
    )
    branch = RelaxationBranch(
        jnp.full(2, 1e3), LinearStiffness(jnp.array([4e3, 5e3])), jnp.full(2, 20.0)
    )
    assert_close(drives.motor_friction, friction, rtol=0)
    assert_close(drives.branch, branch, rtol=0)
    assert_close(drives.damping, [40.0, 50.0], rtol=0)
    # what is not named stays
    assert_close(drives.stiffness, DRIVES.stiffness, rtol=0)
    assert_close(drives.motor, DRIVES.motor, rtol=0)


def test_motor_keeps_what_is_not_named():
    drives = drives_with_parts({"motor": {"lag": [1e-3, 2e-3]}}, DRIVES)
    expected = Motor(DRIVES.motor.inertia, lag=jnp.array([1e-3, 2e-3]))
    assert_close(drives.motor, expected, rtol=0)


def test_rows_per_play():
    play = {
        "kind": "rate_independent",
        "thresholds": [1e-4, [2e-4, 3e-4]],
        "sharpness": 1e5,
        "reversal_speed": 1e-4,
    }
    content = {"branch": {"kind": "stops", "stiffness": [1e3, 2e3], "play": play}}
    branch = drives_with_parts(content, DRIVES).branch
    assert isinstance(branch, StopBranch)
    assert_close(branch.play.thresholds, [[1e-4, 1e-4], [2e-4, 3e-4]], rtol=0)
    assert_close(branch.stiffness, [[1e3, 1e3], [2e3, 2e3]], rtol=0)


LINEAR = {"kind": "linear", "linear": 1e4}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"motor_frictio": {}}, ("`motor_frictio` is unknown", "`motor_friction`")),
        ({"stiffness": 3.0}, ("`stiffness` must be a table",)),
        ({"stiffness": {"linear": 1e4}}, ("`stiffness.kind` is missing", "linear")),
        ({"stiffness": LINEAR | {"kind": "liner"}}, ("did you mean `linear`",)),
        ({"stiffness": LINEAR | {"hard": 1.0}}, ("`hard` is unknown",)),
        ({"stiffness": {"kind": "linear"}}, ("`stiffness.linear` is missing",)),
        ({"stiffness": LINEAR | {"linear": [1.0] * 3}}, ("list of 2", "3 entries")),
        ({"stiffness": LINEAR | {"linear": "stiff"}}, ("must hold numbers",)),
        ({"stiffness": LINEAR | {"linear": -1.0}}, ("`linear` must be positive",)),
        ({"branch": {"kind": "stops", "stiffness": 3.0}}, ("one entry per play",)),
        ({"damping": -2.0}, ("`damping` must be positive",)),
    ],
)
def test_refusals(content, words):
    with pytest.raises(ValueError) as caught:
        drives_with_parts(content, DRIVES)
    for word in words:
        assert word in str(caught.value)


def test_file_is_named_in_the_message(tmp_path):
    path = tmp_path / "parts.toml"
    path.write_text("[stiffness]\nkind = 'liner'\n")
    with pytest.raises(ValueError, match=r"parts\.toml: `stiffness\.kind`"):
        load_drive_parts(path, DRIVES)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda p: p.stem)
def test_examples_fit_the_kr210(path):
    drives = load_drive_parts(path, systems.drive_train(6))
    assert drives.number == 6
    assert np.all(np.asarray(drives.reflected_inertia()) > 0)
