"""Robots: functions that return records, every number with its source."""

from ._kr210 import kr210 as kr210
