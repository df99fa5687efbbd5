"""Random life in a local space, beside rules that must hold whatever happens.

Writers and readers of several kinds come, write, take, go, and time passes. For each reader the test keeps what
the accepted writes should have brought it; conservation, order, bounds and patience are checked at every step.
"""

from collections import Counter

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from muros.space import Durability, History, Qos, Reader, Reliability, Topic, Writer, mismatches, open_space

MS = 1_000_000
LIMIT = 4
PATIENCE = 100 * MS
TOPICS = [
    Topic("rt/a", "T"),
    Topic("rt/a", "T"),
    Topic("rt/a", "T"),
    Topic("rt/b", "T"),
    Topic("rt/a", "Other"),
]
KINDS = [
    Qos(depth=1),
    Qos(depth=3),
    Qos(Reliability.BEST_EFFORT, depth=2),
    Qos(Reliability.BEST_EFFORT, history=History.KEEP_ALL),
    Qos(history=History.KEEP_ALL),
    Qos(depth=3, durability=Durability.TRANSIENT_LOCAL),
    Qos(history=History.KEEP_ALL, durability=Durability.TRANSIENT_LOCAL),
    Qos(depth=2, lifespan=50 * MS),
]


class ReaderModel:
    """What is known of one reader."""

    def __init__(self, reader: Reader) -> None:
        self.reader = reader
        self.came: list[bytes] = []
        self.taken: list[bytes] = []
        self.calls = 0
        self.limit = LIMIT if reader.qos.keeps_all else reader.qos.depth


class WriterModel:
    """What is known of one writer."""

    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        self.written = 0
        self.kept: list[tuple[bytes, int]] = []
        self.refused_at: int | None = None
        self.rooms = 0


class LifeInASpace(RuleBasedStateMachine):
    """The machine that hypothesis drives."""

    @initialize()
    def open(self) -> None:
        self.now = 0
        self.space = open_space(
            clock=lambda: self.now, resource_limit=LIMIT, max_blocking_time=PATIENCE, callbacks=3
        )
        self.readers: list[ReaderModel] = []
        self.writers: list[WriterModel] = []
        self.node = self.space.participant("node")

    @precondition(lambda self: len(self.writers) < 4)
    @rule(topic=st.sampled_from(TOPICS), qos=st.sampled_from(KINDS))
    def writer_comes(self, topic: Topic, qos: Qos) -> None:
        model = WriterModel(self.node.writer(topic, qos))

        def on_room() -> None:
            model.rooms += 1

        model.writer.on_room = on_room
        self.writers.append(model)

    @precondition(lambda self: len(self.readers) < 4)
    @rule(topic=st.sampled_from(TOPICS), qos=st.sampled_from(KINDS), told=st.booleans())
    def reader_comes(self, topic: Topic, qos: Qos, told: bool) -> None:
        def on_data(reader: Reader) -> None:
            assert reader is model.reader
            assert reader.pending or reader.expired, "called for nothing"
            model.calls += 1

        model = ReaderModel(self.node.reader(topic, qos, on_data if told else None))
        history = [
            data
            for w in self.writers
            if self._meet(w.writer, model.reader) and qos.durability is not Durability.VOLATILE
            for data, expires in w.kept
            if not expires or expires > self.now
        ]
        if model.reader.lost == 0:
            model.came = history[-model.limit :]
            assert model.reader.pending == len(model.came)
        else:  # several histories, more than a reader that keeps all can hold
            assert qos.keeps_all
            model.came = history[: model.limit] + [b""] * model.reader.lost
        self.readers.append(model)

    @precondition(lambda self: self.writers)
    @rule(data=st.data(), times=st.integers(1, LIMIT + 2))
    def write(self, data: st.DataObject, times: int) -> None:
        model = data.draw(st.sampled_from(self.writers))
        for _ in range(times):
            self._write(model)

    def _write(self, model: WriterModel) -> None:
        writer = model.writer
        body = f"{self.writers.index(model)} {writer.gid.hex()} {model.written}".encode()
        peers = [r for r in self.readers if self._meet(writer, r.reader)]
        assert Counter(writer.matched) == Counter(r.reader.gid for r in peers)
        stoppers = [
            r
            for r in peers
            if r.reader.qos.keeps_all
            and r.reader.qos.reliability is Reliability.RELIABLE
            and r.reader.pending == LIMIT
        ]
        if not writer.write(body):
            assert stoppers, "refused without a full reader"
            if model.refused_at is None:
                model.refused_at = self.now
            assert self.now < model.refused_at + PATIENCE, "refused for too long"
            return
        model.refused_at = None
        model.written += 1
        if writer.qos.durability is not Durability.VOLATILE:
            limit = LIMIT if writer.qos.keeps_all else writer.qos.depth
            expires = self.now + writer.qos.lifespan if writer.qos.lifespan else 0
            model.kept = [*model.kept, (body, expires)][-limit:]
        for peer in peers:
            peer.came.append(body)

    @precondition(lambda self: self.readers)
    @rule(data=st.data())
    def take(self, data: st.DataObject) -> None:
        model = data.draw(st.sampled_from(self.readers))
        pending = model.reader.pending
        sample = model.reader.take()
        assert (sample is None) == (pending == 0)
        if sample is not None:
            assert not sample.expires or sample.expires > self.now
            assert sample.data in model.came
            model.taken.append(sample.data)

    @precondition(lambda self: len(self.readers) > 2)
    @rule(data=st.data())
    def reader_goes(self, data: st.DataObject) -> None:
        model = data.draw(st.sampled_from(self.readers))
        self.readers.remove(model)
        model.reader.close()
        assert model.reader.take() is None

    @precondition(lambda self: len(self.writers) > 2)
    @rule(data=st.data())
    def writer_goes(self, data: st.DataObject) -> None:
        model = data.draw(st.sampled_from(self.writers))
        self.writers.remove(model)
        model.writer.close()

    @rule(ms=st.sampled_from([1, 30, 99, 100, 500]))
    def time_passes(self, ms: int) -> None:
        self.now += ms * MS
        for _ in range(100):
            due = self.space.tick()
            if due is None or due > self.now:
                break
        else:
            raise AssertionError("never done")

    @precondition(lambda self: len(self.writers) + len(self.readers) > 5)
    @rule()
    def everybody_goes(self) -> None:
        self.node.close()
        assert not self.space.graph.topics
        assert not self.space.graph.participants
        self.node = self.space.participant("node")
        self.readers, self.writers = [], []

    @invariant()
    def nothing_appears_or_vanishes(self) -> None:
        for model in getattr(self, "readers", ()):
            reader = model.reader
            pending = reader.pending
            assert pending <= model.limit
            assert len(model.came) == len(model.taken) + reader.lost + reader.expired + pending

    @invariant()
    def each_writer_is_heard_in_order_and_once(self) -> None:
        for model in getattr(self, "readers", ()):
            heard: dict[str, list[int]] = {}
            for body in model.taken:
                _, gid, number = body.decode().split()
                heard.setdefault(gid, []).append(int(number))
            for numbers in heard.values():
                assert numbers == sorted(set(numbers))

    @invariant()
    def the_graph_agrees(self) -> None:
        if not hasattr(self, "space"):
            return
        matches = {pair for topic in self.space.graph.topics for pair in topic.matches}
        wanted = {
            (w.writer.gid, r.reader.gid)
            for w in self.writers
            for r in self.readers
            if self._meet(w.writer, r.reader)
        }
        assert matches == wanted

    def teardown(self) -> None:
        if hasattr(self, "space"):
            for model in self.readers:
                if not model.reader.qos.keeps_all and not model.reader.expired:
                    rest = []
                    while (sample := model.reader.take()) is not None:
                        rest.append(sample.data)
                    if not model.reader.expired:
                        assert rest == model.came[len(model.came) - len(rest) :], "keep last keeps the last"
            self.space.close()
            assert self.space.tick() is None

    @staticmethod
    def _meet(writer: Writer, reader: Reader) -> bool:
        return writer.topic == reader.topic and not mismatches(writer.qos, reader.qos)


TestLifeInASpace = LifeInASpace.TestCase
TestLifeInASpace.settings = settings(max_examples=100, stateful_step_count=50, deadline=None)
