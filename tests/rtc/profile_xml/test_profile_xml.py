"""RTC profiles: written, read, read from files of editors, refused."""

from pathlib import Path
from xml.etree.ElementTree import fromstring

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtc.profile_xml import (
    ACTIONS,
    DataPortProfile,
    ParameterProfile,
    ProfileError,
    RtcProfile,
    ServiceInterfaceProfile,
    ServicePortProfile,
    constraint_element,
    constraint_text,
    read_profile_file,
    read_profile_untrusted,
    write_profile,
)

EDITORS = """<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<rtc:RtcProfile rtc:version="0.2" rtc:id="RTC:AIST:Test:Arm:1.0.0"
    xmlns:rtcExt="http://www.openrtp.org/namespaces/rtc_ext" xmlns:rtcDoc="http://www.openrtp.org/namespaces/rtc_doc"
    xmlns:rtc="http://www.openrtp.org/namespaces/rtc" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
    <rtc:BasicInfo xsi:type="rtcExt:basic_info_ext" rtcExt:saveProject="Arm" rtc:version="1.0.0" rtc:vendor="AIST"
        rtc:maxInstances="1" rtc:executionType="PeriodicExecutionContext" rtc:executionRate="500.0"
        rtc:description="an arm" rtc:category="Test" rtc:componentKind="DataFlowComponent"
        rtc:activityType="PERIODIC" rtc:componentType="STATIC" rtc:name="Arm">
        <rtcExt:VersionUpLogs>first</rtcExt:VersionUpLogs>
    </rtc:BasicInfo>
    <rtc:Actions>
        <rtc:OnInitialize xsi:type="rtcDoc:action_status_doc" rtc:implemented="true"/>
        <rtc:OnExecute xsi:type="rtcDoc:action_status_doc" rtc:implemented="false"/>
        <rtc:OnSomethingElse rtc:implemented="true"/>
    </rtc:Actions>
    <rtc:ConfigurationSet>
        <rtc:Configuration xsi:type="rtcExt:configuration_ext" rtcExt:variableName="" rtc:unit="m"
            rtc:defaultValue="1" rtc:type="int" rtc:name="length">
            <rtc:Constraint><rtc:ConstraintUnitType><rtc:propertyIsBetween>
                <rtc:LowerBoundary><rtc:Literal>0</rtc:Literal></rtc:LowerBoundary>
                <rtc:UpperBoundary><rtc:Literal>9</rtc:Literal></rtc:UpperBoundary>
            </rtc:propertyIsBetween></rtc:ConstraintUnitType></rtc:Constraint>
            <rtcExt:Properties rtcExt:value="slider.1" rtcExt:name="__widget__"/>
        </rtc:Configuration>
    </rtc:ConfigurationSet>
    <rtc:DataPorts xsi:type="rtcExt:dataport_ext" rtcExt:position="LEFT" rtc:subscriprionType="flush"
        rtc:type="RTC::TimedLong" rtc:name="in" rtc:portType="DataInPort"/>
    <rtc:ServicePorts xsi:type="rtcExt:serviceport_ext" rtc:name="sv">
        <rtc:ServiceInterface rtc:type="SimpleService::MyService" rtc:idlFile="MyService.idl" rtc:instanceName="my"
            rtc:direction="Provided" rtc:name="MyService"/>
    </rtc:ServicePorts>
    <rtc:Language xsi:type="rtcExt:language_ext" rtc:kind="C++"/>
</rtc:RtcProfile>
"""


def test_a_file_as_editors_write_it(tmp_path: Path) -> None:
    path = tmp_path / "RTC.xml"
    path.write_text(EDITORS)
    profile = read_profile_file(path)
    assert profile == RtcProfile(
        "Arm",
        "1.0.0",
        "AIST",
        "Test",
        "an arm",
        execution_rate=500.0,
        language="C++",
        actions={"OnInitialize": True, "OnExecute": False},
        parameters=(ParameterProfile("length", "int", "1", "m", "0<=x<=9", "slider.1"),),
        data_ports=(DataPortProfile("in", "DataInPort", "RTC::TimedLong", subscription_type="flush"),),
        service_ports=(
            ServicePortProfile(
                "sv",
                (
                    ServiceInterfaceProfile(
                        "MyService", "my", "SimpleService::MyService", True, "MyService.idl"
                    ),
                ),
            ),
        ),
    )
    assert profile.id == "RTC:AIST:Test:Arm:1.0.0"
    assert read_profile_untrusted(write_profile(profile).encode(), "again") == profile


def test_prefixes_of_types_are_declared() -> None:
    text = write_profile(RtcProfile("A", actions={"OnExecute": True}))
    for prefix in ("rtc", "rtcExt", "rtcDoc", "xsi"):
        assert text.count(f"xmlns:{prefix}=") == 1
    assert 'xsi:type="rtcDoc:action_status_doc"' in text
    with_extensions = write_profile(RtcProfile("A", data_ports=(DataPortProfile("o", "DataOutPort", "T"),)))
    assert with_extensions.count("xmlns:rtcExt=") == 1


TEXT = st.text(
    st.characters(min_codepoint=32, max_codepoint=0x2FF, exclude_characters="\x7f"), max_size=8
).map(str.strip)
NAME = TEXT.filter(bool)
PARAMETERS = st.builds(
    ParameterProfile,
    NAME,
    TEXT,
    TEXT,
    TEXT,
    st.sampled_from(["", "0<=x<=10", "0<x<=10", "x>=-1.5", "x<3", "(a,b,c)", "only", "{a:b}"]),
    TEXT,
)
DATA_PORTS = st.builds(
    DataPortProfile,
    NAME,
    st.sampled_from(["DataInPort", "DataOutPort", "EventPort"]),
    TEXT,
    TEXT,
    TEXT,
    TEXT,
    TEXT,
    TEXT,
)
INTERFACES = st.builds(ServiceInterfaceProfile, TEXT, TEXT, TEXT, st.booleans(), TEXT)
PROFILES = st.builds(
    RtcProfile,
    name=NAME,
    version=TEXT,
    vendor=TEXT,
    category=TEXT,
    description=TEXT,
    execution_rate=st.none() | st.floats(0, 1e9),
    max_instances=st.integers(0, 1000),
    abstract=TEXT,
    language=TEXT,
    actions=st.dictionaries(st.sampled_from(ACTIONS), st.booleans()),
    parameters=st.lists(PARAMETERS, max_size=3).map(tuple),
    data_ports=st.lists(DATA_PORTS, max_size=3).map(tuple),
    service_ports=st.lists(
        st.builds(ServicePortProfile, NAME, st.lists(INTERFACES, max_size=2).map(tuple)), max_size=2
    ).map(tuple),
)


@given(PROFILES)
def test_what_is_written_reads_back(profile: RtcProfile) -> None:
    assert read_profile_untrusted(write_profile(profile).encode(), "x") == profile


@pytest.mark.parametrize(
    ("text", "back"),
    [
        ("0<=x<=10", "0<=x<=10"),
        ("0 < x <= 10", "0<x<=10"),
        ("0<=x<10", "0<=x<10"),
        ("x>0", "x>0"),
        ("3>=x", "x<=3"),
        ("(a, b,c)", "(a,b,c)"),
        ("a", "a"),
    ],
)
def test_constraints_both_ways(text: str, back: str) -> None:
    element = constraint_element(text)
    assert element is not None
    assert constraint_text(element) == back


@pytest.mark.parametrize("text", ["", "{a:b}", "x", "0<=y<=1", "a b"])
def test_texts_without_a_tree(text: str) -> None:
    element = constraint_element(text)
    assert element is None or constraint_text(element) == text


@pytest.mark.parametrize(
    "inner",
    [
        "",
        "<rtc:Not><rtc:ConstraintUnitType/></rtc:Not>",
        "<rtc:And/>",
        "<rtc:Or><rtc:propertyIsLessThan><rtc:Literal>1</rtc:Literal></rtc:propertyIsLessThan></rtc:Or>",
        "<rtc:And><rtc:propertyIsEqualTo><rtc:Literal>1</rtc:Literal></rtc:propertyIsEqualTo></rtc:And>",
        "<rtc:propertyIsBetween/>",
        "<rtc:And>" * 30 + "</rtc:And>" * 30,
    ],
)
def test_trees_that_no_text_says(inner: str) -> None:
    space = 'xmlns:rtc="http://www.openrtp.org/namespaces/rtc"'
    assert constraint_text(fromstring(f"<rtc:Constraint {space}>{inner}</rtc:Constraint>")) == ""


BOMB = """<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]><x>&b;</x>"""
FILE = """<?xml version="1.0"?><!DOCTYPE x [<!ENTITY f SYSTEM "file:///etc/passwd">]><x>&f;</x>"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x:1: no XML: no element found"),
        ("<a>", "x:1: no XML: no element found"),
        ("<a/>", "its root is 'a', not RtcProfile of http"),
        (BOMB, "it has a document type"),
        (FILE, "it has a document type"),
        ("<a>" * 100 + "</a>" * 100, "elements more than 64 deep"),
        (EDITORS.replace('rtc:name="Arm"', 'rtc:name=" "'), "no BasicInfo with a name"),
        (EDITORS.replace('"500.0"', '"fast"'), "executionRate is 'fast'; it is a number from 0 on"),
        (EDITORS.replace('rtc:maxInstances="1"', 'rtc:maxInstances="-1"'), "maxInstances is '-1'"),
        (EDITORS.replace('rtc:maxInstances="1"', 'rtc:maxInstances="nan"'), "maxInstances is 'nan'"),
        ('<?xml version="1.0" encoding="klingon"?><a/>', "x:1: no XML: "),
    ],
)
def test_hostile_and_broken_files(text: str, message: str) -> None:
    with pytest.raises(ProfileError, match=message):
        read_profile_untrusted(text.encode(), "x")


def test_files_too_large_or_missing(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="more than 4 MiB"):
        read_profile_untrusted(b" " * ((4 << 20) + 1), "x")
    with pytest.raises(ProfileError, match="cannot be read: No such file"):
        read_profile_file(tmp_path / "none.xml")


@given(st.binary(max_size=100) | st.integers(0, len(EDITORS)).map(lambda n: EDITORS[:n].encode()))
def test_any_octets_are_read_or_refused(octets: bytes) -> None:
    try:
        profile = read_profile_untrusted(octets, "x")
    except ProfileError:
        return
    assert profile.name == "Arm"
