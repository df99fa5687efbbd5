"""What old components use for texts, properties, time and references: pure things."""

from __future__ import annotations

import importlib
import inspect
import io
import re
import sys
import threading
from types import SimpleNamespace
from typing import Any

import pytest

import OpenRTM_aist as rtm
import RTC
from OpenRTM_aist._absent import INSTEAD
from OpenRTM_aist._tools import _imp, help_old_tools


class TestProperties:
    def test_of_a_flat_list(self) -> None:
        spec = [
            "implementation_id",
            "Foo",
            "conf.default.x",
            " 1 ",
            "conf.default.y",
            "",
            "",
            "behind the end",
        ]
        properties = rtm.Properties(defaults_str=spec)
        assert properties.propertyNames() == ["implementation_id", "conf.default.x", "conf.default.y"]
        assert properties.size() == 3
        assert properties.getProperty("conf.default.x") == properties.getDefault("conf.default.x") == "1"
        assert properties.getProperty("nowhere") == ""
        assert properties.getProperty("nowhere", "else") == "else"

    def test_texts_go_before_defaults(self) -> None:
        properties = rtm.Properties(defaults_map={"a.b": "default"})
        assert properties.setProperty("a.b", "text") == "default"
        assert properties.getProperty("a.b") == "text"
        assert properties.getDefault("a.b") == "default"
        copy = rtm.Properties(properties)
        copy.setProperty("a.b", 3)
        assert (properties.getProperty("a.b"), copy.getProperty("a.b")) == ("text", "3")

    def test_parts_are_alive(self) -> None:
        properties = rtm.Properties(defaults_str=["a.b.c", "1", "a.b.d", "2", "e", "3", ""])
        node = properties.getNode("a.b")
        node.setProperty("c", "new")
        assert properties.getProperty("a.b.c") == "new"
        assert [leaf.getName() for leaf in properties.getLeaf()] == ["a", "e"]
        assert properties.findNode("nowhere") is None
        assert properties.createNode("f.g")
        assert not properties.createNode("f.g")
        gone = properties.removeNode("a.b")
        assert gone is not None
        assert gone.as_dict() == {"c": "new", "d": "2"}
        assert properties.propertyNames() == ["e", "f.g"]
        assert properties.removeNode("a.b") is None

    def test_merging(self) -> None:
        one, other = rtm.Properties(defaults_map={"a": "1"}), rtm.Properties(key="", value="own")
        other.setProperty("b", "2")
        assert (one << other).as_dict() == {"a": "1", "": "own", "b": "2"}
        assert one.getValue() == "own"
        one.clear()
        assert one.size() == 0

    def test_files(self) -> None:
        properties = rtm.Properties(defaults_map={"corba.nameservers": "localhost", "b": " c"})
        out = io.StringIO()
        properties.store(out, "a remark")
        assert out.getvalue().startswith("#a remark\n")
        again = rtm.Properties()
        again.load(io.StringIO(out.getvalue()))
        assert again.as_dict() == properties.as_dict()
        assert str(again) == "corba.nameservers: localhost\nb:  c\n"


class TestTexts:
    def test_erasing_blanks(self) -> None:
        assert rtm.eraseBlank(" a b\t") == "ab"
        text = ["  Some Text "]
        rtm.eraseHeadBlank(text)
        assert text == ["Some Text "]
        rtm.eraseTailBlank(text)
        assert rtm.normalize(text) == "some text"
        assert text == ["some text"]
        assert rtm.eraseBothEndsBlank(" a ") == "a"
        assert rtm.replaceString("a-b", "-", "+") == "a+b"

    @pytest.mark.parametrize("text", ["", 'a\t"b"\n', "\\n", "\\", "\r\f\\\\"])
    def test_escaping_is_undone(self, text: str) -> None:
        assert rtm.unescape(rtm.escape(text)) == text

    def test_lists(self) -> None:
        assert rtm.split(" a, b,,c ", ",") == ["a", "b", "c"]
        assert rtm.flatten(["a", "b"]) == "a, b"
        assert rtm.unique_sv(["a", "b", "a"]) == ["a", "b"]
        assert rtm.includes("push, Pull", "pull")
        assert not rtm.includes(["push", "Pull"], "pull", False)
        assert rtm.toString([1, 2.5]) == "1, 2.5"

    def test_meanings(self) -> None:
        assert rtm.toBool("Yes", "YES", "NO")
        assert not rtm.toBool("no", "YES", "NO", True)
        assert rtm.toBool("maybe", "YES", "NO", True)
        assert rtm.isAbsolutePath("/a")
        assert rtm.isAbsolutePath("C:\\a")
        assert not rtm.isAbsolutePath("./a")
        assert rtm.isURL("file://a")
        assert not rtm.isURL("a/b")

    @pytest.mark.parametrize(
        ("before", "text", "after"),
        [
            (0, "12", 12),
            (0.5, "2", 2.0),
            ("", "x y", "x y"),
            ([1.0], "1, 2.5", [1.0, 2.5]),
            ([], "a,b", ["a", "b"]),
        ],
    )
    def test_a_text_becomes_a_value(self, before: object, text: str, after: object) -> None:
        variable = [before]
        assert rtm.stringTo(variable, text)
        assert variable == [after]
        assert type(variable[0]) is type(after)

    @pytest.mark.parametrize("variable", [[0], [0.0], [[0]]])
    def test_a_text_that_is_no_such_value(self, variable: list[object]) -> None:
        before = list(variable)
        assert not rtm.stringTo(variable, "x")
        assert variable == before
        assert not rtm.stringTo([], "1")


class TestTime:
    def test_a_timed_value_is_stamped(self) -> None:
        data = RTC.TimedLong(RTC.Time(0, 0), 1)
        rtm.setTimestamp(data)
        assert data.tm.sec > 1_600_000_000
        assert 0 <= data.tm.nsec < 1_000_000_000

    def test_spans(self) -> None:
        assert (rtm.TimeValue(1.25) + rtm.TimeValue(0, 900_000)).toDouble() == 2.15
        span = rtm.TimeValue(1) - rtm.TimeValue(2.5)
        assert (span.sec(), span.usec(), span.sign()) == (-1, -500_000, -1)
        assert rtm.Time().getTime().sec() > 1_600_000_000


class TestReferences:
    def test_names_and_values(self) -> None:
        values: list[Any] = []
        rtm.NVUtil.copyFromProperties(values, rtm.Properties(defaults_map={"a": "1"}))
        rtm.NVUtil.appendStringValue(values, "a", "2")
        rtm.NVUtil.appendStringValue(values, "a", "2")
        rtm.NVUtil.appendStringValue(values, "b", "3")
        assert rtm.NVUtil.toString(values, "a") == "1,2"
        assert rtm.NVUtil.isString(values, "b")
        assert rtm.NVUtil.find_index(values, "c") == -1
        with pytest.raises(KeyError):
            rtm.NVUtil.find(values, "c")
        back = rtm.Properties()
        rtm.NVUtil.copyToProperties(back, values)
        assert back.as_dict() == {"a": "1,2", "b": "3"}

    def test_sequences(self) -> None:
        numbers = [1]
        rtm.CORBA_SeqUtil.push_back(numbers, 2)
        rtm.CORBA_SeqUtil.push_back_list(numbers, [3])
        assert rtm.CORBA_SeqUtil.find(numbers, lambda n: n > 1) == 1
        rtm.CORBA_SeqUtil.erase(numbers, 0)
        assert numbers == [2, 3]
        rtm.CORBA_SeqUtil.clear(numbers)
        assert numbers == []

    def test_requests(self) -> None:
        wanted = rtm.Properties(defaults_map={"dataport.dataflow_type": "pull"})
        request = rtm.CORBA_RTCUtil.create_connector("c", wanted, None, None)
        assert rtm.NVUtil.toString(request.properties, "dataport.dataflow_type") == "pull"
        assert rtm.NVUtil.toString(request.properties, "dataport.interface_type") == "corba_cdr"

    def test_names_of_name_servers(self) -> None:
        found = rtm.CorbaNaming(None).toName("robot.host_cxt/Foo.v2.rtc/plain")
        assert [(name.id, name.kind) for name in found] == [
            ("robot", "host_cxt"),
            ("Foo.v2", "rtc"),
            ("plain", ""),
        ]


class TestOldTools:
    def test_python_has_back_what_rtshell_needs(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delattr(inspect, "getargspec", raising=False)
        help_old_tools(program="no_such_program")
        assert not hasattr(inspect, "getargspec")
        monkeypatch.setitem(sys.modules, "rtshell_stands_in", SimpleNamespace())
        monkeypatch.setattr(inspect, "getargspec", None, raising=False)
        monkeypatch.delattr(inspect, "getargspec")
        help_old_tools(program="rtshell_stands_in")
        args, varargs, keywords, defaults = inspect.getargspec(  # type: ignore[attr-defined]
            lambda a, b=1, *c, **d: None
        )
        assert (args, varargs, keywords, defaults) == (["a", "b"], "c", "d", (1,))

    def test_modules_are_found_as_imp_did(self) -> None:
        imp: Any = _imp()
        file, path, description = imp.find_module("json", None)
        assert imp.load_module("json", file, path, description) is sys.modules["json"]
        with pytest.raises(ImportError):
            imp.find_module("no_such_module_anywhere", None)


def test_stubs_are_one_set() -> None:
    import rtctree.rtc

    import OpenRTM
    import OpenRTM__POA
    import RTC__POA
    import RTM
    import RTM__POA
    import SDOPackage
    import SDOPackage__POA

    assert RTC is rtctree.rtc.RTC
    for module in (OpenRTM, OpenRTM__POA, RTC__POA, RTM, RTM__POA, SDOPackage, SDOPackage__POA):
        assert module.__name__.startswith("rtctree.rtc.")


def test_all_names_are_there() -> None:
    missing = [name for name in rtm.__all__ if not hasattr(rtm, name)]
    assert missing == []


class TestWhatProgramsAskTheModuleFor:
    def test_modules_of_the_original(self) -> None:
        for name in (
            "CORBA_RTCUtil",
            "StringUtil",
            "NVUtil",
            "Guard",
            "EventPort",
            "RTM_IDL",
            "RTObject",
            "Async",
        ):
            assert importlib.import_module(f"OpenRTM_aist.{name}")
        assert rtm.StringUtil.normalize(" A ") == "a"
        assert rtm.RTObject.ECOTHER_OFFSET == 1000
        assert rtm.Guard.ScopedLock is rtm.ScopedLock
        assert rtm.EventPort.EventInPort is rtm.EventInPort

    def test_functions_that_the_original_has_at_its_top(self) -> None:
        for name, module in (("already_connected", rtm.CORBA_RTCUtil), ("Link", rtm.StaticFSM)):
            assert getattr(rtm, name) is getattr(module, name)
        assert rtm.uuid1() != rtm.uuid1()

    @pytest.mark.parametrize(
        ("name", "instead"),
        [
            ("InPortConsumerFactory", "register_transport"),
            ("SerializerFactory", "register_serializer"),
            ("PeriodicTask", "threading"),
            ("ExecutionContextBase", "muros.rtc.contexts"),
            ("Nonsense", "no attribute 'Nonsense'$"),
        ],
    )
    def test_what_is_not_there_says_what_is(self, name: str, instead: str) -> None:
        with pytest.raises(AttributeError, match=instead):
            getattr(rtm, name)

    def test_what_is_named_instead_is_there(self) -> None:
        for words in (words for _, words in INSTEAD):
            for path in re.findall(r"(?:muros|OpenRTM_aist)\.[\w.]*\w", words):
                module, _, name = path.rpartition(".")
                assert hasattr(importlib.import_module(module), name) or importlib.import_module(path)


class TestThreads:
    def test_a_lock_for_as_long_as_a_variable(self) -> None:
        mutex = threading.Lock()

        def hold() -> bool:
            guard = rtm.ScopedLock(mutex)
            return mutex.locked() and guard is not None

        assert hold()
        assert not mutex.locked()
        with rtm.ScopedLock(mutex) as guard:
            assert mutex.locked()
        assert not mutex.locked()
        del guard
        assert not mutex.locked()

    def test_a_task(self) -> None:
        done = []

        class Work(rtm.Task):
            def svc(self) -> int:
                done.append(threading.current_thread().name)
                return 0

        work = Work()
        work.wait()
        work.activate()
        work.wait(10.0)
        work.finalize()
        assert done == ["Work"]
        other = rtm.Task()
        other.setTask(done.append, "set")
        other.activate()
        other.wait(10.0)
        assert done == ["Work", "set"]

    def test_a_call_meanwhile(self) -> None:
        gate, seen = threading.Event(), []

        def slowly(obj: str, word: str) -> None:
            assert gate.wait(10.0)
            seen.append((obj, word))

        call = rtm.Async_tInvoker("object", slowly, "word")
        call.invoke()
        call.invoke()  # it runs already
        assert not call.finished()
        gate.set()
        call.wait(10.0)
        assert call.finished()
        assert seen == [("object", "word")]

    @pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
    def test_a_call_that_fails_is_over(self) -> None:
        call = rtm.Async_tInvoker(None, len)
        call.invoke()
        call.wait(10.0)
        assert call.finished()


class TestTextsOfVersion2:
    def test_values_as_version_2_has_them(self) -> None:
        assert rtm.stringTo(0, "12") == (True, 12)
        assert rtm.stringTo(0, "x") == (False, 0)
        assert rtm.stringTo(False, "1") == (True, True)
        number = [0.5]
        assert rtm.stringTo(number, "1.5")
        assert number == [1.5]
        assert not rtm.stringTo(number, "x")
        assert number == [1.5]
        blank = [" a b "]
        assert rtm.StringUtil.eraseBlank(blank) == "ab"
        assert blank == ["ab"]

    def test_the_error_that_is_handled(self) -> None:
        try:
            raise ValueError("spilled")
        except ValueError:
            assert "ValueError: spilled" in rtm.Logger.print_exception()


class TestListsOfNamesAndValues:
    def test_as_texts(self, capsys: pytest.CaptureFixture[str]) -> None:
        values = [rtm.NVUtil.newNV("a", "1"), rtm.NVUtil.newNV("b", 2)]
        assert rtm.NVUtil.toProperties(values).as_dict() == {"a": "1", "b": "2"}
        assert rtm.NVUtil.isStringValue(values, "a", "1")
        assert not rtm.NVUtil.isStringValue(values, "a", "2")
        assert not rtm.NVUtil.isStringValue(values, "b", "2"), "that is a number"
        more: list[Any] = []
        rtm.NVUtil.append(more, values)
        rtm.NVUtil.dump(more)
        assert capsys.readouterr().out == "a: 1\nb: 2\n"

    def test_sequences(self) -> None:
        numbers = [1, 2, 3]
        rtm.CORBA_SeqUtil.insert(numbers, 0, 0)
        rtm.CORBA_SeqUtil.erase_if(numbers, lambda n: n == 2)
        rtm.CORBA_SeqUtil.erase_if(numbers, lambda n: n == 9)
        assert numbers == [0, 1, 3]
        assert (rtm.CORBA_SeqUtil.front(numbers), rtm.CORBA_SeqUtil.back(numbers)) == (0, 3)
        seen: list[int] = []
        rtm.CORBA_SeqUtil.for_each(numbers, seen.append)
        assert seen == numbers
