"""The numbers of the rosserial protocol by name, as ros_lib and its servers use them.

Modules of the board floor repeat the few they need as ``_NAME = const(n)``, because an underscored constant costs
a board nothing; a test holds every repetition against this table.
"""

SYNC = 0xFF
"""The first byte of every frame."""

# Protocol versions: the second byte of a frame
VERSION_HYDRO = 0xFE
"""Hydro (2013) and every later release."""
VERSION_GROOVY = 0xFF
"""Groovy and earlier: another layout, one checksum."""

# Topic ids of the protocol itself
ID_PUBLISHER = 0
"""From a board: it publishes a topic. To a board: say what you have (the topic request)."""
ID_SUBSCRIBER = 1
ID_SERVICE_SERVER = 2
"""The half of a service server that publishes responses; the half that takes requests is one more."""
ID_SERVICE_CLIENT = 4
"""The half of a service client that publishes requests; the half that takes responses is one more."""
ID_PARAMETER_REQUEST = 6
ID_LOG = 7
ID_TIME = 10
ID_TX_STOP = 11

ID_FIRST_TOPIC = 100
"""The first id that ros_lib gives to a topic."""

# Log levels
LOG_DEBUG = 0
LOG_INFO = 1
LOG_WARN = 2
LOG_ERROR = 3
LOG_FATAL = 4

OVERHEAD = 8
"""Bytes of a frame besides its payload in version 0xFE; one less in 0xFF."""

MAX_PAYLOAD = 0xFFFF
"""The longest payload that the length field can say, in bytes."""

SLOW_FRAME_MS = 20
"""ros_lib abandons a frame when its spinOnce() begins so many milliseconds after the frame's first byte."""
