"""What a manager does with components, without an ORB."""

import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest

from muros.findings import Finding
from muros.rtc.codes import LifeCycleState, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.manager import CreateError, LimitError, Manager, ManagerEvent, ModuleError
from muros.rtc.properties import ConfError
from tests.rtc.manager._processes import wait_until
from tests.rtc.manager._worlds import FakeManager, MemoryWorld, Names, manager_in


class Foo(Component):
    """Does nothing."""

    category = "test"
    vendor = "me"
    specification: ClassVar[dict[str, str]] = {"conf.default.gain": "1", "exec_cxt.periodic.rate": "100"}


class Limited(Foo):
    max_instance = 2


class Failing(Component):
    def on_initialize(self) -> ReturnCode:
        return ReturnCode.RTC_ERROR


class Raising(Component):
    def __init__(self) -> None:
        raise ValueError("no wheel")


ACTIVE = LifeCycleState.ACTIVE_STATE
Make = Callable[..., Manager]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    """Makes managers that know the components above; all end with the test."""
    made: list[Manager] = []

    def make_one(world: MemoryWorld | None = None, **texts: str) -> Manager:
        manager = manager_in(tmp_path, world, **texts)
        made.append(manager)
        for kind in (Foo, Limited, Failing, Raising):
            manager.register(kind)
        return manager

    modules, path = set(sys.modules), list(sys.path)
    yield make_one
    for manager in made:
        manager.close()
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if name.startswith("Module"):
            del sys.modules[name]


def findings(manager: Manager) -> list[Finding]:
    return list(manager.reporter.findings.snapshot())


def test_a_component_is_made_named_and_ended(make: Make) -> None:
    world = MemoryWorld()
    manager = make(world)
    events: list[tuple[str, object]] = []
    for event in (ManagerEvent.COMPONENT_CREATED, ManagerEvent.COMPONENT_ENDED):
        manager.listeners.add(event, lambda component, event=event: events.append((event.value, component)))
    manager.start()
    foo = manager.create_component("Foo")
    assert list(manager.components) == [foo]
    assert foo.instance_name == "Foo0"
    assert world.server.bound == {"robot.host_cxt/Foo0.rtc": ("reference", foo)}
    assert world.offered == {"test.Foo0": foo}
    assert foo.properties["naming.names"] == "robot.host_cxt/Foo0.rtc"
    assert foo.properties["os.hostname"] == "robot"
    assert foo.properties["exec_cxt.sync_transition"] == "YES"
    assert foo.properties["exec_cxt.periodic.rate"] == "100"  # the class knows better than the default
    assert foo.properties["corba.endpoints"] == "127.0.0.1:1"
    assert foo.properties["manager.instance_name"] == "manager"
    assert foo.state() is LifeCycleState.INACTIVE_STATE
    assert manager.delete_component("Foo0") is ReturnCode.RTC_OK
    assert list(manager.components) == []
    assert world.server.bound == {}
    assert world.offered == {}
    assert events == [("COMPONENT_CREATED", foo), ("COMPONENT_ENDED", foo)]
    assert manager.delete_component("Foo0") is ReturnCode.BAD_PARAMETER


def test_names_are_numbered_and_numbers_come_back(make: Make) -> None:
    manager = make(manager__shutdown_on_nortcs="NO")
    manager.start()
    names = [manager.create_component("Foo").instance_name for _ in range(3)]
    assert names == ["Foo0", "Foo1", "Foo2"]
    manager.delete_component("Foo1")
    assert manager.create_component("Foo").instance_name == "Foo1"


def test_a_name_asked_for(make: Make) -> None:
    manager = make()
    manager.start()
    left = manager.create_component("Foo?instance_name=Left&conf.default.gain=2&conf.fast.gain=9")
    assert left.instance_name == "Left"
    assert left.properties["conf.default.gain"] == "2"
    assert left.properties["conf.fast.gain"] == "9"
    assert manager.create_component("Foo?instance_name=Left") is left
    assert manager.components_by_name("Left") == (left,)
    assert manager.components_by_name("test/Left") == (left,)
    assert manager.components_by_name("*/Left") == (left,)
    assert manager.components_by_name("other/Left") == ()


def test_a_living_name_of_another_process_is_not_taken(make: Make) -> None:
    server = Names()
    one, other = make(MemoryWorld(server)), make(MemoryWorld(server))
    for manager in (one, other):
        manager.start()
    first, second = one.create_component("Foo"), other.create_component("Foo")
    assert (first.instance_name, second.instance_name) == ("Foo0", "Foo1")
    assert server.bound["robot.host_cxt/Foo0.rtc"] == ("reference", first)


def test_the_number_cannot_help_where_the_name_has_none(make: Make) -> None:
    world = MemoryWorld()
    world.server.bound["fixed.rtc"] = "somebody"
    manager = make(world, naming__formats="fixed.rtc")
    manager.start()
    assert manager.create_component("Foo").instance_name == "Foo0"
    assert world.server.bound["fixed.rtc"] == "somebody"


def test_several_formats_and_those_of_a_request(make: Make) -> None:
    world = MemoryWorld()
    manager = make(world, naming__formats="%n.rtc, %c.cate_cxt/%V.v_cxt/%n.rtc")
    manager.start()
    manager.create_component("Foo")
    assert set(world.server.bound) == {"Foo0.rtc", "test.cate_cxt/me.v_cxt/Foo0.rtc"}
    manager.create_component("Foo?instance_name=a/b&naming.formats=%n.rtc")
    assert "a\\/b.rtc" in world.server.bound


def test_no_names_where_naming_is_off(make: Make) -> None:
    world = MemoryWorld()
    manager = make(world, naming__enable="NO")
    manager.start()
    manager.create_component("Foo")
    assert world.server.bound == {}


def test_policies_look_further(make: Make) -> None:
    world = MemoryWorld(managers={"localhost:2810": FakeManager()})
    world.managers["localhost:2810"].names = {"Foo0", "Foo1"}
    node = make(world, manager__components__naming_policy="node_unique")
    node.start()
    assert node.create_component("Foo").instance_name == "Foo2"
    world = MemoryWorld()
    world.server.bound["elsewhere.host_cxt/Foo0.rtc"] = "somebody"
    far = make(world, manager__components__naming_policy="ns_unique")
    far.start()
    assert far.create_component("Foo").instance_name == "Foo1"
    with pytest.raises(
        ConfError, match="naming_policy: there is no 'mine'; there are process_unique, node_unique"
    ):
        make(manager__components__naming_policy="mine")


def test_max_instance_is_kept(make: Make) -> None:
    manager = make()
    manager.start()
    manager.create_component("Limited")
    manager.create_component("Limited")
    with pytest.raises(
        LimitError, match="there are 2 instances of Limited already, as many as its max_instance"
    ):
        manager.create_component("Limited")
    manager.delete_component("Limited0")
    assert manager.create_component("Limited").instance_name == "Limited0"


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (
            "Nothing",
            "no component Nothing is known; loaded: PeriodicECSharedComposite, Foo, Limited, Failing",
        ),
        ("RTC:you:test:Foo:Python:1.0.0", "no component RTC:you:test:Foo:Python:1.0.0 is known"),
        ("Failing", "Failing0: on_initialize answered RTC_ERROR; its log says why"),
        ("Raising", "Raising0: making it raised ValueError: no wheel"),
    ],
)
def test_components_that_cannot_be_made_leave_nothing(make: Make, request_: str, message: str) -> None:
    world = MemoryWorld()
    manager = make(world)
    manager.start()
    with pytest.raises(CreateError, match=message):
        manager.create_component(request_)
    assert manager.components == ()
    assert world.server.bound == {}
    with pytest.raises(CreateError, match=message):
        manager.create_component(request_)


def test_a_component_that_cannot_be_offered_is_ended(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(component: Component, key: str) -> object:
        made.append(component)
        raise RtcError("no room")

    made: list[Component] = []
    world = MemoryWorld()
    manager = make(world)
    manager.start()
    with monkeypatch.context() as patched:
        patched.setattr(world, "offer_component", refuse)
        with pytest.raises(RtcError, match="no room"):
            manager.create_component("Foo")
    assert not made[0].is_initialized
    assert manager.create_component("Foo").instance_name == "Foo0"


def test_the_full_id_fits(make: Make) -> None:
    manager = make()
    manager.start()
    assert manager.create_component("RTC:me:test:Foo:Python:1.0.0").instance_name == "Foo0"
    assert manager.create_component("RTC:::Foo::").instance_name == "Foo1"


def test_who_says_what_a_property_is(make: Make, tmp_path: Path) -> None:
    """Instance over type over specification; in each, rtc.conf over the file that it names; the request over all."""
    (tmp_path / "type.conf").write_text(
        "conf.default.a: type file\nconf.default.b: type file\nconf.default.c: x\n"
    )
    (tmp_path / "instance.conf").write_text("conf.default.b: instance file\nconf.default.d: instance file\n")
    (tmp_path / "asked.conf").write_text("conf.default.f: asked file\nconf.default.g: asked file\n")
    manager = make(
        test__Foo__config_file=str(tmp_path / "type.conf"),
        test__Foo__conf__default__c="type",
        test__Foo__conf__default__e="type",
        test__Foo0__config_file=str(tmp_path / "instance.conf"),
        test__Foo0__conf__default__d="instance",
        test__Foo0__conf__default__e="instance",
    )
    manager.start()
    foo = manager.create_component(f"Foo?config_file={tmp_path}/asked.conf&conf.default.g=asked")
    sets = {
        key.removeprefix("conf.default."): text for key, text in foo.properties.items() if "default" in key
    }
    assert sets == {
        "gain": "1",
        "a": "type file",
        "b": "instance file",
        "c": "type",
        "d": "instance",
        "e": "instance",
        "f": "asked file",
        "g": "asked",
    }
    assert len(foo.properties["config_file"].split(",")) == 3


def test_a_file_that_is_not_there(make: Make) -> None:
    manager = make(test__Foo__config_file="none.conf")
    manager.start()
    with pytest.raises(ConfError, match=r"none.conf: cannot be read"):
        manager.create_component("Foo")
    assert manager.components == ()
    with pytest.raises(ConfError, match=r"none.conf: cannot be read"):
        manager.create_component("Foo")


MODULE = """
from muros.rtc.component import Component
class ModuleFoo(Component):
    category = "loaded"
def create(manager):
    return ModuleFoo()
def ModuleOneInit(manager):
    manager.register(ModuleFoo.spec(), create)
    manager.create_component("ModuleFoo")
"""


def test_modules_bring_components(make: Make, tmp_path: Path) -> None:
    (tmp_path / "ModuleOne.py").write_text(MODULE)
    manager = make()
    manager.start()
    assert manager.create_component("ModuleFoo").instance_name == "ModuleFoo1"  # the module itself makes one
    assert [module.path.name for module in manager.modules.loaded] == ["ModuleOne.py"]
    manager.load_module("ModuleOne")
    assert len(manager.components) == 2
    manager.unload_module("ModuleOne")
    with pytest.raises(ModuleError):
        manager.unload_module("ModuleOne")
    assert manager.modules.loaded == ()
    assert "ModuleFoo" not in [factory.name for factory in manager.factories.all]


def test_search_may_be_off(make: Make, tmp_path: Path) -> None:
    (tmp_path / "ModuleOne.py").write_text(MODULE)
    manager = make(manager__modules__search_auto="NO")
    manager.start()
    with pytest.raises(CreateError, match="no component ModuleFoo is known"):
        manager.create_component("ModuleFoo")


def test_an_init_function_that_raises(make: Make, tmp_path: Path) -> None:
    (tmp_path / "ModuleBad.py").write_text("def ModuleBadInit(manager):\n    1 / 0\n")
    manager = make()
    manager.start()
    for _ in range(2):
        with pytest.raises(ModuleError, match="its init function failed: ZeroDivisionError"):
            manager.load_module("ModuleBad")
    assert manager.modules.loaded == ()


def test_what_the_settings_list_is_done(make: Make, tmp_path: Path) -> None:
    (tmp_path / "ModuleOne.py").write_text(MODULE.replace('    manager.create_component("ModuleFoo")\n', ""))
    manager = make(
        manager__modules__preload="ModuleOne.py, Missing.py",
        manager__components__precreate="ModuleFoo, Foo?instance_name=Left, Nothing",
        manager__components__preactivation="Left, Right, rtcname://host/x",
    )
    order: list[str] = []
    manager.start(lambda manager: order.extend(factory.name for factory in manager.factories.all))
    assert "ModuleFoo" in order
    assert [component.instance_name for component in manager.components] == ["ModuleFoo0", "Left"]
    assert manager.components[1].state() is LifeCycleState.ACTIVE_STATE
    assert isinstance(manager.world, MemoryWorld)
    assert manager.world.activated == ["rtcname://host/x"]
    assert [(finding.code, finding.subject) for finding in findings(manager)] == [
        ("preload-failed", "Missing.py"),
        ("precreate-failed", "Nothing"),
        ("preactivation-failed", "Right"),
    ]


def test_connections_of_other_processes_are_the_worlds(make: Make) -> None:
    manager = make(manager__components__preconnect="rtcname://host/A0.out?port=Foo0.in&subscription_type=new")
    manager.start(lambda manager: manager.register(Foo))
    assert isinstance(manager.world, MemoryWorld)
    assert [finding.code for finding in findings(manager)] == ["preconnect-waits"]
    assert manager.world.connected == []
    manager.connect("rtcname://host/A0.out?port=rtcloc://host:2810/test/B0.in")
    assert manager.world.connected[0][0] == ("rtcname://host/A0.out", "rtcloc://host:2810/test/B0.in")


def test_the_last_component_ends_the_manager(make: Make) -> None:
    manager = make()
    manager.start()
    manager.create_component("Foo")
    manager.create_component("Foo")
    manager.delete_component("Foo0")
    assert not manager.is_ending
    manager.delete_component("Foo1")
    assert manager.wait(0)
    with pytest.raises(CreateError, match="the manager is ending"):
        manager.create_component("Foo")


def test_a_manager_without_components_ends_after_its_time(make: Make) -> None:
    manager = make(manager__auto_shutdown_duration="0.01")
    manager.start()
    assert manager.wait(10)
    busy = make(manager__auto_shutdown_duration="0.01", manager__shutdown_on_nortcs="NO")
    busy.start(lambda manager: manager.create_component("Foo"))
    passed = threading.Event()
    busy.timer.after(0.05, passed.set)
    assert passed.wait(10)
    assert not busy.is_ending
    busy.delete_component("Foo0")
    assert busy.wait(10)


@pytest.mark.parametrize("texts", [{"manager__shutdown_auto": "NO"}, {"manager__is_master": "YES"}])
def test_managers_that_stay(make: Make, texts: dict[str, str]) -> None:
    manager = make(manager__auto_shutdown_duration="0.01", **texts)
    manager.start()
    passed = threading.Event()
    manager.timer.after(0.05, passed.set)
    assert passed.wait(10)
    assert not manager.is_ending


def test_the_end_takes_everything_back(make: Make) -> None:
    world = MemoryWorld(managers={"localhost:2810": FakeManager()})
    manager = make(world)
    manager.start()
    components = [manager.create_component("Foo") for _ in range(3)]
    wait_until(lambda: len(world.managers["localhost:2810"].known_slaves) == 1)
    manager.close()
    assert all(not component.is_initialized for component in components)
    assert world.server.bound == {}
    assert world.offered == {}
    assert world.managers["localhost:2810"].known_slaves == []
    assert world.closed
    manager.close()


def test_a_component_whose_end_fails_ends(make: Make) -> None:
    class Clinging(Foo):
        def on_finalize(self) -> ReturnCode:
            raise RuntimeError("no")

    world = MemoryWorld()
    manager = make(world)
    manager.register(Clinging)
    manager.start()
    manager.create_component("Clinging")
    assert manager.delete_component("Clinging0") is ReturnCode.RTC_ERROR
    assert world.server.bound == {}
    assert manager.components == ()


def test_many_threads_make_different_names(make: Make) -> None:
    manager = make()
    manager.start()
    threads = [threading.Thread(target=lambda: manager.create_component("Foo")) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    assert {component.instance_name for component in manager.components} == {f"Foo{n}" for n in range(8)}


def test_composites_are_made_of_what_is_there(make: Make) -> None:
    manager = make()
    manager.start()
    members = [manager.create_component("Foo") for _ in range(2)]
    whole = manager.create_component(
        "PeriodicECSharedComposite?instance_name=Whole&conf.default.members=Foo0,Foo1"
    )
    manager.activate("Whole")
    context = whole.owned_contexts[0]
    for member in members:
        assert member.participating_contexts == (context,)
        wait_until(lambda one=member: context.get_component_state(one.participation) is ACTIVE)  # type: ignore[misc]


def test_start_and_use_in_the_wrong_order(make: Make) -> None:
    manager = make()
    with pytest.raises(RtcError, match="the manager has not been started: call start first"):
        manager.create_component("Foo")
    manager.start()
    with pytest.raises(RtcError, match="has been started already"):
        manager.start()


def test_delete_functions_are_called_and_may_fail(make: Make) -> None:
    manager = make()
    ended: list[object] = []

    def delete(component: Component) -> None:
        ended.append(component)
        raise KeyError("x")

    spec: dict[str, Any] = {**Foo.spec(), "implementation_id": "Bar", "type_name": "Bar"}
    assert manager.register(spec, lambda manager: Foo(), delete)
    assert not manager.register(spec, lambda manager: Foo())
    manager.start()
    bar = manager.create_component("Bar")
    assert bar.instance_name == "Bar0"
    manager.delete_component("Bar0")
    assert ended == [bar]
    assert [finding.code for finding in findings(manager)] == ["delete-failed"]
