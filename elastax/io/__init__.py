"""Files: robots, recordings, results."""

from ._drive_parts import (
    drives_with_parts as drives_with_parts,
    load_drive_parts as load_drive_parts,
)
from ._recording import load_recording as load_recording
from ._report import (
    FEEDFORWARD_COLUMNS as FEEDFORWARD_COLUMNS,
    Column as Column,
    feedforward_rows as feedforward_rows,
    format_table as format_table,
)
from ._results import (
    check_schema as check_schema,
    read_result as read_result,
    versions as versions,
    write_results as write_results,
)
from ._robot_file import load_robot as load_robot, robot_from_table as robot_from_table
from ._urdf import (
    arm_from_urdf as arm_from_urdf,
    robot_from_urdf as robot_from_urdf,
)
from ._urdf_export import (
    urdf_from_arm as urdf_from_arm,
    urdf_from_robot as urdf_from_robot,
)
from ._urdf_notes import UrdfWarning as UrdfWarning
