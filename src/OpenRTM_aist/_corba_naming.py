"""A name server under its old name: `CorbaNaming(orb, "localhost").resolve("host.host_cxt/Foo0.rtc")`."""
# ruff: noqa: N802 (the names are those that programs know)

from __future__ import annotations

import contextlib
from typing import Any

__all__ = ["CorbaNaming"]


class CorbaNaming:
    """A name server at HOST or HOST:PORT.

    Names are texts, `ID.KIND` with `/` between several, or lists of `CosNaming.NameComponent`. What goes wrong comes
    as the server's exceptions (`CosNaming.NamingContext.NotFound` ...).
    """

    def __init__(self, orb: Any, name_server: str | None = None) -> None:
        self._orb = orb
        self._context: Any = None
        if name_server:
            self.init(name_server)

    def init(self, name_server: str) -> None:
        """Use this server."""
        import CosNaming

        location = name_server if name_server.startswith("corbaloc:") else f"corbaloc:iiop:{name_server}"
        found = self._orb.string_to_object(location if "/" in location else f"{location}/NameService")
        self._context = found._narrow(CosNaming.NamingContext)

    def isAlive(self) -> bool:
        """Whether it answers."""
        from muros.rtc.corba._naming import lives

        return self._context is not None and lives(self._context)

    def getRootContext(self) -> Any:
        return self._context

    # Objects

    def resolve(self, name: Any) -> Any:
        """The object of a name."""
        return self._context.resolve(self._name(name))

    resolveStr = resolve  # noqa: N815

    def bind(self, name: Any, obj: Any, force: bool = True) -> None:
        """Give an object a name, another object's too; with `force` the contexts on the way are made."""
        self.rebind(name, obj, force)

    bindByString = bind  # noqa: N815

    def rebind(self, name: Any, obj: Any, force: bool = True) -> None:
        """The same."""
        self._context.rebind(self._with_contexts(name, force), obj)

    rebindByString = rebind  # noqa: N815

    def unbind(self, name: Any) -> None:
        """Take a name away."""
        self._context.unbind(self._name(name))

    # Contexts

    def newContext(self) -> Any:
        """A context without a name."""
        return self._context.new_context()

    def bindContext(self, name: Any, name_cxt: Any, force: bool = True) -> None:
        """Give a context a name; with `force` the contexts on the way are made."""
        self._context.rebind_context(self._with_contexts(name, force), name_cxt)

    rebindContext = bindContext  # noqa: N815

    def bindNewContext(self, name: Any, force: bool = True) -> Any:
        """A new context of this name."""
        return self._context.bind_new_context(self._with_contexts(name, force))

    def destroy(self, context: Any) -> None:
        """End a context, which must be empty."""
        context.destroy()

    def listByKind(self, string_name: str, string_kind: str) -> list[Any]:
        """What is bound in a context with names of this kind, as `CosNaming.Binding`s; nothing where it is none."""
        import CosNaming

        from muros.rtc.corba._naming import entries_of

        with contextlib.suppress(CosNaming.NamingContext.NotFound):
            context = self.resolve(string_name)._narrow(CosNaming.NamingContext)
            found = () if context is None else entries_of(context)
            return [one for one in found if one.binding_name[-1].kind == string_kind]
        return []

    # Names

    def toName(self, string_name: str) -> list[Any]:
        """A text's name components."""
        import CosNaming

        from muros.rtc.corba import split_path

        return [CosNaming.NameComponent(id_, kind) for id_, kind in split_path(string_name)]

    def toString(self, name_list: list[Any]) -> str:
        """The text of name components."""
        return "/".join(f"{one.id}.{one.kind}" if one.kind else one.id for one in name_list)

    def _name(self, name: Any) -> list[Any]:
        return self.toName(name) if isinstance(name, str) else name

    def _with_contexts(self, name: Any, force: bool) -> list[Any]:
        import CosNaming

        parts = self._name(name)
        for depth in range(1, len(parts) if force else 0):
            with contextlib.suppress(CosNaming.NamingContext.AlreadyBound):
                self._context.bind_new_context(parts[:depth])
        return parts
