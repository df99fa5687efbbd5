"""An object adapter that knows old components: they are no servants, and programs ask for their references so."""

from __future__ import annotations

from typing import Any

__all__ = ["Adapter"]


class Adapter:
    """An ORB's adapter; or, made of None, what only knows components."""

    def __init__(self, adapter: Any) -> None:
        self._adapter = adapter

    def servant_to_reference(self, servant: Any) -> Any:
        """The reference of a servant or a component."""
        if hasattr(servant, "getObjRef"):
            return servant.getObjRef()
        return self._adapter.servant_to_reference(servant)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._adapter, name)
