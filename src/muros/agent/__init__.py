"""The DDS-XRCE agent: boards and other clients meet in a data space, through any link.

`Agent` runs in an asyncio program; `AgentCore` is the same without I/O.
"""

from muros.agent._agent import Agent
from muros.agent._core import AgentCore, Port
from muros.agent._limits import Limits
from muros.agent.events import (
    ClientBack,
    ClientConnected,
    ClientGone,
    ClientLost,
    ClientReady,
    ClientSilent,
    EntityCreated,
    EntityDeleted,
    Event,
    LinkDown,
    LinkUp,
    client_name,
)

__all__ = [
    "Agent",
    "AgentCore",
    "ClientBack",
    "ClientConnected",
    "ClientGone",
    "ClientLost",
    "ClientReady",
    "ClientSilent",
    "EntityCreated",
    "EntityDeleted",
    "Event",
    "Limits",
    "LinkDown",
    "LinkUp",
    "Port",
    "client_name",
]
