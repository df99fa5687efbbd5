"""The Autoware reference system: a standardised workload of 24 nodes, to compare executors by the same measures."""

from bench.reference_system.message import CAPACITY, Entry, Message
from bench.reference_system.nodes import System, count_primes
from bench.reference_system.report import Measures, Statistic
from bench.reference_system.topology import HOT_PATH, PLANNER, inputs_of, node_names, outputs_of

__all__ = [
    "CAPACITY",
    "HOT_PATH",
    "PLANNER",
    "Entry",
    "Measures",
    "Message",
    "Statistic",
    "System",
    "count_primes",
    "inputs_of",
    "node_names",
    "outputs_of",
]
