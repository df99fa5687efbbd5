"""A node with parameters that others read and set.

    python parameter_server.py dds:                  # then: muros param set /robot max_speed 1.5

prints

    max_speed 0.5 -> 1.5
"""

from way import open_context

from muros.rclc import Executor

context = open_context()
node = context.node("robot")
parameters = node.parameters()
parameters.declare("name", "marvin", read_only=True)
parameters.declare("max_speed", 0.5, range=(0.0, 2.0), description="m/s")
parameters.declare("lights", False)


def change(old: object, new: object) -> bool:
    """Agrees to a change; False would refuse it."""
    print(new.name, old.value, "->", new.value)  # type: ignore[attr-defined]
    return True


parameters.on_change(change)
Executor(context).spin()
