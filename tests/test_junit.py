"""JUnit XML: what an XML parser reads of it."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from rosbridge_sim.junit import Case, write_suite


def test_suite_counts_its_cases() -> None:
    cases = [Case("a", "one"), Case("a", "two", failure='<"no">'), Case("b", "three", skipped="why")]
    suite = ET.fromstring(write_suite("s & t", cases))  # noqa: S314 - our own text
    assert suite.attrib == {"name": "s & t", "tests": "3", "failures": "1", "skipped": "1"}
    assert [(case.get("classname"), case.get("name")) for case in suite] == [("a", "one"), ("a", "two"), ("b", "three")]
    assert [child.tag for case in suite for child in case] == ["failure", "skipped"]
    assert suite[1][0].get("message") == '<"no">'


def test_characters_that_xml_lacks_are_replaced() -> None:
    suite = ET.fromstring(write_suite("s", [Case("a", "x\0y\x1b\ufffe")]))  # noqa: S314 - as above
    assert suite[0].get("name") == "x?y??"


def test_suite_without_cases_is_read() -> None:
    assert ET.fromstring(write_suite("s", [])).get("tests") == "0"  # noqa: S314 - as above
