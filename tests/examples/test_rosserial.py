"""The example of a rosserial board does what it says, with the server's own words and `muros topic` beside it."""

import re

from tests.cli.shell import Shell
from tests.examples.stage import Stage, interrupt


def test_leds_are_switched_from_the_graph(stage: Stage) -> None:
    shell = Shell(stage.domain)
    with shell.running("rosserial --tcp 0 --bind 127.0.0.1 --name opencr") as server:
        found = re.search(r"tcp4 127\.0\.0\.1:(\d+)", server.line("tcp4"))
        assert found
        board = stage.start("rosserial_board", f"127.0.0.1:{found[1]}")
        assert "[std_msgs/Byte]" in server.line("Setup subscriber on led_out")
        server.line("node /opencr")
        stage.until(lambda: board.lines == ["connected"])
        for number in (1, 2, 4, 8, 0):
            assert shell.run(f"topic pub -1 /led_out std_msgs/msg/Byte '{{data: {number}}}'").returncode == 0
            stage.until(lambda: len(board.lines) > 1)
            assert board.lines.pop() == f"LEDs: {number:04b}"
        called = shell.run("service call /buzzer std_srvs/srv/Trigger")
        assert "loud and clear" in called.stdout
        assert board.lines.pop() == "buzz"
        echoed = shell.run("topic echo --once /battery")
        assert "12.5" in echoed.stdout
        interrupt(board)
