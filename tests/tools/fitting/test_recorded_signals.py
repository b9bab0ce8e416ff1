"""Recorded lights become the programme of an imported map."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
import map_files
from scenewright.errors import InputError
from scenewright.tools.fitting.recorded_signals import fit_recorded_program
from scenewright.tools.map_import import import_map
from scenewright.tools.track_io.signal_files import read_recorded_lights

CYCLE = (
    ("A", 0.0, "green"),
    ("A", 20.0, "yellow"),
    ("A", 23.0, "red"),
    ("B", 0.0, "red"),
    ("B", 26.0, "green"),
    ("B", 44.0, "yellow"),
    ("B", 47.0, "red"),
)
LEGS = {"A": "north", "B": "east", "C": "south", "D": "west"}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    file = map_files.lanelet2(tmp_path_factory.mktemp("maps") / "four.osm")
    return import_map(file, name="four").intersection_map


def write_table(file, cycles=3, header="light,t,colour"):
    """Lights A and C change together, B and D; the cycle is 50 s."""
    rows = [
        f"{light},{50.0 * n + t},{colour}"
        for n in range(cycles)
        for name, t, colour in CYCLE
        for light in ({"A": "AC", "B": "BD"}[name])
    ]
    file.write_text("\n".join((header, *rows)))
    return read_recorded_lights(file)


def test_a_table_of_lights_becomes_the_programme(tmp_path, place):
    made, notes = fit_recorded_program(
        place, write_table(tmp_path / "l.csv"), origin=None, groups=LEGS
    )
    assert made.signals.cycle == pytest.approx(50.0)
    green = dict.fromkeys(LEGS.values(), 0.0)
    for phase in made.signals.phases:
        assert (phase.colours["north"], phase.colours["south"]) == (phase.colours["south"],) * 2
        for leg in green:
            green[leg] += phase.duration * (phase.colours[leg] == "green")
        if phase.colours["walk_north"] == "green":
            assert {phase.colours["north"], phase.colours["south"]} == {"red"}
    assert green == pytest.approx({"north": 20.0, "south": 20.0, "east": 18.0, "west": 18.0})
    assert {m.signal_group for m in made.movements} == set(LEGS.values())
    assert any("50.0 s" in note for note in notes)


def test_what_cannot_be_a_programme_is_refused(tmp_path, place):
    lights = write_table(tmp_path / "l.csv")
    with pytest.raises(InputError, match="south, west leg"):
        fit_recorded_program(place, lights, origin=None, groups={"A": "north", "B": "east"})
    with pytest.raises(InputError, match="names moon"):
        fit_recorded_program(place, lights, origin=None, groups={**LEGS, "A": "moon"})
    short = write_table(tmp_path / "short.csv", cycles=1)
    with pytest.raises(InputError, match="no whole cycle"):
        fit_recorded_program(place, short, origin=None, groups=LEGS)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a,b\n1,2\n", "columns must be"),
        ("light,t,colour\nA,0,blue\n", "no state"),
        ("light,t,colour\nA,soon,red\n", "no time"),
        ("light,t,colour\nA,0,dark\n", "no light"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, text, reason):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=reason):
        read_recorded_lights(tmp_path / "bad.csv")
