"""The agent as part of an asyncio program: real sockets on loopback, its timer, its end."""

import asyncio
import socket
from pathlib import Path

import pytest

from muros.agent import Agent, ClientConnected, ClientGone, Event, LinkUp
from muros.findings import Finding, Findings
from muros.links import LinkError, SerialLink, UdpLink

CREATE_CLIENT = bytes.fromhex("8000000000011000585243450100010faabbccdd8100fc01")
STATUS_AGENT = bytes.fromhex("8100000004010b000000585243450100010f00")


def test_a_client_connects_and_the_agent_tells() -> None:
    async def program() -> list[Event]:
        agent = Agent("local:")
        link = UdpLink(0, "127.0.0.1")
        agent.add_link(link)
        events: list[Event] = []
        agent.on_event(events.append)
        await agent.start()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            client.setblocking(False)
            client.connect(("127.0.0.1", link.port))
            client.send(CREATE_CLIENT)
            answer = await asyncio.wait_for(asyncio.get_running_loop().sock_recv(client, 100), 5)
        assert answer == STATUS_AGENT
        agent.close()
        agent.close()
        return events

    up, connected, gone = asyncio.run(program())
    assert isinstance(up, LinkUp)
    assert isinstance(connected, ClientConnected)
    assert connected.text().startswith("client 0xAABBCCDD connected from 127.0.0.1:")
    assert isinstance(gone, ClientGone)
    assert gone.text() == "client 0xAABBCCDD gone: the agent stops"


def test_repeats_of_a_finding_are_summarised_by_themselves() -> None:
    async def program() -> list[Finding]:
        agent = Agent("local:", findings=Findings(summary_period=0.02))
        link = UdpLink(0, "127.0.0.1")
        agent.add_link(link)
        told: list[Finding] = []
        summarised = asyncio.Event()

        def on_finding(finding: Finding) -> None:
            told.append(finding)
            if sum(each.new for each in told) == 4:
                summarised.set()

        agent.on_finding(on_finding)
        await agent.start()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.connect(("127.0.0.1", link.port))
            for _ in range(4):
                stranger.send(b"not a message of DDS-XRCE")
            await asyncio.wait_for(summarised.wait(), 10)
        agent.close()
        return told

    first, *_, last = asyncio.run(program())
    assert first.code == "unknown-session"
    assert first.new == 1
    assert last.count == 4
    assert last.since is not None


def test_each_port_of_a_multiserial_link_is_told_of(tmp_path: Path) -> None:
    async def program() -> list[Finding]:
        agent = Agent("local:")
        agent.add_link(SerialLink([f"{tmp_path}/a", f"{tmp_path}/b"]))
        told: list[Finding] = []
        agent.on_finding(told.append)
        await agent.start()
        agent.close()
        return told

    first, second = asyncio.run(program())
    assert first.code == second.code == "port-absent"
    assert first.format().startswith(
        f"finding: multiserial {tmp_path}/a {tmp_path}/b at 115200: {tmp_path}/a is not"
    )
    assert f": {tmp_path}/b is not open: there is no such device now." in second.format()


def test_a_link_added_while_running_opens_at_once_and_a_busy_port_says_so() -> None:
    async def program() -> None:
        agent = Agent("local:")
        await agent.start()
        link = UdpLink(0, "127.0.0.1")
        agent.add_link(link)
        assert link.is_open
        with pytest.raises(LinkError, match="in use"):
            agent.add_link(UdpLink(link.port, "127.0.0.1"))
        assert agent.links == [link]
        agent.remove_link(link)
        assert not link.is_open
        agent.close()

    asyncio.run(program())


def test_run_ends_when_the_agent_is_closed() -> None:
    async def program() -> None:
        agent = Agent("local:")
        agent.add_link(UdpLink(0, "127.0.0.1"))
        running = asyncio.create_task(agent.run())
        await asyncio.sleep(0)
        agent.close()
        await asyncio.wait_for(running, 5)

    asyncio.run(program())
