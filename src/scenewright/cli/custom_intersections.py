"""`scenewright intersections import, simulate, fit`: from map and tracks to a bundle for scenes."""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from scenewright.arrays import read_arrays
from scenewright.cli.console import ProgressCallback
from scenewright.cli.learned_walks import learn_walks
from scenewright.cli.options import FitOptions, ImportOptions
from scenewright.cli.refiners import adapt_refiner, train_to_files
from scenewright.cli.views import render
from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.intersections import (
    REFINER_WEIGHTS,
    SHIPPED,
    check_bundle,
    find_bundle_folder,
    find_custom_root,
    load_map,
    make_name,
    read_bundle_header,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.fitting.custom_bundle import (
    CustomBundle,
    open_custom_bundle,
    write_custom_bundle,
)
from scenewright.tools.fitting.derive_priors import derive_priors
from scenewright.tools.fitting.fit_tracks import (
    FrameChange,
    LaneOffsets,
    fit_tracks,
    read_hourly_counts,
)
from scenewright.tools.gmm_sampler import build_paths, load_priors, sample_waypoints
from scenewright.tools.gmm_sampler.priors import Priors
from scenewright.tools.map_import import ImportedMap, import_map
from scenewright.tools.map_import.quality_report import build_report, format_report
from scenewright.tools.map_import.survey_file import write_survey
from scenewright.tools.track_io import save_recordings
from scenewright.tools.track_io.track_files import read_track_files

T = TypeVar("T")
REFINER_CARD = "refiner.md"
REPORT, REPORT_PICTURE, SURVEY = "report.json", "report.png", "survey.json"
_FORMATS = {
    "osm": "OpenStreetMap",
    "lanelet2": "Lanelet2",
    "opendrive": "OpenDRIVE",
    "sumo": "SUMO network",
    "commonroad": "CommonRoad",
    "argoverse2": "Argoverse 2",
    "womd": "Waymo Open Motion",
}


def import_file(file: str, options: ImportOptions, *, log: ProgressCallback) -> dict[str, Any]:
    """Imports a map and writes its bundle; what was made, for printing.

    Raises:
        InputError: the file or an option cannot be used; nothing is written.
    """
    from scenewright.viz.intersection_picture import list_unshown_streets

    name = make_name(options.name)
    if (find_custom_root() / name).exists() and not options.force:
        raise InputError(f"intersection {name!r} exists already; --force replaces it")
    log("reading", file)
    asked = options.pass_on(import_map) | {"center": _read(parse_center, options.center)}
    made = import_map(file, **asked | {"name": name, "streets": options.street or ()})
    log("deriving", "priors from the map, nothing was seen there yet")
    place, lines = made.intersection_map, made.route_lines
    report = build_report(made.items, made.crosswalks, made.notes)
    how = {"map_format": made.map_format, "extent": options.extent, "title": options.title,
           "signals": options.signals}  # fmt: skip
    folder = write_custom_bundle(
        name,
        place,
        lines,
        derive_priors(place, lines),
        provenance={
            "map": Path(file).name,
            "map_format": _FORMATS[made.map_format],
            "map_sha256": hashlib.sha256(Path(file).read_bytes()).hexdigest(),
            "priors": "derived from the map and the pool of amsterdam_120; nothing was seen there",
        },
        frame={"origin": made.survey.origin, "offset": made.survey.offset},
        notes=made.notes,
        licence=options.licence,
        force=options.force,
        extra={**_report_files(made, report), SURVEY: write_survey(made.survey, **how)},
    )
    called = [] if name == options.name else [f"{options.name!r} is called {name} in commands"]
    return {
        "name": name,
        "folder": str(folder),
        "format": _FORMATS[made.map_format],
        "title": place.title,
        "legs": [{"name": leg.name, "road": leg.road} for leg in place.legs],
        "movements": len(place.movements),
        "crosswalks": len(place.crosswalks),
        "signals": place.signals is not None,
        "notes": [*called, *made.notes, *list_unshown_streets(place)],
        "report": format_report(report),
    }


def _report_files(made: ImportedMap, report: Mapping[str, Any]) -> dict[str, bytes]:
    """The report as files of the bundle: its facts, and the map over the file's own geometry."""
    from scenewright.viz.import_picture import draw_import

    drawn = render(lambda path: draw_import(
        path, intersection=made.intersection_map, layers=made.survey.drawn,
        lines=[f"{item.item}: {item.detail}" for item in made.items],
    ))  # fmt: skip
    facts = json.dumps(report, indent=1, ensure_ascii=False) + "\n"
    return {REPORT: facts.encode(), REPORT_PICTURE: drawn}


def simulate_own(
    name: str, *, minutes: int, seed: int, train: bool, corpus: str | None, log: ProgressCallback
) -> dict[str, Any]:
    """Simulates traffic on an imported map, fits its priors anew and trains its refiner.

    Args:
        train: whether to train; else a refiner that the bundle has stays as it is.
        corpus: a file to keep the simulated tracks in.

    Raises:
        InputError: no such imported intersection, SUMO not installed, a number that cannot be.
    """
    if train:
        no = "leave it out with --no-train"
        require_extra("learn", "training a refiner", "torch", otherwise=no)
    from scenewright.tools.fitting.simulated_priors import fit_simulated_priors, simulate_map
    from scenewright.tools.trajnet_refiner.bundled import load_bundled_refiner

    bundle = open_custom_bundle(name)
    place, lines = bundle.intersection_map, bundle.route_lines
    made = simulate_map(
        place, lines, minutes=minutes, seed=seed, progress=partial(log, "simulating")
    )
    if corpus is not None:
        save_recordings(Path(corpus), made.recordings)
    log("fitting", f"priors on {len(made.trips)} trips")
    priors = fit_simulated_priors(place, lines, made.trips, made.present)
    extra, figures = dict[str, bytes](), dict[str, Any]()
    if train:
        # It goes on from the shipped intersection's, which knows how people drive but not how they
        # do here: from nothing, so little traffic would not teach it.
        shipped = load_bundled_refiner(SHIPPED)
        log("training", f"a refiner on {len(made.recordings)} recordings")
        extra, figures = train_to_files(
            name, made.recordings, start=None if shipped is None else shipped.net, seed=seed,
            command=f"scenewright intersections simulate {name} --minutes {minutes} --seed {seed}",
            log=log,
        )  # fmt: skip
    on_foot = sum(trip.subtype is None for trip in made.trips)
    folder = _rewrite_bundle(
        bundle,
        priors,
        {"priors": "fitted on simulated traffic (Eclipse SUMO); demand assumed, walked ways "
         "derived from the map",
         "simulated_minutes": minutes, "simulated_trips": len(made.trips),
         "simulated_walks": on_foot, "seed": seed},
        extra,
    )  # fmt: skip
    return {"name": name, "folder": folder, "trips": len(made.trips), "walks": on_foot,
            "minutes": minutes, "trained": train, "figures": figures}  # fmt: skip


def fit_own(
    name: str, paths: Sequence[str], options: FitOptions, *, log: ProgressCallback
) -> dict[str, Any]:
    """Fits an imported intersection's priors on recorded tracks.

    Raises:
        InputError: no such imported intersection, or tracks or options that cannot be used.
    """
    if options.train:
        require_extra("learn", "adapting the refiner", "torch", otherwise="leave out --train")
    bundle, lit = _add_recorded_lights(open_custom_bundle(name), options)
    log("reading", f"{len(paths)} files or folders")
    columns = _read(parse_columns, options.columns)
    files = read_track_files(paths, columns=columns, scale=options.scale, named=options.named)
    elsewhere, pool_notes = _fit_elsewhere(options.pool or (), options.pool_scale)
    origin, shift = _read(parse_center, options.origin), _read(parse_center, options.shift)
    frame = FrameChange(bundle.origin, origin, shift)
    bundle, learned, new_report = learn_walks(bundle, files, frame)
    removed = sum((file.removed for file in files[1:]), start=files[0].removed)
    log("fitting", f"{sum(len(file.tracks) for file in files)} tracks")
    fitted = fit_tracks(
        bundle.intersection_map,
        bundle.route_lines,
        files,
        frame,
        begin=_read(_parse_clock, options.start),
        hourly=_read(read_hourly_counts, options.counts),
        elsewhere=elsewhere,
    )
    adapted, *note = adapt_refiner(name, files, log) if options.train else ({},)
    folder = _rewrite_bundle(
        bundle,
        fitted.priors,
        {"priors": "fitted on recorded tracks; what they do not show is derived from the map",
         "track_files": sorted(file.name for file in files)[:50],
         "tracks": sum(fitted.matched.values()), "tracks_licence": options.licence,
         "pool": ", ".join(pool_notes) or None,
         "lights": None if options.lights is None else Path(options.lights).name},
        {"seen.npz": pack_tracks(fitted.positions), **adapted, **new_report},
    )  # fmt: skip
    return {
        "name": name,
        "folder": folder,
        "files": len(files),
        "cleaning": removed.format_lines(),
        "matched": fitted.matched,
        "off": fitted.off_route,
        "open": fitted.open_route,
        "notes": [*lit, *pool_notes, *learned, *fitted.notes, *note],
        "heldout": [
            {"share": row.share, "tracks": row.tracks, "pooled_nll": row.pooled,
             "unpooled_nll": row.unpooled}
            for row in fitted.heldout
        ],
    }  # fmt: skip


def _add_recorded_lights(
    bundle: CustomBundle, options: FitOptions
) -> tuple[CustomBundle, list[str]]:
    """The bundle with a recorded programme in its map, and what was taken."""
    legs = options.light_legs
    if options.lights is None:
        if legs is not None:
            raise InputError("--light-legs needs --lights, the file of recorded lights")
        return bundle, []
    from scenewright.tools.fitting.recorded_signals import fit_recorded_program
    from scenewright.tools.track_io.signal_files import read_recorded_lights

    place, notes = fit_recorded_program(
        bundle.intersection_map,
        read_recorded_lights(options.lights),
        origin=bundle.origin,
        groups=_read(_parse_light_legs, legs),
    )
    return replace(bundle, intersection_map=place), notes


def _read(parse: Callable[[str], T], text: str | None) -> T | None:
    """The value of an option, where it is given."""
    return None if text is None else parse(text)


def _parse_light_legs(text: str) -> dict[str, str]:
    """Legs by recorded lights: `1=east,13=walk_east`."""
    pairs = [[*map(str.strip, part.split("=", 1))] for part in text.split(",")]
    if not all(len(pair) == 2 and all(pair) for pair in pairs):
        raise InputError(f"--light-legs is LIGHT=LEG,..., got {text[:60]!r}")
    return dict(pairs)


def _fit_elsewhere(paths: Sequence[str], scale: float | None) -> tuple[LaneOffsets, list[str]]:
    """How drivers of other places keep to their lanes, and a line on each file."""
    from scenewright.tools.fitting.lane_keeping import find_lane_offsets, measure_scale

    found: dict[str, list[FloatArray]] = {}
    notes = []
    for file in read_track_files(paths, scale=scale) if paths else ():
        tracks = [track.xy for subtype, track in file.tracks if subtype != "pedestrian"]
        lanes = find_lane_offsets(tracks)
        for turn, own in lanes.items():
            found.setdefault(turn, []).extend(own)
        count = sum(len(own) for lane in lanes.values() for own in lane)
        wide = None if scale is None else measure_scale(tracks, scale)
        on = f"{count} tracks on {sum(map(len, lanes.values()))} lanes"
        at = "" if scale is None else f", at {scale:g} m per pixel"
        fits = "" if wide is None else f" ({wide:.3f} would make its lanes 3.25 m wide)"
        notes.append(f"{file.name}: {on}, for the pool{at}{fits}")
    if paths and not found:
        raise InputError(f"{', '.join(paths)[:200]}: no lane that three vehicles share")
    return found, notes


def pack_tracks(tracks: Sequence[Any]) -> bytes:
    """Up to 400 tracks in the map's frame as a file of plain arrays, for the picture."""
    import numpy as np

    kept = list(tracks)[:: max(len(tracks) // 400, 1)]
    lengths = np.array([len(xy) for xy in kept], dtype=np.int64)
    points = np.concatenate([np.zeros((0, 2)), *kept]).astype(np.float32)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, lengths=lengths, points=points)
    return buffer.getvalue()


def _rewrite_bundle(
    bundle: CustomBundle, priors: Priors, facts: Mapping[str, Any], extra: Mapping[str, bytes]
) -> str:
    """The bundle with new priors; its map's origin and its refiner stay, if not replaced."""
    header = bundle.header
    kept = {
        file: (bundle.folder / file).read_bytes()
        for file in (REFINER_WEIGHTS, REFINER_CARD, REPORT, REPORT_PICTURE, SURVEY)
        if (bundle.folder / file).is_file()
    }
    old = {k: v for k, v in header.get("provenance", {}).items() if k.startswith("map")}
    folder = write_custom_bundle(
        bundle.folder.name,
        bundle.intersection_map,
        bundle.route_lines,
        priors,
        provenance={**old, **facts},
        frame=header.get("frame", {}),
        notes=header.get("notes", ()),
        licence=header.get("licence"),
        force=True,
        extra={**kept, **extra},
    )
    return str(folder)


def parse_columns(text: str) -> dict[str, str]:
    """Columns by our names: `t=frame/25,id=track,x=px,y=py,class==car`."""
    found = dict(part.split("=", 1) for part in text.split(",") if "=" in part)
    strange = sorted(found.keys() - {"t", "id", "class", "x", "y"})
    if strange or not found:
        raise InputError(
            f"--columns is t=...,id=...,class=...,x=...,y=..., got {', '.join(strange) or text!r}"
        )
    return {key.strip(): value.strip() for key, value in found.items()}


def _parse_clock(text: str) -> float:
    try:
        clock = datetime.strptime(text, "%H:%M")
    except ValueError:
        raise InputError(f"a time of day is HH:MM, got {text[:20]!r}") from None
    return clock.hour + clock.minute / 60


def fit_text(facts: dict[str, Any]) -> list[str]:
    """What was read, removed and fitted, as lines for people."""
    most = sorted(facts["matched"].items(), key=lambda each: -each[1])[:12]
    tracks = "tracks: " + ", ".join(f"{route} {n}" for route, n in most)
    rows = [
        f"held out, {row['tracks']} tracks to fit on: {row['pooled_nll']:.2f} nats per waypoint "
        f"pooled, {row['unpooled_nll']:.2f} unpooled"
        for row in facts["heldout"]
    ]
    return [*facts["cleaning"], *facts["notes"], tracks, *rows]


def draw_own(png: str, name: str, *, with_samples: bool = False) -> None:
    """A bundle's picture: map, legs, movements, recorded tracks if it keeps some.

    Args:
        with_samples: paths drawn from the priors are shown as well.
    """
    from scenewright.viz.intersection_picture import draw_intersection

    place = load_map(name)
    drawn = _draw_paths(name, place).values() if with_samples else ()
    samples = [path for paths in drawn for path in paths]
    draw_intersection(png, intersection=place, tracks=_load_seen(name), samples=samples)


def record_own(rrd: str, name: str) -> None:
    """The same as a recording for the rerun viewer, with what was assumed beside it."""
    from scenewright.viz.intersection_recording import record_intersection

    place, header = load_map(name), read_bundle_header(find_bundle_folder(name))
    facts = [f"{key}: {value}" for key, value in header.get("provenance", {}).items()]
    facts += [f"licence: {header.get('licence', 'unstated')}", *header.get("notes", ())]
    record_intersection(
        rrd,
        intersection=place,
        tracks=_load_seen(name),
        priors=_draw_paths(name, place),
        facts=[each for each in map(str, facts) if len(each) < _LONGEST_FACT],
    )


def _draw_paths(name: str, place: IntersectionMap) -> dict[str, list[FloatArray]]:
    """By route id, paths drawn from its prior; those of jaywalkers are left out."""
    import numpy as np

    if not (find_bundle_folder(name) / "priors.npz").is_file():
        return {}
    priors, rng = load_priors(name), np.random.default_rng(0)
    return {
        route.id: [
            path.xy
            for path in build_paths(
                priors.waypoints[route.id],
                sample_waypoints(priors.waypoints[route.id], rng, size=_SHOWN[route.type]),
            )
        ]
        for route in place.routes
        if route.movement != "jaywalking"
    }


def _load_seen(name: str) -> list[FloatArray]:
    """The recorded tracks that a bundle keeps, [T, 2] each [m]."""
    import numpy as np

    folder = find_bundle_folder(name)
    if not (folder / "seen.npz").is_file():
        return []
    check_bundle(folder, "seen.npz")
    what = f"the tracks seen at {name!r}"
    stored = read_arrays(folder / "seen.npz", what=what)
    try:
        return np.split(stored["points"].astype(float), np.cumsum(stored["lengths"])[:-1])
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(f"cannot read {what}: {fault}") from None


_LONGEST_FACT = 300
_SHOWN = {"vehicle": 6, "pedestrian": 1}
"""Paths drawn of every route."""


def parse_center(text: str) -> tuple[float, float]:
    """LAT,LON (or X,Y): `49.0053,8.4374`."""
    try:
        first, second = (float(part) for part in text.split(","))
        if not (math.isfinite(first) and math.isfinite(second)):
            raise ValueError
    except ValueError:
        raise InputError(f"a centre is LAT,LON, two numbers, got {text[:40]!r}") from None
    return first, second


def import_text(facts: dict[str, Any]) -> list[str]:
    """What was made and assumed, as lines for people."""
    legs = ", ".join(f"{leg['name']} ({leg['road']})" for leg in facts["legs"])
    lights = "signals" if facts["signals"] else "no signals"
    return [
        f"{facts['name']}: {facts['title']} ({facts['format']})",
        f"legs: {legs}",
        f"{facts['movements']} movements, {facts['crosswalks']} crosswalks, {lights}",
        *(f"note: {line}" for line in facts["notes"]),
        f"{facts['report']}; see {REPORT_PICTURE} and {REPORT} in its folder",
    ]
