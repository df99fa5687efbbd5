"""The bridge that turns diagnostics of boards, which are numbers, into those that ROS 2's tools show.

Boards publish `micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus` (see `muros.rclc.DiagnosticUpdater`, or the
diagnostics of micro-ROS); a `Table` read from YAML has the words for their numbers.
"""

from muros.diagnostics._bridge import Bridge
from muros.diagnostics._table import NOT_FOUND, Table, TableError, read_table, read_table_untrusted

__all__ = ["NOT_FOUND", "Bridge", "Table", "TableError", "read_table", "read_table_untrusted"]
