"""Configuration sets: what the recorded component did, step by step, and what parameters take."""

import json
import threading
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.configuration import (
    ActivationError,
    ConfigEvent,
    Configuration,
    ConfigurationError,
    ConfigurationSet,
    EmptyIdError,
    FullError,
    NotAvailableError,
    UnknownSetError,
    converter_of,
)

STEPS = json.loads((Path(__file__).parents[1] / "vectors/rtc/configuration_behaviour.json").read_text())

SPEC = {
    "default": {"a": "7", "b": "3.5", "c": "spec", "d": "1.0,2.0", "e": "1"},
    "m1": {"a": "8"},
    "__widget__": {"a": "slider.1"},
}
BOUND = {"a": 5, "b": 1.5, "c": "bound", "d": [0.0], "e": True}
CANNOT_ACTIVATE = "Configuration.activate_configuration_set()"
NOT_AVAILABLE = "NotAvailable: Configuration.get_active_configuration_set()"
ERRORS = {
    f"NotAvailable: SDOPackage.NotAvailable(description='{NOT_AVAILABLE}')": NotAvailableError,
    "InvalidParameter: SDOPackage.InvalidParameter(description='ID is empty.')": EmptyIdError,
    f"InternalError: SDOPackage.InternalError(description='{CANNOT_ACTIVATE}')": ActivationError,
    "InternalError: SDOPackage.InternalError(description='No such ConfigurationSet')": UnknownSetError,
}


class Recorded:
    """The component of the recording: five parameters, and listeners that write down what they hear."""

    def __init__(self) -> None:
        self.configuration = Configuration(SPEC)
        for name, default in BOUND.items():
            text = ",".join(map(str, default)) if isinstance(default, list) else str(default)
            self.configuration.bind(name, text, converter_of(default))
        self.configuration.update()
        self.heard: list[list[str]] = []
        for event in ConfigEvent:
            self.configuration.listeners.add(event, self._ear(event))
        self.active = False

    def _ear(self, event: ConfigEvent) -> Any:
        def hear(*arguments: Any) -> None:
            self.heard.append([event.value, *(getattr(one, "id", one) for one in arguments)])

        return hear

    def values(self) -> dict[str, Any]:
        return {parameter.name: parameter.value for parameter in self.configuration.parameters}

    def cycle(self) -> None:
        """What the context does a while later: an active component takes new values over."""
        if self.active:
            self.configuration.update()

    def take_heard(self) -> list[list[str]]:
        heard, self.heard = self.heard, []
        return heard


def set_one(name: str, text: str, *, in_set: str = "default") -> Any:
    return lambda c: c.set_values(ConfigurationSet(in_set, "", {name: text}))


def activate(id_: str) -> Any:
    def act(c: Configuration) -> bool:
        c.activate(id_)
        return True

    return act


DOING: dict[str, list[Any]] = {
    "after creation": [],
    "set_configuration_set_values default a=9 (inactive)": [set_one("a", "9")],
    "get_active_configuration_set right after set": [lambda c: c.active()],
    "activate_configuration_set default (inactive)": [activate("default")],
    "activate component": [],
    "set a=10 while active": [set_one("a", "10")],
    "activate default while active": [activate("default")],
    "set a=abc + activate": [set_one("a", "abc"), activate("default")],
    "activate m1": [activate("m1")],
    "activate nosuch": [activate("nosuch")],
    "activate __widget__": [activate("__widget__")],
    "activate empty": [activate("")],
    "add m2 a=20": [lambda c: c.add(ConfigurationSet("m2", "", {"a": "20"}))],
    "add m2 again": [lambda c: c.add(ConfigurationSet("m2", "", {"a": "20"}))],
    "activate m2": [activate("m2")],
    "remove active m2": [lambda c: c.remove("m2")],
    "activate default, remove m2": [activate("default"), lambda c: c.remove("m2")],
    "remove m1 (from spec)": [lambda c: c.remove("m1")],
    "remove default": [lambda c: c.remove("default")],
    "set values of unknown set": [set_one("a", "1", in_set="nosuch")],
    "set unknown parameter": [set_one("zzz", "1")],
    "get_configuration_set nosuch": [lambda c: c.get("nosuch")],
    "vector: d=1,2": [set_one("d", " 1 , 2 "), activate("default")],
    "bool e=0": [set_one("e", "0"), activate("default")],
}


def outcome(configuration: Configuration, step: str) -> set[str]:
    """The texts by which the recording may say what the step's actions returned or raised."""
    try:
        returned = [act(configuration) for act in DOING[step]]
    except ConfigurationError as error:
        return {text for text, kinds in ERRORS.items() if isinstance(error, kinds)}
    return {str(returned[0])} if len(returned) == 1 else {str(tuple(returned))}


def test_the_recorded_component_did_the_same() -> None:
    recorded = Recorded()
    assert [step["step"] for step in STEPS] == list(DOING)
    for step in STEPS:
        assert step["returned"] in {None, "RTC_OK", *outcome(recorded.configuration, step["step"])}, step[
            "step"
        ]
        if step["step"] == "activate component":
            recorded.active = True
            recorded.cycle()
        assert recorded.values() == step["values"], step["step"]
        assert recorded.take_heard() == step["listeners"], step["step"]
        recorded.cycle()
        assert recorded.values() == step["values_0.2s_later"], step["step"]
        assert recorded.take_heard() == step["listeners_later"], step["step"]


def test_a_text_that_cannot_be_converted_is_told_and_the_default_counts() -> None:
    told = []
    configuration = Configuration(
        on_bad_text=lambda parameter, error: told.append((parameter.name, str(error)))
    )
    gain = configuration.bind("gain", "1.5", float)
    configuration.set_values(ConfigurationSet("default", "", {"gain": "much"}))
    configuration.activate("default")
    configuration.update()
    assert gain.value == 1.5
    assert told == [("gain", "could not convert string to float: 'much'")]


def test_no_lock_is_held_while_texts_are_converted_and_assigned() -> None:
    configuration = Configuration()
    seen: list[object] = []

    def ask() -> None:
        seen.append(configuration.get("default").values["gain"])
        seen.append(configuration.update())  # somebody does already
        configuration.set_values(ConfigurationSet("default", "", {"gain": "3"}))
        configuration.activate("default")

    def elsewhere(value: int) -> int:
        if value == 2:
            other = threading.Thread(target=ask, daemon=True)
            other.start()
            other.join(10)
            assert not other.is_alive()
        return value

    gain = configuration.bind("gain", "1", lambda text: elsewhere(int(text)))
    offset = configuration.bind("offset", "1", int, lambda value: elsewhere(value))
    values = {"gain": "2", "offset": "2"}
    configuration.set_values(ConfigurationSet("default", "", values))
    configuration.activate("default")
    assert configuration.update()
    assert seen == ["2", False, "3", False]
    assert (gain.value, offset.value) == (2, 2), "what changed meanwhile is for the next update"
    assert configuration.update()
    assert (gain.value, offset.value) == (3, 2)
    assert not configuration.update()


def test_an_assignment_that_raises_ends_one_update_only() -> None:
    def refuse(value: int) -> None:
        if value == 2:
            raise RuntimeError("no")

    configuration = Configuration()
    gain = configuration.bind("gain", "1", int, refuse)
    for text in ("2", "3"):
        configuration.set_values(ConfigurationSet("default", "", {"gain": text}))
        configuration.activate("default")
        if text == "2":
            with pytest.raises(RuntimeError):
                configuration.update()
    assert configuration.update()
    assert gain.value == 3


def test_a_listener_that_raises_harms_nobody() -> None:
    failed = []
    configuration = Configuration(
        {"fast": {}}, on_error=lambda event, error: failed.append((event, str(error)))
    )

    def raises(id_: str) -> None:
        raise RuntimeError("no")

    heard: list[str] = []
    configuration.listeners.add(ConfigEvent.ACTIVATE_CONFIG_SET, raises)
    configuration.listeners.add(ConfigEvent.ACTIVATE_CONFIG_SET, heard.append)
    configuration.activate("fast")
    assert heard == ["fast"]
    assert failed == [(ConfigEvent.ACTIVATE_CONFIG_SET, "no")]


@pytest.mark.parametrize(
    ("like", "text", "value"),
    [
        (1, " 12 ", 12),
        (0.5, "2.5e-3", 0.0025),
        ("x", " kept as it is ", " kept as it is "),
        (True, "NO", False),
        (False, "1", True),
        ([1], "1, 2,3", [1, 2, 3]),
        ((0.5,), "", ()),
        ([], "a,b", ["a", "b"]),
    ],
)
def test_texts_become_values_of_the_defaults_type(like: object, text: str, value: object) -> None:
    converted = converter_of(like)(text)
    assert converted == value
    assert type(converted) is type(value)


def test_a_stranger_cannot_fill_the_memory() -> None:
    configuration = Configuration({"default": {"gain": "1"}}, size_limit=2000)
    for number in range(8):
        assert configuration.add(ConfigurationSet(f"s{number}", "", {"x": ""}))
    with pytest.raises(FullError, match="'s8': all sets together would have more than 2000 characters"):
        configuration.add(ConfigurationSet("s8", "", {"x": ""}))
    with pytest.raises(FullError):
        configuration.set_values(ConfigurationSet("default", "", {"gain": "1" * 2000}))
    with pytest.raises(FullError):
        configuration.set_values(ConfigurationSet("default", "", {str(n): "" for n in range(20)}))
    assert configuration.get("default").values == {"gain": "1"}
    assert configuration.remove("s0")
    assert configuration.set_values(ConfigurationSet("default", "", {"gain": "2"}))


def test_what_cannot_be_bound_is_refused() -> None:
    configuration = Configuration()
    configuration.bind("gain", "1", int)
    with pytest.raises(ConfigurationError, match="'gain' is bound already"):
        configuration.bind("gain", "1", int)
    with pytest.raises(ConfigurationError, match="its default 'x' cannot be converted"):
        configuration.bind("rate", "x", int)
    with pytest.raises(ConfigurationError, match="type dict: give one"):
        converter_of({})
