"""The functions of :mod:`muros.interfaces`: one registry for each distribution, one class for each type."""

from __future__ import annotations

import os
from threading import RLock
from typing import Any, ClassVar

from muros.interfaces import _hashes, _host
from muros.interfaces import _model as model
from muros.interfaces._model import InterfaceError
from muros.interfaces._names import split_type
from muros.interfaces._registry import ENV_PATHS, Registry
from muros.interfaces._shape import shape as shape_of


class ServiceType:
    """The base of service types: what they have in common."""

    TYPE: ClassVar[str]
    Request: ClassVar[type[Any]]
    Response: ClassVar[type[Any]]


class ActionType:
    """The base of action types: their own messages, and the services and message that carry them."""

    TYPE: ClassVar[str]
    Goal: ClassVar[type[Any]]
    Result: ClassVar[type[Any]]
    Feedback: ClassVar[type[Any]]
    SendGoal: ClassVar[type[ServiceType]]
    GetResult: ClassVar[type[ServiceType]]
    FeedbackMessage: ClassVar[type[Any]]


_lock = RLock()  # so that two threads never get two classes of one type
_registries: dict[str | None, Registry] = {}
_classes: dict[tuple[Registry, str], type[Any]] = {}
_paths: list[str | os.PathLike[str]] = []


def registry(distro: str | None = None) -> Registry:
    """The registry that the functions of this package use for a distribution (default: see the package)."""
    found = _registries.get(distro)
    return found or _new_registry(distro)


def add_path(folder: str | os.PathLike[str]) -> tuple[str, ...]:
    """Adds a folder of the user's definitions; returns the names of the packages in it.

    The folder is a package (it has ``msg/*.msg``, ``srv/*.srv`` or ``action/*.action``) or holds packages. Its
    definitions go before standard ones of the same name; classes made earlier stay as they are. Raises
    :class:`InterfaceError` if the folder has none.
    """
    with _lock:
        home = registry()
        before = home.user_files()
        found = home.add_path(folder)
        changed = {name for name, path in home.user_files().items() if before.get(name) != path}
        for distro, other in _registries.items():
            if distro is not None:
                other.add_path(folder)
        _paths.append(os.path.abspath(os.path.expanduser(folder)))
        if any(name in changed for _, name in _classes):
            _classes.clear()  # something that was used got another definition: nothing made of it may be used again
        return found


def message(name: str, distro: str | None = None) -> type[Any]:
    """The class of a message, ``std_msgs/msg/Int32`` or short ``std_msgs/Int32``; always the same one.

    It is a subclass of :class:`MessageBase` with the message's fields as arguments and attributes. Also gives the
    messages of services and actions (``example_interfaces/srv/AddTwoInts_Request``). Raises :class:`InterfaceError`.
    """
    home = registry(distro)
    full = "/".join(split_type(name))
    made = _classes.get((home, full))
    if made is None:
        with _lock:
            made = _classes.get((home, full))
            if made is None:
                made = _host.build(home, home.message(full), lambda nested: message(nested, distro))
                _classes[home, full] = made
    if issubclass(made, (ServiceType, ActionType)):
        kind = "a service" if issubclass(made, ServiceType) else "an action"
        raise InterfaceError(f"{full} is {kind}, not a message")
    return made


def service(name: str, distro: str | None = None) -> type[ServiceType]:
    """The class of a service, ``example_interfaces/srv/AddTwoInts``, with ``.Request`` and ``.Response``."""
    home = registry(distro)
    full = "/".join(split_type(name, "srv"))
    with _lock:
        if (home, full) not in _classes:
            described = home.definition(full)
            if not isinstance(described, model.Service):
                raise InterfaceError(f"{full} is no service")
            _classes[home, full] = _made(
                full,
                ServiceType,
                Request=message(described.request.name, distro),
                Response=message(described.response.name, distro),
            )
        made = _classes[home, full]
    if not issubclass(made, ServiceType):
        raise InterfaceError(f"{full} is no service")
    return made


def action(name: str, distro: str | None = None) -> type[ActionType]:
    """The class of an action, ``example_interfaces/action/Fibonacci``, with ``.Goal``, ``.SendGoal`` and so on."""
    home = registry(distro)
    full = "/".join(split_type(name, "action"))
    with _lock:
        if (home, full) not in _classes:
            described = home.definition(full)
            if not isinstance(described, model.Action):
                raise InterfaceError(f"{full} is no action")
            _classes[home, full] = _made(
                full,
                ActionType,
                Goal=message(described.goal.name, distro),
                Result=message(described.result.name, distro),
                Feedback=message(described.feedback.name, distro),
                SendGoal=service(described.send_goal.name, distro),
                GetResult=service(described.get_result.name, distro),
                FeedbackMessage=message(described.feedback_message.name, distro),
            )
        made = _classes[home, full]
    if not issubclass(made, ActionType):
        raise InterfaceError(f"{full} is no action")
    return made


def load(name: str, distro: str | None = None) -> type[Any]:
    """The class of whatever has that name; the short ``package/Type`` means the first kind that has one."""
    home = registry(distro)
    described = home.definition(home.full_name(name))
    if isinstance(described, model.Service):
        return service(described.name, distro)
    if isinstance(described, model.Action):
        return action(described.name, distro)
    return message(described.name, distro)


def full_name(name: str, distro: str | None = None) -> str:
    """The full name that is meant by ``package/Type``, or the name itself; :class:`InterfaceError` if it is none."""
    return registry(distro).full_name(name)


def definition_text(name: str, distro: str | None = None) -> str:
    """The text of a definition alone."""
    return _hashes.definition_text(definition(name, distro))


def definition(name: str, distro: str | None = None) -> model.Definition:
    """The definition of that full name; everything it refers to exists."""
    return registry(distro).definition("/".join(split_type(name)))


def known(name: str) -> bool:
    """Whether there is a definition of that full name."""
    try:
        return registry().known("/".join(split_type(name)))
    except InterfaceError:
        return False


def names(package: str | None = None) -> list[str]:
    """The full names of all definitions, or of those of one package, sorted."""
    return registry().names(package)


def packages() -> frozenset[str]:
    """The names of all packages that have definitions; quick."""
    return registry().packages()


def rihs01(name: str, distro: str | None = None) -> str:
    """The ROS 2 type hash (REP-2011) of a message, service or action: ``RIHS01_`` and 64 hex digits."""
    return _hashes.rihs01(registry(distro), "/".join(split_type(name)))


def md5(name: str) -> str:
    """The ROS 1 md5 sum of a message, a service, or one half of a service (``std_srvs/srv/SetBool_Request``).

    Standard messages are those of ROS 1 Noetic, where some have other fields than in ROS 2.
    """
    return _hashes.ros1_md5(registry(), "/".join(split_type(name)))


def text(name: str, distro: str | None = None) -> str:
    """The text of a definition followed by those of all nested messages, divided as in bag files."""
    return _hashes.full_text(registry(distro), "/".join(split_type(name)))


def shape(name: str, distro: str | None = None) -> str:
    """The shape of a message as a line of text, by which its size is bounded; see ``muros.interfaces._shape``."""
    home = registry(distro)
    return shape_of(home.message("/".join(split_type(name))), home.message)


def source(name: str, distro: str | None = None) -> str:
    """The Python source of the generated class of a message, for reading."""
    home = registry(distro)
    return _host.source(home, home.message("/".join(split_type(name))))


def _new_registry(distro: str | None) -> Registry:
    with _lock:
        if distro not in _registries:
            made = Registry(distro)
            for folder in filter(None, os.environ.get(ENV_PATHS, "").split(os.pathsep)):
                try:
                    made.add_path(folder)
                except InterfaceError as error:
                    raise InterfaceError(f"${ENV_PATHS}: {error}") from None
            for path in _paths:
                made.add_path(path)
            _registries[distro] = made
        return _registries[distro]


def _made(full: str, base: type[Any], **members: object) -> type[Any]:
    package, kind, type_name = full.split("/")
    return type(
        type_name, (base,), {"TYPE": full, "__module__": f"{package}.{kind}", "__doc__": full, **members}
    )
