"""Figures of runs, pose grids, recordings, perturbed models, poles and zeros.

Every function takes data and returns a matplotlib `Figure` with its own canvas: no
window, no global state. Angles come in radians, lengths in metres; the axes say what
is drawn.
"""

from ._branches import (
    plot_branch_path as plot_branch_path,
    plot_branches as plot_branches,
)
from ._drives import (
    plot_deformations as plot_deformations,
    plot_torques as plot_torques,
)
from ._grid import plot_pose_grid as plot_pose_grid
from ._paths import (
    plot_cartesian_path as plot_cartesian_path,
    plot_path_error as plot_path_error,
    plot_tool_deviation as plot_tool_deviation,
    plot_wrist_acceleration as plot_wrist_acceleration,
)
from ._perturbations import plot_perturbations as plot_perturbations
from ._recording import plot_recording as plot_recording
from ._structure import (
    animate as animate,
    plot_deflection as plot_deflection,
    plot_deformed as plot_deformed,
    plot_modes as plot_modes,
    skeleton as skeleton,
)
from ._style import save_figure as save_figure
from ._workspace import (
    plot_dexterity_section as plot_dexterity_section,
    plot_reach_section as plot_reach_section,
)
from ._zero_maps import (
    plot_frequency_map as plot_frequency_map,
    plot_zero_map as plot_zero_map,
    plot_zeros_along_link as plot_zeros_along_link,
)
from ._zeros import (
    plot_bode as plot_bode,
    plot_nyquist as plot_nyquist,
    plot_poles_and_zeros as plot_poles_and_zeros,
)
