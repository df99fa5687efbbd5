"""The whole graph as the agent of muros tells it to clients on hosts: with what endpoints are, not only their names.

A client that wants it reads the topic ``muros_graph`` in the participant of its node. Nothing of this enters a data
space: the agent of muros answers such a reader itself, at once and after changes; to other agents it is a topic that
nobody writes. A sample is compressed (zlib, RFC 1950) JSON (RFC 8259), an object with

=============  =========================================================================================
``nodes``      full names of the nodes
``endpoints``  a list for each: kind, name, type, node, gid (hexadecimal), QoS, type hash
=============  =========================================================================================

where QoS is a list of the fields of `muros.space.Qos` in their order: kinds as their numbers on the wire, times in ns.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable
from dataclasses import astuple
from importlib import import_module
from typing import Any, Final

from muros.rclc.host.endpoints import KINDS, Endpoint

__all__ = ["LARGEST", "TOPIC", "TYPE", "pack", "read_untrusted"]

TOPIC: Final = "muros_graph"
TYPE: Final = "muros_msgs/msg/Graph"
LARGEST: Final = 16 << 20
"""Bytes that a graph may have when it is no longer compressed."""

_QUICKLY: Final = 1
"""The level of compression: more would take an agent longer than it saves on the way."""


def pack(nodes: Iterable[str], endpoints: Iterable[Endpoint]) -> bytes:
    """A sample, serialised. The same graph gives the same bytes."""
    content = {
        "nodes": list(nodes),
        "endpoints": [
            (
                end.kind,
                end.name,
                end.type,
                end.node,
                end.gid.hex(),
                end.qos and astuple(end.qos),
                end.type_hash,
            )
            for end in endpoints
        ],
    }
    return zlib.compress(json.dumps(content, separators=(",", ":")).encode(), _QUICKLY)


def read_untrusted(data: bytes) -> tuple[list[str], list[Endpoint]]:
    """The nodes and endpoints of a sample. ValueError for what is none."""
    try:
        inflating = zlib.decompressobj()
        text = inflating.decompress(data, LARGEST)
        if not inflating.eof:
            raise ValueError("it is cut short, or too long")
        content = json.loads(text)
        nodes = [_text(name) for name in content["nodes"]]
        return nodes, [_endpoint(*fields) for fields in content["endpoints"]]
    except (zlib.error, ValueError, TypeError, KeyError, RecursionError) as error:
        raise ValueError(f"{len(data)} B are no graph: {error}") from None


def _endpoint(
    kind: Any, name: Any, type_name: Any, node: Any, gid: Any, qos: Any, type_hash: Any
) -> Endpoint:
    if kind not in KINDS:
        raise ValueError(f"{kind!r} is no kind of endpoint")
    return Endpoint(
        kind, _text(name), _text(type_name), _text(node), bytes.fromhex(gid), _qos(qos), _text(type_hash)
    )


def _qos(fields: Any) -> Any:
    if fields is None:
        return None
    reliability, durability, history, *numbers = fields
    depth, deadline, lifespan, liveliness, lease, ownership, strength, partitions = numbers
    for number in (depth, deadline, lifespan, lease, strength):
        if not isinstance(number, int):
            raise ValueError(f"{number!r} is no number")  # one exception for foreign bytes
    space = import_module("muros.space")  # a room above this one
    return space.Qos(
        space.Reliability(reliability),
        space.Durability(durability),
        space.History(history),
        depth,
        deadline,
        lifespan,
        space.Liveliness(liveliness),
        lease,
        space.Ownership(ownership),
        strength,
        tuple(_text(name) for name in partitions),
    )


def _text(text: Any) -> str:
    if not isinstance(text, str):
        raise ValueError(f"{text!r} is no text")
    return text
