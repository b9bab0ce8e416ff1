"""Road users, objects and pronouns are found in small texts."""

import pytest

from scenewright.tools.account.mentions import Mention, find_mentions
from scenewright.tools.account.vocabulary import read_tokens


def find(text: str) -> tuple[Mention, ...]:
    return find_mentions(read_tokens(text))


def test_a_noun_phrase_goes_from_its_article_to_its_noun() -> None:
    tokens = read_tokens("There is a small red car")
    (car,) = find_mentions(tokens)
    assert [t.text for t in tokens[car.start : car.stop]] == ["a", "small", "red", "car"]
    assert (car.classes, car.count, car.new) == ({"car"}, 1, True)


@pytest.mark.parametrize(
    ("text", "classes"),
    [
        ("a lorry", {"truck"}),
        ("a boy on a bike", {"cyclist"}),
        ("a woman driving a van", {"van"}),
        ("the police van", {"emergency"}),
        ("someone", {"pedestrian", "any"}),
        ("V1", {"vehicle"}),
        ("ped2", {"pedestrian"}),
    ],
)
def test_a_noun_says_which_classes_are_meant(text: str, classes: set[str]) -> None:
    (mention,) = find(text)
    assert mention.classes <= classes


@pytest.mark.parametrize(
    ("text", "count"),
    [("two cars", 2), ("a car", 1), ("cars", None), ("several cars", None), ("a dozen cars", 12)],
)
def test_numbers_and_plurals_are_counted(text: str, count: int | None) -> None:
    (mention,) = find(text)
    assert mention.count == count


def test_the_other_way_is_no_road_user() -> None:
    (driver,) = find("a driver coming the other way turns left")
    assert driver.classes == {"vehicle"}


def test_those_around_and_those_who_are_not_there_are_told_apart() -> None:
    asked, others, nobody = find("A bus with three other cars and no pedestrians")
    assert (asked.background, asked.absent) == (False, False)
    assert (others.background, others.count, others.absent) == (True, 3, False)
    assert (nobody.absent, nobody.classes) == (True, {"pedestrian"})


def test_pronouns_and_labels_stand_for_those_told_of_before() -> None:
    mentions = find("Car A follows car B. A hits it")
    assert [m.label for m in mentions] == ["a", "b", "a", None]
    assert [m.pronoun for m in mentions] == [False, False, True, True]


def test_what_is_said_to_be_parked_is_an_object() -> None:
    assert [m.object for m in find("a van is parked and a man is parked")] == [True, False]


def test_a_number_may_stand_close_to_its_noun() -> None:
    first, second = find("veh1 hits ped2")
    assert (first.label, second.label) == ("1", "2")


def test_a_parked_vehicle_is_an_object() -> None:
    cyclist, van = find("A cyclist passes a parked van")
    assert (cyclist.object, van.object) == (False, True)


def test_a_noun_that_describes_another_is_no_road_user() -> None:
    assert [m.classes for m in find("A car stops at the pedestrian crossing")] == [{"car"}]


def test_words_in_brackets_stand_for_what_a_label_names() -> None:
    text = "Vehicle 1 (eastbound car) struck vehicle 2 (northbound motorcycle)"
    assert [each.label for each in find_mentions(read_tokens(text))] == ["1", "1", "2", "2"]


def test_a_counted_vehicle_before_an_event_may_be_of_any_class() -> None:
    assert find("two vehicle accident, a scooter and a van")[0].classes == {"any"}
    assert find("two car accident")[0].classes == {"car"}


def test_a_man_told_of_again_is_the_one_who_rides() -> None:
    assert "cyclist" in find("a car passes a man on a bike and the man swerves")[2].classes
    assert find("a car passes a man on a bike and a man walks")[2].classes == {"pedestrian"}


def test_a_group_of_so_many_is_one_mention_of_so_many() -> None:
    tokens = read_tokens("a car yields to a group of five pedestrians")
    _, group = find_mentions(tokens)
    assert [token.text for token in tokens[group.start : group.stop]] == [
        "a", "group", "of", "five", "pedestrians",
    ]  # fmt: skip
    assert (group.classes, group.count, group.new) == ({"pedestrian"}, 5, True)
