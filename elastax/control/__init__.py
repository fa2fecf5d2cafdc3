"""Controllers at the motors, and runs of a feed-forward on the elastic plant."""

from ._analogue import AnalogueCascade as AnalogueCascade
from ._comparison import (
    Run as Run,
    rigid_tool_path as rigid_tool_path,
    run_command as run_command,
    run_feedforward as run_feedforward,
)
from ._motor import (
    CascadeMotorControl as CascadeMotorControl,
    IdealMotorControl as IdealMotorControl,
)
