"""What RTPS noticed of others in a domain, as findings: what it means and what to do."""

from typing import Final, NamedTuple

from muros.findings import Severity
from muros.rtps import DomainProblem, DomainReport
from muros.space._core import Core

__all__ = ["report_domain"]


class _Told(NamedTuple):
    """One kind of problem. In the texts, {who} is the participant, {number} and {text} are the report's."""

    code: str
    what: str
    why: str
    remedy: str
    severity: Severity = Severity.WARNING


def report_domain(core: Core, domain: int, report: DomainReport, name: str) -> None:
    """Tell of a problem; `name` is what to call the participant concerned, "" = not known."""
    told = _PROBLEMS[report.problem]
    who = name or (f"somebody at {report.source}" if report.source is not None else "somebody")
    more = f": {report.text}" if report.text else ""
    core.report(
        told.code,
        who=f"dds domain {domain}",
        subject=report.prefix.hex() or str(report.source or ""),
        what=told.what.format(who=who, number=report.number),
        why=told.why.format(who=who, number=report.number) + more,
        remedy=told.remedy,
        severity=told.severity,
    )


_PROBLEMS: Final = {
    DomainProblem.MALFORMED: _Told(
        "dds-malformed",
        "a datagram of {who} was dropped",
        "it is no RTPS message, or breaks off",
        "Look at what else sends to the ports of this domain",
        Severity.INFO,
    ),
    DomainProblem.DISCOVERY_MALFORMED: _Told(
        "dds-discovery-malformed",
        "what {who} says of itself was left alone",
        "it describes no participant or endpoint",
        "Update that program, or report the fault to its authors",
    ),
    DomainProblem.FOREIGN_DOMAIN: _Told(
        "dds-foreign-domain",
        "{who} is not met here",
        "it is in another domain, or has another domain tag",
        "Give both the same ROS_DOMAIN_ID",
        Severity.INFO,
    ),
    DomainProblem.PREFIX_MISMATCH: _Told(
        "dds-prefix-mismatch",
        "what {who} said was left alone",
        "it speaks of participants or endpoints that are not its own",
        "Nothing, unless somebody is missing in the graph",
        Severity.INFO,
    ),
    DomainProblem.PREFIX_TAKEN: _Told(
        "dds-prefix-taken",
        "{who} has the identity of a participant of this process",
        "both were made with the same key, or one of them pretends",
        "Stop one of the two, or give it another key",
    ),
    DomainProblem.UNREACHABLE: _Told(
        "dds-no-address",
        "{who} cannot be reached",
        "none of its {number} addresses can be reached from here",
        "Look at the interfaces and addresses of both hosts; shared memory alone is not enough",
    ),
    DomainProblem.TOO_MANY_PEERS: _Told(
        "dds-too-many-peers",
        "{who} is not met",
        "{number} participants are known already",
        "Use another domain for some of them",
    ),
    DomainProblem.TOO_MANY_ENDPOINTS: _Told(
        "dds-too-many-endpoints",
        "some writers or readers of {who} are not met",
        "it has more than {number}",
        "Split it up into several participants",
    ),
    DomainProblem.DISCOVERY_TOO_LARGE: _Told(
        "dds-discovery-too-large",
        "some writers or readers of {who} are not met",
        "what it says of them takes more than {number} bytes",
        "Split it up into several participants",
    ),
    DomainProblem.FLOOD: _Told(
        "dds-flood",
        "{who} is heard with delay",
        "it changes what it says of itself more than {number} times in a second",
        "Look at that program: it makes and destroys endpoints all the time",
    ),
    DomainProblem.QUEUE_FULL: _Told(
        "dds-queue-full",
        "datagrams among the participants of this process were lost",
        "too many were under way at once",
        "Nothing for reliable ones; else write less in one go",
    ),
}
"""What to say, by problem."""
