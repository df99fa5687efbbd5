"""Properties, as old components use them: texts by dotted names, with defaults."""
# ruff: noqa: N802, N803 (the names are those that components know)

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TextIO

from muros.rtc.properties import Properties as Texts
from muros.rtc.properties import read_conf_untrusted, write_conf

__all__ = ["Properties"]


class Properties:
    """Texts by dotted names.

    Made of another one (`prop`), of one text (`key`, `value`), or of defaults: a mapping, or a flat list of names and
    texts that ends with an empty text (`defaults_str`).
    """

    def __init__(
        self,
        prop: Properties | None = None,
        key: str | None = None,
        value: str | None = None,
        defaults_map: Mapping[str, str] | None = None,
        defaults_str: Iterable[str] | None = None,
        num: int | None = None,
    ) -> None:
        self._name = key or ""
        self._texts = Texts()
        self._defaults = Texts()
        if prop is not None:
            self._texts.update(prop._texts)
            self._defaults.update(prop._defaults)
            self._name = prop._name
        elif key is not None:
            self._texts[""] = value or ""
        elif defaults_map is not None:
            self._defaults.update(defaults_map)
        elif defaults_str is not None:
            self.setDefaults(defaults_str, num)

    @classmethod
    def of(cls, texts: Mapping[str, str]) -> Properties:
        """With these texts."""
        made = cls()
        made._texts.update(texts)
        return made

    def as_dict(self) -> dict[str, str]:
        """All texts, defaults among them."""
        return {**self._defaults, **self._texts}

    # One text

    def getProperty(self, key: str, default: str | None = None) -> str:
        """The text; its default; `default`; or an empty text."""
        text = self._texts.get(key)
        if text is None:
            text = self._defaults.get(key)
        return text if text is not None else (default or "")

    def getDefault(self, key: str) -> str:
        return self._defaults.get(key, "")

    def setProperty(self, key: str, value: Any = None) -> str:
        """Set a text; the one it had."""
        before = self.getProperty(key)
        self._texts[key] = "" if value is None else str(value)
        return before

    def setDefault(self, key: str, value: str) -> str:
        self._defaults[key] = value
        return value

    def setDefaults(self, defaults: Iterable[str], num: int | None = None) -> None:
        """Of a flat list: names and texts in turn, up to `num` of both or to an empty name."""
        flat = list(defaults) if num is None else list(defaults)[:num]
        for key, value in zip(flat[::2], flat[1::2], strict=False):
            if not key:
                break
            self._defaults[key.strip()] = value.strip()

    def getName(self) -> str:
        return self._name

    def getValue(self) -> str:
        return self.getProperty("")

    def getDefaultValue(self) -> str:
        return self.getDefault("")

    # Parts

    def getNode(self, key: str) -> Properties:
        """The part below `key.`, alive."""
        node = Properties()
        node._texts, node._defaults = self._texts.node(key), self._defaults.node(key)
        node._name = key.rpartition(".")[2]
        return node

    def findNode(self, key: str) -> Properties | None:
        """The part below `key.`; None where there is none."""
        node = self.getNode(key)
        return node if node.as_dict() else None

    def createNode(self, key: str) -> bool:
        """Begin a part. False where there is one."""
        if not key or self.findNode(key) is not None:
            return False
        self._texts[key] = ""
        return True

    def removeNode(self, leaf_name: str) -> Properties | None:
        """Take a part away; it."""
        node = self.findNode(leaf_name)
        if node is None:
            return None
        gone = Properties(node)
        node.clear()
        return gone

    def hasKey(self, key: str) -> Properties | None:
        return self.findNode(key)

    def getLeaf(self) -> list[Properties]:
        names = dict.fromkeys(name.partition(".")[0] for name in self.as_dict() if name)
        return [self.getNode(name) for name in names]

    def propertyNames(self) -> list[str]:
        return [name for name in self.as_dict() if name]

    def size(self) -> int:
        return len(self.propertyNames())

    def clear(self) -> None:
        for texts in (self._texts, self._defaults):
            for key in list(texts):
                del texts[key]

    def mergeProperties(self, prop: Properties) -> Properties:
        """Take the texts of `prop` over; itself."""
        self._texts.update(prop.as_dict())
        return self

    def __lshift__(self, prop: Properties) -> Properties:
        return self.mergeProperties(prop)

    # Files

    def load(self, inStream: TextIO | Iterable[str]) -> None:
        """Read what an open file, or a list of lines, holds. ConfError where it is no such file."""
        text = "\n".join(line.rstrip("\n") for line in inStream)
        self._texts.update(read_conf_untrusted(text.encode(), getattr(inStream, "name", "properties")))

    def save(self, out: TextIO, header: str = "") -> None:
        self.store(out, header)

    def store(self, out: TextIO, header: str = "") -> None:
        """Write all texts, behind `header` as a remark."""
        if header:
            out.write(f"#{header}\n")
        out.write(write_conf(self.as_dict()))

    def list(self, out: TextIO) -> None:
        out.write(str(self))

    def __str__(self) -> str:
        return "".join(f"{name}: {text}\n" for name, text in self.as_dict().items())
