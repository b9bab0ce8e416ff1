"""Ways of real tracks, from priors fitted on every other recording of their intersection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lab.rollouts.prior_goals import FindRoutePrior, RoutePrior
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.tools.fitting.fit_tracks import FittedTracks, FrameChange, WaypointFit, fit_tracks
from scenewright.tools.fitting.route_matching import Match, Matcher
from scenewright.tools.gmm_sampler import Priors, WaypointPrior
from scenewright.tools.map_import import import_map
from scenewright.tools.map_import.map_parts import RouteLines
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.track_io.track_files import FileTracks, read_track_files


class _LeftOutMap(NamedTuple):
    """One intersection: its map, with the latitude and longitude of its origin, and its tracks."""

    place: IntersectionMap
    lines: RouteLines
    origin: tuple[float, float] | None
    files: tuple[FileTracks, ...]


def fit_left_out_routes(folder: Path) -> FindRoutePrior:
    """Fit priors for each TAF-BW recording on all others at the same intersection.

    The priors of `intersections fit`, as they predict another recording: the map, the other
    recordings' tracks, the pool for the rest. The map is the newest `<site>_<date>.osm`.

    Raises:
        InputError: a site has no map below the folder, two recordings of one name, a single one, or
            one whose other recordings do not lie on the map.
    """
    known = {
        _name(file): _fit_routes(site, file)
        for site in (_read(folder, *each) for each in _find_sessions(folder).items())
        for file in site.files
    }

    def find_route_prior(recording: Recording, agent: RecordedAgent) -> RoutePrior | None:
        found = known.get(recording.name)
        return None if found is None else found(agent)

    return find_route_prior


def _find_sessions(folder: Path) -> dict[str, list[Path]]:
    """Find the folders with tracks below a folder, by site: their names' part before the date."""
    found: dict[str, list[Path]] = {}
    for session in sorted({file.parent for file in folder.rglob("vehicle_tracks_*.csv")}):
        found.setdefault(session.name.split("_", 1)[0], []).append(session)
    return found


def _read(folder: Path, site: str, sessions: Sequence[Path]) -> _LeftOutMap:
    maps = sorted(folder.rglob(f"{site}_*.osm"))
    if not maps:
        raise InputError(
            f"there is no map {site}_<date>.osm below {folder}; leave out --prior-goals"
        )
    files = read_track_files(sessions)
    if len({_name(file) for file in files}) < len(files):
        raise InputError(f"{folder} holds recordings of {site} twice: none would be left out")
    if len(files) == 1:
        raise InputError(f"{files[0].name} is the only recording of {site}: none is left to fit on")
    made = import_map(maps[-1], name=site, signals="none")
    return _LeftOutMap(made.intersection_map, made.route_lines, made.survey.origin, tuple(files))


def _name(file: FileTracks) -> str:
    """`<site>_<date>/NNN`, as `read_taf_bw` names what it reads from this file."""
    return f"{file.session}/{Path(file.name).stem[-3:]}"


def _fit_routes(
    site: _LeftOutMap, file: FileTracks
) -> Callable[[RecordedAgent], RoutePrior | None]:
    """Fit priors without a recording; the routes of its agents come from their whole tracks."""
    others = [each for each in site.files if each is not file]
    fitted = _fit_others(site, file, others)
    fit = WaypointFit(site.place, site.lines, fitted.matches)
    priors = replace(fitted.priors, waypoints=fit.fit_priors(predictive=True))
    frame = FrameChange(site.origin)
    registered = [
        fitted.shifts[each.name] - frame.compute_shift(each)
        for each in others
        if each.session == file.session
    ]
    moved = frame.compute_shift(file) + (registered[0] if registered else 0.0)
    matcher = Matcher(site.place, site.lines)
    routes = {route.id: route for route in site.place.routes}

    def find_route_prior(agent: RecordedAgent) -> RoutePrior | None:
        found = matcher.match(agent.track.xy + moved, agent.shape.type)
        if not isinstance(found, Match):
            return None
        return RoutePrior(routes[found.route], _shift_prior(priors, found.route, moved), priors)

    return find_route_prior


def _fit_others(site: _LeftOutMap, file: FileTracks, others: Sequence[FileTracks]) -> FittedTracks:
    try:
        return fit_tracks(site.place, site.lines, others, FrameChange(site.origin))
    except InputError:
        raise InputError(
            f"no track of the other recordings lies on the map of {site.place.name}, so there is "
            f"no prior for {file.name}; leave out --prior-goals"
        ) from None


def _shift_prior(priors: Priors, route: str, moved: FloatArray) -> WaypointPrior:
    """Shift p_wp of a route from the map's frame to that of a recording, by -`moved`."""
    prior = priors.waypoints[route]
    return replace(prior, means=prior.means - np.tile(moved, K), base=prior.base - moved)
