"""What users program: context, nodes, publishers, subscriptions, services, timers and executors.

    context = Context(Udp("192.168.1.10", 8888))
    node = context.node("thermometer", namespace="greenhouse")
    publisher = node.publisher(Int32, "temperature")
    node.timer(1.0, lambda: publisher.publish(Int32(data=read_sensor())))
    Executor(context).spin()

The same source runs on MicroPython and on CPython. Names are imported when they are first used, so that a board loads
only what its program needs. Hosts have classes that check more and say more, see ``host.context``.
"""

from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.qos import Qos as Qos
    from muros.rclc.arena import Arena as Arena
    from muros.rclc.arena import Text as Text
    from muros.rclc.diagnostics import DiagnosticUpdater as DiagnosticUpdater
    from muros.rclc.epoch import Epoch as Epoch
    from muros.rclc.errors import CapacityError as CapacityError
    from muros.rclc.errors import InvalidNameError as InvalidNameError
    from muros.rclc.errors import RclError as RclError
    from muros.rclc.goal_error import GoalError as GoalError
    from muros.rclc.handle_error import HandleError as HandleError
    from muros.rclc.host.actions import ActionClient as ActionClient
    from muros.rclc.host.actions import ActionServer as ActionServer
    from muros.rclc.host.clock import Clock as Clock
    from muros.rclc.host.context import Context as Context
    from muros.rclc.host.context import Node as Node
    from muros.rclc.host.entities import Client as Client
    from muros.rclc.host.entities import Publisher as Publisher
    from muros.rclc.host.entities import Service as Service
    from muros.rclc.host.events import Event as Event
    from muros.rclc.host.executor import Executor as Executor
    from muros.rclc.host.graph import Endpoint as Endpoint
    from muros.rclc.host.graph import Graph as Graph
    from muros.rclc.host.groups import BEST_EFFORT as BEST_EFFORT
    from muros.rclc.host.groups import REAL_TIME_CRITICAL as REAL_TIME_CRITICAL
    from muros.rclc.host.groups import SOFT_REAL_TIME as SOFT_REAL_TIME
    from muros.rclc.host.groups import CallbackGroup as CallbackGroup
    from muros.rclc.host.groups import RealTimeClass as RealTimeClass
    from muros.rclc.host.groups import ThreadError as ThreadError
    from muros.rclc.host.groups import Threads as Threads
    from muros.rclc.host.handles import GuardCondition as GuardCondition
    from muros.rclc.host.handles import Subscription as Subscription
    from muros.rclc.host.handles import Timer as Timer
    from muros.rclc.host.middleware import register as register
    from muros.rclc.host.parameter_files import ParameterClient as ParameterClient
    from muros.rclc.host.parameters import Parameters as Parameters
    from muros.rclc.host.remapping import ArgumentsError as ArgumentsError
    from muros.rclc.host.remapping import RosArguments as RosArguments
    from muros.rclc.host.remapping import remove_ros_arguments as remove_ros_arguments
    from muros.rclc.host.sense_plan_act import FAWKES_STAGES as FAWKES_STAGES
    from muros.rclc.host.sense_plan_act import SensePlanAct as SensePlanAct
    from muros.rclc.host.workers import Workers as Workers
    from muros.rclc.illegal import TransitionError as TransitionError
    from muros.rclc.lifecycle import Lifecycle as Lifecycle
    from muros.rclc.lifecycle_client import LifecycleClient as LifecycleClient
    from muros.rclc.logger import Logger as Logger
    from muros.rclc.memory import Rules as Rules
    from muros.rclc.overruns import CANCEL_CURRENT as CANCEL_CURRENT
    from muros.rclc.overruns import CANCEL_NEXT as CANCEL_NEXT
    from muros.rclc.overruns import CANCEL_WITHOUT_OUTPUT as CANCEL_WITHOUT_OUTPUT
    from muros.rclc.overruns import GO_ON as GO_ON
    from muros.rclc.overruns import LOW_PRIORITY as LOW_PRIORITY
    from muros.rclc.parameter_errors import ParameterError as ParameterError
    from muros.rclc.parameter_errors import ParameterNotDeclaredError as ParameterNotDeclaredError
    from muros.rclc.parameter_errors import ParameterRejectedError as ParameterRejectedError
    from muros.rclc.parameter_errors import ParameterTypeError as ParameterTypeError
    from muros.rclc.parameters import Parameter as Parameter
    from muros.rclc.ros_time import RosTime as RosTime
    from muros.rclc.semantics import ALWAYS as ALWAYS
    from muros.rclc.semantics import LET as LET
    from muros.rclc.semantics import ON_NEW_DATA as ON_NEW_DATA
    from muros.rclc.semantics import RCLCPP as RCLCPP
    from muros.rclc.streaming import Streamer as Streamer
    from muros.rclc.triggers import all_of as all_of
    from muros.rclc.triggers import always as always
    from muros.rclc.triggers import any_of as any_of
    from muros.rclc.triggers import one as one


def __getattr__(name: str) -> object:
    return borrow("muros.exports").find("rclc", name)
