"""Recordings from files, and what is refused."""

import csv
import shutil

import numpy as np
import pytest
from elastax.io import load_recording
from scipy.io import loadmat, savemat

from tests.helpers import assert_close


TIMES = np.arange(251) * 4e-3
ANGLE = np.stack([0.4 * np.sin(3 * TIMES), 0.2 * np.cos(2 * TIMES)], axis=1)
SPEED = np.stack([1.2 * np.cos(3 * TIMES), -0.4 * np.sin(2 * TIMES)], axis=1)
TORQUE = np.stack([np.sin(5 * TIMES), np.cos(4 * TIMES)], axis=1)


def columns():
    """Headings and values of a complete file."""
    table = {"time [s]": TIMES}
    for k in range(2):
        table[f"q_ref_{k + 1} [rad]"] = ANGLE[:, k]
        table[f"q_motor_{k + 1} [rad]"] = ANGLE[:, k] + 1e-4
        table[f"qd_motor_{k + 1} [rad/s]"] = SPEED[:, k]
        table[f"tau_motor_{k + 1} [N m]"] = TORQUE[:, k]
    table["q_link_2 [rad]"] = ANGLE[:, 1] - 1e-4
    return table


def write_csv(path, table):
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(
            [[repr(float(x)) for x in row] for row in zip(*table.values())]
        )
    return path


def mat_content(axes=2):
    """A complete structure of the KR300's kind, with an encoder on the first axis."""
    degrees = np.rad2deg
    link = degrees(ANGLE.T).copy()
    link[1] = 0.0
    return {
        "ref_kin": {"phi_r_all": ANGLE, "phi_r_all_d1": SPEED},
        "rec": {
            "time_cont": TIMES,
            "act_pos_mot_deg": degrees(ANGLE.T),
            "act_vel_mot_deg_per_s": degrees(SPEED.T),
            "act_torque_abs_nm": TORQUE.T,
            "act_pos_se_deg": link,
        },
        "tau_ff_all": TORQUE.T,
    }


def load_mat(path, content):
    savemat(path, content)
    return load_recording(path, start_pose=[0.1, 0.2])


def test_csv(tmp_path):
    recording = load_recording(write_csv(tmp_path / "run.csv", columns()))
    assert recording.name == "run.csv"
    assert (recording.axes, recording.encoders) == (2, (1,))
    assert_close(recording.reference, ANGLE[None], rtol=0.0)
    assert_close(recording.motor_angle, ANGLE + 1e-4, rtol=0.0)
    assert_close(recording.motor_torque, TORQUE, rtol=0.0)
    assert_close(recording.link_angle, ANGLE[:, 1:] - 1e-4, rtol=0.0)
    assert recording.stored_torque is None
    assert_close(recording.start_pose, ANGLE[0], rtol=0.0)


def test_csv_in_degrees_and_with_derivatives(tmp_path):
    table = columns()
    for k in (1, 2):
        table[f"q_ref_{k} [deg]"] = np.rad2deg(table.pop(f"q_ref_{k} [rad]"))
        table[f"qd_ref_{k} [deg/s]"] = np.rad2deg(SPEED[:, k - 1])
        table[f"tau_stored_{k} [Nm]"] = TORQUE[:, k - 1]
        del table[f"qd_motor_{k} [rad/s]"]
    recording = load_recording(write_csv(tmp_path / "run.csv", table))
    assert_close(recording.reference, np.stack([ANGLE, SPEED]), rtol=1e-14, atol=1e-16)
    assert_close(recording.stored_torque, TORQUE, rtol=0.0)
    # central differences: (rate dt)^2 / 6, at the ends half a step of acceleration
    assert_close(recording.motor_speed, SPEED, rtol=0.0, atol=1e-2)


def test_mat(tmp_path):
    recording = load_mat(tmp_path / "run.mat", mat_content())
    start = np.array([0.1, 0.2])
    assert recording.encoders == (0,)
    assert recording.reference.shape == (2, 251, 2)
    assert_close(recording.reference[0], ANGLE + start, rtol=0.0)
    assert_close(recording.motor_angle, ANGLE + start, rtol=1e-14, atol=1e-16)
    assert_close(recording.motor_speed, SPEED, rtol=1e-14, atol=1e-16)
    assert_close(recording.link_angle, ANGLE[:, :1] + 0.1, rtol=1e-14, atol=1e-16)
    assert_close(recording.stored_torque, TORQUE, rtol=0.0)


def test_axis_at_rest_is_no_jump(tmp_path):
    """An axis that holds still, with noise on its speed, is a good recording."""
    table = columns()
    noise = 1e-3 * np.random.default_rng(0).standard_normal(251)
    table["q_ref_2 [rad]"] = table["q_motor_2 [rad]"] = table["q_link_2 [rad]"] = (
        0 * TIMES
    )
    table["qd_motor_2 [rad/s]"] = noise
    load_recording(write_csv(tmp_path / "run.csv", table))


def change(name, sample, value):
    def apply(table):
        table[name] = table[name].copy()
        table[name][sample] = value

    return apply


def drop(name):
    return lambda table: table.pop(name)


def rename(old, new):
    def apply(table):
        table[new] = table.pop(old)

    return apply


def scale(name, factor):
    def apply(table):
        table[name] = factor * table[name]

    return apply


def shorten(table):
    for name in table:
        table[name] = table[name][:20]


BAD_CSV = [
    (change("q_motor_1 [rad]", 7, np.nan), "`motor_angle` .* finite, but is nan .* 7"),
    (change("qd_motor_2 [rad/s]", 7, np.inf), "`motor_speed` of run.csv: .* finite"),
    (change("tau_motor_2 [N m]", 7, np.nan), "`motor_torque` of run.csv: .* finite"),
    (change("q_ref_2 [rad]", 7, np.nan), r"`reference\[0\]` of run.csv: .* finite"),
    (change("q_motor_1 [rad]", 100, 0.5), "`motor_angle` of run.csv: .* must not jump"),
    (change("q_link_2 [rad]", 100, 0.5), "`link_angle` of run.csv: .* must not jump"),
    (change("q_ref_1 [rad]", 100, 0.5), r"`reference\[0\]` of run.csv: .* not jump"),
    (change("qd_motor_1 [rad/s]", 100, 0.0), "`motor_speed` of run.csv: .* not jump"),
    (change("time [s]", 100, 0.4001), "`times` must be uniform"),
    (change("time [s]", 100, 0.3), "`times` must increase"),
    (drop("time [s]"), r"lacks the columns time \[s\]"),
    (drop("tau_motor_2 [N m]"), "lacks the columns tau_motor_2"),
    (drop("q_motor_1 [rad]"), "lacks the columns q_motor_1"),
    (rename("q_ref_1 [rad]", "q_ref_1"), "heading `q_ref_1` .* must be"),
    (rename("q_ref_1 [rad]", "phi_1 [rad]"), r"heading `phi_1 \[rad\]` .* must be"),
    (rename("time [s]", "time_1 [s]"), r"heading `time_1 \[s\]` .* must be"),
    (rename("q_ref_1 [rad]", "q_ref_1 [m]"), "unit of .* must be one of rad, deg"),
    (scale("q_motor_1 [rad]", -1.0), "motor of axis 0 .* must follow the reference"),
    (scale("q_ref_2 [rad]", 0.0), "motor of axis 1 .* must follow the reference"),
    (shorten, "must hold at least 50 samples, but has 20"),
]


@pytest.mark.parametrize(("spoil", "message"), BAD_CSV)
def test_bad_csv(tmp_path, spoil, message):
    table = columns()
    spoil(table)
    path = write_csv(tmp_path / "run.csv", table)
    with pytest.raises(ValueError, match=message) as caught:
        load_recording(path)
    assert "\n" not in str(caught.value)


def test_angle_jump_without_recorded_speed(tmp_path):
    table = columns()
    for k in (1, 2):
        del table[f"qd_motor_{k} [rad/s]"]
    change("q_motor_1 [rad]", slice(100, None), ANGLE[100:, 0] + 0.1)(table)
    with pytest.raises(ValueError, match="must not jump"):
        load_recording(write_csv(tmp_path / "run.csv", table))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must hold headings and samples"),
        ("time [s],time [s]\n0,1\n", "only once"),
        ("time [s],q_ref_1 [rad]\n0\n", "line 2 of run.csv must have 2 values"),
        ("time [s]\n0\n", "lacks the columns q_ref_1, q_motor_1, tau_motor_1"),
        ("time [s],q_ref_1 [rad]\n0,x\n", "must be numbers"),
    ],
)
def test_malformed_csv(tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load_recording(path)


def test_no_file(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        load_recording(tmp_path / "run.mat")


def test_wrong_kinds_of_files(tmp_path):
    path = write_csv(tmp_path / "run.csv", columns())
    with pytest.raises(ValueError, match="must be a .mat or a .csv file"):
        load_recording(shutil.copy(path, tmp_path / "run.txt"))
    with pytest.raises(ValueError, match="cannot be read as a MATLAB file"):
        load_recording(shutil.copy(path, tmp_path / "run.mat"))
    savemat(tmp_path / "other.mat", {"x": 1.0, "rec": {"time_cont": TIMES}})
    with pytest.raises(
        ValueError, match="lacks ref_kin.phi_r_all, rec.act_pos_mot_deg"
    ):
        load_recording(tmp_path / "other.mat")


def test_bad_mat(tmp_path):
    content = mat_content()
    content["rec"]["act_torque_abs_nm"] = TORQUE
    with pytest.raises(
        ValueError, match="`rec.act_torque_abs_nm` .* must have the shape"
    ):
        load_mat(tmp_path / "run.mat", content)
    content = mat_content()
    content["rec"]["act_pos_mot_deg"][0, 9] = np.nan
    with pytest.raises(ValueError, match="`motor_angle` of run.mat: .* finite"):
        load_mat(tmp_path / "run.mat", content)
    savemat(tmp_path / "run.mat", mat_content())
    with pytest.raises(ValueError, match="`start_pose` must have one angle"):
        load_recording(tmp_path / "run.mat")


def test_torque_step_is_only_a_warning(tmp_path):
    table = columns()
    change("tau_motor_1 [N m]", 100, 40.0)(table)
    path = write_csv(tmp_path / "run.csv", table)
    with pytest.warns(UserWarning, match="torque of axis 0"):
        load_recording(path)


@pytest.mark.parametrize("run", "AB")
def test_kr300(data_dir, run):
    path = data_dir / "kuka_kr300" / f"kr300_10s_FF_{run}.mat"
    if not path.is_file():
        pytest.skip(f"{path.name} is absent: see the README for where to get it")
    recording = load_recording(path)
    content = loadmat(path, simplify_cells=True)
    assert recording.reference.shape == (5, 2501, 6)
    assert recording.encoders == (0, 1, 2)
    assert_close(recording.dt, 0.004, rtol=1e-6)
    first = content["ref_kin"]["phi_r_all"][0]
    start = np.deg2rad([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    assert_close(recording.start_pose, start + first, rtol=1e-14)
    assert_close(recording.stored_torque, content["tau_ff_all"].T, rtol=0.0)
