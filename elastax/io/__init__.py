"""Files: robots, recordings, results."""

from ._drive_parts import (
    drives_with_parts as drives_with_parts,
    load_drive_parts as load_drive_parts,
)
from ._matrices import load_matrices as load_matrices
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
from ._sid_dialect import (
    FEMBEAM as FEMBEAM,
    FEMBS as FEMBS,
    MATMOREMBS as MATMOREMBS,
    PY_SID as PY_SID,
    SidDialect as SidDialect,
)
from ._sid_file import SidFile as SidFile, SidNode as SidNode
from ._sid_layout import (
    AXIS_MAJOR as AXIS_MAJOR,
    MODE_MAJOR as MODE_MAJOR,
    ROW_COLUMN_MODE as ROW_COLUMN_MODE,
    ROW_MODE_COLUMN as ROW_MODE_COLUMN,
    AbstractColumnLayout as AbstractColumnLayout,
    AbstractIndexOrder as AbstractIndexOrder,
    AbstractStorage as AbstractStorage,
    SpecialStorage as SpecialStorage,
    TriangularStorage as TriangularStorage,
)
from ._sid_read import load_sid as load_sid
from ._sid_report import (
    SidIdentity as SidIdentity,
    SidMeasure as SidMeasure,
    SidReport as SidReport,
)
from ._sid_taylor import IndexFinding as IndexFinding, SidBlock as SidBlock
from ._sid_write import save_sid as save_sid, sid_from_body as sid_from_body
from ._urdf import (
    arm_from_urdf as arm_from_urdf,
    robot_from_urdf as robot_from_urdf,
)
from ._urdf_export import (
    urdf_from_arm as urdf_from_arm,
    urdf_from_robot as urdf_from_robot,
)
from ._urdf_notes import UrdfWarning as UrdfWarning
