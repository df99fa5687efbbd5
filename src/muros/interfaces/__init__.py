"""ROS interface types: definitions, generated classes with CDR codecs, hashes and names.

Definitions come from the user's folders (:func:`add_path`, or ``$MUROS_INTERFACES``) and from the standard packages of
a ROS 2 distribution (``$MUROS_DISTRO``, default the newest). What is wrong with a name or a definition raises
:class:`InterfaceError`; what is wrong with a value or a byte of a message raises :class:`muros.cdr.CdrError`.

Nothing is read or generated before it is asked for.
"""

from muros.cdr import CdrError
from muros.interfaces._api import (
    ActionType,
    ServiceType,
    action,
    add_path,
    definition,
    definition_text,
    full_name,
    known,
    load,
    md5,
    message,
    names,
    packages,
    registry,
    rihs01,
    service,
    source,
    text,
)
from muros.interfaces._model import (
    Action,
    Constant,
    Definition,
    Field,
    FieldType,
    InterfaceError,
    Kind,
    Message,
    Service,
)
from muros.interfaces._names import (
    check_full_name,
    check_namespace,
    check_node_name,
    dds_reply_topic,
    dds_request_topic,
    dds_topic,
    dds_type_name,
    expand_name,
    ros_service,
    ros_topic,
    ros_type_name,
    split_type,
)
from muros.interfaces._parse import parse
from muros.interfaces._registry import ENV_PATHS, Registry
from muros.interfaces._ros1 import (
    Converter,
    ServiceConverter,
    converter,
    ros1_definition,
    ros1_name,
    ros2_message,
    ros2_service,
    service_converter,
)
from muros.interfaces._runtime import Message as MessageBase

__all__ = [
    "ENV_PATHS",
    "Action",
    "ActionType",
    "CdrError",
    "Constant",
    "Converter",
    "Definition",
    "Field",
    "FieldType",
    "InterfaceError",
    "Kind",
    "Message",
    "MessageBase",
    "Registry",
    "Service",
    "ServiceConverter",
    "ServiceType",
    "action",
    "add_path",
    "check_full_name",
    "check_namespace",
    "check_node_name",
    "converter",
    "dds_reply_topic",
    "dds_request_topic",
    "dds_topic",
    "dds_type_name",
    "definition",
    "definition_text",
    "expand_name",
    "full_name",
    "known",
    "load",
    "md5",
    "message",
    "names",
    "packages",
    "parse",
    "registry",
    "rihs01",
    "ros1_definition",
    "ros1_name",
    "ros2_message",
    "ros2_service",
    "ros_service",
    "ros_topic",
    "ros_type_name",
    "service",
    "service_converter",
    "source",
    "split_type",
    "text",
]
