"""`scenewright intersections import, simulate, fit`: from map and tracks to a bundle for scenes."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenewright.errors import InputError
from scenewright.intersections import checked_name, own_root
from scenewright.tools.gmm_sampler.derived import derived_priors
from scenewright.tools.gmm_sampler.own import OwnBundle, open_own, write_own
from scenewright.tools.gmm_sampler.priors import Priors
from scenewright.tools.map_import import Imported, import_map

Tell = Callable[[str, str], None]
_FORMATS = {
    "osm": "OpenStreetMap",
    "lanelet2": "Lanelet2",
    "opendrive": "OpenDRIVE",
    "sumo": "SUMO network",
}


def import_file(
    file: str,
    *,
    name: str,
    center: str | None,
    junction: str | None,
    left_hand: bool | None,
    extent: float | None,
    title: str | None,
    signals: str,
    licence: str | None,
    force: bool,
    tell: Tell,
) -> dict[str, Any]:
    """Imports a map and writes its bundle; what was made, for printing.

    Raises:
        InputError: the file or an option cannot be used; nothing is written.
    """
    checked_name(name)
    if (own_root() / name).exists() and not force:
        raise InputError(f"intersection {name!r} exists already; --force replaces it")
    tell("reading", file)
    made = import_map(
        file,
        name=name,
        center=None if center is None else parsed_center(center),
        junction=junction,
        left_hand=left_hand,
        extent=extent,
        title=title,
        signals=signals,
    )
    tell("deriving", "priors from the map, nothing was seen there yet")
    place, lines = made.assembled.place, made.assembled.lines
    folder = write_own(
        name,
        place,
        lines,
        derived_priors(place, lines),
        provenance=_provenance(file, made),
        frame={"origin": made.origin, "offset": made.offset},
        notes=made.assembled.notes,
        licence=licence,
        force=force,
    )
    return {
        "name": name,
        "folder": str(folder),
        "format": _FORMATS[made.kind],
        "title": place.title,
        "legs": [{"name": leg.name, "road": leg.road} for leg in place.legs],
        "movements": len(place.movements),
        "crosswalks": len(place.crosswalks),
        "signals": place.signals is not None,
        "notes": list(made.assembled.notes),
    }


def simulate_own(name: str, *, minutes: int, seed: int, tell: Tell) -> dict[str, Any]:
    """Simulates traffic on an imported map and fits its priors anew.

    Raises:
        InputError: no such imported intersection, SUMO not installed, a number that cannot be.
    """
    from scenewright.tools.gmm_sampler.simulated import fitted_priors, simulated_trips

    bundle = open_own(name)
    trips, present = simulated_trips(
        bundle.place, minutes=minutes, seed=seed, progress=lambda line: tell("simulating", line)
    )
    tell("fitting", f"priors on {len(trips)} trips")
    priors = fitted_priors(bundle.place, bundle.ways, trips, present)
    folder = _rewritten(
        bundle,
        priors,
        {"priors": "fitted on simulated traffic (Eclipse SUMO); demand assumed, people derived",
         "simulated_minutes": minutes, "simulated_trips": len(trips), "seed": seed},
        {},
    )  # fmt: skip
    return {"name": name, "folder": folder, "trips": len(trips), "minutes": minutes}


def fit_own(
    name: str,
    paths: Sequence[str],
    *,
    columns: str | None,
    origin: str | None,
    shift: str | None,
    start: str | None,
    counts: str | None,
    licence: str | None,
    tell: Tell,
) -> dict[str, Any]:
    """Fits an imported intersection's priors on recorded tracks.

    Raises:
        InputError: no such imported intersection, or tracks or options that cannot be used.
    """
    from scenewright.tools.gmm_sampler.fitting import fit_tracks, read_hourly
    from scenewright.tools.recordings.track_files import read_track_files

    bundle = open_own(name)
    tell("reading", f"{len(paths)} files or folders")
    files = read_track_files(paths, columns=None if columns is None else parsed_columns(columns))
    removed = sum((file.removed for file in files[1:]), start=files[0].removed)
    tell("fitting", f"{sum(len(file.tracks) for file in files)} tracks")
    fitted = fit_tracks(
        bundle.place,
        bundle.ways,
        files,
        origin=bundle.origin,
        track_origin=None if origin is None else parsed_center(origin),
        shift=None if shift is None else parsed_center(shift),
        begin=None if start is None else _parsed_clock(start),
        hourly=None if counts is None else read_hourly(counts),
    )
    folder = _rewritten(
        bundle,
        fitted.priors,
        {"priors": "fitted on recorded tracks; what they do not tell is derived from the map",
         "track_files": sorted(file.name for file in files)[:50],
         "tracks": sum(fitted.matched.values()), "tracks_licence": licence},
        {"seen.npz": seen_bytes(fitted.seen)},
    )  # fmt: skip
    return {
        "name": name,
        "folder": folder,
        "files": len(files),
        "cleaning": removed.lines(),
        "matched": fitted.matched,
        "off": fitted.off,
        "open": fitted.open_,
        "notes": list(fitted.lines),
        "heldout": [
            {"share": share, "tracks": n, "pooled_nll": pooled, "unpooled_nll": alone}
            for share, n, pooled, alone in fitted.heldout
        ],
    }


def seen_bytes(tracks: Sequence[Any]) -> bytes:
    """Up to 400 tracks in the map's frame as a file of plain arrays, for the picture."""
    import io

    import numpy as np

    kept = list(tracks)[:: max(len(tracks) // 400, 1)]
    buffer = io.BytesIO()
    save: Any = np.savez_compressed
    save(
        buffer,
        lengths=np.array([len(xy) for xy in kept], dtype=np.int64),
        points=np.concatenate([np.zeros((0, 2)), *kept]).astype(np.float32),
    )
    return buffer.getvalue()


def _rewritten(
    bundle: OwnBundle, priors: Priors, facts: Mapping[str, Any], extra: Mapping[str, bytes]
) -> str:
    """The bundle with new priors; what its map came from stays as it is."""
    header = bundle.header
    old = {k: v for k, v in header.get("provenance", {}).items() if k.startswith("map")}
    folder = write_own(
        bundle.folder.name,
        bundle.place,
        bundle.ways,
        priors,
        provenance={**old, **facts},
        frame=header.get("frame", {}),
        notes=header.get("notes", ()),
        licence=header.get("licence"),
        force=True,
        extra=extra,
    )
    return str(folder)


def parsed_columns(text: str) -> dict[str, str]:
    """Columns by our names.

    >>> parsed_columns("t=frame/25,id=track,x=px,y=py,class==car")["class"]
    '=car'
    """
    found = dict(part.split("=", 1) for part in text.split(",") if "=" in part)
    strange = sorted(found.keys() - {"t", "id", "class", "x", "y"})
    if strange or not found:
        raise InputError(
            f"--columns is t=...,id=...,class=...,x=...,y=..., got {', '.join(strange) or text!r}"
        )
    return {key.strip(): value.strip() for key, value in found.items()}


def _parsed_clock(text: str) -> float:
    try:
        hours, minutes = (int(part) for part in text.split(":"))
    except ValueError:
        hours, minutes = -1, 0
    if not (0 <= hours < 24 and 0 <= minutes < 60):
        raise InputError(f"a time of day is HH:MM, got {text[:20]!r}")
    return hours + minutes / 60


def fit_text(facts: dict[str, Any]) -> list[str]:
    """What was read, removed and fitted, as lines for people."""
    rows = [
        f"held out, {row['tracks']} tracks to fit on: {row['pooled_nll']:.2f} nats per waypoint "
        f"pooled, {row['unpooled_nll']:.2f} unpooled"
        for row in facts["heldout"]
    ]
    most = sorted(facts["matched"].items(), key=lambda each: -each[1])[:12]
    return [
        *facts["cleaning"],
        *facts["notes"],
        "tracks: " + ", ".join(f"{route} {n}" for route, n in most),
        *rows,
    ]


def draw_own(png: str, name: str) -> None:
    """A bundle's picture: map, legs, movements, recorded tracks if it keeps some, its priors."""
    import numpy as np

    from scenewright.graph.picture.intersection import draw_intersection
    from scenewright.intersections import bundle_folder, check_bundle, load_map
    from scenewright.tools.gmm_sampler import load_priors, paths_of, sample_waypoints

    place, folder = load_map(name), bundle_folder(name)
    samples, tracks = [], []
    if (folder / "priors.npz").is_file():
        priors, rng = load_priors(name), np.random.default_rng(0)
        for route in place.routes:
            if route.movement != "jaywalking":
                prior = priors.waypoints[route.id]
                drawn = sample_waypoints(prior, rng, size=_SHOWN[route.type])
                samples += [path.xy for path in paths_of(prior, drawn)]
    if (folder / "seen.npz").is_file():
        check_bundle(folder, "seen.npz")
        with np.load(folder / "seen.npz", allow_pickle=False) as stored:
            tracks = np.split(stored["points"].astype(float), np.cumsum(stored["lengths"])[:-1])
    draw_intersection(png, intersection=place, tracks=tracks, samples=samples)


_SHOWN = {"vehicle": 6, "pedestrian": 1}
"""Paths drawn of every route."""


def parsed_center(text: str) -> tuple[float, float]:
    """LAT,LON (or X,Y).

    >>> parsed_center("49.0053,8.4374")
    (49.0053, 8.4374)
    """
    try:
        first, second = (float(part) for part in text.split(","))
        if not (math.isfinite(first) and math.isfinite(second)):
            raise ValueError
    except ValueError:
        raise InputError(f"a centre is LAT,LON, two numbers, got {text[:40]!r}") from None
    return first, second


def _provenance(file: str, made: Imported) -> dict[str, Any]:
    return {
        "map": Path(file).name,
        "map_format": _FORMATS[made.kind],
        "map_sha256": hashlib.sha256(Path(file).read_bytes()).hexdigest(),
        "priors": "derived from the map and the pool of amsterdam_120; nothing was seen there",
    }


def import_text(facts: dict[str, Any]) -> list[str]:
    """What was made and assumed, as lines for people."""
    legs = ", ".join(f"{leg['name']} ({leg['road']})" for leg in facts["legs"])
    lights = "signals" if facts["signals"] else "no signals"
    return [
        f"{facts['name']}: {facts['title']} ({facts['format']})",
        f"legs: {legs}",
        f"{facts['movements']} movements, {facts['crosswalks']} crosswalks, {lights}",
        *(f"note: {line}" for line in facts["notes"]),
    ]
