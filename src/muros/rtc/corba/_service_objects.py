"""What service ports need of the ORB: objects that are offered, and those that are called.

Fulfils `muros.rtc.services.ServiceObjects`; `OrbServiceObjects(orb)` is to be given to `use_service_objects` when the
ORB has been started.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import omniORB
from omniORB import CORBA, PortableServer

from muros.rtc.codes import PeerLostError, RtcError
from muros.rtc.corba._lost import LOST, describe
from muros.rtc.corba._orb import Orb
from muros.rtc.corba.idl import load_idl
from muros.rtc.services import ServiceTypeError

__all__ = ["OrbServiceObjects"]

ATTRIBUTE: Final = ("_get_", "_set_")
"""How the names of the operations begin that stand for an attribute of an interface."""


class OrbServiceObjects:
    """The service objects of an ORB."""

    def __init__(self, orb: Orb) -> None:
        self._orb = orb

    def interface(self, name: str, idl: Path) -> Any:
        """The stub class of `name` (`SimpleService::MyService`) in an IDL file. RtcError if it has none."""
        modules = load_idl(idl)
        first, *inner = name.strip(":").split("::")
        found: Any = modules.get(first) if inner else getattr(modules.get("_GlobalIDL"), first, None)
        for part in inner:
            found = getattr(found, part, None)
        if not hasattr(found, "_NP_RepositoryId"):
            have = ", ".join(sorted(module for module in modules if not module.endswith("__POA")))
            raise RtcError(f"{idl} has no interface {name}; its modules are {have or 'none'}")
        return found

    def type_name(self, interface: Any) -> str:
        """`MyService` of the stub class of SimpleService::MyService."""
        return str(interface.__name__)

    def offer(self, interface: Any, target: object, on_error: Callable[[str, Exception], object]) -> _Offered:
        """A reference to `target`, behind which there is nobody yet."""
        if isinstance(target, PortableServer.Servant):
            return _Offered(self._orb, target)
        if interface is None:
            raise RtcError(f"{type(target).__name__} is no servant: say which interface it provides")
        skeleton = omniORB.skeletonMapping.get(interface._NP_RepositoryId)
        if skeleton is None:
            raise RtcError(
                f"{interface.__name__}: its skeleton ({interface.__module__}__POA) is not imported"
            )
        return _Offered(self._orb, _servant(skeleton, target, on_error))

    def resolve(self, reference: str, interface: Any) -> Any:
        """The stub object that a reference leads to."""
        found = self._orb.to_reference(reference)
        if found is None or interface is None:
            return found
        try:
            fits = found._is_a(interface._NP_RepositoryId)
        except CORBA.OBJECT_NOT_EXIST:
            fits = _may_be(found, interface)
            if fits:
                return found._unchecked_narrow(interface)
        except LOST as error:
            raise PeerLostError(f"its process does not answer: {describe(error)}") from error
        except CORBA.SystemException as error:
            raise RtcError(f"it cannot be asked for its type: {describe(error)}") from error
        if not fits:
            raise ServiceTypeError(f"it is no {interface._NP_RepositoryId}")
        return found._narrow(interface)

    def explain(self, error: Exception) -> RtcError | None:
        """What an exception of the ORB means to a caller."""
        if isinstance(error, CORBA.OBJECT_NOT_EXIST):
            return PeerLostError("the provider is not active, or has ended")
        if isinstance(error, LOST):
            return PeerLostError(f"the provider does not answer: {describe(error)}")
        if isinstance(error, CORBA.SystemException):
            return RtcError(f"the call failed: {describe(error)}")
        return None


class _Offered:
    """A servant with a reference that stays the same while it comes and goes."""

    def __init__(self, orb: Orb, servant: Any) -> None:
        try:
            self._place = orb.reserve(servant)
            self.reference: Final = orb.to_text(self._place.reference)
        except CORBA.SystemException as error:
            raise RtcError(f"no reference can be made: {describe(error)}") from error

    def activate(self) -> None:
        try:
            self._place.activate()
        except CORBA.SystemException as error:
            raise RtcError(f"a provider cannot be activated: {describe(error)}") from error

    def deactivate(self) -> None:
        with contextlib.suppress(CORBA.SystemException):  # the ORB may have ended before
            self._place.deactivate()


def _may_be(found: Any, interface: Any) -> bool:
    """Whether an object that cannot be asked may have `interface`: its reference names that type, or an unknown one."""
    proxy = omniORB.objrefMapping.get(interface._NP_RepositoryId, object)
    return type(found) is CORBA.Object or isinstance(found, proxy)


def _servant(skeleton: Any, target: object, on_error: Callable[[str, Exception], object]) -> Any:
    """A servant whose operations are the methods of `target`, its attributes those of `target`."""
    methods: dict[str, Any] = {}
    missing = []
    for operation in skeleton._omni_op_d:
        if operation.startswith(ATTRIBUTE):
            methods[operation] = _attribute(target, operation)
        elif callable(method := getattr(target, operation, None)):
            methods[operation] = _guarded(operation, method, on_error)
        else:
            missing.append(operation)
    if missing:
        raise RtcError(
            f"{type(target).__name__} provides {skeleton._NP_RepositoryId} and has no {', '.join(sorted(missing))}"
        )
    return type(f"{skeleton.__name__}Servant", (skeleton,), methods)()


def _guarded(
    operation: str, method: Callable[..., Any], on_error: Callable[[str, Exception], object]
) -> Callable[..., Any]:
    def call(servant: object, *arguments: Any) -> Any:
        try:
            return method(*arguments)
        except CORBA.Exception:
            raise
        except Exception as error:
            on_error(operation, error)
            raise CORBA.UNKNOWN(omniORB.UNKNOWN_PythonException, CORBA.COMPLETED_MAYBE) from error

    return call


def _attribute(target: object, operation: str) -> Callable[..., Any]:
    name = operation[len(ATTRIBUTE[0]) :]
    if operation.startswith("_get_"):
        return lambda servant: getattr(target, name)
    return lambda servant, value: setattr(target, name, value)
