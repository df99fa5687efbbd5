"""Findings: counted, summarised, bounded, told in plain words. Time is a number these tests make up."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.findings import Finding, Findings, Severity

CLIENT = "client 0x1A2B0007"


class Told(list[Finding]):
    """A watcher that keeps what it is told."""

    def __call__(self, finding: Finding) -> None:
        self.append(finding)


@pytest.fixture
def told() -> Told:
    return Told()


@pytest.fixture
def findings(told: Told) -> Findings:
    findings = Findings(capacity=5, summary_period=10.0)
    findings.on_finding(told)
    return findings


def too_big(
    findings: Findings, now: float, *, n: int = 1, who: str = CLIENT, topic: str = "rt/joint_states"
) -> None:
    findings.report(
        "best-effort-too-big",
        who=who,
        what=f"{{n}} sample{{s}} of {topic} from {who} dropped",
        why="700 B do not fit its best-effort MTU of 508 B",
        remedy="Raise the client's MTU, or publish with reliable QoS",
        now=now,
        subject=topic,
        n=n,
    )


def test_the_first_is_told_at_once_with_everything(findings: Findings, told: Told) -> None:
    too_big(findings, 3.0, n=12)
    assert told == [
        Finding(
            code="best-effort-too-big",
            who=CLIENT,
            what="{n} sample{s} of rt/joint_states from client 0x1A2B0007 dropped",
            why="700 B do not fit its best-effort MTU of 508 B",
            remedy="Raise the client's MTU, or publish with reliable QoS",
            severity=Severity.WARNING,
            subject="rt/joint_states",
            count=12,
            new=12,
            first=3.0,
            last=3.0,
            since=None,
        )
    ]


def test_text_of_the_first() -> None:
    findings, lines = Findings(), []
    findings.on_finding(lambda f: lines.append(f.format()))
    too_big(findings, 3.0, n=12)
    too_big(findings, 3.0, topic="rt/a")
    assert lines[0] == (
        "finding: 12 samples of rt/joint_states from client 0x1A2B0007 dropped: "
        "700 B do not fit its best-effort MTU of 508 B.\n"
        "           Raise the client's MTU, or publish with reliable QoS."
    )
    assert lines[1].startswith("finding: 1 sample of rt/a from")


def test_repeats_are_told_once_a_period(findings: Findings, told: Told) -> None:
    too_big(findings, 100.0)
    for i in range(12):
        too_big(findings, 101.0 + i / 10)
    assert len(told) == 1
    assert findings.tick(109.9) == 110.0
    assert len(told) == 1
    assert findings.tick(110.0) is None
    assert [(f.count, f.new, f.since, f.first, f.last) for f in told[1:]] == [(13, 12, 100.0, 100.0, 102.1)]
    assert (
        told[1]
        .format(lambda t: f"<{t:g}>")
        .startswith(
            "finding: 12 more samples of rt/joint_states from client 0x1A2B0007 dropped since <100>: 700 B"
        )
    )
    assert findings.tick(130.0) is None
    assert len(told) == 2, "nothing new, nothing told"
    too_big(findings, 131.0)
    assert findings.tick(131.0) is None, "the period since the last telling is over"
    assert told[2].new == 1
    assert told[2].since == 110.0


def test_summary_of_a_text_without_number() -> None:
    f = Finding("c", "node /a", "node /a is silent", since=5.0, count=4, new=3)
    assert f.format(str) == "finding: node /a is silent, 3 more since 5.0."
    assert f.format().count(":") == 3, "local time of the form 12:00:09"


def test_due_at_time_zero_is_a_time(findings: Findings) -> None:
    too_big(findings, -10.0)
    too_big(findings, -9.0)
    assert findings.tick(-5.0) == 0.0


def test_clock_set_back_tells_rather_than_waits(findings: Findings, told: Told) -> None:
    too_big(findings, 1e9)
    too_big(findings, 5.0)
    assert findings.tick(5.0) is None
    assert told[-1].new == 1


def test_again_counts_only_what_is_known(findings: Findings, told: Told) -> None:
    known: dict[str, Any] = {"who": CLIENT, "subject": "rt/joint_states"}
    assert not findings.again("best-effort-too-big", **known, now=1.0)
    too_big(findings, 1.0)
    assert findings.again("best-effort-too-big", **known, now=2.0, n=4)
    assert findings.counts() == {"best-effort-too-big": 5}
    assert len(told) == 1


def test_nothing_happened_is_no_finding(findings: Findings, told: Told) -> None:
    too_big(findings, 1.0, n=0)
    assert (told, findings.snapshot()) == ([], ())


def test_who_is_named_once_and_control_characters_are_shown(findings: Findings, told: Told) -> None:
    findings.report("x", who="client\x1b[31m", what="lost", now=0.0)
    findings.report("x", who="node /a", what="node /a lost", why="gone\n", now=0.0)
    assert told[0].format() == "finding: client\\x1b[31m: lost."
    assert told[1].format() == "finding: node /a lost: gone\\n."


def test_braces_in_foreign_names_are_harmless(findings: Findings, told: Told) -> None:
    findings.report("x", who="client", what="topic {0} {name} {", now=0.0)
    assert told[0].format() == "finding: client: topic {0} {name} {."


def test_capacity_folds_the_rest_by_code(findings: Findings, told: Told) -> None:
    for i in range(100):
        too_big(findings, float(i), topic=f"rt/t{i}")
    assert len(findings.snapshot()) == 6
    assert len(told) == 6, "five by name and the first of the others"
    assert told[-1].who == "others"
    assert "best-effort-too-big" in told[-1].format()
    assert findings.counts() == {"best-effort-too-big": 100}
    findings.tick(1000.0)
    assert told[-1].new == 94


def test_codes_are_bounded_too() -> None:
    findings = Findings(capacity=1)
    for i in range(5000):
        findings.report(f"code-{i}", who="w", what="x", now=0.0)
    counts = findings.counts()
    assert sum(counts.values()) == 5000
    assert len(counts) < 300
    for i in range(5000):
        findings.report(f"lost-{i}", who=f"w{i}", what="x", now=0.0)
        findings.forget(f"w{i}")
    assert sum(findings.counts().values()) == 10000
    assert len(findings.counts()) < 500


def test_forget_frees_room_tells_what_was_left_and_keeps_the_count(findings: Findings, told: Told) -> None:
    for i in range(5):
        too_big(findings, 0.0, topic=f"rt/t{i}")
    too_big(findings, 1.0, topic="rt/t0")
    findings.forget(CLIENT)
    findings.forget("nobody")
    assert told[-1].new == 1
    assert told[-1].since == 0.0
    assert findings.snapshot() == ()
    assert findings.counts() == {"best-effort-too-big": 6}
    assert findings.tick(99.0) is None
    too_big(findings, 2.0)
    assert told[-1].who == CLIENT
    assert told[-1].count == 1
    assert findings.counts() == {"best-effort-too-big": 7}


def test_flush_tells_what_is_left(findings: Findings, told: Told) -> None:
    too_big(findings, 0.0)
    too_big(findings, 1.0)
    findings.flush()
    assert told[-1].new == 1
    assert findings.tick(99.0) is None


def test_snapshot_shows_latest_texts_and_untold_number(findings: Findings) -> None:
    findings.report("a", who="w", what="first", now=1.0, severity=Severity.INFO)
    findings.report("b", who="w", what="other", now=2.0)
    findings.report("a", who="w", what="second", now=3.0, severity=Severity.ERROR)
    a, b = findings.snapshot()
    assert (a.what, a.severity, a.count, a.new, a.first, a.last) == ("second", Severity.ERROR, 2, 1, 1.0, 3.0)
    assert (b.code, b.new) == ("b", 0)


def test_a_watcher_that_raises_is_counted_and_harms_nobody(told: Told) -> None:
    findings = Findings()

    def broken(finding: Finding) -> None:
        raise RuntimeError("no terminal")

    findings.on_finding(broken)
    findings.on_finding(told)
    too_big(findings, 1.0)
    too_big(findings, 2.0, who="client 2")
    assert [f.who for f in told] == [CLIENT, "client 2"]
    assert findings.counts() == {"best-effort-too-big": 2, "watcher-failed": 2}
    failed = next(f for f in findings.snapshot() if f.code == "watcher-failed")
    assert "RuntimeError: no terminal" in failed.why


def test_a_watcher_may_report(told: Told) -> None:
    findings = Findings(capacity=10)
    order: list[str] = []

    def chatty(finding: Finding) -> None:
        order.append("in " + finding.subject)
        if finding.subject != "end":
            findings.report("x", who="w", what="more", now=0.0, subject="end")
        order.append("out " + finding.subject)

    findings.on_finding(chatty)
    findings.on_finding(told)
    findings.report("x", who="w", what="begin", now=0.0, subject="begin")
    assert order == ["in begin", "out begin", "in end", "out end"]
    assert [f.subject for f in told] == ["begin", "end"]


def test_watching_ends(findings: Findings) -> None:
    second = Told()
    cancel, again = findings.on_finding(second), findings.on_finding(second)
    too_big(findings, 1.0)
    cancel()
    cancel()
    too_big(findings, 1.0, topic="rt/b")
    assert len(second) == 3
    again()
    too_big(findings, 1.0, topic="rt/c")
    assert len(second) == 3


@pytest.mark.parametrize("bad", [{"capacity": 0}, {"summary_period": 0.0}])
def test_limits_must_make_sense(bad: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        Findings(**bad)


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("report"), st.sampled_from("abcdefgh"), st.integers(0, 3)),
            st.tuples(st.just("forget"), st.sampled_from("abcdefgh"), st.just(0)),
            st.tuples(st.just("tick"), st.just(""), st.integers(0, 30)),
        ),
        max_size=60,
    )
)
def test_every_occurrence_is_told_once(steps: list[tuple[str, str, int]]) -> None:
    """However reports, ticks and departures mix: what the watchers heard adds up to what was reported."""
    findings, told, now, total = Findings(capacity=4), Told(), 0.0, 0
    findings.on_finding(told)
    for step, who, n in steps:
        if step == "report":
            findings.report("code", who=who, what="x", now=now, n=n)
            total += n
        elif step == "forget":
            findings.forget(who)
        else:
            now += n
            due = findings.tick(now)
            assert due is None or now < due <= now + findings.summary_period
        assert sum(f.new for f in told) + sum(f.new for f in findings.snapshot()) == total
        assert findings.counts().get("code", 0) == total
        assert len(findings.snapshot()) <= 5
    findings.flush()
    assert sum(f.new for f in told) == total


def test_old_findings_make_room_for_new_ones() -> None:
    findings = Findings(capacity=2, memory=60.0)
    findings.report("old", who="a", what="x", now=0.0)
    findings.report("fresh", who="b", what="x", now=50.0)
    findings.report("new", who="c", what="x", why="y", now=70.0)
    assert [finding.who for finding in findings.snapshot()] == ["b", "c"]
    assert findings.counts() == {"old": 1, "fresh": 1, "new": 1}
