"""What a board offers through `muros agent` is used from rclpy: its parameters are read and set, its action is run."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.dds.domains import Domain
from tests.dds.peers import PROGRAMS, Peer
from tests.dds.test_agent_in_graph import agent

ROS = ("jazzy", "kilted")
Fetch = Callable[[str], Peer]

FIBONACCI = "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n"
SUCCEEDED, CANCELED = 4, 5
INTEGER, STRING = 2, 4


@contextmanager
def board(domain: Domain, folder: Path) -> Iterator[None]:
    """The board and its agent, as processes of their own."""
    (folder / "test_msgs/action").mkdir(parents=True)
    (folder / "test_msgs/action/Fibonacci.action").write_text(FIBONACCI)
    with agent() as port:
        command = [sys.executable, str(PROGRAMS / "board.py"), str(port), str(domain), str(folder)]
        process = subprocess.Popen(command)
        try:
            yield
            assert process.poll() is None, "the board has ended"
        finally:
            process.kill()
            process.wait(20)


@pytest.mark.parametrize("distro", ROS)
def test_parameters_of_a_board_are_read_and_set(
    distro: str, peer: Fetch, domain: Domain, tmp_path: Path
) -> None:
    ros = peer(distro)
    with board(domain, tmp_path):
        node = ros.do("node", name="asker", domain=domain)
        kinds = {"get": "rcl_interfaces/srv/GetParameters", "set": "rcl_interfaces/srv/SetParameters"}
        clients = {
            verb: ros.do("client", node=node, name=f"/lab/board/{verb}_parameters", type=kind)
            for verb, kind in kinds.items()
        }

        def values(*names: str) -> list[tuple[int, int]]:
            (answer,) = ros.do("call", client=clients["get"], request={"names": list(names)})
            return [(value["type"], value["integer_value"]) for value in answer["values"]]

        def put(name: str, **value: Any) -> Any:
            parameter = {"name": name, "value": value}
            (answer,) = ros.do("call", client=clients["set"], request={"parameters": [parameter]})
            return answer["results"]

        assert values("speed", "height") == [(INTEGER, 5), (0, 0)]
        assert put("speed", type=INTEGER, integer_value=-7) == [{"successful": True, "reason": ""}]
        assert values("speed") == [(INTEGER, -7)]
        (refused,) = put("speed", type=STRING, string_value="fast")
        assert refused == {"successful": False, "reason": "there is only an integer speed"}
        assert values("speed") == [(INTEGER, -7)]


@pytest.mark.parametrize("distro", ROS)
def test_an_action_of_a_board_is_run_and_cancelled(
    distro: str, peer: Fetch, domain: Domain, tmp_path: Path
) -> None:
    ros = peer(distro)
    with board(domain, tmp_path):
        node = ros.do("node", name="asker", domain=domain)
        client = ros.do("action_client", node=node, name="/lab/count", type="test_msgs/action/Fibonacci")
        outcome = ros.do("goal", client=client, goal={"order": 6})
        assert outcome["status"] == SUCCEEDED
        assert outcome["result"] == {"sequence": [0, 1, 1, 2, 3, 5, 8, 13]}
        assert [len(piece["sequence"]) for piece in outcome["feedback"]] == [3, 4, 5, 6, 7, 8]
        outcome = ros.do("goal", client=client, goal={"order": 40}, cancel_after=2)
        assert (outcome["cancelled"], outcome["status"]) == (1, CANCELED)
        assert outcome["result"]["sequence"][:4] == [0, 1, 1, 2]
