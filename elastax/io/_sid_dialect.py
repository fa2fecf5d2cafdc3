"""The dialects of SID_FEM: what differs between the generators."""

import dataclasses

from ._sid_layout import (
    AXIS_MAJOR,
    MODE_MAJOR,
    ROW_COLUMN_MODE,
    ROW_MODE_COLUMN,
    AbstractColumnLayout,
    AbstractIndexOrder,
    AbstractStorage,
    SpecialStorage,
    TriangularStorage,
)


@dataclasses.dataclass(frozen=True)
class SidDialect:
    """Names and layouts of one generator.

    Attributes:
        name: of the generator.
        first_moment: name of the block of the first moment.
        inertia: name of the block of the inertia.
        G_r: columns of `Gr`.
        G_e: columns of `Ge`.
        indices: order of the indices of `m1`.
        storage: structures of the matrices.
        exponent: letter before the exponent.
    """

    name: str
    first_moment: str = "mdCM"
    inertia: str = "J"
    G_r: AbstractColumnLayout = AXIS_MAJOR
    G_e: AbstractColumnLayout = AXIS_MAJOR
    indices: AbstractIndexOrder = ROW_MODE_COLUMN
    storage: AbstractStorage = TriangularStorage()
    exponent: str = "D"


FEMBS = SidDialect("FEMBS")
PY_SID = SidDialect("PY_SID", G_r=MODE_MAJOR, storage=SpecialStorage())
MATMOREMBS = SidDialect("MatMorembs", first_moment="mCM", inertia="mmi", exponent="E")
FEMBEAM = SidDialect("FEMBeam", G_r=MODE_MAJOR, G_e=MODE_MAJOR, indices=ROW_COLUMN_MODE)
