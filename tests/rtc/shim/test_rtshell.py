"""The tools of rtshell that are components themselves: rtinject, rtprint, rtlog stand on the old names."""

from __future__ import annotations

from pathlib import Path

from tests.rtc.shim.stage import Stage


def names_at(stage: Stage) -> set[str]:
    """What the name server knows, without the `*` of what has died."""
    return set(stage.tool("rtls", "@").stdout.split())


def test_rtinject_writes_to_a_port(stage: Stage) -> None:
    program = stage.python("ConsoleOut")
    stage.component("ConsoleOut0")
    stage.activate("ConsoleOut0")
    done = stage.tool(
        "rtinject", "-n", "20", "-r", "50", "-c", "RTC.TimedLong({time},21)", "@ConsoleOut0.rtc:in"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert len(program.said("Received: 42 stamped True")) >= 10
    typed = "".join(f"RTC.TimedLong(RTC.Time(0,0),{n})\n" for n in range(5))
    done = stage.tool("rtinject", "-n", "5", "-r", "20", "@ConsoleOut0.rtc:in", typed=typed)
    assert (done.returncode, done.stderr) == (0, "")
    program.said("Received: 4 stamped False")
    assert names_at(stage) == {"ConsoleOut0.rtc"}, "no tool leaves its component behind"


def test_rtprint_reads_from_a_port(stage: Stage) -> None:
    stage.python("SeqIO")
    stage.activate("SeqOut0")
    done = stage.tool("rtprint", "-n", "3", "-r", "50", "@SeqOut0.rtc:Text")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len(lines) >= 3
    assert all(line.startswith("[0.000000000] number ") for line in lines)
    assert names_at(stage) == {"SeqOut0.rtc", "SeqIn0.rtc"}


def test_rtlog_records_and_plays(stage: Stage, tmp_path: Path) -> None:
    program = stage.python("SeqIO")
    for name in ("SeqOut0", "SeqIn0"):
        stage.component(name)
    stage.activate("SeqOut0", "SeqIn0")
    done = stage.tool("rtlog", "-f", "log", "-i", "-e", "10", "@SeqOut0.rtc:Long.long", "@SeqOut0.rtc:Text.text",
                      "@SeqOut0.rtc:Octet.octet", "@SeqOut0.rtc:Double.double")  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "Recording 10 entries.\n")
    told = stage.tool("rtlog", "-f", "log", "-d").stdout
    assert "Name: long" in told
    assert "Number of entries: " in told
    assert not any("got" in line for line in program.lines)
    done = stage.tool("rtlog", "-p", "-n", "-f", "log", "-i", "-s", "1", "-e", "8", "@SeqIn0.rtc:Long.long",
                      "@SeqIn0.rtc:Text.text", "@SeqIn0.rtc:Octet.octet", "@SeqIn0.rtc:Double.double")  # fmt: skip
    assert done.returncode == 0, done
    program.said("got")


def test_rtfsm_asks_for_a_state_machine(stage: Stage) -> None:
    """No component of the original package answers it."""
    stage.python("Turnstile")
    stage.activate("Turnstile0")
    assert stage.tool("rtfsm", "@Turnstile0.rtc", "getstate").stdout.split() == ["Locked"]
    profiles = stage.tool("rtfsm", "@Turnstile0.rtc", "geteventprofiles").stdout
    assert profiles.strip() == "coin:IDL:RTC/TimedLong:1.0, push:"
    assert (
        '<transition event="coin" target="Unlocked" />'
        in stage.tool("rtfsm", "@Turnstile0.rtc", "getstructure").stdout
    )
