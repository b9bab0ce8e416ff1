"""What `scenewright intersections fit` learns of crosswalks and sidewalks from people on foot."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace

from scenewright.errors import InputError
from scenewright.geometry.map_areas import geos
from scenewright.scene.base import FloatArray
from scenewright.tools.fitting.custom_bundle import CustomBundle
from scenewright.tools.fitting.fit_tracks import FrameChange, find_shifts
from scenewright.tools.fitting.learn_walks import (
    learn_crossings,
    learn_sidewalks,
    say_what_was_learned,
)
from scenewright.tools.map_import.assemble import assemble_map
from scenewright.tools.map_import.quality_report import build_report
from scenewright.tools.map_import.survey_file import read_survey
from scenewright.tools.track_io.track_files import FileTracks

_FILE = "survey.json"
_STAYS = 0.5
"""A crosswalk that lies so close to where people walk is left there [m]."""


def learn_walks(
    bundle: CustomBundle, files: Sequence[FileTracks], frame: FrameChange
) -> tuple[CustomBundle, list[str], dict[str, bytes]]:
    """The bundle with its map derived anew from where people walk.

    Crosswalks that the file draws stay. Where nothing is learned, all is as it was.

    Returns:
        The bundle, a line for each thing learned, the new report as files of the bundle.
    """
    walkers = _list_walkers(bundle, files, frame)
    if not walkers:
        return bundle, [], {}
    place = bundle.intersection_map
    found, walks = learn_crossings(place, walkers), learn_sidewalks(place, walkers)
    try:
        report = json.loads((bundle.folder / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        report = {}
    kept = [each["leg"] for each in report.get("crosswalks", ()) if each["origin"] == "file"]
    notes = say_what_was_learned(found, kept)
    moved = [each for each in found if each.leg not in kept and abs(each.moved) > _STAYS]
    if not moved and not walks:
        none = f"{len(walkers)} people on foot: too few cross any leg at one place to move it"
        return bundle, notes or [none], {}
    if not (bundle.folder / _FILE).is_file():
        return bundle, [*notes, "import the map again to have that on it"], {}
    survey, options = read_survey((bundle.folder / _FILE).read_bytes())
    lengths = {walk.leg: math.dist(*walk.centreline[:2]) for walk in place.crosswalks}
    crossings = tuple(each.build_crossing(lengths[each.leg]) for each in moved)
    made = assemble_map(
        replace(survey, crossings=(*survey.crossings, *crossings), walks=(*survey.walks, *walks)),
        options["map_format"],
        name=place.name, extent=place.extent, title=place.title, signals=str(options["signals"]),
    )  # fmt: skip
    if [leg.name for leg in made.intersection_map.legs] != [leg.name for leg in place.legs]:
        raise InputError("the map's legs have changed; import it again before it is fitted")
    facts = build_report(made.items, made.crosswalks, made.notes)
    content = json.dumps(facts, indent=1, ensure_ascii=False) + "\n"
    changed = replace(bundle, intersection_map=made.intersection_map, route_lines=made.route_lines)
    area = sum(geos.Polygon(outline).area for outline in walks)
    more = [f"sidewalks: {area:.0f} m² beside the derived ones, where people walk"] if walks else []
    return changed, [*notes, *more], {"report.json": content.encode()}


def _list_walkers(
    bundle: CustomBundle, files: Sequence[FileTracks], frame: FrameChange
) -> list[FloatArray]:
    """[T, 2] of each pedestrian, in the map's frame [m]."""
    on_foot = [(file.name, track.xy) for file in files for kind, track in file.tracks
               if kind == "pedestrian"]  # fmt: skip
    if not on_foot:
        return []
    shifts = find_shifts(bundle.intersection_map, bundle.route_lines, files, frame)
    return [xy + shifts[name] for name, xy in on_foot]
