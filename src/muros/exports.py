"""Where the public names of ``muros.client`` and ``muros.rclc`` are, so that a board loads only what its program needs.

Boards borrow this, and with it the modules with a star. What hosts have instead, or beside, is in ``_host``.
"""

from muros.compat import MPY, borrow

PLACES = """
client.custom Custom
*client.discovery discover
*client.link WAITING CONNECTING CONNECTED LOST
*client.presence ping
*client.qos Qos
client.serial Serial
client.session Session
client.tcp Tcp
client.timesync TimeSync
client.uart Uart
client.udp Udp
rclc.action_client ActionClient
rclc.action_server ActionServer
rclc.goal_error GoalError
rclc.client Client
rclc.context Context Node
rclc.diagnostics DiagnosticUpdater
rclc.epoch Epoch
rclc.errors CapacityError InvalidNameError RclError
rclc.executor Executor
rclc.guard GuardCondition
rclc.handle_error HandleError
rclc.illegal TransitionError
rclc.lifecycle Lifecycle
rclc.lifecycle_client LifecycleClient
rclc.logger Logger
rclc.middleware register
rclc.parameter_client ParameterClient
rclc.parameter_errors ParameterError ParameterNotDeclaredError ParameterTypeError ParameterRejectedError
rclc.parameters Parameter Parameters
rclc.ros_time RosTime
rclc.service Service
rclc.memory Rules
rclc.arena Arena Text
rclc.streaming Streamer
rclc.subscription Subscription
rclc.timer Timer
*rclc.semantics ALWAYS LET ON_NEW_DATA RCLCPP
*rclc.overruns CANCEL_CURRENT CANCEL_NEXT CANCEL_WITHOUT_OUTPUT GO_ON LOW_PRIORITY
rclc.triggers all_of always any_of one
"""
if not MPY:
    from muros.compat import HOSTS

    PLACES = HOSTS + PLACES


def find(package: str, name: str) -> object:
    """What a package calls ``name``; AttributeError for what is not there."""
    at = 1
    while at < len(PLACES):  # splitting all of it at once would take a board's heap
        end = PLACES.find("\n", at)
        words = PLACES[at:end].split()
        at = end + 1
        if name not in words:
            continue
        place = words[0].strip("*")
        if place.split(".")[0] == package or name == "Qos":
            if words[0] != place:
                return getattr(borrow("muros." + place), name)
            return getattr(__import__("muros." + place, None, None, (name,)), name)
    raise AttributeError(name)
