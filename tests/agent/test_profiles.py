"""What references mean: profiles files, the convention of names, and both together."""

from pathlib import Path

import pytest

from muros.agent.profiles import (
    NAMED_READER_QOS,
    NAMED_WRITER_QOS,
    NamedReferences,
    Profiles,
    ProfilesError,
    ReferenceChain,
    UnknownReference,
)
from muros.xrce.representation import (
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    EndpointQos,
    Entity,
    Kind,
    ParticipantEntity,
    PublisherEntity,
    ReplierEntity,
    RequesterEntity,
    SubscriberEntity,
    TopicEntity,
)

REFS = """\
<profiles>
    <participant profile_name="greenhouse">
        <rtps>
            <builtin>
                "<discovery_config>"<leaseDuration>INFINITE</leaseDuration>"</discovery_config>"
                <domainId>4</domainId>
            </builtin>
            <name>greenhouse</name>
        </rtps>
    </participant>
    <topic profile_name="light_topic">
        <kind>WITH_KEY</kind><name>light</name><dataType>Lux</dataType>
    </topic>
    <data_writer profile_name="light_writer">
        <topic>
            <name>light</name><dataType>Lux</dataType>
            <historyQos><kind>KEEP_LAST</kind><depth>5</depth></historyQos>
        </topic>
        <qos><durability><kind>TRANSIENT_LOCAL</kind></durability></qos>
    </data_writer>
    <subscriber profile_name="light_reader">
        <topic><name>light</name><dataType>Lux</dataType></topic>
    </subscriber>
    <requester profile_name="switch" service_name="switch"
               request_type="Q"reply_type="P">
    </requester>
    <replier profile_name="switch" service_name="switch" request_type="Q" reply_type="P"/>
    <types/>
</profiles>
"""

LUX = {"topic_name": "light", "type_name": "Lux"}


def written(folder: Path, text: str, name: str = "agent.refs") -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("rooted", [REFS, f"<dds>{REFS}</dds>"], ids=["profiles", "dds"])
def test_a_file_of_profiles(tmp_path: Path, rooted: str) -> None:
    profiles = Profiles.load(written(tmp_path, rooted))
    assert len(profiles) == 6
    expected: list[tuple[Kind, str, Entity]] = [
        (Kind.PARTICIPANT, "greenhouse", ParticipantEntity("greenhouse", domain=4)),
        (Kind.TOPIC, "light_topic", TopicEntity("light", "Lux", with_key=True)),
        (
            Kind.DATAWRITER,
            "light_writer",
            DataWriterEntity(
                topic_name="light",
                type_name="Lux",
                qos=EndpointQos(depth=5, durability=Durability.TRANSIENT_LOCAL),
            ),
        ),
        (
            Kind.DATAREADER,
            "light_reader",
            DataReaderEntity(topic_name="light", type_name="Lux", qos=EndpointQos(reliable=False)),
        ),
        (Kind.REQUESTER, "switch", RequesterEntity("switch", "Q", "P")),
        (Kind.REPLIER, "switch", ReplierEntity("switch", "Q", "P")),
        (Kind.PUBLISHER, "any", PublisherEntity("any")),
        (Kind.SUBSCRIBER, "any", SubscriberEntity("any")),
    ]
    for kind, name, entity in expected:
        assert profiles.lookup(kind, name) == entity
    assert profiles.names(Kind.DATAWRITER) == ("light_writer",)
    assert profiles.names(Kind.TYPE) == ()


def test_what_has_no_effect_is_told(tmp_path: Path) -> None:
    path = written(tmp_path, REFS)
    assert Profiles.load(path).notes() == (
        f"{path}:2: no effect in profile 'greenhouse': builtin/discovery_config",
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<profiles>\n<topic>\n</profiles>", ":3: not well-formed: mismatched tag"),
        ("", ":1: not well-formed: no element found"),
        ("<profiles>\n\n<topik/></profiles>", ":3: unknown profile <topik>; known here: participant, topic,"),
        ("<profiles>\n<topic><name>T</name></topic></profiles>", ":2: <topic> has no profile_name"),
        (
            '<profiles><topic profile_name="t"><name>T</name></topic>\n'
            '<topic profile_name="t"><name>U</name></topic></profiles>',
            ":2: topic 't' is there already, on line 1",
        ),
        (
            '<profiles><topic profile_name="t">\n<name>T</name>\n<nmae/></topic></profiles>',
            ":3: unknown element <nmae> in <topic>",
        ),
    ],
)
def test_a_bad_file_is_one_line_with_its_place(tmp_path: Path, text: str, reason: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ProfilesError) as caught:
        Profiles.load(path)
    assert str(caught.value).startswith(f"{path}{reason}")
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ProfilesError, match=r"none\.refs: no such file or directory$"):
        Profiles.load(tmp_path / "none.refs")
    with pytest.raises(ProfilesError, match="is a directory"):
        Profiles.load(tmp_path)
    with pytest.raises(ProfilesError, match="bytes of XML, at most 10 are taken"):
        Profiles.load(written(tmp_path, REFS), max_bytes=10)


@pytest.mark.parametrize(
    ("kind", "reference", "reason"),
    [
        (Kind.TOPIC, "light_topik", "did you mean 'light_topic'?"),
        (Kind.TOPIC, "zzz", "it has 'light_topic' of that kind"),
        (Kind.TYPE, "zzz", "it has none of that kind"),
    ],
)
def test_an_unknown_profile(tmp_path: Path, kind: Kind, reference: str, reason: str) -> None:
    path = written(tmp_path, REFS)
    with pytest.raises(UnknownReference) as caught:
        Profiles.load(path).lookup(kind, reference)
    assert str(caught.value) == f"no {kind.name.lower()} profile {reference!r} in {path}: {reason}"


def test_no_profiles_at_all() -> None:
    assert len(Profiles()) == 0
    with pytest.raises(UnknownReference, match=r"no profiles file \(--refs FILE\)"):
        Profiles().lookup(Kind.TOPIC, "x" * 10000)


@pytest.mark.parametrize(
    ("kind", "reference", "entity"),
    [
        (Kind.PARTICIPANT, "default_xrce_participant", ParticipantEntity("default_xrce_participant")),
        (Kind.TOPIC, "ProbeTopic__t", TopicEntity("ProbeTopic")),
        (Kind.TOPIC, "a__t__t", TopicEntity("a__t")),
        (Kind.DATAWRITER, "ProbeTopic__dw", DataWriterEntity(topic_name="ProbeTopic", qos=NAMED_WRITER_QOS)),
        (Kind.DATAREADER, "ProbeTopic__dr", DataReaderEntity(topic_name="ProbeTopic", qos=NAMED_READER_QOS)),
        (Kind.PUBLISHER, "p", PublisherEntity("p")),
        (Kind.SUBSCRIBER, "s", SubscriberEntity("s")),
    ],
)
def test_names_that_say_it_themselves(kind: Kind, reference: str, entity: Entity) -> None:
    assert NamedReferences().lookup(kind, reference) == entity


@pytest.mark.parametrize(
    ("kind", "reference", "reason"),
    [
        (Kind.TOPIC, "ProbeTopic", "topic reference 'ProbeTopic' is not of the form NAME__t"),
        (Kind.TOPIC, "__t", "topic reference '__t' is not of the form NAME__t"),
        (
            Kind.DATAWRITER,
            "ProbeTopic__dr",
            "datawriter reference 'ProbeTopic__dr' is not of the form NAME__dw",
        ),
        (Kind.REQUESTER, "r", "a requester by reference needs a profiles file (--refs FILE)"),
        (Kind.TYPE, "r", "a type by reference needs a profiles file (--refs FILE)"),
    ],
)
def test_names_that_do_not(kind: Kind, reference: str, reason: str) -> None:
    with pytest.raises(UnknownReference) as caught:
        NamedReferences().lookup(kind, reference)
    assert str(caught.value) == reason


def test_profiles_come_before_names(tmp_path: Path) -> None:
    profiles = Profiles.load(
        written(tmp_path, '<profiles><topic profile_name="a__t"><name>other</name></topic></profiles>')
    )
    chain = ReferenceChain(profiles, NamedReferences())
    assert chain.lookup(Kind.TOPIC, "a__t") == TopicEntity("other")
    assert chain.lookup(Kind.TOPIC, "b__t") == TopicEntity("b")
    with pytest.raises(
        UnknownReference, match=r"did you mean 'a__t'\?; topic reference 'a_t' is not of the form"
    ):
        chain.lookup(Kind.TOPIC, "a_t")
