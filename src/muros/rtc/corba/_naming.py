"""The name service: objects by paths such as `robot.host_cxt/Motor0.rtc`, at one server or several.

A path's parts are `ID.KIND`, with `/` between; the last dot parts them, `\\.`, `\\/` and `\\\\` are themselves.

`NameServer` is one server, asked directly; it raises when it does not answer. `Names` is what a process wants to be
known as, at all its servers: servers that are down, restarted or forgetful are caught up with at each `update`.
"""

from __future__ import annotations

import contextlib
import re
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeVar

import CosNaming
from omniORB import CORBA

from muros.findings import Finding, Severity
from muros.rtc.codes import PeerLostError, RtcError
from muros.rtc.corba._lost import LOST, asked_again, describe, is_there
from muros.rtc.corba._orb import Orb
from muros.rtc.properties import split_address

__all__ = ["Binding", "NameServer", "Names", "entries_of", "is_same", "lives", "server_address", "split_path"]

DEFAULT_PORT: Final = 2809
"""TCP port of a name server whose address has none."""

LIST_LIMIT: Final = 100_000
"""Bindings that are listed of one context, and told of by one walk."""

WALK_LIMIT: Final = 1000
"""Contexts that one walk looks into."""

T = TypeVar("T")

_BATCH: Final = 200
_DOT: Final = re.compile(r"\\.|\.", re.DOTALL)
_PART: Final = re.compile(r"(?:[^\\/]|\\.)+", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Binding:
    """One entry of a naming context."""

    name: str
    """Its id, such as `Motor0`."""
    kind: str
    """Such as `rtc`."""
    is_context: bool


def server_address(text: str) -> str:
    """`HOST:PORT` of an entry of `corba.nameservers`, which may lack the port or be a `corbaname`. RtcError if bad."""
    address = re.sub(r"^corba(?:name|loc):(?:iiop)?:", "", text.strip())
    host, port = split_address(address.rstrip("/"), str(DEFAULT_PORT))
    if not host.strip(":") or not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise RtcError(f"'{text}' is no address of a name server: write HOST or HOST:PORT")
    return f"{host}:{port}"


def split_path(path: str) -> list[tuple[str, str]]:
    """The (id, kind) pairs of a path. RtcError if it has none, or an empty part."""
    parts = _PART.findall(path)
    if not parts or "/".join(parts) != path.strip("/"):
        raise RtcError(f"'{path}' is no name: write ID.KIND, with / between several")
    return [_split_part(part) for part in parts]


def _split_part(part: str) -> tuple[str, str]:
    dots = [found.start() for found in _DOT.finditer(part) if found.group() == "."]
    place = dots[-1] if dots else len(part)
    return _plain(part[:place]), _plain(part[place + 1 :])


def _plain(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text, flags=re.DOTALL)


class NameServer:
    """One name server. All operations raise PeerLostError when it does not answer, RtcError for what it refuses."""

    def __init__(self, orb: Orb, address: str) -> None:
        self.address: Final = server_address(address)
        self._orb = orb
        self._context: Any = None

    def is_there(self) -> bool:
        """Whether it answers."""
        try:
            return not self._root()._non_existent()
        except (CORBA.Exception, RtcError):
            return False

    def bind(self, path: str, reference: Any) -> None:
        """Give an object this name; contexts on the way are made, another object of this name loses it."""
        name = _components(path)

        def rebind(root: Any) -> None:
            try:
                root.rebind(name, reference)
                return
            except CosNaming.NamingContext.NotFound:
                for depth in range(1, len(name)):
                    with contextlib.suppress(CosNaming.NamingContext.AlreadyBound):
                        root.bind_new_context(name[:depth])
            root.rebind(name, reference)

        self._ask(path, rebind)

    def unbind(self, path: str) -> bool:
        """Take the name away. False if there was none."""
        name = _components(path)

        def unbind(root: Any) -> bool:
            try:
                root.unbind(name)
            except CosNaming.NamingContext.NotFound:
                return False
            return True

        return self._ask(path, unbind)

    def resolve(self, path: str) -> Any | None:
        """The object of this name, which may have ended; None if there is no such name."""
        name = _components(path)

        def resolve(root: Any) -> Any | None:
            try:
                return root.resolve(name)
            except CosNaming.NamingContext.NotFound:
                return None

        return self._ask(path, resolve)

    def list(self, path: str = "") -> list[Binding]:
        """What is in a context ("" = the root), in the server's order."""
        context = self._ask(path, lambda root: _context_at(root, path))
        return [_binding(one) for one in self._listed(path, context)]

    def walk(
        self, path: str = "", *, contexts: int = WALK_LIMIT, bindings: int = LIST_LIMIT
    ) -> Iterator[tuple[str, Binding]]:
        """The bindings below a context, with their paths, nearest first.

        Each context is looked into once, by its nearest path, though it may have several or contain itself; at most
        `contexts` are, and at most `bindings` are told of. One that does not answer is skipped, but for the first.
        """
        first = self._ask(path, lambda root: _context_at(root, path))
        seen, waiting = [first], deque([(path, first)])
        while waiting:
            place, context = waiting.popleft()
            try:
                entries = self._listed(place, context)
            except RtcError:
                if context is first:
                    raise
                continue
            for entry in entries[:bindings]:
                binding = _binding(entry)
                part = "/".join(filter(None, (place, f"{_quoted(binding.name)}.{_quoted(binding.kind)}")))
                yield part, binding
                if binding.is_context and len(seen) < contexts:
                    with contextlib.suppress(RtcError):
                        inner = self._ask(part, partial(_inner, context, entry))
                        if not any(is_same(inner, other) for other in seen):
                            seen.append(inner)
                            waiting.append((part, inner))
            bindings -= len(entries)
            if bindings <= 0:
                return

    def _listed(self, path: str, context: Any) -> Sequence[Any]:
        return self._ask(path, lambda _: entries_of(context))

    def _root(self) -> Any:
        if self._context is None:
            reference = self._orb.to_reference(f"corbaloc::{self.address}/NameService")
            self._context = reference._unchecked_narrow(CosNaming.NamingContext)
        return self._context

    def _ask(self, path: str, question: Callable[[Any], T]) -> T:
        """The answer to a question that may be asked twice; a server that was restarted hears the second one."""
        who = f"name server {self.address}"
        try:
            return asked_again(lambda: question(self._root()))
        except LOST as error:
            raise PeerLostError(f"{who} does not answer: {describe(error)}") from error
        except CORBA.Exception as error:
            raise RtcError(f"{who} refuses '{path}': {describe(error)}") from error


class Names:
    """What objects of this process are to be called, at several servers. Nothing here raises for what servers do.

    `report` takes findings: a server that does not answer, a name that another object has.
    """

    def __init__(
        self,
        orb: Orb,
        addresses: Iterable[str],
        *,
        report: Callable[[Finding], object] = lambda finding: None,
    ) -> None:
        self.servers: Final = tuple(NameServer(orb, address) for address in addresses)
        self._report = report
        self._lock = threading.Lock()
        self._wanted: dict[str, Any] = {}
        self._down: set[str] = set()

    @property
    def bound(self) -> dict[str, Any]:
        """The names wanted, with their objects."""
        with self._lock:
            return dict(self._wanted)

    def bind(self, path: str, reference: Any) -> None:
        """Call this object so at every server, those that come later too, until `unbind`. RtcError: no such path."""
        split_path(path)
        with self._lock:
            self._wanted[path] = reference
        for server in self.servers:
            with self._at(server):
                self._tell_taken(server, path, reference, "it is now the name of the object of this process")
                server.bind(path, reference)

    def unbind(self, path: str) -> None:
        """Take the name away where it is that of our object."""
        with self._lock:
            reference = self._wanted.pop(path, None)
        for server in self.servers:
            with self._at(server):
                if is_same(server.resolve(path), reference):
                    server.unbind(path)

    def unbind_all(self) -> None:
        """Take all names away, as a process does that ends."""
        for path in self.bound:
            self.unbind(path)

    def update(self) -> None:
        """Give every server the names it lacks. Names that other living objects have taken stay theirs."""
        for server in self.servers:
            for path, reference in self.bound.items():
                answered = False
                with self._at(server):
                    bound = server.resolve(path)
                    answered = True
                    if is_same(bound, reference):
                        continue
                    if bound is None or not self._tell_taken(server, path, reference, "the name stays there"):
                        server.bind(path, reference)
                if not answered:
                    break

    def _tell_taken(self, server: NameServer, path: str, reference: Any, outcome: str) -> bool:
        """Whether a living object of another process has the name."""
        bound = server.resolve(path)
        if bound is None or is_same(bound, reference) or not is_there(bound):
            return False
        self._report(
            Finding(
                "name-taken",
                f"name server {server.address}",
                f"{path} is the name of another process's object, too",
                outcome,
                "give the instances different names, or set manager.components.naming_policy: ns_unique",
                subject=path,
            )
        )
        return True

    def _at(self, server: NameServer) -> _AtServer:
        return _AtServer(self, server)

    def _answered(self, server: NameServer, error: BaseException | None) -> None:
        """Note whether the server answers; only changes are told."""
        who = f"name server {server.address}"
        with self._lock:
            was_down = server.address in self._down
            (self._down.add if isinstance(error, PeerLostError) else self._down.discard)(server.address)
        if isinstance(error, PeerLostError):
            if not was_down:
                why = str(error).removeprefix(f"{who} ")
                cure = "start it (muros rtc names); names are given to it as soon as it runs"
                self._report(Finding("name-server-down", who, "names are not known there", why, cure))
        elif error is not None:
            self._report(Finding("name-refused", who, "a name was refused", str(error)))
        elif was_down:
            self._report(Finding("name-server-up", who, "it answers", severity=Severity.INFO))


class _AtServer:
    """Around what is done at one server of several: errors are noted and do not leave."""

    def __init__(self, names: Names, server: NameServer) -> None:
        self._names = names
        self._server = server

    def __enter__(self) -> None: ...

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if error is not None and not isinstance(error, RtcError):
            return False
        self._names._answered(self._server, error)
        return True


def _components(path: str) -> list[Any]:
    return [CosNaming.NameComponent(name, kind) for name, kind in split_path(path)]


def _context_at(root: Any, path: str) -> Any:
    """The naming context of a path. RtcError if it is none."""
    if not path:
        return root
    context = root.resolve(_components(path))._narrow(CosNaming.NamingContext)
    if context is None:
        raise RtcError(f"'{path}' is not a naming context")
    return context


def _inner(context: Any, entry: Any, root: Any) -> Any:
    """The context that is bound in `context` as `entry` says. RtcError if it is none."""
    inner = context.resolve(entry.binding_name)._narrow(CosNaming.NamingContext)
    if inner is None:
        raise RtcError("not a naming context")
    return inner


def entries_of(context: Any) -> list[Any]:
    """What is bound in a context, as the server tells it: `CosNaming.Binding`s. CORBA's exceptions if it does not."""
    found, more = context.list(_BATCH)
    try:
        while more is not None and len(found) < LIST_LIMIT:
            again, some = more.next_n(_BATCH)
            found += some
            if not again:
                break
    finally:
        if more is not None:
            with contextlib.suppress(CORBA.Exception):
                more.destroy()
    return [one for one in found if one.binding_name]


def _binding(entry: Any) -> Binding:
    name = entry.binding_name[-1]
    return Binding(name.id, name.kind, entry.binding_type == CosNaming.ncontext)


def is_same(one: Any | None, other: Any | None) -> bool:
    """Whether two references, either of which may be nil, lead to the same object. Nobody is called."""
    if one is None or other is None:
        return one is other
    try:
        return bool(one._is_equivalent(other))
    except CORBA.Exception:
        return False


def lives(reference: Any) -> bool:
    """Whether the object of a reference exists: asked of its process."""
    try:
        return not reference._non_existent()
    except CORBA.Exception:
        return False


def _quoted(text: str) -> str:
    return re.sub(r"([\\/.])", r"\\\1", text)
