"""Where the public names of ``muros.client`` and ``muros.rclc`` are, so that a board loads only what its program needs.

Boards borrow this, and with it the modules with a star. What hosts have instead, or beside, is in ``_host``.
"""

from muros.compat import MPY, borrow

PLACES = {
    "client": """
custom Custom
*discovery discover
*link WAITING CONNECTING CONNECTED LOST
*presence ping
*qos Qos
serial Serial
session Session
tcp Tcp
timesync TimeSync
uart Uart
udp Udp
""",
    "rclc": """
action_client ActionClient
action_server ActionServer
goal_error GoalError
client Client
context Context Node
diagnostics DiagnosticUpdater
epoch Epoch
errors CapacityError InvalidNameError RclError
executor Executor
guard GuardCondition
handle_error HandleError
illegal TransitionError
lifecycle Lifecycle
lifecycle_client LifecycleClient
logger Logger
host.middleware register
parameter_client ParameterClient
parameter_errors ParameterError ParameterNotDeclaredError ParameterTypeError ParameterRejectedError
parameters Parameter Parameters
ros_time RosTime
service Service
memory Rules
arena Arena Text
streaming Streamer
subscription Subscription
timer Timer
*semantics ALWAYS LET ON_NEW_DATA RCLCPP
*overruns CANCEL_CURRENT CANCEL_NEXT CANCEL_WITHOUT_OUTPUT GO_ON LOW_PRIORITY
triggers all_of always any_of one
""",
}
if not MPY:
    from muros.compat import HOSTS, names

    PLACES = {package: HOSTS[package] + PLACES[package] for package in PLACES}


def find(package: str, name: str) -> object:
    """What a package calls ``name``; AttributeError for what is not there."""
    if not MPY and name == "__all__":
        return names(PLACES, package)
    if name == "Qos":
        package = "client"
    places = PLACES[package]
    at = 1
    while at < len(places):  # splitting all of it at once would take a board's heap
        end = places.find("\n", at)
        words = places[at:end].split()
        at = end + 1
        if name in words[1:]:
            place = "muros." + package + "." + words[0]
            if "*" in place:
                return getattr(borrow(place.replace("*", "")), name)
            return getattr(__import__(place, None, None, (name,)), name)
    raise AttributeError(name)
