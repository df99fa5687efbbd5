"""Functions of old programs that look for components and connect them: names, sequences, properties of requests."""
# ruff: noqa: N801, N802 (the names are those that programs know)

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from OpenRTM_aist._properties import Properties

__all__ = ["CORBA_RTCUtil", "CORBA_SeqUtil", "CorbaNaming", "NVUtil"]


class CorbaNaming:
    """A name server: `resolve("host.host_cxt/Foo0.rtc")`."""

    def __init__(self, orb: Any, name_server: str = "") -> None:
        self._orb = orb
        self._context: Any = None
        if name_server:
            self.init(name_server)

    def init(self, name_server: str) -> None:
        """Use the server at HOST or HOST:PORT."""
        import CosNaming

        found = self._orb.string_to_object(f"corbaloc:iiop:{name_server}/NameService")
        self._context = found._narrow(CosNaming.NamingContext)

    def resolve(self, name: str) -> Any:
        """The object of a name (`id.kind/id.kind`, or a list of name components). The server's exceptions."""
        return self._context.resolve(self.toName(name) if isinstance(name, str) else name)

    resolveStr = resolve  # noqa: N815

    def rebindByString(self, string_name: str, obj: Any, force: bool = True) -> None:
        self._context.rebind(self.toName(string_name), obj)

    def unbind(self, name: str) -> None:
        self._context.unbind(self.toName(name) if isinstance(name, str) else name)

    def toName(self, string_name: str) -> list[Any]:
        import CosNaming

        parts = [part.rpartition(".") for part in string_name.split("/") if part]
        return [
            CosNaming.NameComponent(id_ or kind if dot else kind, kind if dot else "")
            for id_, dot, kind in parts
        ]

    def getRootContext(self) -> Any:
        return self._context


class CORBA_SeqUtil:
    """Sequences are lists."""

    @staticmethod
    def push_back(seq: list[Any], elem: Any) -> None:
        seq.append(elem)

    @staticmethod
    def push_back_list(seq1: list[Any], seq2: Iterable[Any]) -> None:
        seq1.extend(seq2)

    @staticmethod
    def for_each(seq: Iterable[Any], f: Callable[[Any], Any]) -> Callable[[Any], Any]:
        for elem in seq:
            f(elem)
        return f

    @staticmethod
    def find(seq: Sequence[Any], f: Callable[[Any], Any]) -> int:
        """The place of the first for which `f` is true, -1 if there is none."""
        return next((place for place, elem in enumerate(seq) if f(elem)), -1)

    @staticmethod
    def erase(seq: list[Any], index: int) -> None:
        if 0 <= index < len(seq):
            del seq[index]

    @staticmethod
    def clear(seq: list[Any]) -> None:
        del seq[:]


class NVUtil:
    """Lists of names and values."""

    @staticmethod
    def newNV(name: str, value: Any) -> Any:
        from omniORB import any as any_

        import SDOPackage

        return SDOPackage.NameValue(name, any_.to_any(str(value) if isinstance(value, str) else value))

    @staticmethod
    def copyFromProperties(nv: list[Any], prop: Properties) -> None:
        nv[:] = [NVUtil.newNV(name, text) for name, text in prop.as_dict().items()]

    @staticmethod
    def copyToProperties(prop: Properties, nvlist: Iterable[Any]) -> None:
        for one in nvlist:
            prop.setProperty(one.name, NVUtil._text(one.value))

    @staticmethod
    def find(nv: Iterable[Any], name: str) -> Any:
        """The value of a name. KeyError where there is none."""
        for one in nv:
            if one.name == name:
                return one.value
        raise KeyError(name)

    @staticmethod
    def find_index(nv: Sequence[Any], name: str) -> int:
        return next((place for place, one in enumerate(nv) if one.name == name), -1)

    @staticmethod
    def isString(nv: Iterable[Any], name: str) -> bool:
        return any(one.name == name and isinstance(NVUtil._value(one.value), str) for one in nv)

    @staticmethod
    def toString(nv: Iterable[Any], name: str | None = None) -> str:
        if name is None:
            return "".join(f"{one.name}: {NVUtil._text(one.value)}\n" for one in nv)
        return next((NVUtil._text(one.value) for one in nv if one.name == name), "")

    @staticmethod
    def appendStringValue(nv: list[Any], name: str, value: str) -> bool:
        """Add a value to the list with commas that the name has."""
        place = NVUtil.find_index(nv, name)
        if place < 0:
            nv.append(NVUtil.newNV(name, value))
        else:
            parts = [part.strip() for part in NVUtil._text(nv[place].value).split(",")]
            if value not in parts:
                nv[place] = NVUtil.newNV(name, ",".join([*parts, value]))
        return True

    @staticmethod
    def _value(value: Any) -> Any:
        from omniORB import any as any_

        return any_.from_any(value, keep_structs=True)

    @staticmethod
    def _text(value: Any) -> str:
        found = NVUtil._value(value)
        return found if isinstance(found, str) else str(found)


class CORBA_RTCUtil:
    """What programs do with references to components."""

    @staticmethod
    def is_existing(rtc: Any) -> bool:
        """Whether its process answers."""
        from omniORB import CORBA

        try:
            return not rtc._non_existent()
        except CORBA.SystemException:
            return False

    @staticmethod
    def get_actual_ec(rtc: Any, ec_id: int = 0) -> Any:
        """The context of a handle; None where there is none."""
        contexts = rtc.get_owned_contexts() if ec_id < 1000 else rtc.get_participating_contexts()
        place = ec_id % 1000
        return contexts[place] if place < len(contexts) else None

    @staticmethod
    def activate(rtc: Any, ec_id: int = 0) -> Any:
        return CORBA_RTCUtil.get_actual_ec(rtc, ec_id).activate_component(rtc)

    @staticmethod
    def deactivate(rtc: Any, ec_id: int = 0) -> Any:
        return CORBA_RTCUtil.get_actual_ec(rtc, ec_id).deactivate_component(rtc)

    @staticmethod
    def reset(rtc: Any, ec_id: int = 0) -> Any:
        return CORBA_RTCUtil.get_actual_ec(rtc, ec_id).reset_component(rtc)

    @staticmethod
    def get_state(rtc: Any, ec_id: int = 0) -> Any:
        return CORBA_RTCUtil.get_actual_ec(rtc, ec_id).get_component_state(rtc)

    @staticmethod
    def get_default_rate(rtc: Any) -> float:
        return float(CORBA_RTCUtil.get_actual_ec(rtc).get_rate())

    @staticmethod
    def set_default_rate(rtc: Any, rate: float) -> Any:
        return CORBA_RTCUtil.get_actual_ec(rtc).set_rate(rate)

    @staticmethod
    def get_port_names(rtc: Any) -> list[str]:
        return [port.get_port_profile().name for port in rtc.get_ports()]

    @staticmethod
    def get_port_by_name(rtc: Any, name: str) -> Any:
        """The port of that name, with or without the component's before it; None where there is none."""
        for port in rtc.get_ports():
            full = port.get_port_profile().name
            if name in (full, full.rpartition(".")[2]):
                return port
        return None

    @staticmethod
    def create_connector(name: str, prop_arg: Properties | None, port0: Any, port1: Any) -> Any:
        """The profile of a request that joins two ports."""
        import RTC

        prop = Properties(prop_arg) if prop_arg is not None else Properties()
        for key, text in (
            ("dataport.dataflow_type", "push"),
            ("dataport.interface_type", "corba_cdr"),
            ("dataport.subscription_type", "flush"),
        ):
            if not prop.getProperty(key):
                prop.setProperty(key, text)
        request = RTC.ConnectorProfile(name, "", [port0, port1], [])
        NVUtil.copyFromProperties(request.properties, prop)
        return request

    @staticmethod
    def connect(name: str, prop: Properties | None, port0: Any, port1: Any) -> Any:
        """Join two ports; the return code."""
        return port0.connect(CORBA_RTCUtil.create_connector(name, prop, port0, port1))[0]

    @staticmethod
    def disconnect(port: Any, connector_id: str) -> Any:
        return port.disconnect(connector_id)
