"""Pictures: they exist, show something, take any text, and are whole or absent."""

from __future__ import annotations

import subprocess
import sys
from io import BytesIO
from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from scenewright.errors import InputError
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import EventRecord, SceneRecord
from scenewright.viz import animate_scene, draw_intersection, draw_scene
from scenewright.viz.animation import AnimatedScene, choose_frame_times
from scenewright.viz.appearance import (
    BACKGROUND_VEHICLE,
    choose_colours,
    list_motions,
    make_printable,
    parse_colour,
)
from scenewright.viz.drawing import Drawing, create_page, measure_block
from scenewright.viz.fonts import find_unshown, make_drawable, measure_text
from scenewright.viz.painting import paint
from scenewright.viz.still import draw_page
from scenewright.viz.video import film_scene

HOSTILE = (
    "A car\nyields \x1b[31m$\\frac{1}{0}$ _{x} 行人 \u202eleft\ud800 & <b>" + " very long" * 4000
)


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def decode(png: bytes) -> np.ndarray:
    with Image.open(BytesIO(png)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def share_of(picture: np.ndarray, colour: str) -> float:
    return float((np.abs(picture - np.array(parse_colour(colour))).sum(axis=2) < 30).mean())


def read_words(drawing: Drawing) -> list[tuple[str, dict[str, str]]]:
    """Every line of text of a page and its attributes."""
    found = ElementTree.fromstring(drawing.build_svg()).iter("{http://www.w3.org/2000/svg}text")
    return [(each.text or "", each.attrib) for each in found]


def asked(scene: SceneRecord, prompt: str) -> SceneRecord:
    return scene.model_copy(update={"meta": scene.meta.model_copy(update={"user_prompt": prompt})})


def test_still_shows_every_foreground_agent_in_its_colour(
    tmp_path: Path, scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> None:
    draw_scene(tmp_path / "a.png", scene=scene, proof=proof, intersection=intersection, dpi=100)
    picture = pixels(tmp_path / "a.png")
    assert picture.shape[1] == 700
    shades = choose_colours(scene)
    assert share_of(picture, shades[1]) > 1e-3
    assert share_of(picture, shades[2]) > 2e-4
    assert share_of(picture, BACKGROUND_VEHICLE) > 1e-3
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_north_is_up_and_east_right(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    """The car stands east of the middle, the walker north-east of it."""
    draw_scene(tmp_path / "a.png", scene=scene, proof=None, intersection=intersection, dpi=100)
    picture = pixels(tmp_path / "a.png")[:740]
    spots = {}
    for number in (1, 2):
        colour = choose_colours(scene)[number]
        found = np.argwhere(np.abs(picture - np.array(parse_colour(colour))).sum(axis=2) < 30)
        spots[number] = found.mean(axis=0)
    assert spots[1][1] > 350
    assert spots[2][0] < spots[1][0]


def test_amber_words_stand_beside_the_tick_of_picture_and_animation(
    scene: SceneRecord, proof: Proof, partly: Proof, intersection: IntersectionMap
) -> None:
    bare = proof.model_copy(update={"account": ()})
    for checked, words, colour in (
        (proof, "✓ verified", "#15803D"),
        (partly, "✓ partly\n'coming', 'light' not shown", "#A15C00"),
        (bare, "✓ verified\nno account of words", "#A15C00"),
        (partly.model_copy(update={"verified": False}), "not verified\n'coming', 'light' not shown",
         "#B3202A"),
    ):  # fmt: skip
        written = read_words(draw_page(scene, checked, intersection))
        shades = [style["fill"] for line, style in written if line in words.split("\n")]
        assert shades == [colour] * len(words.split("\n"))
        facts, style = read_words(AnimatedScene(scene, checked, intersection).still)[-1]
        assert facts.endswith(f" {checked.describe_verdict()}")
        assert style["fill"] == colour


def test_same_scene_gives_the_same_bytes(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    for name in ("a.png", "b.png"):
        draw_scene(tmp_path / name, scene=scene, proof=None, intersection=intersection, dpi=60)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_any_prompt_is_only_text(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    draw_scene(
        tmp_path / "a.png",
        scene=asked(scene, HOSTILE),
        proof=None,
        intersection=intersection,
        dpi=60,
    )
    assert pixels(tmp_path / "a.png").shape[0] < 700


def test_a_scene_without_agents_or_events_can_be_drawn(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    normal = EventRecord.model_validate(
        {"type": "normal", "from": None, "to": None, "time": None, "location": None}
    )
    empty = scene.model_copy(update={"agents": (), "events": (normal,), "signals": ()})
    draw_scene(tmp_path / "a.png", scene=empty, proof=None, intersection=intersection, dpi=60)
    assert pixels(tmp_path / "a.png").std() > 5


@pytest.mark.parametrize("where", ["missing/a.png", "file/a.png", "folder"])
def test_nothing_is_left_half_written(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap, where: str
) -> None:
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match="cannot write") as caught:
        draw_scene(tmp_path / where, scene=scene, proof=None, intersection=intersection, dpi=40)
    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_whole_animation_moves_and_is_slow_round_its_event(
    tmp_path: Path, scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> None:
    path = tmp_path / "a.gif"
    animate_scene(path, scene=scene, proof=proof, intersection=intersection, fps=1, whole=True)
    with Image.open(path) as image:
        lasts, shown = 0, []
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            lasts += image.info["duration"]
            shown.append(np.asarray(image.convert("RGB")).astype(int))
    assert lasts == pytest.approx(31_000 + 2 * 2_000, abs=1_000)
    assert all((a != b).any() for a, b in pairwise(shown))
    assert path.stat().st_size < 1_000_000
    orange = [share_of(picture, choose_colours(scene)[1]) for picture in shown]
    assert max(orange) > 1e-3 > min(orange)


def test_names_and_the_label_of_an_event_do_not_overlap(
    scene: SceneRecord, intersection: IntersectionMap
) -> None:
    animated = AnimatedScene(scene, None, intersection)
    [mark] = animated.marks
    for time in np.arange(mark.time, mark.time + 1.0, 0.2):
        boxes = []
        for words, style in read_words(animated.draw_moving(float(time))):
            size, bold = float(style["font-size"]), "font-weight" in style
            wide, high = measure_block([words], size, bold=bold)
            left = float(style["x"]) - (wide / 2 if style["text-anchor"] == "middle" else 0)
            base = float(style["y"])
            boxes.append((left, base - high, left + wide, base))
        assert len(boxes) == 4
        assert not any(
            a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
            for a, b in combinations(boxes, 2)
        )


def test_an_animation_ends_two_seconds_after_its_event(scene: SceneRecord) -> None:
    times = choose_frame_times(scene, fps=10)
    assert times[-1] == pytest.approx(8.2 + 2.0, abs=0.11)
    steps = np.diff(times)
    assert steps[30] == pytest.approx(0.1)
    slow = (times[:-1] > 7.1) & (times[1:] < 8.9)
    assert steps[slow] == pytest.approx(0.1 / 3, abs=1e-3)


def test_a_scene_without_events_is_animated_whole(scene: SceneRecord) -> None:
    quiet = scene.model_copy(update={"events": ()})
    times = choose_frame_times(quiet, fps=10)
    assert times == pytest.approx(np.arange(301) / 10)


def test_frames_are_handed_to_the_encoder_whole_and_its_words_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene: SceneRecord,
    intersection: IntersectionMap,
) -> None:  # fmt: skip
    encoder = tmp_path / "encoder"
    encoder.write_text(
        "#!/usr/bin/env python3\nimport sys\n"
        "frames = sys.stdin.buffer.read()\nwide, high = map(int, sys.argv[8].split('x'))\n"
        "assert frames and len(frames) % (wide * high * 3) == 0, 'part of a frame'\n"
        "open(sys.argv[-1], 'wb').write(frames[:9])\n"
    )
    encoder.chmod(0o755)
    monkeypatch.setattr("scenewright.viz.video.find_ffmpeg", lambda: str(encoder))
    monkeypatch.setattr("scenewright.viz.video.FPS", 1)
    film_scene(tmp_path / "a.mp4", scene=scene, proof=None, intersection=intersection)
    assert len((tmp_path / "a.mp4").read_bytes()) == 9
    encoder.write_text("#!/bin/sh\necho no such codec >&2; exit 1\n")
    with pytest.raises(InputError, match="no such codec"):
        film_scene(tmp_path / "b.mp4", scene=scene, proof=None, intersection=intersection)
    assert not (tmp_path / "b.mp4").exists()


@pytest.mark.parametrize("fps", [0, 51])
def test_animation_refuses_absurd_frame_rates(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap, fps: int
) -> None:
    with pytest.raises(InputError, match="frames per second"):
        animate_scene(
            tmp_path / "a.gif", scene=scene, proof=None, intersection=intersection, fps=fps
        )


def test_intersection_with_tracks_and_samples(
    tmp_path: Path, intersection: IntersectionMap
) -> None:
    track = np.array([(4.95, -60.0), (4.95, 60.0)])
    draw_intersection(
        tmp_path / "a.png", intersection=intersection, tracks=[track], samples=[track + 1.0], dpi=60
    )
    draw_intersection(tmp_path / "b.png", intersection=intersection, dpi=60)
    with_tracks, alone = pixels(tmp_path / "a.png"), pixels(tmp_path / "b.png")
    assert with_tracks.shape == alone.shape
    assert (with_tracks != alone).any()


def test_an_agent_is_shown_only_while_it_is_there(scene: SceneRecord) -> None:
    walker = next(motion for motion in list_motions(scene) if motion.agent.id == 2)
    assert walker.find_sample(1.9) is None
    assert walker.find_sample(2.0) == 0
    assert walker.find_sample(24.0) == len(walker.times) - 1
    assert walker.find_sample(24.2) is None


def test_after_a_collision_the_footprint_stays(scene: SceneRecord) -> None:
    crash = EventRecord.model_validate(
        {"type": "collision", "from": 1, "to": 2, "time": 24.0, "location": (0.0, 0.0)}
    )
    walker = next(
        m for m in list_motions(scene.model_copy(update={"events": (crash,)})) if m.agent.id == 2
    )
    assert walker.find_sample(29.0) == len(walker.times) - 1


def test_outline_of_a_turned_vehicle(scene: SceneRecord) -> None:
    """Car 3 drives east: its footprint is 4.6 m along x and 1.85 m along y around its centre."""
    car = next(motion for motion in list_motions(scene) if motion.agent.id == 3)
    outline = car.compute_outline(0)
    assert np.ptp(outline, axis=0) == pytest.approx([4.6, 1.85], abs=1e-6)
    assert car.compute_front(0) == pytest.approx([-40 + 2.3, -1.65], abs=1e-6)


def test_printable_keeps_one_short_line() -> None:
    assert make_printable("a\n\tb\x00 c") == "a b c"
    assert len(make_printable("x" * 100_000, limit=50)) == 50
    assert make_printable("x" * 50, limit=50) == "x" * 50


def test_words_are_data_and_characters_of_no_font_are_boxes() -> None:
    page = create_page(3.0, 1.0)
    page.write('<b fill="red">\x1b[31m & \ud800\U0010fffd', (0.1, 0.1), 8)
    page.write("two\nlines", (0.1, 0.5), 8)
    assert [words for words, _ in read_words(page)] == ['<b fill="red"> [31m &', "two", "lines"]
    assert make_drawable("née ✓ Ωж") == "née ✓ Ωж"
    assert find_unshown("a𒀀𒀀") == "𒀀"
    assert make_drawable("a𒀀") == "a□"


def test_text_is_at_most_a_little_narrower_than_measured() -> None:
    for bold in (False, True):
        page = create_page(4.0, 0.4)
        page.write("Pedestrian-1: AVA to Wells", (0.0, 0.2), 16, bold=bold)
        ink = np.flatnonzero((decode(page.render(100)) < 128).any(axis=(0, 2)))
        wide = measure_text("Pedestrian-1: AVA to Wells", 16, bold=bold) / 72 * 100
        assert 0.95 * wide < np.ptp(ink) <= wide  # measured without kerning


def test_what_lies_outside_a_map_is_not_seen() -> None:
    page = create_page(2.0, 2.0)
    axes = page.add_map((0.0, 10.0, 0.0, 10.0), 0.5, 0.5, 1.0, 1.0)
    axes.draw([[(-20.0, 5.0), (30.0, 5.0)]], order=2, stroke="#FF0000", stroke_width=30)
    axes.mark([(5.0, 5.0)], 20, order=3, fill="#0000FF")
    axes.mark([(5.0, 5.0)], 30, order=1, fill="#00FF00")
    picture = decode(page.render(100))
    assert picture[100, 20].tolist() == [255, 255, 255]
    assert picture[100, 60].tolist() == [255, 0, 0]
    assert picture[100, 100].tolist() == [0, 0, 255]


def test_a_painted_drawing_looks_like_the_rendered_one(
    scene: SceneRecord, intersection: IntersectionMap
) -> None:
    drawing = AnimatedScene(scene, None, intersection).draw_moving(8.4)
    rendered = decode(drawing.render(100))
    image = Image.new("RGB", (1620, 1620), "white")
    paint(drawing, image, 300 / 72)
    painted = np.asarray(image.reduce(3)).astype(int)
    assert rendered.shape == painted.shape
    assert (rendered < 255).any(axis=2).mean() > 0.02
    assert np.abs(rendered - painted).mean() < 0.5
    assert (np.abs(rendered - painted).sum(axis=2) > 200).mean() < 2e-3


def test_a_scene_is_made_and_drawn_without_matplotlib(tmp_path: Path) -> None:
    script = (
        "import sys; from scenewright.cli.main import main\n"
        "words = 'make', 'A car yields to a pedestrian', '--refiner', 'none', '--seed', '1'\n"
        "assert main([*words, '--no-recording', '-q', '--out', sys.argv[1]]) == 0\n"
        "assert 'matplotlib' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "made")], check=True)
    assert pixels(tmp_path / "made" / "scene.png").shape[1] == 1400
