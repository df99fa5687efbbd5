"""`muros topic`: what it prints is what `ros2 topic` prints, line for line."""

import asyncio

import pytest

from muros import interfaces
from muros.cli import _rates
from muros.space import CDR_BE, Durability, Qos, Reliability, Topic
from tests.cli.scene import Scene, parse, play

STRING = "std_msgs/msg/String"
String = interfaces.message(STRING)
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def hello(text: str = "hello") -> bytes:
    return bytes(String(data=text).serialize())


def test_list() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/chatter", STRING)
        scene.reader("/listener", "/chatter", STRING)
        scene.reader("/listener", "/cmd_vel", "geometry_msgs/msg/Twist")
        scene.writer("/talker", "/_hidden", STRING)
        scene.node("/talker").writer(Topic("plain", "Square"))
        assert (await scene.muros("topic list")).out == "/chatter\n/cmd_vel\n"
        assert (await scene.muros("topic list -t")).out == (
            "/chatter [std_msgs/msg/String]\n/cmd_vel [geometry_msgs/msg/Twist]\n"
        )
        assert (await scene.muros("topic list -c")).out == "2\n"
        assert (await scene.muros("topic list -a")).out == "/_hidden\n/chatter\n/cmd_vel\n"
        assert (await scene.muros("topic list -v")).out == (
            "Published topics:\n * /chatter [std_msgs/msg/String] 1 publisher\n\n"
            "Subscribed topics:\n * /chatter [std_msgs/msg/String] 1 subscriber\n"
            " * /cmd_vel [geometry_msgs/msg/Twist] 1 subscriber\n\n"
        )
        assert "plain [Square]\n" in (await scene.muros("topic list --dds -t")).out
        assert (await scene.muros("topic find std_msgs/String")).out == "/chatter\n"
        assert (await scene.muros("topic type chatter")).out == "std_msgs/msg/String\n"

    play(scenario)


def test_list_of_an_empty_space_prints_nothing() -> None:
    async def scenario(scene: Scene) -> None:
        assert await scene.muros("topic list") == ("", "", "", 0)
        done = await scene.muros("topic info /chatter")
        assert done.error == ("Unknown topic '/chatter': there is none at all in domain 0; see muros doctor")

    play(scenario)


def test_info() -> None:
    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/greenhouse/talker", "/chatter", STRING, deadline=10**8)
        reader = scene.reader("/listener", "/chatter", STRING, "sensor_data")
        scene.node("").reader(reader.topic, Qos.preset("sensor_data"))
        assert (await scene.muros("topic info /chatter")).out == (
            "Type: std_msgs/msg/String\nPublisher count: 1\nSubscription count: 2\n"
        )
        done = await scene.muros("topic info /chatter -v")
        assert done.err == ""
        assert done.out.startswith(
            f"""\
Type: std_msgs/msg/String

Publisher count: 1

Node name: talker
Node namespace: /greenhouse
Topic type: std_msgs/msg/String
Topic type hash: INVALID
Endpoint type: PUBLISHER
GID: {writer.gid.hex(".")}
QoS profile:
  Reliability: RELIABLE
  History (Depth): KEEP_LAST (10)
  Durability: VOLATILE
  Lifespan: Infinite
  Deadline: 100000000 nanoseconds
  Liveliness: AUTOMATIC
  Liveliness lease duration: Infinite

Subscription count: 2

Node name: listener
"""
        )
        assert "Node name: _CREATED_BY_BARE_DDS_APP_\n" in done.out
        assert done.out.endswith("Liveliness lease duration: Infinite\n\n")

    play(scenario)


def test_info_tells_of_what_does_not_fit() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/chatter", STRING, "sensor_data")
        scene.reader("/listener", "/chatter", STRING)
        done = await scene.muros("topic info /chatter")
        assert done.err.startswith("muros: /talker does not reach /listener: ")
        assert "reliable" in done.err

    play(scenario)


def test_unknown_topic() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/chatter", STRING)
        done = await scene.muros("topic info /chater")
        assert (done.error, done.status) == ("Unknown topic '/chater': did you mean /chatter?", 1)
        done = await scene.muros("topic info '/no good'")
        assert done.status == 2
        assert "' ' is not allowed" in done.error

    play(scenario)


# ---- echo ----


def test_echo_prints_yaml_and_ends_after_so_many() -> None:
    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/talker", "/chatter", STRING)
        echo = scene.start("topic echo /chatter --times 2")
        await scene.until(lambda: writer.matched)
        writer.write(hello("one"))
        writer.write(hello("2"))
        writer.write(hello("three"))
        assert (await echo.end()).out == "data: one\n---\ndata: '2'\n---\n"

    play(scenario)


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        ("", "header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: laser\n"),
        ("--flow-style", "{header: {stamp: {sec: 1, nanosec: 2}, frame_id: laser}, "),
        ("--field header.stamp", "sec: 1\nnanosec: 2\n---\n"),
        ("--field header.frame_id", "laser\n---\n"),
        ("--field ranges[1]", "2.5\n---\n"),
        ("--field ranges -l 2", "- 1.0\n- 2.5\n- '...'\n---\n"),
        ("--csv", "1,2,laser,0.0,0.0,0.0,0.0,0.0,0.0,0.0,1.0,2.5,4.0,\n"),
        ("--csv --no-arr --field header", "1,2,laser\n"),
        ("--filter 'm.sec == 1' --field header.stamp", "sec: 1\nnanosec: 2\n---\n"),
        (
            "--raw -l 16",
            "00000000  01 00 00 00 02 00 00 00  06 00 00 00 6c 61 73 65  |............lase|\n...",
        ),
    ],
)
def test_echo_looks(options: str, shown: str) -> None:
    scan = interfaces.message("sensor_msgs/msg/LaserScan")()
    scan.header.stamp.sec, scan.header.stamp.nanosec, scan.header.frame_id = 1, 2, "laser"
    scan.ranges = [1.0, 2.5, 4.0]

    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/laser", "/scan", "sensor_msgs/msg/LaserScan")
        echo = scene.start(f"topic echo /scan --once {options}")
        await scene.until(lambda: writer.matched)
        writer.write(scan.serialize())
        done = await echo.end()
        assert done.out.startswith(shown)
        assert done.error == ""

    play(scenario)


def test_echo_fits_its_qos_to_the_publishers() -> None:
    async def scenario(scene: Scene) -> None:
        first = scene.writer("/a", "/map", STRING, durability=Durability.TRANSIENT_LOCAL)
        first.write(hello("kept"))
        assert (await scene.muros("topic echo /map --once")).out == "data: kept\n---\n"

        second = scene.writer("/b", "/map", STRING, "sensor_data")
        echo = scene.start("topic echo /map --once")
        await scene.until(lambda: first.matched and second.matched)
        second.write(hello("live"))
        done = await echo.end()
        assert done.out == "data: live\n---\n"
        assert done.err == (
            "muros: /map: some publishers are reliable, others best effort: listening best effort, to hear all\n"
            "muros: /map: some publishers are transient local, others volatile: "
            "listening volatile, to hear all\n"
        )

    play(scenario)


def test_echo_tells_of_publishers_that_do_not_fit_what_was_chosen() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/a", "/map", STRING)
        echo = scene.start("topic echo /map --qos-durability transient_local")
        await scene.until(lambda: "does not match" in echo.err.getvalue())
        scene.writer("/late", "/map", STRING)
        await scene.until(lambda: "muros: /late does not match" in echo.err.getvalue())
        await echo.stop()

    play(scenario)


def test_echo_waits_for_a_topic_that_is_not_there() -> None:
    async def scenario(scene: Scene) -> None:
        echo = scene.start("topic echo chatter --once")
        await scene.until(lambda: "does not appear to be published yet" in echo.err.getvalue())
        writer = scene.writer("/talker", "/chatter", STRING)
        await scene.until(lambda: writer.matched)
        writer.write(hello())
        assert (await echo.end()).out == "data: hello\n---\n"

    play(scenario)


def test_echo_with_a_type_listens_at_once() -> None:
    async def scenario(scene: Scene) -> None:
        echo = scene.start("topic echo chatter std_msgs/String --once")
        await scene.until(lambda: any(r.topic == "rt/chatter" for r in scene.space.graph.readers))
        scene.writer("/talker", "/chatter", STRING).write(hello())
        assert (await echo.end()).out == "data: hello\n---\n"

    play(scenario)


def test_echo_gives_up_in_time() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/chatter", STRING)
        assert await scene.muros("topic echo /chatter --timeout 0.05") == ("", "", "", 0)

    play(scenario)


def test_echo_shows_unknown_types_as_hex_with_a_hint() -> None:
    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/probe", "/probe", "cli_unknown_msgs/msg/Probe")
        echo = scene.start("topic echo /probe --once")
        await scene.until(lambda: writer.matched)
        writer.write(bytes(range(60, 80)))
        done = await echo.end()
        assert done.out == (
            "00000000  3c 3d 3e 3f 40 41 42 43  44 45 46 47 48 49 4a 4b  |<=>?@ABCDEFGHIJK|\n"
            "00000010  4c 4d 4e 4f                                       |LMNO|\n---\n"
        )
        assert "cli_unknown_msgs/msg/Probe, a type without a definition here: say --types FOLDER" in done.err

    play(scenario)


def test_echo_learns_types_from_a_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("ws")
    (folder / "cli_probe_msgs" / "msg").mkdir(parents=True)
    (folder / "cli_probe_msgs" / "msg" / "Probe.msg").write_text("uint8 level\nstring note\n")

    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/probe", "/probe", "cli_probe_msgs/msg/Probe")
        echo = scene.start(f"topic echo /probe --once --types {folder}")
        await scene.until(lambda: writer.matched)
        writer.write(b"\x07\0\0\0\x03\0\0\0ok\0")
        assert (await echo.end()).out == "level: 7\nnote: ok\n---\n"

    play(scenario)


def test_echo_reads_big_endian_and_says_what_it_cannot_read() -> None:
    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/talker", "/x", "std_msgs/msg/Int32")
        echo = scene.start("topic echo /x --times 3")
        await scene.until(lambda: writer.matched)
        writer.write(b"\0\0\0\5", representation=CDR_BE)
        writer.write(b"\5\0\0\0", representation=7)
        writer.write(b"\5\0\0\0", representation=7)
        done = await echo.end()
        assert done.out.startswith("data: 5\n---\n00000000  05 00 00 00  ")
        assert done.err == "muros: samples are encoded as 0x0007, which is no plain CDR; here are the bytes\n"

    play(scenario)


def test_echo_of_bytes_that_do_not_fit_the_type() -> None:
    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/talker", "/chatter", STRING)
        echo = scene.start("topic echo /chatter --once")
        await scene.until(lambda: writer.matched)
        writer.write(b"\xff\0\0\0abc\0")
        done = await echo.end()
        assert done.out.startswith("00000000  ff 00 00 00")
        assert "std_msgs/msg/String: malformed body" in done.err
        assert done.status == 0

    play(scenario)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ("--field dat", "--field dat: std_msgs/msg/String has no field 'dat' (did you mean data?)"),
        ("--field data.x", "--field data.x: there is no field 'x' in str"),
        ("--filter 'm.x'", "--filter m.x: AttributeError: 'String' object has no attribute 'x'"),
        ("--filter 'm.'", "--filter m.: invalid syntax"),
        ("--qos-depth -1", "history depth is -1; it must be from 0 to 2147483647"),
    ],
)
def test_echo_errors(options: str, error: str) -> None:
    async def scenario(scene: Scene) -> None:
        writer = scene.writer("/talker", "/chatter", STRING, durability=Durability.TRANSIENT_LOCAL)
        writer.write(hello())
        done = await scene.muros(f"topic echo /chatter {options}")
        assert done.error == error
        assert done.out == ""

    play(scenario)


def test_echo_of_a_topic_with_two_types() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/a", "/x", STRING)
        scene.writer("/b", "/x", "std_msgs/msg/Int32")
        done = await scene.muros("topic echo /x")
        assert done.error == (
            "/x carries more than one type: std_msgs/msg/Int32, std_msgs/msg/String; name the one to read"
        )

    play(scenario)


# ---- pub ----


def test_pub_once_waits_for_a_subscription() -> None:
    async def scenario(scene: Scene) -> None:
        pub = scene.start("topic pub --once /chatter std_msgs/String 'data: Hello World' --keep-alive 0")
        await scene.until(
            lambda: "Waiting for at least 1 matching subscription(s)...\n" in pub.out.getvalue()
        )
        reader = scene.reader("/listener", "/chatter", STRING)
        done = await pub.end()
        sample = reader.take()
        assert sample is not None
        assert String.deserialize(sample.data).data == "Hello World"
        assert done.out.endswith(
            "publisher: beginning loop\npublishing #1: std_msgs.msg.String(data='Hello World')\n\n"
        )

    play(scenario)


def test_pub_times_and_rate_and_print() -> None:
    async def scenario(scene: Scene) -> None:
        reader = scene.reader("/listener", "/count", "std_msgs/msg/Int32")
        done = await scene.muros("topic pub -t 10 -r 1000 -p 5 --keep-alive 0 /count std_msgs/msg/Int32 7")
        assert done.out.count("publishing #") == 2
        assert reader.pending == 10

    play(scenario)


def test_pub_gives_up_waiting() -> None:
    async def scenario(scene: Scene) -> None:
        done = await scene.muros("topic pub -1 -w 2 --max-wait-time-secs 0.05 /x std_msgs/msg/Int32")
        assert (done.error, done.status) == ("timed out: 0 of 2 subscriptions matched", 1)

    play(scenario)


def test_pub_sets_stamps_at_each_sending() -> None:
    async def scenario(scene: Scene) -> None:
        kind = "geometry_msgs/msg/PointStamped"
        reader = scene.reader("/listener", "/point", kind)
        await scene.muros(
            f"topic pub -t 2 -r 500 --keep-alive 0 /point {kind} '{{header: auto, point: {{x: 1}}}}'"
        )
        made = interfaces.message(kind)
        samples = [reader.take(), reader.take()]
        points = [made.deserialize(sample.data) for sample in samples if sample is not None]
        stamps = [p.header.stamp.sec * 10**9 + p.header.stamp.nanosec for p in points]
        assert stamps == [sample.source_time for sample in samples if sample is not None]
        assert stamps[0] < stamps[1]
        assert points[0].point.x == 1.0

    play(scenario)


def test_pub_goes_under_the_name_of_a_node() -> None:
    async def scenario(scene: Scene) -> None:
        pub = scene.start("topic pub -n lamp /x std_msgs/msg/Int32")
        await scene.until(lambda: "publishing #1" in pub.out.getvalue())
        assert [n.full_name for n in scene.space.graph.nodes] == ["/lamp"]
        await pub.stop()

    play(scenario)


def test_pub_from_a_file_publishes_its_documents_in_turn(tmp_path_factory: pytest.TempPathFactory) -> None:
    file = tmp_path_factory.mktemp("values") / "values.yaml"
    file.write_text("data: 1\n---\ndata: 2\n---\n")

    async def scenario(scene: Scene) -> None:
        reader = scene.reader("/listener", "/x", "std_msgs/msg/Int32")
        await scene.muros(f"topic pub -t 3 -r 500 --keep-alive 0 /x std_msgs/msg/Int32 --yaml-file {file}")
        data = [sample.data for _ in range(3) if (sample := reader.take()) is not None]
        assert [int.from_bytes(each, "little") for each in data] == [1, 2, 1]

    play(scenario)


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("/x std_msgs/msg/Strin", "unknown type 'std_msgs/msg/Strin' (did you mean std_msgs/msg/String?)"),
        ("/x nothing", "'nothing' is no type name: write package/msg/Type, "),
        ("/x std_msgs/msg/String '{dat: 1}'", "std_msgs/msg/String has no field 'dat' (did you mean data?)"),
        ("/x std_msgs/msg/Int8 '{data: 200}'", "field data: 200 is out of the range of int8, -128 to 127"),
        ("/x std_msgs/msg/Int8 '{data: x}'", "field data: 'x' is no int8"),
        ("/x std_msgs/msg/Int8 '{data: 1'", "the values are no YAML at line "),
        (
            "/x geometry_msgs/msg/Twist 5",
            "the values: geometry_msgs/msg/Twist needs its fields by name, as in ",
        ),
        (
            "/x my_own_msgs/msg/A",
            "unknown type 'my_own_msgs/msg/A': say --types FOLDER, where FOLDER holds my_own_msgs/msg/A.msg",
        ),
        (
            "/x std_msgs/msg/Int8 1 --yaml-file x",
            "give the values either as words, by --stdin or by --yaml-file",
        ),
    ],
)
def test_pub_errors(line: str, error: str) -> None:
    async def scenario(scene: Scene) -> None:
        done = await scene.muros(f"topic pub --once {line}")
        assert done.error.startswith(error)
        assert done.status in (1, 2)

    play(scenario)


# ---- rates ----


def test_hz_bw_and_delay_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_rates, "PERIOD", 0.01)

    async def scenario(scene: Scene) -> None:
        kind = "geometry_msgs/msg/PointStamped"
        pub = scene.start(f"topic pub -r 500 -p 0 /point {kind} '{{header: auto}}' --keep-alive 0")
        await scene.until(lambda: scene.space.graph.topic("rt/point"))
        scene.writer("/other", "/quiet", STRING)
        hz = await scene.muros("topic hz /point --times 1 --window 3")
        assert hz.out.startswith("average rate: ")
        assert "\n\tmin: " in hz.out
        table = await scene.muros("topic hz /point /quiet --times 1")
        assert (
            table.out.splitlines()[:3]
            == [
                "Subscribed to [/point]",
                "Subscribed to [/quiet]",
                "topic   rate     min_delta  max_delta  std_dev  window",
            ]
            or "topic " in table.out
        )
        bw = await scene.muros("topic bw /point --times 1")
        assert bw.out.startswith("Subscribed to [/point]\n")
        assert "\n\tMessage size mean: " in bw.out
        delay = await scene.muros("topic delay /point --times 1")
        assert delay.out.startswith("average delay: ")
        done = await scene.muros("topic delay /quiet")
        assert done.error == "std_msgs/msg/String has no header, so it does not tell when it was made"
        await pub.stop()

    play(scenario)


def test_hz_with_a_filter_that_fails_ends_with_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_rates, "PERIOD", 0.01)

    async def scenario(scene: Scene) -> None:
        pub = scene.start("topic pub -r 500 -p 0 /x std_msgs/msg/Int32 --keep-alive 0")
        await scene.until(lambda: scene.space.graph.topic("rt/x"))
        done = await scene.muros("topic hz /x --filter 'm.data > nothing'")
        assert done.error == "--filter m.data > nothing: NameError: name 'nothing' is not defined"
        await pub.stop()

    play(scenario)


def test_options_of_ros2_are_understood() -> None:
    arguments = parse("topic echo /x --no-daemon --spin-time 2 --qos-profile sensor_data -s --lost-messages")
    assert arguments.spin_time == 2
    assert parse("topic pub /x std_msgs/msg/Int32 -1 -w 1 --qos-reliability best_effort").once
    assert parse("topic hz /x -w 10").window == 10


def test_cancelled_commands_leave_nothing() -> None:
    async def scenario(scene: Scene) -> None:
        echo = scene.start("topic echo /x")
        await scene.until(lambda: "does not appear" in echo.err.getvalue())
        await echo.stop()
        await asyncio.sleep(0)
        assert scene.space.graph.participants == ()

    play(scenario)


def test_the_reliability_that_is_chosen_is_taken() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/a", "/x", STRING, durability=Durability.TRANSIENT_LOCAL)
        echo = scene.start("topic echo /x --qos-reliability best_effort")
        await scene.until(lambda: [r for r in scene.space.graph.readers if r.topic == "rt/x"])
        (reader,) = [r for r in scene.space.graph.readers if r.topic == "rt/x"]
        assert reader.qos.reliability == Reliability.BEST_EFFORT
        await echo.stop()

    play(scenario)


def test_echo_fits_publishers_that_are_found_one_after_the_other() -> None:
    async def scenario(scene: Scene) -> None:
        first = scene.writer("/a", "/x", STRING)
        echo = scene.start("topic echo /x --once")
        await asyncio.sleep(0)
        second = scene.writer("/b", "/x", STRING, "sensor_data")
        await scene.until(lambda: first.matched and second.matched)
        second.write(hello("live"))
        assert (await echo.end()).out == "data: live\n---\n"

    play(scenario)
