"""Controllers at the motors."""

from ._motor import (
    CascadeMotorControl as CascadeMotorControl,
    IdealMotorControl as IdealMotorControl,
)
