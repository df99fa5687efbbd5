"""The data space where everybody meets: topics, services, graph, in CDR bytes.

Engines behind one door, chosen by a URL:

    space = open_space("local:")
    talker = space.participant("talker")
    writer = talker.writer(Topic("rt/chatter", "std_msgs::msg::dds_::String_"), Qos.preset("default"))
    writer.write(body)

See docs/space.md.
"""

from muros.space._door import (
    ClosedError,
    Entity,
    Participant,
    Reader,
    Replier,
    Requester,
    Space,
    SpaceError,
    UnknownEngineError,
    Writer,
)
from muros.space._graph import (
    Appeared,
    Assigned,
    Endpoint,
    Graph,
    GraphEvent,
    Incompatible,
    Matched,
    ParticipantInfo,
    Role,
    ServiceInfo,
    TopicInfo,
    Unmatched,
    Vanished,
)
from muros.space._qos import (
    PRESETS,
    Durability,
    History,
    Liveliness,
    Mismatch,
    Ownership,
    Qos,
    Reliability,
    mismatches,
)
from muros.space._registry import EngineFactory, open_space, register_engine
from muros.space._values import (
    CDR_BE,
    CDR_LE,
    Reply,
    Request,
    Sample,
    Service,
    Topic,
    identity_of,
    split_identity,
)

__all__ = [
    "CDR_BE",
    "CDR_LE",
    "PRESETS",
    "Appeared",
    "Assigned",
    "ClosedError",
    "Durability",
    "Endpoint",
    "EngineFactory",
    "Entity",
    "Graph",
    "GraphEvent",
    "History",
    "Incompatible",
    "Liveliness",
    "Matched",
    "Mismatch",
    "Ownership",
    "Participant",
    "ParticipantInfo",
    "Qos",
    "Reader",
    "Reliability",
    "Replier",
    "Reply",
    "Request",
    "Requester",
    "Role",
    "Sample",
    "Service",
    "ServiceInfo",
    "Space",
    "SpaceError",
    "Topic",
    "TopicInfo",
    "UnknownEngineError",
    "Unmatched",
    "Vanished",
    "Writer",
    "identity_of",
    "mismatches",
    "open_space",
    "register_engine",
    "split_identity",
]
