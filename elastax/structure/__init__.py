"""Elastic structure: spring laws, bearings, beams and modal bodies."""

from ._axes import AxisStiffness as AxisStiffness
from ._backlash_stiffness import BacklashStiffness as BacklashStiffness
from ._bar_modes import (
    BarModes as BarModes,
    bar_modes as bar_modes,
    extension_modes as extension_modes,
    torsion_modes as torsion_modes,
)
from ._beam import (
    HINGE_POSITION as HINGE_POSITION,
    TIP_FORCE as TIP_FORCE,
    TIP_MOMENT as TIP_MOMENT,
    UNIFORM_LOAD as UNIFORM_LOAD,
    BeamSection as BeamSection,
    LoadCase as LoadCase,
    Material as Material,
    UniformBeam as UniformBeam,
)
from ._beam_body import (
    ModeCounts as ModeCounts,
    TipMass as TipMass,
    modal_beam as modal_beam,
)
from ._beam_elements import beam_frame as beam_frame, beam_line as beam_line
from ._beam_segments import BeamSegments as BeamSegments, SlenderBody as SlenderBody
from ._beam_supports import (
    AbstractSupport as AbstractSupport,
    ClampedFree as ClampedFree,
    FreeFree as FreeFree,
    SupportedFree as SupportedFree,
)
from ._bending_modes import (
    BendingModes as BendingModes,
    bending_modes as bending_modes,
)
from ._body_detail import (
    BODY_DETAILS as BODY_DETAILS,
    NOMINAL as NOMINAL,
    VARIANT_1 as VARIANT_1,
    VARIANT_2 as VARIANT_2,
    VARIANT_3 as VARIANT_3,
    VARIANT_4 as VARIANT_4,
    VARIANT_5 as VARIANT_5,
    BodyDetail as BodyDetail,
)
from ._body_nodes import BodyNodes as BodyNodes, no_nodes as no_nodes
from ._exponential_stiffness import ExponentialStiffness as ExponentialStiffness
from ._finite_elements import (
    FiniteElementModel as FiniteElementModel,
    craig_bampton as craig_bampton,
    eigenmodes as eigenmodes,
    modal_body as modal_body,
)
from ._floating_frame import (
    BodyForces as BodyForces,
    element_motion as element_motion,
    free_body as free_body,
    inertial_forces as inertial_forces,
)
from ._hinged_beam import ClampHinges as ClampHinges, GaussHinges as GaussHinges
from ._modal_body import ModalBody as ModalBody
from ._point_masses import point_mass_body as point_mass_body
from ._stiffness import (
    AbstractStiffness as AbstractStiffness,
    CubicStiffness as CubicStiffness,
    LimitedStiffness as LimitedStiffness,
    LinearStiffness as LinearStiffness,
)
from ._tabulated_stiffness import TabulatedStiffness as TabulatedStiffness
