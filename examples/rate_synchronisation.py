"""Sensors of different rates: ten samples of the IMU are gathered into one message for each scan of the laser.

    python rate_synchronisation.py local:

prints

    laser 0 with IMU 0 to 9
    laser 1 with IMU 10 to 19
    laser 2 with IMU 20 to 29

The trigger lets the fusion begin when a scan and a full set of samples are there, so that each scan meets the samples
of its time, whichever of the two comes first.
"""

from way import open_context

from muros.rclc import Executor, all_of

from std_msgs.msg import Int32, UInt8MultiArray

SAMPLES = 10

context = open_context()
sensors, fusion = context.node("sensors"), context.node("fusion")
imu, laser = sensors.publisher(Int32, "imu"), sensors.publisher(Int32, "laser")
sets = fusion.publisher(UInt8MultiArray, "imu_sets")
ticks = 0
samples: "list[int]" = []
scan = 0


def measure() -> None:
    """What the sensors would do: the laser is now before, now behind the IMU."""
    global ticks
    number = ticks // SAMPLES
    whole = ticks % SAMPLES == SAMPLES - 1
    if whole and number % 2:
        laser.publish(Int32(data=number))
    imu.publish(Int32(data=ticks % 256))
    if whole and not number % 2:
        laser.publish(Int32(data=number))
    ticks += 1


def gather(message: "Int32") -> None:
    """Makes one message of ten."""
    samples.append(message.data)
    if len(samples) == SAMPLES:
        sets.publish(UInt8MultiArray(data=bytes(samples)))
        samples.clear()


def on_laser(message: "Int32") -> None:
    """Keeps the scan."""
    global scan
    scan = message.data


def on_set(message: "UInt8MultiArray") -> None:
    """Fuses the scan with the samples."""
    print(f"laser {scan} with IMU {message.data[0]} to {message.data[-1]}")


on_scan = fusion.subscription(Int32, "laser", on_laser)
on_samples = fusion.subscription(UInt8MultiArray, "imu_sets", on_set)
aggregate = Executor(context)
aggregate.add(fusion.subscription(Int32, "imu", gather))
fuse = Executor(context, trigger=all_of(on_scan, on_samples))
fuse.add(on_scan)
fuse.add(on_samples)
sensors.timer(0.02, measure)

others = Executor(context)  # runs what no executor was given: the timer
while context.running:
    others.spin_some(0.01)
    aggregate.spin_some()
    fuse.spin_some()
