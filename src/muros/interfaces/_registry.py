"""Where definitions are found: folders of the user first, then the standard packages of one ROS 2 distribution.

A :class:`Registry` answers for a full name with a definition whose nested types all exist, so that generators and
hashes need not check anything. The derived messages of services and actions (``AddTwoInts_Request``,
``Fibonacci_SendGoal_Response``, ...) are found under their own names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path

from muros.interfaces import _standard
from muros.interfaces._model import Action, Definition, Field, FieldType, InterfaceError, Message, Service
from muros.interfaces._names import KINDS, split_type
from muros.interfaces._parse import MAX_TEXT, parse

ENV_PATHS = "MUROS_INTERFACES"
"""The environment variable with the user's definition folders, separated as in ``PATH``."""

_DEPTH = 3  # folders below the one given that are searched for packages
_DERIVED = re.compile(
    r"(\w+?)_(Request|Response|Event|Goal|Result|Feedback|FeedbackMessage|(?:SendGoal|GetResult)\w*)\Z"
)
_ROS1_ACTION = re.compile(r"(\w+)/msg/(\w+?)(Action)?(Goal|Result|Feedback)?\Z")
_PACKAGE_NAME = re.compile(r"<name>\s*([a-z][a-z0-9_]*)\s*</name>")


class Registry:
    """Definitions by name, with the standard messages of one distribution (see :func:`_standard.chosen_distro`)."""

    def __init__(self, distro: str | None = None) -> None:
        self._wanted = distro
        self._distro = ""
        self._files: dict[str, Path] = {}
        self._user_packages: frozenset[str] = frozenset()
        self._share: dict[str, Path] | None = None
        self._found: dict[str, Definition] = {}
        self._checked: dict[str, Definition] = {}

    @property
    def distro(self) -> str:
        """The distribution whose standard messages are used."""
        if not self._distro:
            self._distro = _standard.chosen_distro(self._wanted)
        return self._distro

    def add_path(self, folder: str | os.PathLike[str]) -> tuple[str, ...]:
        """Adds a folder of definitions; returns the names of the packages found in it.

        The folder is a package (``msg/*.msg``, ``srv/*.srv``, ``action/*.action``; named by its ``package.xml`` or
        else itself) or holds packages, up to three levels below. What is found there goes before the standard
        definitions and those of folders added earlier. Raises :class:`InterfaceError` if there is nothing.
        """
        root = Path(os.path.abspath(os.path.expanduser(folder)))
        if not root.is_dir():
            raise InterfaceError(f"{os.fspath(folder)}: no such folder")
        files = _scan(root, _DEPTH)
        if not files:
            raise InterfaceError(
                f"{os.fspath(folder)}: no definitions found: expected package/msg/*.msg or msg/*.msg"
            )
        self._files.update(files)
        self._user_packages |= {name.partition("/")[0] for name in files}
        self._found.clear()
        self._checked.clear()
        return tuple(sorted({name.partition("/")[0] for name in files}))

    def packages(self) -> frozenset[str]:
        """The packages that have definitions; answers without reading any."""
        return self.user_packages() | _standard.PACKAGES

    def user_packages(self) -> frozenset[str]:
        """The packages found in folders of the user."""
        return self._user_packages

    def user_files(self) -> dict[str, Path]:
        """The definitions found in folders of the user: full name -> file."""
        return dict(self._files)

    def names(self, package: str | None = None) -> list[str]:
        """The full names of all definitions, sorted, derived messages left out."""
        every = {*self._files, *self._shared(), *_standard.stored_names(self.distro)}
        return sorted(name for name in every if package is None or name.partition("/")[0] == package)

    def known(self, name: str) -> bool:
        """Whether there is a definition of that full name (it may still be a bad one)."""
        try:
            return self._find(name) is not None
        except InterfaceError:
            return True

    def full_name(self, name: str) -> str:
        """The full name that is meant: ``package/Type`` is the first of msg, srv and action that there is."""
        if name.count("/") != 1:
            return "/".join(split_type(name))
        candidates = ["/".join(split_type(name, kind)) for kind in KINDS]
        return next((full for full in candidates if self.known(full)), candidates[0])

    def definition(self, name: str) -> Definition:
        """The definition of that full name with everything it refers to checked; :class:`InterfaceError` if bad."""
        if name not in self._checked:
            found = self._find(name)
            if found is None:
                raise InterfaceError(self._unknown(name))
            for message in found.messages():
                if not message.name.endswith(
                    "_Event"
                ):  # made here, so right; and older distributions know no events
                    self._check(message, (), set())
            self._checked[name] = found
        return self._checked[name]

    def message(self, name: str) -> Message:
        """The message of that full name; :class:`InterfaceError` if there is none or it is a service or action."""
        found = self.definition(name)
        if not isinstance(found, Message):
            raise InterfaceError(f"{name} is {_a(found)}, not a message")
        return found

    def closure(self, message: Message) -> dict[str, Message]:
        """The messages that a message holds, directly or in depth, by name in the order of their first mention."""
        found: dict[str, Message] = {}
        self._collect(message, found)
        return found

    def ros1_message(self, name: str) -> Message | None:
        """The message as ROS 1 defines it: the user's, else that of noetic, else one that comes with muros."""
        found = self._file(self._files, name) or _standard.stored_message(name, "noetic")
        found = found or self._derived(name, self.ros1_definition) or self._file(self._shared(), name)
        found = found or self._ros1_action_message(name)
        return found if isinstance(found, Message) else None

    def ros1_definition(self, name: str) -> Definition | None:
        """Like :meth:`ros1_message`, for any kind of definition."""
        if split_type(name).kind == "msg":
            return self.ros1_message(name)
        return self._file(self._files, name) or self._file(self._shared(), name)

    def _ros1_action_message(self, name: str) -> Message | None:
        """One of the seven messages that ROS 1 makes of an action, such as ``FibonacciActionGoal``."""
        match = _ROS1_ACTION.match(name)
        found = match and self.ros1_definition(f"{match[1]}/action/{match[2]}")
        if not match or not isinstance(found, Action):
            return None
        part, whole = match[4], f"{match[1]}/msg/{match[2]}"
        parts = {"Goal": found.goal, "Result": found.result, "Feedback": found.feedback}
        if not match[3]:
            return Message(name, parts[part].fields, parts[part].constants) if part else None
        if not part:
            return Message(name, tuple(_member(f"action_{p.lower()}", f"{whole}Action{p}") for p in parts))
        inner = _member(part.lower(), whole + part)
        about = _member("goal_id", "actionlib_msgs/msg/GoalID")
        about = about if part == "Goal" else _member("status", "actionlib_msgs/msg/GoalStatus")
        return Message(name, (_member("header", "std_msgs/msg/Header"), about, inner))

    # ---- finding ----

    def _find(self, name: str) -> Definition | None:
        if name not in self._found:
            kind = split_type(name).kind
            found = self._file(self._files, name)
            if found is None and kind == "msg":
                found = _standard.stored_message(name, self.distro)
            found = found or self._file(self._shared(), name) or self._derived(name, self._find)
            if found is None:
                return None
            self._found[name] = found
        return self._found[name]

    def _file(self, files: dict[str, Path], name: str) -> Definition | None:
        path = files.get(name)
        if path is None:
            return None
        if path in (cached := _cache):
            return cached[path]
        shown = _shown(path)
        try:
            with path.open(encoding="utf-8", newline=None) as file:
                text = file.read(MAX_TEXT + 1)
        except UnicodeDecodeError as error:
            raise InterfaceError(f"{shown}: not UTF-8 text (byte {error.start})") from None
        except OSError as error:
            raise InterfaceError(f"{shown}: cannot be read: {error.strerror}") from None
        found = parse(text, name, shown)
        if path.is_relative_to(_standard.SHARE):
            cached[path] = found
        return found

    def _derived(self, name: str, find: object) -> Definition | None:
        package, kind, type_name = split_type(name)
        match = _DERIVED.match(type_name) if kind != "msg" else None
        if not match or not callable(find):
            return None
        whole = find(f"{package}/{kind}/{match[1]}")
        if whole is None:
            return None
        parts: list[Definition] = list(whole.messages())
        if isinstance(whole, Action):
            parts += [whole.send_goal, whole.get_result]
        return next((part for part in parts if part.name == name), None)

    def _shared(self) -> dict[str, Path]:
        if self._share is None:
            self._share = _scan(_standard.SHARE, 1)
        return self._share

    # ---- checking ----

    def _check(self, message: Message, above: tuple[str, ...], done: set[str]) -> None:
        """Follows the nested types; ``above`` are the messages that contain this one."""
        if message.name in done or message.name in self._checked:
            return
        for field in message.fields:
            if not field.type.nested:
                continue
            if field.type.base == message.name or field.type.base in above:
                raise InterfaceError(f"{_place(message, field)}: {field.type} contains itself")
            nested = self._find(field.type.base)
            if nested is None:
                raise InterfaceError(
                    f"{_place(message, field)}: {self._unknown(field.type.base, str(field.type))}"
                )
            if not isinstance(nested, Message):
                raise InterfaceError(f"{_place(message, field)}: {field.type} is {_a(nested)}, not a message")
            self._check(nested, (*above, message.name), done)
        done.add(message.name)

    def _collect(self, message: Message, found: dict[str, Message]) -> None:
        for field in message.fields:
            if field.type.nested and field.type.base not in found:
                nested = self.message(field.type.base)
                found[nested.name] = nested
                self._collect(nested, found)

    def _unknown(self, name: str, shown: str = "") -> str:
        package, kind, type_name = split_type(name)
        text = f"unknown type '{shown.partition('[')[0] or name}'"
        of_kind = [other for other in self.names() if other.split("/")[1] == kind]
        same = [other for other in of_kind if other.startswith(f"{package}/")]
        short = get_close_matches(type_name, [other.rpartition("/")[2] for other in same], 1, 0.7)
        near = [f"{package}/{kind}/{short[0]}"] if short else []
        near = near or [other for other in of_kind if other.endswith(f"/{type_name}")][:1]
        near = near or get_close_matches(name, of_kind, 1, 0.85)
        if near:
            return f"{text} (did you mean {near[0].replace('/msg/', '/') if shown else near[0]}?)"
        if not same and package not in self.packages():
            return f"{text}: no package {package!r}; add its folder with add_path(), ${ENV_PATHS} or --path"
        return text


_cache: dict[Path, Definition] = {}  # definitions that come with muros, which never change


def _scan(folder: Path, depth: int) -> dict[str, Path]:
    """The definition files of the packages in a folder: full name -> file."""
    found: dict[str, Path] = {}
    for package, path in _packages(folder, depth):
        for kind in KINDS:
            for file in sorted((path / kind).glob(f"*.{kind}")):
                name = f"{package}/{kind}/{file.stem}"
                try:
                    split_type(name)
                except InterfaceError:
                    raise InterfaceError(
                        f"{_shown(file)}: a type is called like MyType, its package my_msgs"
                    ) from None
                found[name] = file
    return found


def _packages(folder: Path, depth: int) -> Iterator[tuple[str, Path]]:
    if any((folder / kind).is_dir() for kind in KINDS) and any(
        True for kind in KINDS for _ in (folder / kind).glob(f"*.{kind}")
    ):
        yield _package_name(folder), folder
    elif depth:
        for inner in sorted(folder.iterdir()):
            if inner.is_dir() and not inner.name.startswith("."):
                yield from _packages(inner, depth - 1)


def _package_name(folder: Path) -> str:
    try:
        match = _PACKAGE_NAME.search((folder / "package.xml").read_text("utf-8", "replace"))
    except OSError:
        match = None
    return match[1] if match else folder.name


def _shown(path: Path) -> str:
    """The path as the user would write it: relative to the working folder when it lies inside."""
    relative = os.path.relpath(path)
    return os.fspath(path) if relative.startswith("..") else relative


def _member(name: str, type_name: str) -> Field:
    return Field(name, FieldType(type_name, nested=True))


def _place(message: Message, field: Field) -> str:
    return f"{message.origin or message.name}:{field.line}" if field.line else f"{message.name}.{field.name}"


def _a(definition: Definition) -> str:
    return (
        "a service"
        if isinstance(definition, Service)
        else "an action"
        if isinstance(definition, Action)
        else "a message"
    )
