"""The example that looks at the graph sees what others make."""

import pytest

from tests.examples.stage import Stage, interrupt


@pytest.mark.parametrize("way", ["graph", "agent"])
def test_what_others_make_is_seen(stage: Stage, way: str) -> None:
    place = "dds:" if way == "graph" else stage.agent()
    looking = stage.start("graph_introspection", place)
    stage.start("int32_publisher_subscriber", place)
    stage.start("add_two_ints_server", place)
    both = [
        "node /int32_publisher_subscriber",
        "  publishes /int32 [std_msgs/msg/Int32]",
        "  hears /int32 [std_msgs/msg/Int32]",
    ]
    server = ["node /add_two_ints_server", "  serves /add_two_ints [example_interfaces/srv/AddTwoInts]"]

    def seen() -> bool:
        said = "\n".join(looking.lines)
        return "\n".join(both) in said and "\n".join(server) in said

    stage.until(seen)
    interrupt(looking)
