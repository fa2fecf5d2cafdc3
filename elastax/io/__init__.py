"""Files: robots, recordings, results."""

from ._robot_file import load_robot as load_robot, robot_from_table as robot_from_table
