"""Gates on what the board floor costs, and proof that the instruments which measure it can tell."""

from functools import partial
from pathlib import Path

import pytest

from tests.micropython import budgets
from tests.micropython.budgets import BUDGETS, Budget
from tests.micropython.fuel import fuel, fuel_per_call
from tests.micropython.gauge import heap_cost, run_gauge
from tests.micropython.runtimes import BoardError, require
from tests.micropython.tree import compiled
from tests.micropython.unix import run_mpy, smallest_heap


@pytest.mark.parametrize("budget", BUDGETS, ids=[budget.what.replace(" ", "-") for budget in BUDGETS])
def test_budget(budget: Budget) -> None:
    for runtime in budget.runtimes:
        require(runtime)
    figure = budget.measure()
    assert figure <= budget.limit, (
        f"{budget.what}: {figure:,.0f} {budget.unit}, the budget is {budget.limit:,.0f} {budget.unit}"
    )


def test_gauge_counts_what_lives_and_no_garbage() -> None:
    require("gauge")
    small, large = (heap_cost({}, f"kept = bytearray({size})") for size in (16, 5016))
    assert large - small == pytest.approx(5000, abs=32)
    nothing = heap_cost({}, "for i in range(1): bytes(i)")
    assert heap_cost({}, "for i in range(9): bytes(i)") == nothing


def test_object_heap_is_the_size_of_the_object() -> None:
    require("gauge")
    require("mpy-cross")
    assert budgets.object_heap("", "bytearray(320)") == 16 + 320
    assert budgets.object_heap("", "None") == 0


def test_gauge_is_32_bit() -> None:
    require("gauge")
    (step,) = run_gauge({}, "import struct\nprint(struct.calcsize('P'))")
    assert step.output == "4\n"


def test_gauge_reports_where_a_program_fails() -> None:
    require("gauge")
    with pytest.raises(BoardError, match=r"(?s)muros/broken\.py.*ZeroDivisionError"):
        run_gauge({"muros/broken.py": b"1 / 0\n"}, "import muros.broken")


@pytest.mark.parametrize("measure", ["allocation_32", "allocation_64"])
def test_allocation_is_seen(measure: str) -> None:
    for runtime in ("mpy-cross", "gauge") if measure == "allocation_32" else ("unix",):
        require(runtime)
    allocation = partial(getattr(budgets, measure), "buf = bytearray(200)")
    assert allocation("bytes(buf[:100])") >= 100
    assert allocation("buf[0] = 1") == 0


def test_bytecode_is_what_the_compiler_makes() -> None:
    require("mpy-cross")
    tree = compiled({"a/b.py": b"x = 1\n", "a/data.bin": b"\x00"})
    assert sorted(tree) == ["a/b.mpy", "a/data.bin"]
    assert tree["a/b.mpy"].startswith(b"M\x06")


def test_native_code_needs_a_target() -> None:
    require("mpy-cross")
    tree = {"n.py": b"import micropython\n@micropython.viper\ndef f(a: int) -> int:\n    return a + 1\n"}
    assert compiled(tree) == {}
    assert compiled(tree, march="x64")["n.mpy"] != compiled(tree, march="armv6m")["n.mpy"]


def test_fuel_is_exact_and_grows_with_the_work() -> None:
    require("fuel")
    setup = "buf = bytearray(64)"
    one = fuel_per_call({}, setup, "buf[0] = 1")
    assert one == fuel_per_call({}, setup, "buf[0] = 1")
    assert 10 < one < fuel_per_call({}, setup, "buf[0] = 1; buf[1] = 1; buf[2] = 1; buf[3] = 1")


def test_fuel_reports_where_a_program_fails() -> None:
    require("fuel")
    with pytest.raises(BoardError, match="NameError"):
        fuel({}, "there_is_no_such_name()")


def test_unix_port_caps_the_heap() -> None:
    require("unix")
    program = "kept = bytearray(30000)\nprint('done')"
    assert run_mpy(program, heapsize="60K") == "done\n"
    with pytest.raises(BoardError, match="MemoryError"):
        run_mpy(program, heapsize="20K")
    assert 30 <= smallest_heap(lambda heapsize: _run(program, heapsize), 4, 64) <= 40


def test_a_program_too_big_for_any_allowed_heap_is_an_error() -> None:
    require("unix")
    with pytest.raises(BoardError, match="MemoryError"):
        smallest_heap(lambda heapsize: _run("kept = bytearray(300000)", heapsize), 4, 64)


@pytest.mark.parametrize("form", ["py", "mpy"])
def test_smallest_heap_of_a_program(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require("unix")
    require("mpy-cross")
    monkeypatch.setattr(budgets, "PROGRAMS", tmp_path)
    program = tmp_path / "hungry.py"
    program.write_text("import muros.compat\nkept = bytearray(30000)\nprint('done')\n")
    assert 30 < budgets.smallest("hungry", form, 40) < 45
    with pytest.raises(BoardError, match="MemoryError"):
        budgets.smallest("hungry", form, 10)
    program.write_text("print('gave up')\n")
    with pytest.raises(BoardError, match=r"did not finish its work:\ngave up"):
        budgets.smallest("hungry", form, 40)


def test_drift_sees_what_piles_up() -> None:
    require("gauge")
    require("mpy-cross")
    setup = "pile = []\nnumbers = bytearray(4)"
    assert budgets.drift(setup, "pile.append(bytearray(16))", 100) > 100 * 32
    assert budgets.drift(setup, "numbers[0] = 1; bytes(20)", 1000) == 0


def test_unix_port_passes_arguments(tmp_path: Path) -> None:
    require("unix")
    script = tmp_path / "script.py"
    script.write_text("import sys\nprint(sys.argv[1:])\n")
    assert run_mpy(script, ["a", "b"]) == "['a', 'b']\n"


def test_a_program_that_hangs_is_ended() -> None:
    require("unix")
    with pytest.raises(BoardError, match="did not end within"):
        run_mpy("print('going round')\nwhile True: pass", timeout=0.5)


def _run(program: str, heapsize: str) -> None:
    run_mpy(program, heapsize=heapsize)
