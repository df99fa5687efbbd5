"""The agent's benchmark works and its figures are sane: counts add up, shares are shares. Speed is not judged here."""

import json
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from bench import _load as load
from bench._load_server import RELAY, Server

ROOT = Path(__file__).resolve().parents[1]

pytestmark = [
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc"),
    pytest.mark.timeout(300),  # half a minute where nothing else runs
]


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, Any]]]:
    path = tmp_path_factory.mktemp("bench") / "rows.json"
    command = [sys.executable, "bench/bench_agent.py", "--quick", "--json", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stderr
    by_section: dict[str, list[dict[str, Any]]] = {}
    for row in json.loads(path.read_text()):
        by_section.setdefault(row["section"], []).append(row)
    return by_section


def test_every_table_has_its_rows(rows: dict[str, list[dict[str, Any]]]) -> None:
    assert {name: len(found) for name, found in rows.items()} == {
        "latency": 8,
        "reliable": 4,
        "delivered": 4,
        "best-effort": 4,
        "sessions": 2,
        "memory": 3,
        "leave": 1,
        "stall": 4,
    }


def test_rates_and_times_are_positive_and_ordered(rows: dict[str, list[dict[str, Any]]]) -> None:
    for row in (*rows["latency"], *rows["stall"]):
        assert 0 < row["p50"] <= row["p99"]
    for row in (*rows["reliable"], *rows["delivered"]):
        assert row["rate"] > 0
        assert row["relay"] > 0
        assert row["cpu_us"] > 0
    for row in rows["sessions"]:
        assert row["up"] > 0
        assert row["down"] > 0


def test_nothing_is_delivered_that_was_not_written(rows: dict[str, list[dict[str, Any]]]) -> None:
    for row in rows["delivered"]:
        assert 0 < row["share"] <= 1.05  # the last ones are delivered before their acknowledgement is seen


def test_one_thread_serves_all_sessions(rows: dict[str, list[dict[str, Any]]]) -> None:
    assert [(row["sessions"], row["threads"]) for row in rows["memory"]] == [(0, 1), (1, 1), (20, 1)]


def test_no_sample_is_lost_beside_clients_that_misbehave(rows: dict[str, list[dict[str, Any]]]) -> None:
    assert [row["lost"] for row in rows["stall"]] == [0, 0, 0, 0]


def test_a_client_acknowledges_what_it_takes_and_names_what_is_missing() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as agent:
        agent.bind(("127.0.0.1", 0))
        agent.settimeout(2)
        client = load.Client(agent.getsockname()[1], 1)
        try:
            taken = [client.take(bytes((0x81, 0x80, number, 0))) for number in (0, 3, 3, 1, 2, 2)]
            answers = [agent.recv(64)[8:12] for _ in taken]
        finally:
            client.close()
    assert taken == [True, True, False, True, True, False]
    assert [answer.hex() for answer in answers] == [
        "01000000", "01000003", "01000003", "02000001", "04000000", "04000000",
    ]  # fmt: skip


def test_an_agent_that_does_not_answer_is_an_error_in_bounded_time() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        client = load.Client(silent.getsockname()[1], 1)
        try:
            with pytest.raises(load.LoadError, match="1 clients not served"):
                load.drive([client], lambda c: [load.connect(c.key)], 1, 0.3)
        finally:
            client.close()


def test_a_server_that_ends_at_once_is_an_error() -> None:
    with (
        pytest.raises(RuntimeError, match="has ended with 3"),
        Server(f"{sys.executable} -c 'exit(3)' {{port}}"),
    ):
        pass


def test_a_relay_is_driven_like_an_agent() -> None:
    table = load.messages(load.RELIABLE, 32)
    with Server(RELAY) as server:
        client = load.Client(server.port, 1)
        try:
            flow = load.closed_loop(server, [client], [], 4, table, 0.05)
        finally:
            client.close()
        assert 0 < flow.acked <= flow.sent
        assert server.queue() == (0, 0)
