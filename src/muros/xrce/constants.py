"""The wire constants of DDS-XRCE by their names in the specification (DDS-XRCE 1.0, clauses 8.3 and 7.7).

Modules of the board floor repeat the few they need as ``_NAME = const(n)``, because an underscored constant costs
a board nothing; a test holds every repetition against this table.
"""

# Submessages (8.3.5)
CREATE_CLIENT = 0
CREATE = 1
GET_INFO = 2
DELETE = 3
STATUS_AGENT = 4
STATUS = 5
INFO = 6
WRITE_DATA = 7
READ_DATA = 8
DATA = 9
ACKNACK = 10
HEARTBEAT = 11
RESET = 12
FRAGMENT = 13
TIMESTAMP = 14
TIMESTAMP_REPLY = 15

# Submessage flags (8.3.4)
LITTLE_ENDIAN = 0x01
REUSE = 0x02
REPLACE = 0x04
LAST_FRAGMENT = 0x02
FORMAT_MASK = 0x0E

# What a session's handler answers to a submessage (ours, see ``session``)
HANDLED = 0
FAILED = 1
LATER = 2

# Streams (8.3.2.2)
STREAM_NONE = 0
STREAM_BEST_EFFORT = 0x01
STREAM_RELIABLE = 0x80

# Sessions (8.3.2.1): from here on a header carries no client key
SESSION_NONE_WITH_KEY = 0x00
SESSION_NONE = 0x80

# Object kinds: the low nibble of an object id (7.7.10)
KIND_PARTICIPANT = 0x01
KIND_TOPIC = 0x02
KIND_PUBLISHER = 0x03
KIND_SUBSCRIBER = 0x04
KIND_DATAWRITER = 0x05
KIND_DATAREADER = 0x06
KIND_REQUESTER = 0x07
KIND_REPLIER = 0x08
KIND_TYPE = 0x0A
KIND_QOSPROFILE = 0x0B
KIND_APPLICATION = 0x0C
KIND_AGENT = 0x0D
KIND_CLIENT = 0x0E
OBJECT_AGENT = 0xFFFD
OBJECT_CLIENT = 0xFFFE
OBJECT_SESSION = 0xFFFF

KIND_NAMES = {
    KIND_PARTICIPANT: "participant",
    KIND_TOPIC: "topic",
    KIND_PUBLISHER: "publisher",
    KIND_SUBSCRIBER: "subscriber",
    KIND_DATAWRITER: "datawriter",
    KIND_DATAREADER: "datareader",
    KIND_REQUESTER: "requester",
    KIND_REPLIER: "replier",
    KIND_TYPE: "type",
    KIND_QOSPROFILE: "qos profile",
    KIND_APPLICATION: "application",
    KIND_AGENT: "agent",
    KIND_CLIENT: "client",
}

# Representation formats (7.7.3)
BY_REFERENCE = 1
AS_XML = 2
IN_BINARY = 3

# ResultStatus (7.7.12)
STATUS_OK = 0x00
STATUS_OK_MATCHED = 0x01
STATUS_ERR_DDS_ERROR = 0x80
STATUS_ERR_MISMATCH = 0x81
STATUS_ERR_ALREADY_EXISTS = 0x82
STATUS_ERR_DENIED = 0x83
STATUS_ERR_UNKNOWN_REFERENCE = 0x84
STATUS_ERR_INVALID_DATA = 0x85
STATUS_ERR_INCOMPATIBLE = 0x86
STATUS_ERR_RESOURCES = 0x87

STATUS_NAMES = {
    STATUS_OK: "OK",
    STATUS_OK_MATCHED: "OK_MATCHED",
    STATUS_ERR_DDS_ERROR: "ERR_DDS_ERROR",
    STATUS_ERR_MISMATCH: "ERR_MISMATCH",
    STATUS_ERR_ALREADY_EXISTS: "ERR_ALREADY_EXISTS",
    STATUS_ERR_DENIED: "ERR_DENIED",
    STATUS_ERR_UNKNOWN_REFERENCE: "ERR_UNKNOWN_REFERENCE",
    STATUS_ERR_INVALID_DATA: "ERR_INVALID_DATA",
    STATUS_ERR_INCOMPATIBLE: "ERR_INCOMPATIBLE",
    STATUS_ERR_RESOURCES: "ERR_RESOURCES",
}

# Endpoint QoS flags of the binary representation (7.7.3.5)
QOS_RELIABLE = 0x01
QOS_KEEP_LAST = 0x02
QOS_OWNERSHIP_EXCLUSIVE = 0x04
QOS_TRANSIENT_LOCAL = 0x08
QOS_TRANSIENT = 0x10
QOS_PERSISTENT = 0x20

# Request ids a client reserves; those of entities count from FIRST_REQUEST and wrap to it
REQUEST_NONE = 0
REQUEST_LOGIN = 1
REQUEST_LOGOUT = 2
REQUEST_DISCOVERY = 9
REQUEST_PING = 10
FIRST_REQUEST = 10

# CREATE_CLIENT and STATUS_AGENT (7.8.2)
COOKIE = b"XRCE"
VERSION = (1, 0)
VENDOR = b"\x01\x0f"
UNLIMITED_SAMPLES = 0xFFFF

# Limits of the reference peers, the defaults of our arguments
DEFAULT_MTU = 512
DEFAULT_HISTORY = 4
AGENT_WINDOW = 16
"""Reliable messages in flight, either way, at the agent."""
AGENT_HEARTBEAT_MS = 200
CLIENT_HEARTBEAT_MS = 100
AGENT_DEAD_TIME_MS = 30_000
"""Silence after which an agent stops its heartbeats to a client."""
AGENT_BUFFER = 65535
DISCOVERY_PORT = 7400
DISCOVERY_GROUP = "239.255.0.2"
