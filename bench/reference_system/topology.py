"""The nodes of the reference system and how they are connected, as data. Every topic is named after who publishes it.

Sensors publish with a period. A transform answers each sample of its input. A fusion answers when both of its inputs
have come. The cyclic node publishes with a period what has come since. The intersection is two transforms in one node.
Commands are where the paths end.
"""

from dataclasses import dataclass
from typing import Final

__all__ = [
    "COMMANDS",
    "CYCLIC",
    "FUSIONS",
    "HOT_PATH",
    "HOT_PATH_ROOTS",
    "HOT_PATH_SINK",
    "INTERSECTION",
    "PLANNER",
    "SENSORS",
    "TRANSFORMS",
    "Cyclic",
    "inputs_of",
    "node_names",
    "outputs_of",
]


@dataclass(frozen=True)
class Cyclic:
    """The node that plans: its name, its period in seconds and its inputs."""

    name: str
    period: float
    inputs: tuple[str, ...]


SENSORS: Final = {
    "FrontLidarDriver": 0.100,
    "RearLidarDriver": 0.100,
    "PointCloudMap": 0.120,
    "Visualizer": 0.060,
    "Lanelet2Map": 0.100,
    "EuclideanClusterSettings": 0.025,
}
"""Periods in seconds."""

TRANSFORMS: Final = {
    "PointsTransformerFront": "FrontLidarDriver",
    "PointsTransformerRear": "RearLidarDriver",
    "VoxelGridDownsampler": "PointCloudFusion",
    "PointCloudMapLoader": "PointCloudMap",
    "RayGroundFilter": "PointCloudFusion",
    "ObjectCollisionEstimator": "EuclideanClusterDetector",
    "MPCController": "BehaviorPlanner",
    "ParkingPlanner": "Lanelet2MapLoader",
    "LanePlanner": "Lanelet2MapLoader",
}
"""What each listens to."""

FUSIONS: Final = {
    "PointCloudFusion": ("PointsTransformerFront", "PointsTransformerRear"),
    "NDTLocalizer": ("VoxelGridDownsampler", "PointCloudMapLoader"),
    "VehicleInterface": ("MPCController", "BehaviorPlanner"),
    "Lanelet2GlobalPlanner": ("Visualizer", "NDTLocalizer"),
    "Lanelet2MapLoader": ("Lanelet2Map", "Lanelet2GlobalPlanner"),
}

CYCLIC: Final = Cyclic(
    "BehaviorPlanner",
    0.100,
    (
        "ObjectCollisionEstimator",
        "NDTLocalizer",
        "Lanelet2GlobalPlanner",
        "Lanelet2MapLoader",
        "ParkingPlanner",
        "LanePlanner",
    ),
)

INTERSECTION: Final = {
    "EuclideanClusterDetector": (
        ("RayGroundFilter", "EuclideanClusterDetector"),
        ("EuclideanClusterSettings", "EuclideanIntersection"),
    ),
}
"""Inputs and outputs of its two paths."""

COMMANDS: Final = {"VehicleDBWSystem": "VehicleInterface", "IntersectionOutput": "EuclideanIntersection"}

HOT_PATH_ROOTS: Final = ("FrontLidarDriver", "RearLidarDriver")
HOT_PATH_SINK: Final = "ObjectCollisionEstimator"
HOT_PATH: Final = (
    *HOT_PATH_ROOTS,
    "PointsTransformerFront",
    "PointsTransformerRear",
    "PointCloudFusion",
    "RayGroundFilter",
    "EuclideanClusterDetector",
    HOT_PATH_SINK,
)
"""From the lidars to the estimate of collisions: what must be fast."""
PLANNER: Final = CYCLIC.name


def node_names() -> tuple[str, ...]:
    """Every node: the sensors first, then the way of the data."""
    return (*SENSORS, *TRANSFORMS, *FUSIONS, CYCLIC.name, *INTERSECTION, *COMMANDS)


def inputs_of(node: str) -> tuple[str, ...]:
    """The topics that a node listens to."""
    if node in TRANSFORMS:
        return (TRANSFORMS[node],)
    if node in FUSIONS:
        return FUSIONS[node]
    if node == CYCLIC.name:
        return CYCLIC.inputs
    if node in INTERSECTION:
        return tuple(path[0] for path in INTERSECTION[node])
    return (COMMANDS[node],) if node in COMMANDS else ()


def outputs_of(node: str) -> tuple[str, ...]:
    """The topics that a node publishes on."""
    if node in INTERSECTION:
        return tuple(path[1] for path in INTERSECTION[node])
    return () if node in COMMANDS else (node,)
