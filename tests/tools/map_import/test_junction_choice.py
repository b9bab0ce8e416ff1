"""A junction is chosen by id, by streets or by place, and every refusal says what there is."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.geometry.geographic import project_to_degrees
from scenewright.tools.map_import.junction_choice import Junction, choose_junction, find_streets
from scenewright.tools.map_import.junction_groups import StreetPiece, group_junctions

FILE = Path("town.osm")


def make_junction(name, xy, *streets, **options):
    return Junction(name, xy, streets, tuple(float(k) for k in range(len(streets))), **options)


MAIN = make_junction("1", (0.0, 0.0), "Main Street", "Mill Lane", "Main Street", "")
SIDE = make_junction("2", (400.0, 0.0), "Main Street", "Oak Road", "Oak Road")
RING = make_junction(
    "3", (0.0, 300.0), "Mill Lane", "Oak Road", "Elm Avenue", "Ash Close",
    is_roundabout=True, nodes=frozenset(("31", "32")),
)  # fmt: skip
TOWN = (MAIN, SIDE, RING)


def choose(junctions=TOWN, *, center=None, junction=None, streets=()):
    return choose_junction(junctions, file=FILE, center=center, junction=junction, streets=streets)


@pytest.mark.parametrize(("name", "found"), [("1", MAIN), ("3", RING), ("32", RING)])
def test_an_id_is_that_of_the_junction_or_of_one_of_its_nodes(name, found):
    assert choose(junction=name) is found


def test_the_only_junction_need_not_be_chosen():
    assert choose((SIDE,)) is SIDE


def test_a_file_without_junctions_is_refused():
    with pytest.raises(InputError, match=r"^town.osm has no junction of three or more legs for"):
        choose(())


def test_several_junctions_are_listed_with_the_ways_to_choose():
    with pytest.raises(InputError) as refused:
        choose()
    assert str(refused.value) == (
        "town.osm has 3 junctions; choose one with --junction ID, --at or --street: there are "
        "1 (4 legs, Main Street, Mill Lane); "
        "3 (4 legs, Ash Close, Elm Avenue, Mill Lane, Oak Road); "
        "2 (3 legs, Main Street, Oak Road)"
    )


def test_an_unknown_id_is_quoted_and_what_there_is_listed():
    with pytest.raises(InputError, match=r"has no junction '99'; there are 1 \(4 legs, Main"):
        choose(junction="99")


def test_a_long_list_is_cut_and_the_rest_counted():
    many = [make_junction(f"{k:02}", (300.0 * k, 0.0), "", "", "") for k in range(15)]
    with pytest.raises(InputError) as refused:
        choose(many)
    text = str(refused.value)
    assert text.count("(3 legs)") == 12
    assert text.endswith("11 (3 legs) and 3 more")


@pytest.mark.parametrize(
    ("streets", "found"),
    [
        (["Mill Lane", "Main Street"], MAIN),
        (["main street", "MILL LANE"], MAIN),
        (["Oak Road", "Main Street"], SIDE),
        (["Elm Avenue"], RING),
        (["Elm Ave"], RING),
        (["Oak Rd", "Mill Ln"], RING),
        (["Ash"], RING),
    ],
)
def test_streets_choose_the_junction_that_has_all_of_them(streets, found):
    assert choose(streets=streets) is found
    assert choose(streets=streets[::-1]) is found


def test_a_part_of_a_word_is_no_street():
    with pytest.raises(InputError, match=r"^town.osm has no junction of Mil; its streets are "):
        choose(streets=["Mil"])


def test_a_misspelt_street_is_answered_with_those_like_it():
    with pytest.raises(InputError) as refused:
        choose(streets=["Elm Avenve"])
    assert str(refused.value) == (
        "town.osm has no junction of Elm Avenve; its streets are Elm Avenue"
    )


def test_streets_that_do_not_meet_are_both_named():
    with pytest.raises(InputError, match=r"no junction of Elm Avenue and Main Street; its"):
        choose(streets=["Elm Avenue", "Main Street"])


def test_streets_of_several_junctions_leave_the_choice_between_them():
    assert find_streets(TOWN, FILE, ["Main Street"]) == [MAIN, SIDE]
    with pytest.raises(InputError, match=r"has 2 junctions; choose one with .* 2 \(3 legs"):
        choose(streets=["Main Street"])
    assert choose(streets=["Main Street"], center=(390.0, 5.0)) is SIDE


@pytest.mark.parametrize(
    ("center", "found"), [((3.0, -4.0), MAIN), ((300.0, 40.0), SIDE), ((10.0, 280.0), RING)]
)
def test_the_nearest_junction_is_taken(center, found):
    assert choose(center=center) is found
    assert choose(TOWN[::-1], center=center) is found


@pytest.mark.parametrize(("far", "refused"), [(149.0, False), (151.0, True)])
def test_a_place_too_far_from_every_junction_is_refused_with_the_distance(far, refused):
    if not refused:
        assert choose((SIDE,), center=(400.0, far)) is SIDE
        return
    with pytest.raises(InputError, match=r"nearest to 400,151 is 151 m away; there are 2 \(3"):
        choose((SIDE,), center=(400.0, far))


@given(st.floats(-60.0, 60.0), st.floats(-179.0, 179.0), st.sampled_from(TOWN))
def test_in_a_file_with_degrees_a_place_is_latitude_and_longitude(lat, lon, wanted):
    town = [replace(each, origin=(lat, lon)) for each in TOWN]
    place = project_to_degrees((lat, lon), np.array(wanted.xy) + np.array([3.0, -2.0]))
    chosen = choose(town, center=place)
    assert chosen.id == wanted.id
    assert chosen.degrees == pytest.approx(
        project_to_degrees((lat, lon), np.array(wanted.xy)), abs=1e-9
    )


def test_a_file_without_degrees_has_none_for_its_junctions():
    assert MAIN.degrees is None


def test_of_two_equally_near_the_first_id_is_taken():
    a, b = make_junction("a", (10.0, 0.0), *"xyz"), make_junction("b", (-10.0, 0.0), *"xyz")
    assert choose((b, a), center=(0.0, 0.0)) is a


@pytest.mark.parametrize(("ring", "kind"), [(False, "junction"), (True, "roundabout")])
def test_a_junction_known_not_to_be_representable_is_refused_with_the_reason(ring, kind):
    bad = replace(SIDE, refusal="it is under water", is_roundabout=ring)
    with pytest.raises(InputError) as refused:
        choose((bad, MAIN), junction="2")
    assert str(refused.value) == f"{kind} 2 of town.osm cannot be imported: it is under water"


def test_the_name_of_a_junction_is_its_streets_without_doubles():
    assert MAIN.name == "Main Street, Mill Lane"
    assert MAIN.legs == 4
    assert make_junction("9", (0.0, 0.0), "", "", "").name == ""
    assert len(make_junction("9", (0.0, 0.0), "a" * 60, "b" * 60).name) == 80


# How nodes of a network become junctions.


def build_network(places, pieces, degrees=0.0, *, mirrored=False, origin=None):
    """Junctions of straight pieces (from, to, name[, flags]), the network turned."""
    a = math.radians(degrees)
    matrix = np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]])
    spots = {
        name: np.array(xy, float) * ([1, -1] if mirrored else [1, 1]) @ matrix
        for name, xy in places.items()
    }
    made = [
        StreetPiece(s, e, np.array([spots[s], spots[e]]), name, **dict.fromkeys(flags, True))
        for s, e, name, *flags in pieces
    ]
    return group_junctions(spots, made, origin)


CROSS = {"m": (0, 0), "e": (90, 0), "n": (0, 90), "w": (-90, 0), "s": (0, -90)}
ARMS = [("m", far, far.upper()) for far in "enws"]


@given(st.floats(0.0, 360.0), st.permutations(range(4)), st.lists(st.booleans(), min_size=4))
def test_a_cross_is_one_junction_however_its_pieces_are_listed_drawn_and_turned(
    degrees, order, flips
):
    pieces = [
        (b, a, name) if flip else (a, b, name)
        for (a, b, name), flip in zip((ARMS[k] for k in order), flips, strict=False)
    ]
    [found] = build_network(CROSS, pieces, degrees)
    assert (found.id, found.legs, found.nodes) == ("m", 4, {"m"})
    for name, bearing in zip(found.streets, found.bearings, strict=True):
        expected = math.radians(degrees + 90.0 * "ENWS".index(name))
        assert math.remainder(bearing - expected, math.tau) == pytest.approx(0.0, abs=1e-6)
    assert list(found.bearings) == sorted(found.bearings)


@pytest.mark.parametrize(
    ("gap", "flags", "count"),
    [
        (14.0, (), 1), (16.0, (), 2),
        (24.0, ("is_one_way",), 1), (26.0, ("is_one_way",), 2),
        (69.0, ("is_slip",), 1), (71.0, ("is_slip",), 2),
    ],
)  # fmt: skip
def test_nodes_that_a_short_piece_connects_are_one_junction(gap, flags, count):
    places = {"a": (0, 0), "b": (gap, 0), "w": (-200, 0), "e": (gap + 200, 0)}
    places |= {"n": (0, 200), "s": (gap, -200), "n2": (-200, 200), "s2": (gap + 200, -200)}
    pieces = [("a", "b", "X", *flags), ("w", "a", "X"), ("b", "e", "X")]
    pieces += [("a", "n", "N"), ("b", "s", "S"), ("a", "n2", "N2"), ("b", "s2", "S2")]
    found = build_network(places, pieces)
    assert len(found) == count
    assert {frozenset(each.nodes) for each in found} == (
        {frozenset("ab")} if count == 1 else {frozenset("a"), frozenset("b")}
    )


@pytest.mark.parametrize(
    ("median", "name", "count"), [(40.0, "Main", 1), (50.0, "Main", 2), (30.0, "Other", 2)]
)
@pytest.mark.parametrize("degrees", [0.0, 37.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_carriageways_of_one_street_are_one_junction_up_to_its_widest_median(
    median, name, count, degrees, mirrored
):
    half = median / 2
    places = {"a": (0, half), "b": (0, -half), "n": (0, 200), "s": (0, -200)}
    places |= {"aw": (-200, half), "ae": (200, half), "bw": (-200, -half), "be": (200, -half)}
    pieces = [("ae", "a", "Main", "is_one_way"), ("a", "aw", "Main", "is_one_way")]
    pieces += [("bw", "b", name, "is_one_way"), ("b", "be", name, "is_one_way")]
    pieces += [("n", "a", "Side"), ("b", "s", "Side"), ("a", "b", "Side")]
    assert len(build_network(places, pieces, degrees, mirrored=mirrored)) == count


@pytest.mark.parametrize(("side", "count"), [(40.0, 1), (50.0, 3)])
def test_a_small_triangle_of_streets_stands_round_an_island(side, count):
    corners = [
        (side / math.sqrt(3) * math.cos(a), side / math.sqrt(3) * math.sin(a))
        for a in (math.pi / 2 + k * math.tau / 3 for k in range(3))
    ]
    places = {f"c{k}": xy for k, xy in enumerate(corners)}
    places |= {f"f{k}": (8 * x, 8 * y) for k, (x, y) in enumerate(corners)}
    pieces = [(f"c{k}", f"c{(k + 1) % 3}", "") for k in range(3)]
    pieces += [(f"c{k}", f"f{k}", f"S{k}") for k in range(3)]
    found = build_network(places, pieces)
    assert len(found) == count
    if count == 1:
        assert sorted(found[0].streets) == ["S0", "S1", "S2"]
        assert found[0].xy == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_star_of_more_legs_than_names_is_listed_with_its_refusal():
    far = {f"f{k}": (90 * math.cos(k * 0.6), 90 * math.sin(k * 0.6)) for k in range(10)}
    [found] = build_network({"m": (0, 0)} | far, [("m", name, name) for name in far])
    assert found.refusal == "it has 10 legs; an intersection has 3 to 8"


def test_the_id_is_the_least_of_the_nodes_by_length_first():
    places = {
        "10": (0, 0),
        "9": (10, 0),
        "w": (-90, 0),
        "e": (100, 0),
        "n": (0, 90),
        "s": (10, -90),
    }
    pieces = [("10", "9", ""), ("w", "10", ""), ("9", "e", ""), ("10", "n", ""), ("9", "s", "")]
    [found] = build_network(places, pieces, origin=(48.0, 9.0))
    assert (found.id, found.xy) == ("9", (5.0, 0.0))
    assert found.degrees == pytest.approx(project_to_degrees((48.0, 9.0), np.array([5.0, 0.0])))


def test_pieces_without_length_are_nothing():
    pieces = [*ARMS, ("m", "m2", "Zero")]
    [found] = build_network(CROSS | {"m2": (0, 0)}, pieces)
    assert found.nodes == {"m"}


def test_the_name_at_the_end_of_a_piece_is_its_last_one():
    line = np.array([(0.0, 0.0), (50.0, 0.0)])
    piece = StreetPiece("a", "b", line, "First", last_name="Last")
    assert (piece.name_at("a"), piece.name_at("b")) == ("First", "Last")
    assert StreetPiece("a", "b", line, "First").name_at("b") == "First"
