"""`scenewright verify` on tracks that scenewright never made: every event in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.cli.console import count, format_columns, format_one_line, shorten
from scenewright.cli.scene_summary import SAME_MOMENT, describe_avoidability
from scenewright.scene.events import Event, Finding
from scenewright.tools.relation_checker.external_events import ExternalTracks, RecordedEvents

_MEASURES = {
    "collision": (("relative speed", "relative_speed", "m/s"),),
    "near_miss": (("PET", "pet", "s"), ("path TTC", "path_ttc", "s"), ("gap", "clearance", "m")),
    "yielding": (
        ("PET", "pet", "s"),
        ("came at", "approach_speed", "m/s"),
        ("slowed to", "lowest_speed", "m/s"),
    ),
    "follow": (
        ("until", "until", "s"),
        ("headway", "least_headway", "s"),
        ("gap", "least_gap", "m"),
    ),
}
"""The evidence that is shown by type of event; `--json` has all of it."""
SHOWN = 12
"""Contacts, and events with what would have avoided them, listed; `--json` has all."""


@dataclass(frozen=True, eq=False)
class CheckedTracks:
    """A file of tracks and what happens in it.

    Attributes:
        off_map: agents that are off the map, where a map was named.
    """

    path: Path
    tracks: ExternalTracks
    found: RecordedEvents
    off_map: tuple[Finding, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The object of `--json`: agents with their ids in the file, events, findings."""
        return {
            "path": str(self.path),
            "step": self.tracks.step,
            "origin": self.tracks.origin,
            "agents": [_build_agent(self.tracks, k) for k in range(len(self.tracks.users))],
            "events": [event.model_dump(mode="json", by_alias=True) for event in self.found.events],
            "avoidability": list(self.found.avoidability),
            "findings": [
                finding.model_dump(mode="json")
                for finding in (*self.found.contacts, *self.found.implausible, *self.off_map)
            ],
            "notes": list(self.tracks.notes),
        }


def check_tracks(path: Path, *, intersection: str | None) -> list[CheckedTracks]:
    """Every event in a file of tracks, scenario by scenario.

    Raises:
        InputError: unreadable, or no such intersection.
    """
    from scenewright.graph.verify import examine_tracks, load_recordings
    from scenewright.intersections import load_map
    from scenewright.tools.relation_checker.external_events import find_off_map

    checked = []
    for name, tracks in load_recordings(path).items():
        found = examine_tracks(tracks, intersection=intersection)
        off_map = () if intersection is None else find_off_map(tracks, load_map(intersection))
        place = Path(f"{path}:{name}") if name else path
        checked.append(CheckedTracks(place, tracks, found, off_map))
    return checked


def _build_agent(tracks: ExternalTracks, k: int) -> dict[str, Any]:
    user = tracks.users[k]
    return {
        "id": user.id,
        "name": tracks.names[user.id],
        "type": user.shape.type,
        "subtype": tracks.subtypes[user.id],
        "start": round(user.track.start, 3),
        "end": round(user.track.end, 3),
        "length": round(user.shape.length, 3),
        "width": round(user.shape.width, 3),
    }


def format_tracks_report(checked: CheckedTracks) -> str:
    """What was read, a table of the events, what would have avoided them, and what else is odd."""
    titles = ("event", "from", "to", "time", "place", "evidence")
    events = checked.found.plausible
    rows = [_build_row(event, checked.tracks) for event in events]
    listed = format_columns(titles, rows, right={"time", "place"}) if rows else ""
    names = {n: str(n) for n in checked.tracks.names}
    avoided = [
        f"{event.from_} and {event.to} at {event.time:.1f} s, {line}"
        for event in events
        for line in describe_avoidability(event, checked.found.avoidability, names)
    ]
    contacts = [finding.detail for finding in checked.found.contacts]
    below = [*_format_legend(checked), *_format_implausible(checked.found.implausible),
             *shorten(avoided, SHOWN), *shorten(contacts, SHOWN),
             *(finding.detail for finding in checked.off_map)]  # fmt: skip
    said = "".join(format_one_line(line) + "\n" for line in below)
    return _format_headline(checked) + listed + said


def _format_implausible(found: Sequence[Finding]) -> list[str]:
    if not found:
        return []
    which = ", ".join(each.detail for each in found[:SHOWN])
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return [f"{count(len(found), 'collision')} that the tracks deny: {which}{more}"]


def _format_headline(checked: CheckedTracks) -> str:
    users, step = checked.tracks.users, checked.tracks.step
    start, end = min(u.track.start for u in users), max(u.track.end for u in users)
    counts = Counter(event.type.replace("_", " ") for event in checked.found.plausible)
    if checked.found.implausible:
        counts["implausible collision"] = len(checked.found.implausible)
    if checked.found.contacts:
        counts["contact without a collision"] = len(checked.found.contacts)
    found = ", ".join(f"{n} {name}" for name, n in sorted(counts.items())) or "no events"
    agents = count(len(set(checked.tracks.names.values())), "agent")
    what = f"{agents}, {start:.1f} to {end:.1f} s every {step:.3g} s"
    return format_one_line(f"{checked.path}: {what}: {found}") + "\n"


def _build_row(event: Event, tracks: ExternalTracks) -> tuple[str, ...]:
    more = "".join(f", {each.replace('_', ' ')}" for each in (event.kind, event.cause) if each)
    x, y = event.location
    return (
        event.type.replace("_", " ") + more,
        *(f"{n} ({tracks.subtypes[n]})" for n in (event.from_, event.to)),
        f"{event.time:.1f} s",
        f"({x:.1f}, {y:.1f})",
        format_evidence(event),
    )


def format_evidence(event: Event) -> str:
    """The figures of an event that say most."""
    said = []
    for words, key, unit in _MEASURES[event.type]:
        if isinstance(value := event.evidence.get(key), int | float):
            moment = event.when.get(key)
            other = moment is not None and abs(moment.time - event.time) > SAME_MOMENT
            when = f" at {moment.time:.1f} s" if moment is not None and other else ""
            said.append(f"{words} {value:.1f} {unit}{when}")
    return ", ".join(said)


def _format_legend(checked: CheckedTracks) -> list[str]:
    """The agents' ids behind the numbers of the table, where these are not the ids of the file."""
    tracks = checked.tracks
    shown = {n for event in checked.found.events for n in (event.from_, event.to)}
    shown |= {n for finding in checked.found.contacts for n in finding.agents}
    starts = {user.id: user.track.start for user in tracks.users}
    several = Counter(tracks.names.values())
    return [
        f"{n} is {tracks.names[n]}"
        + (f" from {starts[n]:.1f} s" if several[tracks.names[n]] > 1 else "")
        for n in sorted(shown & tracks.renamed)
    ]
