"""The contract of all engines for a dds space that is spread over two computers.

Participants are made on one and the other in turn; the network between them takes no time, and discovery does not
wait for company, so that the tests' own clock decides. What is found is that of both computers.
"""

from typing import Any, Self

from muros.findings import Findings
from muros.rtps import DomainSettings, ReaderSettings, WriterSettings
from muros.space import Participant
from tests.space.dds_world import Net
from tests.space.test_dds import TestDds as Together


class Spread:
    """Two spaces that pass for one."""

    def __init__(self, net: Net, **options: Any) -> None:
        self.net = net
        self.findings = Findings()
        self.parts = [net.computer(findings=self.findings, **options) for _ in range(2)]
        self.clock = net.clock
        self.closed = False
        self._made = 0

    def participant(self, name: str, **options: Any) -> Participant:
        """On the next computer."""
        self._made += 1
        return self.parts[self._made % 2].space.participant(name, **options)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.closed = True
        for part in self.parts:
            part.space.close()


class TestSpread(Together):
    """Samples, services and time; the books of two computers are not those of one, and a key is known to one of them.

    What is set to None asks of the graph, of `tick`, or for one finding where both computers tell of their side; for
    two computers that is held in `test_dds_network`.
    """

    test_what_does_not_fit_is_a_finding_and_in_the_graph: Any = None
    test_different_types_do_not_meet: Any = None
    test_services_of_another_type_do_not_meet: Any = None
    test_the_graph_is_a_value: Any = None
    test_changes_of_the_graph_are_told: Any = None
    test_watching_ends_and_may_fail: Any = None
    test_each_entity_closes_by_itself_and_twice: Any = None
    test_a_closed_space_takes_nothing_more: Any = None
    test_keys_give_the_same_gids_in_every_life: Any = None
    test_a_key_is_used_once: Any = None

    def open_space(self) -> Any:
        at_once = DomainSettings(discovery_writer=WriterSettings(), discovery_reader=ReaderSettings())
        self.net = Net(settings=at_once, delay=(0.0, 0.0))
        return Spread(
            self.net,
            resource_limit=self.LIMIT,
            max_blocking_time=self.PATIENCE,
            request_wait=self.REQUEST_WAIT,
        )

    def settle(self, space: Any) -> None:
        for _ in range(3):
            self.net.run(0)

    def pass_time(self, space: Any, ns: int) -> None:
        self.net.run(ns)
