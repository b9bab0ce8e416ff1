"""Results as JUnit XML, which continuous integration reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree


class Case(NamedTuple):
    """One test: its class, its name, why it failed if it did, and how long it took [s]."""

    group: str
    name: str
    fault: str | None = None
    time: float | None = None


def build_junit(suites: Mapping[str, Sequence[Case]]) -> bytes:
    """The document of suites by name; the first line of a fault is its message."""
    root = ElementTree.Element("testsuites")
    for suite, cases in suites.items():
        failed = sum(case.fault is not None for case in cases)
        counts = {"tests": str(len(cases)), "failures": str(failed)}
        held = ElementTree.SubElement(root, "testsuite", {"name": suite} | counts)
        for case in cases:
            entry = ElementTree.SubElement(held, "testcase", classname=case.group, name=case.name)
            if case.time is not None:
                entry.set("time", str(case.time))
            if case.fault is not None:
                fault = "".join(c if c.isprintable() or c == "\n" else " " for c in case.fault)
                failure = ElementTree.SubElement(entry, "failure", message=fault.split("\n")[0])
                failure.text = fault
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))
