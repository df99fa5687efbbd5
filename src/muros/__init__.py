"""Robot middleware from a microcontroller to a fleet.

On hosts, importing muros makes ROS message classes importable by name, generated where no ROS is installed:
``from std_msgs.msg import Int32``. Boards find theirs as files, from the build step.
"""

from muros.compat import MPY

__version__ = "0.1.0"

if not MPY:
    from muros import _importer

    _importer.install()
