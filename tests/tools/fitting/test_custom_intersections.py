"""Priors of an imported intersection: derived, pooled in the moving frame, fitted on few tracks."""

import json
from dataclasses import astuple

import numpy as np
import pytest

import map_files
from scenewright.errors import InputError
from scenewright.intersections import FORMAT, check_bundle, find_bundle_folder, load_map
from scenewright.scene.candidates import K
from scenewright.tools.fitting.custom_bundle import open_custom_bundle, write_custom_bundle
from scenewright.tools.fitting.derive_priors import derive_priors
from scenewright.tools.fitting.fit_tracks import FrameChange, fit_tracks, read_hourly_counts
from scenewright.tools.fitting.partial_tracks import compute_offset_nll, fit_partial_prior
from scenewright.tools.fitting.path_frame import (
    build_centreline,
    build_pooled_prior,
    load_shipped_pool,
)
from scenewright.tools.fitting.route_matching import Match, Matcher, Unmatched
from scenewright.tools.gmm_sampler import compute_waypoint_nll, load_priors, sample_waypoints
from scenewright.tools.map_import import import_map
from scenewright.tools.track_io.track_files import read_track_files


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    file = map_files.lanelet2(tmp_path_factory.mktemp("map") / "four.osm")
    return import_map(file, name="four")


@pytest.fixture(scope="module")
def place(made):
    return made.intersection_map


@pytest.fixture(scope="module")
def ways(made):
    return made.route_lines


@pytest.fixture
def bundle(made, tmp_path, monkeypatch):
    (tmp_path / "own").mkdir(exist_ok=True)
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "own"))
    place, ways = made.intersection_map, made.route_lines
    return write_custom_bundle(
        "four", place, ways, derive_priors(place, ways),
        provenance={"map": 'a "quoted" name\n'}, frame={"origin": made.survey.origin},
        notes=["a note"],
    )  # fmt: skip


def route(place, name):
    return next(each for each in place.routes if each.id == name)


STRAIGHT = "vehicle:north>south:straight"


def along(line, aside):
    """[T, 2] a drive at 8 m/s beside a line."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.arange(0.0, s[-1], 0.8)
    xy = np.stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)], axis=1)
    ahead = np.gradient(xy, axis=0)
    ahead /= np.hypot(*ahead.T)[:, None]
    return xy + aside * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)


def test_derived_priors_keep_people_where_they_belong(place, ways):
    priors, rng = derive_priors(place, ways), np.random.default_rng(3)
    assert set(priors.waypoints) == {each.id for each in place.routes}
    for each in place.routes:
        drawn = sample_waypoints(priors.waypoints[each.id], rng, size=50)
        assert np.isfinite(compute_waypoint_nll(priors.waypoints[each.id], drawn)).all()
        if each.movement != "jaywalking":
            middle = build_centreline(ways[each.id][0]).knots
            assert np.abs(drawn.mean(axis=0) - middle).max() < 0.5
            assert np.abs(drawn - middle).max() < (3.0 if each.type == "vehicle" else 4.5)


def test_turning_the_map_turns_the_prior(place, ways):
    own, pool = route(place, STRAIGHT), load_shipped_pool()
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    line = np.asarray(ways[STRAIGHT][0])
    tracks = np.array([build_centreline(along(line, a)).knots for a in (0.2, 0.4, 0.3)])
    straight = build_pooled_prior(own, [line], tracks, pool=pool)
    turned = build_pooled_prior(own, [line @ turn.T], tracks @ turn.T, pool=pool)
    assert np.allclose(
        compute_waypoint_nll(straight, tracks),
        compute_waypoint_nll(turned, tracks @ turn.T),
        atol=1e-6,
    )


def test_the_more_tracks_the_less_the_centreline_counts(place, ways):
    own, line, pool = route(place, STRAIGHT), np.asarray(ways[STRAIGHT][0]), load_shipped_pool()
    offsets = []
    for count in (0, 2, 20, 200):
        beside = np.full((count, K), 1.0)
        prior = fit_partial_prior(own, [line], [beside], pool=pool)
        ready = build_centreline(line)
        deviation = ready.turn.T @ (prior.means[0] - ready.knots.ravel())
        offsets.append(float(deviation[1::2].mean()))
    assert offsets[0] == pytest.approx(0.0, abs=1e-9)
    assert offsets == sorted(offsets)
    assert 0.1 < offsets[1] < offsets[3] - 0.05 < 0.95  # one recording alone may be off


def test_a_part_of_the_way_tells_of_the_rest(place, ways):
    own, line = route(place, STRAIGHT), np.asarray(ways[STRAIGHT][0])
    beside = np.full((30, K), np.nan)
    beside[:, :4] = 0.6
    prior = fit_partial_prior(own, [line], [beside], pool=load_shipped_pool())
    ready = build_centreline(line)
    left = (ready.turn.T @ (prior.means[0] - ready.knots.ravel()))[1::2]
    assert 0.25 < left[:4].mean() < 0.6
    assert 0.1 < left[8] <= left[:4].mean() + 0.01


def test_pooling_helps_where_tracks_are_few(place, ways):
    """Tracks of a known spread: two tracks and the pool foretell better than two tracks alone."""
    from scenewright.tools.fitting.partial_tracks import fit_unpooled_prior

    own, line = route(place, STRAIGHT), np.asarray(ways[STRAIGHT][0])
    rng = np.random.default_rng(1)
    factor = np.linalg.cholesky(load_shipped_pool()["straight"] + 0.01 * np.eye(2 * K))
    beside = (rng.standard_normal((202, 2 * K)) @ factor.T)[:, 1::2]
    few, test = beside[:2], beside[2:]
    pooled = fit_partial_prior(own, [line], [few], pool=load_shipped_pool(), predictive=True)
    alone = fit_unpooled_prior(own, [line], [few])
    assert (
        compute_offset_nll(pooled, line, test).mean() < compute_offset_nll(alone, line, test).mean()
    )


def test_tracks_are_matched_to_routes_and_said_to_be_open_or_off(place, ways):
    matcher = Matcher(place, ways)
    line = np.asarray(ways[STRAIGHT][0])
    whole = matcher.match(along(line, 0.4), "vehicle")
    assert isinstance(whole, Match)
    assert whole.route == STRAIGHT
    assert np.nanmean(whole.offsets) == pytest.approx(0.4, abs=0.05)
    approach = matcher.match(along(line, 0.0)[:30], "vehicle")
    assert isinstance(approach, Unmatched)
    assert (approach.reason, approach.entry) == ("open", "north")
    lost = matcher.match(np.array([[20.0 + t, 20.0 + t] for t in range(20)]), "vehicle")
    assert isinstance(lost, Unmatched)
    assert lost.reason == "off"


def test_a_bundle_comes_back_as_it_was_written(bundle, made):
    own = open_custom_bundle("four")
    assert own.intersection_map == made.intersection_map
    assert own.origin == pytest.approx(made.survey.origin)
    assert own.header["format"] == FORMAT
    assert own.header["provenance"]["map"] == 'a "quoted" name\n'
    for name, lines in made.route_lines.items():
        for one, other in zip(own.route_lines[name], lines, strict=True):
            assert np.allclose(one, other, atol=1e-4)
    assert load_priors("four").name == "four"
    check_bundle(bundle)


def test_the_same_map_gives_the_same_bytes(bundle, made, tmp_path, monkeypatch):
    (tmp_path / "other").mkdir(exist_ok=True)
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "other"))
    place, ways = made.intersection_map, made.route_lines
    again = write_custom_bundle(
        "four", place, ways, derive_priors(place, ways),
        provenance={"map": 'a "quoted" name\n'}, frame={"origin": made.survey.origin},
        notes=["a note"],
    )  # fmt: skip
    for file in bundle.iterdir():
        assert (again / file.name).read_bytes() == file.read_bytes(), file.name


def test_an_existing_bundle_is_replaced_only_on_request(bundle, made):
    place, ways = made.intersection_map, made.route_lines
    rest = {"provenance": {}, "frame": {}, "notes": []}
    with pytest.raises(InputError, match="exists already"):
        write_custom_bundle("four", place, ways, derive_priors(place, ways), **rest)
    write_custom_bundle("four", place, ways, derive_priors(place, ways), **rest, force=True)
    assert "a note" not in (bundle / "bundle.toml").read_text()
    assert [each.name for each in bundle.parent.iterdir()] == ["four"]


@pytest.mark.parametrize("name", ["", "  ", "amsterdam_120", " Amsterdam_120 "])
def test_names_that_cannot_be_are_refused(name, made, tmp_path, monkeypatch):
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path))
    place, ways = made.intersection_map, made.route_lines
    with pytest.raises(InputError, match="name"):
        write_custom_bundle(
            name, place, ways, derive_priors(place, ways), provenance={}, frame={}, notes=[]
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("file", "change", "reason"),
    [
        ("bundle.toml", lambda b: b.replace(b"format = 1", b"format = 2"), "newer scenewright"),
        ("bundle.toml", lambda b: b.replace(b"format = 1", b'format = "x"'), "names no format"),
        ("bundle.toml", lambda b: b[: len(b) // 2], "bundle.toml"),
        ("bundle.toml", lambda b: b.replace(b'"map.json" =', b'"../map.json" ='), "outside"),
        ("map.json", lambda b: b.replace(b"north", b"south", 1), "does not match its checksum"),
    ],
)
def test_newer_and_damaged_bundles_are_refused_with_the_reason(bundle, file, change, reason):
    (bundle / file).write_bytes(change((bundle / file).read_bytes()))
    with pytest.raises(InputError, match=reason):
        load_map("four")


def test_damaged_priors_and_ways_are_refused(bundle):
    for file, load in (("priors.npz", load_priors), ("ways.npz", open_custom_bundle)):
        data = bytearray((bundle / file).read_bytes())
        data[len(data) // 2] ^= 255
        (bundle / file).write_bytes(bytes(data))
        with pytest.raises(InputError, match=f"{file}.*checksum"):
            load("four")


def test_shipped_bundles_match_their_checksums():
    check_bundle(find_bundle_folder("amsterdam_120"))


def write_csv(file, rows, header="t,id,class,x,y"):
    file.write_text(header + "\n" + "\n".join(",".join(map(str, r)) for r in rows) + "\n")
    return file


def drives(ways, count=24, step=0.1):
    """Rows (t, id, class, x, y) of cars straight on from the north, spread about 0.5 m aside."""
    rng, rows = np.random.default_rng(5), []
    for n in range(count):
        xy = along(np.asarray(ways[STRAIGHT][0]), 0.5 + 0.2 * rng.standard_normal())
        for k, (x, y) in enumerate(xy[:: round(step / 0.1)]):
            rows.append((round(12 * n + step * k, 3), n, "car", round(x, 3), round(y, 3)))
    return rows


def test_tracks_of_any_csv_are_read_by_naming_its_columns(tmp_path, ways):
    rows = drives(ways)
    plain = read_track_files([write_csv(tmp_path / "a.csv", rows)])[0]
    renamed = [(round(25 * t), n, x, y) for t, n, _, x, y in rows]
    odd = write_csv(tmp_path / "odd.csv", renamed, "frame,track,px,py")
    columns = {"t": "frame/25", "id": "track", "class": "=car", "x": "px", "y": "py"}
    mapped = read_track_files([odd], columns=columns)[0]
    assert len(plain.tracks) == len(mapped.tracks) == 24
    assert np.allclose(plain.tracks[0][1].xy[5:60], mapped.tracks[0][1].xy[5:60], atol=0.3)
    with pytest.raises(InputError, match="no column nope"):
        read_track_files([odd], columns=columns | {"x": "nope"})


def test_decimal_commas_of_any_csv_are_read(tmp_path, ways):
    rows = drives(ways, count=2)
    points, commas = tmp_path / "a.csv", tmp_path / "b.csv"
    text = write_csv(points, rows).read_text()
    commas.write_text(text.replace(",", ";").replace(".", ","))
    for one, other in zip(
        read_track_files([points])[0].tracks, read_track_files([commas])[0].tracks, strict=True
    ):
        assert np.array_equal(one[1].xy, other[1].xy)


def test_classes_have_the_same_synonyms_as_in_verified_tracks(tmp_path, ways):
    rows = [(t, n, "Passenger-Car", x, y) for t, n, _, x, y in drives(ways, count=2)]
    [file] = read_track_files([write_csv(tmp_path / "a.csv", rows)])
    assert [subtype for subtype, _ in file.tracks] == ["car", "car"]


@pytest.mark.parametrize(("site", "settling"), [("K729", 3.0), ("k733", 1.0), ("other", 1.0)])
def test_how_long_a_tracker_settles_is_read_from_the_data_not_the_path(
    tmp_path, ways, site, settling
):
    folder = tmp_path / "copy of k729"
    folder.mkdir()
    rows = [(round(1000 * t), n, "Car", x, y) for t, n, _, x, y in drives(ways, count=1)]
    file = write_csv(
        folder / "vehicle_tracks_000.csv", rows, "timestamp_ms,track_id,agent_type,x,y"
    )
    write_csv(folder / "meta_data.csv", [("000", site, 49.0, 8.4, "11:17:19")],
              "id,locationId,originLat,originLon,startTime")  # fmt: skip
    [read] = read_track_files([file])
    assert read.tracks[0][1].start == pytest.approx(settling)
    assert (read.origin, read.begin) == ((49.0, 8.4), pytest.approx(11 + 17 / 60))


def test_ind_style_trajnet_and_fcd_say_the_same(tmp_path, ways):
    rows = drives(ways, count=3)
    write_csv(tmp_path / "07_tracks.csv", [(0, n, round(10 * t), x, y) for t, n, _, x, y in rows],
              "recordingId,trackId,frame,xCenter,yCenter")  # fmt: skip
    write_csv(tmp_path / "07_tracksMeta.csv", [(n, "car") for n in range(3)], "trackId,class")
    write_csv(tmp_path / "07_recordingMeta.csv", [(10, 9)], "frameRate,startTime")
    [ind] = read_track_files([tmp_path / "07_tracks.csv"])
    assert ind.begin == 9.0
    steps = {}
    for t, n, _, x, y in rows:
        steps.setdefault(t, []).append(f'<vehicle id="{n}" type="car" x="{x}" y="{y}"/>')
    text = "".join(f'<timestep time="{t}">{"".join(v)}</timestep>' for t, v in steps.items())
    (tmp_path / "fcd.xml").write_text(f"<fcd-export>{text}</fcd-export>")
    [fcd] = read_track_files([tmp_path / "fcd.xml"])
    for one, other in zip(ind.tracks, fcd.tracks, strict=True):
        assert np.allclose(one[1].xy, other[1].xy, atol=1e-6)
    walk = [{"track": {"f": 10 * k, "p": 1, "x": 0.5 * k, "y": 0.0}} for k in range(40)]
    lines = [json.dumps({"scene": {"id": 0, "p": 1, "s": 0, "e": 390, "fps": 2.5}})]
    (tmp_path / "w.ndjson").write_text("\n".join(lines + [json.dumps(each) for each in walk]))
    [people] = read_track_files([tmp_path / "w.ndjson"])
    subtype, track = people.tracks[0]
    assert subtype == "pedestrian"
    speed = np.hypot(*(track.xy[40] - track.xy[20])) / 2.0
    assert speed == pytest.approx(1.25, abs=0.01)


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("a.csv", "t,id,class,x\n0,1,car,2\n", "no column y"),
        ("a.csv", "t,id,class,x,y\n0,1,dragon,2,3\n", "line 2: class 'dragon'"),
        ("a.csv", "t,id,class,x,y\n0,1,car,two,3\n", "line 2"),
        ("a.csv", "t,id,class,x,y\n0,1,car,inf,3\n", "line 2: x is inf"),
        ("a.csv", "t,id,class,x,y\n0,5,1,car,2,5,3,5\n", "line 2: 8 cells under 5 .* semicolon"),
        ("a.csv", 't;id;class;x;y\n0.5;1;car;"1,5";3\n', "line 2: x is '1,5', although"),
        ("a.ndjson", "{\n", "line 1"),
        ("fcd.xml", "<fcd-export><timestep time='0'>", "well-formed"),
        ("fcd.xml", "<!DOCTYPE x [<!ENTITY a 'b'>]><fcd-export/>", "document type"),
        ("a.dat", "hello", "no kind that is known"),
    ],
)
def test_unusable_tracks_end_in_one_line(tmp_path, name, text, reason):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=reason) as caught:
        read_track_files([tmp_path / name])
    assert "\n" not in str(caught.value)


def test_fitting_learns_where_people_drive_and_how_many(tmp_path, place, ways):
    files = read_track_files([write_csv(tmp_path / "a.csv", drives(ways))])
    fitted = fit_tracks(place, ways, files, FrameChange(), begin=8.0)
    assert fitted.matched == {STRAIGHT: 24}
    assert fitted.priors.waypoints[STRAIGHT].tracks == 24
    assert set(fitted.priors.waypoints) == {each.id for each in place.routes}
    before = derive_priors(place, ways)
    others = "vehicle:south>north:straight"
    grown = [fitted.priors.frequency[n][8] / before.frequency[n][8] for n in (STRAIGHT, others)]
    assert grown[0] > grown[1]
    assert all(np.isfinite(row).all() for row in map(astuple, fitted.heldout))
    assert fitted.priors.driving_profiles[STRAIGHT].median[0] == pytest.approx(8.0, rel=0.2)


def test_tracks_in_another_frame_are_refused_until_it_is_named(tmp_path, place, ways):
    rows = [(t, n, c, x + 5000.0, y) for t, n, c, x, y in drives(ways, count=6)]
    files = read_track_files([write_csv(tmp_path / "a.csv", rows)])
    with pytest.raises(InputError, match="--origin"):
        fit_tracks(place, ways, files, FrameChange())
    fitted = fit_tracks(place, ways, files, FrameChange(shift=(-5000.0, 0.0)))
    assert fitted.matched == {STRAIGHT: 6}


def test_a_table_of_counts_sets_the_course_of_the_day(tmp_path, place, ways):
    table = write_csv(tmp_path / "c.csv", [(h, 100 + h) for h in range(24)], "hour,vehicles")
    files = read_track_files([write_csv(tmp_path / "a.csv", drives(ways, count=4))])
    fitted = fit_tracks(place, ways, files, FrameChange(), hourly=read_hourly_counts(table))
    cars = [r.id for r in place.routes if r.type == "vehicle"]
    total = np.sum([fitted.priors.frequency[n] for n in cars], axis=0)
    assert total == pytest.approx(100 + np.arange(24))
    short = write_csv(tmp_path / "d.csv", [(1, 5)], "hour,vehicles")
    with pytest.raises(InputError, match="lacks 23"):
        read_hourly_counts(short)
