"""What the card and the pictures of a dataset report, counted row by row."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenewright.dataset.tables.coverage import Encounter, list_encounters
from scenewright.dataset.tables.parquet import SceneFiles
from scenewright.geometry.kinematics import differentiate
from scenewright.scene.events import Proof

MOVING = 0.5
"""Slower than this an agent stands [m/s]."""
_MEASURES: Mapping[str, tuple[str, str]] = {
    "pet": ("post-encroachment time", "s"),
    "ttc_2d": ("least time to collision straight on", "s"),
    "path_ttc": ("least time to collision along paths", "s"),
    "drac": ("deceleration needed to avoid the crash", "m/s²"),
    "clearance": ("least clearance", "m"),
    "relative_speed": ("closing speed at contact", "m/s"),
}
"""Key of the checker's evidence -> what it is, and its unit."""


@dataclass
class Tally:
    """Counts over the rows of a dataset.

    Attributes:
        statuses, codes, tables: rows by what became of them, by why there is no scene, by table.
        events, causes: by type and whether they were asked for; by type and cause, those asked for.
        patterns, intersections, verdicts, unshown: scenes by these; by words that they do not show.
        agents: scenes by their number of agents; unlawful, worse: scenes with a red light run
            unasked, and with something worse between the two than in their event.
        places: type of event -> x [m], y [m], time [s] of each, one after the other.
        figures: name with its unit -> values; encounters: of the verified scenes.
    """

    statuses: Counter[str] = field(default_factory=Counter)
    codes: Counter[str] = field(default_factory=Counter)
    tables: Counter[str] = field(default_factory=Counter)
    events: Counter[tuple[str, str]] = field(default_factory=Counter)
    causes: Counter[tuple[str, str]] = field(default_factory=Counter)
    patterns: Counter[str] = field(default_factory=Counter)
    intersections: Counter[str] = field(default_factory=Counter)
    verdicts: Counter[str] = field(default_factory=Counter)
    unshown: Counter[str] = field(default_factory=Counter)
    agents: Counter[int] = field(default_factory=Counter)
    unlawful: int = 0
    worse: int = 0
    places: dict[str, array[float]] = field(default_factory=dict)
    figures: dict[str, array[float]] = field(default_factory=dict)
    encounters: list[Encounter] = field(default_factory=list)

    def note(self, files: SceneFiles, rows: Mapping[str, Any]) -> None:
        """Counts one row of the dataset, of which each table got these rows."""
        self.statuses[files.about["status"]] += 1
        if (code := files.about["code"]) is not None:
            self.codes[f"{files.about['status']}: {code}"] += 1
        self.tables.update(
            {name: len(each["row"] if name == "tracks" and each else each)
             for name, each in rows.items()}
        )  # fmt: skip
        if files.scene is None or files.proof is None:
            return
        (scene,) = rows["scenes"]
        self.verdicts[scene["verdict"]] += 1
        self.unshown.update(list(dict.fromkeys(scene["not_shown"])))
        self.unlawful += scene["unasked_red_lights"] > 0
        self.worse += any(event.list_worse() for event in Proof.model_validate(files.proof).events)
        self.patterns.update(scene["patterns"])
        self.agents[len(rows["agents"])] += 1
        self.intersections[scene["intersection"]] += 1
        if scene["verified"]:
            self.encounters += list_encounters(files.scene, files.proof)
        for event in rows["events"]:
            self._note_event(event)
        self._note_figures(files.scene, files.proof)

    def _note_event(self, event: Mapping[str, Any]) -> None:
        kind = event["type"]
        asked = event["asked"] or kind == "normal"
        how = "incidental" if event["incidental"] else "asked for" if asked else "unasked"
        self.events[kind, how] += 1
        if event["asked"]:
            self.causes[kind, (event["cause"] or "none seen").replace("_", " ")] += 1
        if event["x"] is not None and how != "incidental":
            kept = self.places.setdefault(kind, array("d"))
            kept.extend((event["x"], event["y"], event["time"]))

    def _note_figures(self, scene: Mapping[str, Any], proof: Mapping[str, Any]) -> None:
        """How close, how fast, how many."""
        found: list[tuple[str, float]] = []
        for event in proof["events"]:
            kind = event["type"].replace("_", " ")
            for key, (name, unit) in _MEASURES.items():
                if (value := event["evidence"].get(key)) is not None:
                    found.append((f"{name} of {kind} [{unit}]", value))
                if (worst := event.get("worst", {}).get(key)) is not None:
                    figure = f"{name}, worst of the whole scene between the two of {kind} [{unit}]"
                    found.append((figure, worst["value"]))
        kinds = [agent["type"] for agent in scene["agents"]]
        usual = ("vehicle", "pedestrian")
        found += [
            (f"seen in a scene{'' if kind in usual else ' that has any'}: {kind}s [agents]", n)
            for kind, n in (dict.fromkeys(usual, 0) | Counter(kinds)).items()
        ]
        for agent in scene["agents"]:
            track = np.array(agent["trajectory"], dtype=np.float64)
            speed = np.hypot(*differentiate(track, scene["meta"]["step"]).T)
            if (speed > MOVING).any():
                figure = f"mean speed of moving {agent['type']}s [m/s]"
                found.append((figure, float(speed[speed > MOVING].mean())))
        for figure, value in found:
            self.figures.setdefault(figure, array("d")).append(value)
