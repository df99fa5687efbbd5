"""The simulated network and the in-memory links: public test doubles, so tested like the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from textwrap import dedent
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.links import Locator, testing
from muros.links.testing import Datagram, Endpoint, PairLink, Recorder, SimulatedLink, SimulatedNetwork


def numbers(network: SimulatedNetwork, count: int, spacing: float = 0.0) -> list[int]:
    """What arrives, in order, of ``count`` numbered messages."""
    sender, receiver = network.endpoint("a"), network.endpoint("b")
    for number in range(count):
        if spacing:
            network.step(number * spacing)
        sender.send(b"%d" % number, "b")
    network.run(1000.0)
    return [int(data) for data, _ in receiver.inbox]


class TestSimulatedNetwork:
    def test_the_example_of_the_manual_works(self) -> None:
        assert testing.__doc__ is not None
        code = testing.__doc__.partition("\n\n    ")[2]
        exec(dedent("    " + code), {"SimulatedNetwork": SimulatedNetwork})

    def test_by_default_everything_arrives_at_once_and_in_order(self) -> None:
        network = SimulatedNetwork()
        assert numbers(network, 100) == list(range(100))
        assert network.counters == {"sent": 100, "delivered": 100}

    def test_nothing_arrives_before_its_time(self) -> None:
        network = SimulatedNetwork(delay=(2.0, 2.0))
        a, b = network.endpoint("a"), network.endpoint("b")
        a.send(b"hello", "b")
        assert network.next_event() == 2.0
        assert network.in_flight == 1
        assert network.step(1.9) == 0
        assert b.receive() is None
        assert network.step(2.0) == 1
        assert b.receive() == (b"hello", "a")
        assert network.next_event() is None
        with pytest.raises(ValueError, match="time does not go back"):
            network.step(1.0)

    def test_receivers_see_the_time_of_arrival_and_may_answer(self) -> None:
        network = SimulatedNetwork(delay=(1.0, 1.0))
        seen: list[tuple[str, float, bytes]] = []
        a = network.endpoint("a", lambda data, _: seen.append(("a", network.now, data)))

        def answer(data: bytes, sender: Hashable) -> None:
            seen.append(("b", network.now, data))
            b.send(data + b"!", sender)

        b = network.endpoint("b", answer)
        a.send(b"hi", "b")
        assert network.step(5.0) == 2
        assert seen == [("b", 1.0, b"hi"), ("a", 2.0, b"hi!")]
        assert network.now == 5.0

    @given(seed=st.integers(), rates=st.tuples(*[st.floats(0, 1)] * 3), span=st.floats(0, 1))
    def test_the_same_seed_is_the_same_world(
        self, seed: int, rates: tuple[float, float, float], span: float
    ) -> None:
        def world() -> tuple[list[int], Counter[str]]:
            loss, duplicate, reorder = rates
            network = SimulatedNetwork(seed, loss=loss, duplicate=duplicate, reorder=reorder, delay=(0, span))
            return numbers(network, 30, 0.01), network.counters

        assert world() == world()

    @given(seed=st.integers(), delay=st.tuples(st.floats(0, 1), st.floats(0, 1)).map(sorted))
    def test_without_reordering_the_order_is_kept_whatever_the_delays(
        self, seed: int, delay: list[float]
    ) -> None:
        network = SimulatedNetwork(seed, loss=0.2, delay=(delay[0], delay[1]))
        got = numbers(network, 50, 0.01)
        assert got == sorted(got)
        assert len(got) == network.counters["delivered"] == 50 - network.counters["lost"]

    @pytest.mark.parametrize("delay", [(0.0, 0.0), (0.5, 1.0)])
    def test_reordering_and_duplication(self, delay: tuple[float, float]) -> None:
        network = SimulatedNetwork(3, reorder=0.2, delay=delay)
        got = numbers(network, 200, 0.0)
        assert got != sorted(got)
        assert sorted(got) == list(range(200))
        assert 10 < network.counters["reordered"] < 80
        network = SimulatedNetwork(3, duplicate=0.2, delay=delay)
        counted = Counter(numbers(network, 200))
        assert set(counted.values()) == {1, 2}
        assert len(counted) == 200
        assert sum(counted.values()) == 200 + network.counters["duplicated"]

    def test_rates_come_out(self) -> None:
        network = SimulatedNetwork(5, loss=0.1)
        numbers(network, 2000)
        assert 120 < network.counters["lost"] < 280
        assert numbers(SimulatedNetwork(5, loss=1.0), 50) == []

    def test_one_setting_leaves_the_other_decisions_alone(self) -> None:
        lossy = numbers(SimulatedNetwork(11, loss=0.3), 200)
        more = numbers(
            SimulatedNetwork(11, loss=0.3, duplicate=0.5, reorder=0.5, delay=(0.1, 0.9)), 200, 0.01
        )
        assert set(more) == set(lossy)

    def test_a_partition_parts_and_heals(self) -> None:
        network = SimulatedNetwork(delay=(1.0, 1.0))
        ends = {name: network.endpoint(name) for name in "abc"}

        def reached() -> set[str]:
            for sender in "abc":
                for receiver in "abc":
                    if sender != receiver:
                        ends[sender].send(b"x", receiver)
            network.step(network.now + 1)
            found = {f"{sender}{name}" for name, end in ends.items() for _, sender in end.inbox}
            for end in ends.values():
                end.inbox.clear()
            return found

        everyone = {"ab", "ac", "ba", "bc", "ca", "cb"}
        assert reached() == everyone
        network.partition({"a"})
        assert reached() == {"bc", "cb"}
        network.partition({"a", "b"}, {"c"})
        assert reached() == {"ab", "ba"}
        network.heal()
        assert reached() == everyone
        assert network.counters["parted"] == 8
        assert network.reachable("a", "c")

    def test_what_is_on_its_way_across_a_new_border_is_lost(self) -> None:
        network = SimulatedNetwork(delay=(1.0, 1.0))
        a, b, c = (network.endpoint(name) for name in "abc")
        a.send(b"lost", "b")
        c.send(b"stays", "b")
        network.partition({"a"})
        network.heal()
        network.step(2.0)
        assert list(b.inbox) == [(b"stays", "c")]

    def test_a_tap_sees_all_and_takes_out_what_it_likes(self) -> None:
        network = SimulatedNetwork()
        seen: list[Datagram] = []

        def third_is_lost(datagram: Datagram) -> bool:
            seen.append(datagram)
            return len(seen) != 3

        network.tap = third_is_lost
        assert numbers(network, 5, 1.0) == [0, 1, 3, 4]
        assert seen[2] == Datagram("a", "b", b"2", 2.0)
        assert network.counters["tapped"] == 1

    def test_endpoints_leave_and_come_back(self) -> None:
        network = SimulatedNetwork()
        a, b = network.endpoint("a"), network.endpoint("b")
        with pytest.raises(ValueError, match="there is an endpoint 'b' already"):
            network.endpoint("b")
        a.send(b"on its way", "b")
        b.close()
        network.step(1.0)
        assert network.counters["nowhere"] == 1
        assert b.send(b"from nowhere", "a") is False
        again = network.endpoint("b")
        b.close()  # the old one has no say any more
        a.send(b"hello", "b")
        network.step(2.0)
        assert again.receive() == (b"hello", "a")

    def test_too_long_and_changed_afterwards(self) -> None:
        network = SimulatedNetwork(mtu=4)
        a, b = network.endpoint("a"), network.endpoint("b")
        assert a.send(b"12345", "b") is False
        buffer = bytearray(b"1234")
        assert a.send(memoryview(buffer), "b") is True
        buffer[:] = b"...."
        network.step(1.0)
        assert list(b.inbox) == [(b"1234", "a")]
        assert network.counters["too-long"] == 1

    def test_actors_run_by_their_deadlines(self) -> None:
        network = SimulatedNetwork(delay=(0.25, 0.25))
        a = network.endpoint("a")
        heard: list[float] = []
        network.endpoint("b", lambda data, _: heard.append(network.now))
        due = 1.0

        def talker(now: float) -> float:
            nonlocal due
            if now >= due:
                a.send(b"tick", "b")
                due += 1.0
            return due

        network.run(3.5, talker)
        assert heard == [1.25, 2.25, 3.25]
        assert network.now == 3.5
        network.run(3.5, talker)
        assert network.now == 3.5

    def test_an_actor_that_makes_no_progress_is_found_out(self) -> None:
        network = SimulatedNetwork()
        with pytest.raises(RuntimeError, match="an actor's deadline stays in the past"):
            network.run(1.0, lambda now: 0.0)

    def test_a_ping_pong_without_delay_is_found_out(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("muros.links.testing._EVENTS_AT_MOST", 1000)
        network = SimulatedNetwork()
        ends: dict[str, Endpoint] = {}

        def back(data: bytes, sender: Hashable) -> None:
            ends["b" if sender == "a" else "a"].send(data, sender)

        ends["a"], ends["b"] = network.endpoint("a", back), network.endpoint("b", back)
        ends["a"].send(b"ball", "b")
        with pytest.raises(RuntimeError, match="give the network a delay"):
            network.step(1.0)

    def test_time_in_whole_milliseconds(self) -> None:
        network = SimulatedNetwork(delay=(5, 5))
        network.endpoint("b")
        network.endpoint("a").send(b"x", "b")
        assert network.next_event() == 5


class TestSimulatedLink:
    def test_it_is_a_link_on_the_network(self) -> None:
        network = SimulatedNetwork(seed=1, loss=0.5)
        link, events = SimulatedLink(network), Recorder()
        link.open(events)
        assert events.up == ["simulated agent"]
        client = network.endpoint("client")
        for _ in range(100):
            client.send(b"hello", "agent")
        network.step(1.0)
        assert events.messages == [(b"hello", "client")] * network.counters["delivered"]
        assert link.counters.received == network.counters["delivered"]
        assert 20 < link.counters.received < 80
        assert link.send(b"hi", "client")  # True even if it gets lost on the way, as with UDP
        link.close()
        client.send(b"anybody?", "agent")
        network.step(2.0)
        assert network.counters["sent"] == 102
        assert len(events.messages) == link.counters.received


class TestPairLink:
    def test_peers_are_objects_of_the_test(self) -> None:
        locator = Locator(4, bytes(4), 8888)
        link, events = PairLink("bench", locators=[locator]), Recorder()
        link.open(events)
        assert (link.name, link.locators()) == ("bench", [locator])
        first, second = link.peer("1"), link.peer("2")
        assert link.peer("1") is first
        first.send(b"hello")
        assert events.messages == [(b"hello", "1")]
        assert link.send(b"to 2", "2")
        assert (first.receive(), second.receive(), second.receive()) == (None, b"to 2", None)
        second.leave("cable pulled")
        assert events.gone == [("2", "cable pulled")]
        assert link.send(b"to 2", "2") is False
        assert link.counters.dropped == {"no-such-peer": 1}

    def test_recorder_rings(self) -> None:
        rings: list[Any] = []
        recorder = Recorder(on_any=lambda: rings.append(1))
        link = PairLink()
        link.open(recorder)
        link.peer().send(b"x")
        link.peer().leave()
        link.send(b"x", "peer")
        recorder.on_down(link, "why not")
        assert len(rings) == 5
        assert recorder.down == ["why not"]
