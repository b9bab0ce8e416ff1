"""Damaged input of every kind: does each case end in a value or one of our own errors?

    python benchmarks/fuzz.py [--cases 2000] [--seed 0] [--parts planner,tracks] [--json FILE]

Each part takes honest input (instructions, constraint programs, scene.json, track files of every
format that we write, map files, files of an intersection, arguments of MCP tools, requests to the
page), damages it (bytes or words dropped, doubled, exchanged, replaced by odd ones; values of JSON
replaced by others, of other types or absurd), and hands it to the code that reads it; the turns of
conversations are honest, and come in any order. A case is in order if it returns or raises a
`ScenewrightError` of one line, within 6 GB of address space and, the first of a part and those that
make scenes aside, 5 s of processor time; the page must answer below 500. Case n of a part depends
on the seed and n alone, so `--parts tracks --only 17` runs one again. The exit code is 1 if a case
fails; the cases are spread over the parts by how long they take. `make fuzz` runs 100,000.
"""

from __future__ import annotations

import argparse
import asyncio
import copy
import io
import json
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from everyday_requests import ROWS
from robustness import REQUESTS

import scenewright
from authoring import EDITS
from scenewright.errors import ScenewrightError
from scenewright.graph.run import Scene
from scenewright.graph.scene_files import encode_scene
from scenewright.intersections import find_bundle_folder
from scenewright.nodes.prompts import LONGEST_REQUEST

Json = Any
ROOT = Path(__file__).parent.parent
ODD = (
    "", "\x00", "\ufeff", "\u202e", "🚗", "٣", "½", "nan", "-inf", "1e999", "9" * 40, "../..",
    "<b>", "{{x}}", "%s", "\\", '"', "'", "\n", "\t", ",", ";", "null", "-0", "0x1F", "１２", "é",
)  # fmt: skip
ABSURD: tuple[Json, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, -(2**70), 0.0, -1e-300, 1e308, 1e-308, "", "x", "0",
    "nan", [], {}, [[]], [None], {"a": 1}, "🚗" * 50, float("inf"), float("nan"),
)  # fmt: skip


MOST_MEMORY = 6_000_000_000
"""Address space of this process [bytes]; a case that wants more ends in a MemoryError, a fault."""
SLOW, SLOWEST = 2.0, 5.0
"""A text that takes the planner longer, or any case that takes longer, is a fault [s of processor
time]; others may be at work."""


def damage_text(text: str, rng: random.Random) -> str:
    """The text with one to four words or characters changed."""
    for _ in range(rng.randint(1, 4)):
        parts = text.split(" ") if rng.random() < 0.5 else list(text)
        between = " " if len(parts) < len(text) else ""
        k = rng.randrange(len(parts) + 1)
        match rng.randrange(5):
            case 0:
                del parts[k : k + rng.randint(1, 3)]
            case 1:
                parts[k:k] = parts[k : k + 2]
            case 2:
                rng.shuffle(parts[:k] if between else parts)
            case 3:
                parts[k:k] = [rng.choice(ODD)]
            case _:
                parts[k : k + 1] = [rng.choice(ODD)]
        text = between.join(parts)
    return text


def damage_bytes(data: bytes, rng: random.Random) -> bytes:
    """The bytes cut, with pieces exchanged or doubled, or single ones replaced."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        if not found:
            break
        k, length = rng.randrange(len(found)), rng.choice((1, 2, 8, 64, 500))
        match rng.randrange(6):
            case 0:
                del found[k:]
            case 1:
                del found[k : k + length]
            case 2:
                found[k:k] = found[k : k + length]
            case 3:
                found[k : k + 1] = bytes([rng.randrange(256)])
            case 4:
                found[k : k + 1] = rng.choice(ODD).encode("utf-8", "surrogatepass")
            case _:
                digits = [i for i in range(k, min(k + 2000, len(found))) if 48 <= found[i] < 58]
                if digits:
                    at = rng.choice(digits)
                    found[at : at + 1] = rng.choice((b"-1", b"1e9", b"nan", b"999999999", b""))
    return bytes(found)


def damage_json(value: Json, rng: random.Random) -> Json:
    """A copy in which one to three places hold something else, or are gone."""
    value = copy.deepcopy(value)
    for _ in range(rng.randint(1, 3)):
        place, key = value, None
        while isinstance(place, dict | list) and place:
            outer, key = (
                place,
                rng.choice([*(place if isinstance(place, dict) else range(len(place)))]),
            )
            place = outer[key]
            if rng.random() < 0.15:
                break
        if key is None:
            return copy.deepcopy(rng.choice(ABSURD))
        match rng.randrange(4):
            case 0:
                del outer[key]
            case 1 if isinstance(outer[key], int | float) and not isinstance(outer[key], bool):
                outer[key] *= rng.choice((-1, 0, 1.5, 1e6, -1e-9))
            case _:
                outer[key] = copy.deepcopy(rng.choice(ABSURD))
    return value


def list_texts() -> list[str]:
    """Requests of the other benchmarks, and the examples."""
    lines = (ROOT / "examples" / "instructions.txt").read_text(encoding="utf-8").splitlines()
    return [*REQUESTS.values(), *(line for line in lines if line and line[0] != "#")]


@cache
def make_scenes() -> tuple[Scene, ...]:
    """Honest scenes, small ones, of several kinds."""
    texts = (
        "A vehicle yields to a pedestrian at 5 am in light traffic",
        "A car hits a cyclist in light traffic at 5 am",
        "A car rear-ends a truck in light traffic at 6 am",
    )
    return tuple(scenewright.synthesize(text, seed=7, refiner="none") for text in texts)


@cache
def list_records() -> tuple[Json, ...]:
    """Their scene.json."""
    return tuple(json.loads(encode_scene(scene.record)) for scene in make_scenes())


@cache
def list_track_files() -> tuple[tuple[str, bytes], ...]:
    """Name and bytes of the first scene in every format that we write."""
    from scenewright.tools.formats.registry import FORMATS

    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in FORMATS:
            paths = scenewright.export(make_scenes()[0], name, Path(folder) / name)
            found += [(path.name, path.read_bytes()) for path in paths]
    return tuple(found)


@cache
def list_map_files() -> tuple[tuple[str, bytes], ...]:
    """Map files: those of our own exports, and a small one of OpenStreetMap."""
    sys.path.insert(0, str(ROOT / "tests"))
    from map_files import osm  # type: ignore[import-not-found]

    with tempfile.TemporaryDirectory() as folder:
        street = osm(Path(folder) / "small.osm", (0, 90, 180, 270)).read_bytes()
    written = [(n, d) for n, d in list_track_files() if n.endswith((".xodr", ".net.xml"))]
    return (("small.osm", street), *written)


@cache
def list_programs() -> tuple[str, ...]:
    """Constraint programs of the documentation."""
    pages = (ROOT / "docs" / "constraint-language.md").read_text(encoding="utf-8")
    return tuple(re.findall(r"```constraints\n(.*?)```", pages, re.DOTALL))


def plan_text(rng: random.Random, _folder: Path) -> None:
    """The offline planner on a damaged instruction, some as long as they may be."""
    texts = rng.choices(list_texts(), k=rng.choice((1, 1, 1, 1, 3, 25)))
    text = rng.choice((" ", " Then ", " and ", "\n")).join(texts)[:LONGEST_REQUEST]
    before = time.process_time()
    scenewright.plan(damage_text(text, rng))
    if (took := time.process_time() - before) > SLOW:
        raise TimeoutError(f"{took:.2f} s for {len(text)} characters: {text!r}")


def parse_program(rng: random.Random, _folder: Path) -> None:
    """The constraint language on a damaged program."""
    from scenewright.tools.dsl_validator.parse import parse

    parse(damage_text(rng.choice(list_programs()), rng))


def read_scene(rng: random.Random, folder: Path) -> None:
    """The verifier on a damaged scene.json."""
    file = folder / "scene.json"
    if rng.random() < 0.3:
        data = json.dumps(list_records()[0]).encode()
        file.write_bytes(damage_bytes(data, rng))
    else:
        file.write_text(json.dumps(damage_json(rng.choice(list_records()), rng)))
    scenewright.verify(file)


def read_track_file(rng: random.Random, _folder: Path) -> None:
    """The readers of foreign tracks on a damaged file."""
    from scenewright.tools.track_io.external_tracks import read_external_recordings

    name, data = rng.choice(list_track_files())
    read_external_recordings(damage_bytes(data, rng), name=name)


def read_map(rng: random.Random, folder: Path) -> None:
    """The import of maps on a damaged file."""
    from scenewright.tools.map_import import import_map

    name, data = rng.choice(list_map_files())
    (folder / name).write_bytes(damage_bytes(data, rng))
    import_map(folder / name, name="small")


def damage_arrays(data: bytes, rng: random.Random) -> bytes:
    """A .npz in which one array holds another number, is cut short, of another type or gone."""
    with np.load(io.BytesIO(data)) as stored:
        arrays = dict(stored)
    name = rng.choice(sorted(arrays))
    array = arrays.pop(name)
    match rng.randrange(5):
        case 0 if array.size and array.dtype.kind in "fi":
            array.reshape(-1)[rng.randrange(array.size)] = rng.choice((0, -1, 7, 1e6, -1e-9, 1e300))
        case 1:
            array = array[: rng.randrange(len(array) + 1)] if array.ndim else array[None]
        case 2:
            kinds = ("S8",) if array.dtype.kind == "U" else ("U8", "i8", "f4", "?")
            array = array.astype(rng.choice(kinds))
        case 3:
            array = np.repeat(np.atleast_1d(array), 2, axis=0)
    if rng.random() < 0.9:
        arrays[name] = array
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def use_bundle(rng: random.Random, folder: Path) -> None:
    """A scene at an intersection of which one file is damaged; if one is made, it is verified."""
    shipped = find_bundle_folder("amsterdam_120")
    files = ("map.json", "priors.npz", "demand.json", "manners.json")
    name = f"odd-{rng.randrange(10**9)}"
    (folder / name).mkdir()
    for each in files:
        shutil.copy(shipped / each, folder / name / each)
    file = (
        folder
        / name
        / rng.choice(("map.json", "map.json", "priors.npz", "demand.json", "manners.json"))
    )
    data = file.read_bytes()
    if rng.random() < 0.2:
        damaged = damage_bytes(data, rng)
    elif file.suffix == ".npz":
        with np.errstate(all="ignore"):
            damaged = damage_arrays(data, rng)
    else:
        damaged = json.dumps(damage_json(json.loads(data), rng)).encode()
    file.write_bytes(damaged)
    before = os.environ.get("SCENEWRIGHT_INTERSECTIONS")
    os.environ["SCENEWRIGHT_INTERSECTIONS"] = str(folder)
    try:
        made = scenewright.synthesize(
            "A car yields to a pedestrian at 5 am in light traffic", seed=1, intersection=name,
            refiner="none", max_agents=3, time_limit=SLOWEST,
        )  # fmt: skip
        if not scenewright.verify(made, intersection=name).verified:
            raise RuntimeError("a scene that is not verified was handed out")
    finally:
        os.environ.pop("SCENEWRIGHT_INTERSECTIONS")
        if before is not None:
            os.environ["SCENEWRIGHT_INTERSECTIONS"] = before


def write_export(rng: random.Random, folder: Path) -> None:
    """An exporter on a damaged scene.json."""
    from scenewright.tools.formats.registry import FORMATS

    file = folder / "scene.json"
    file.write_text(json.dumps(damage_json(rng.choice(list_records()), rng)))
    scenewright.export(file, rng.choice(list(FORMATS)), folder / "out")


@cache
def open_tools() -> tuple[Any, tuple[str, ...]]:
    """The server of one MCP session with a scene in it, and its tools' names."""
    from scenewright.cli.mcp import build_server
    from scenewright.cli.options import SessionOptions

    file = str(Path(tempfile.mkdtemp(prefix="scenewright-fuzz-")) / "threads.sqlite")
    server = build_server(SessionOptions(threads=file), thread="t", out=None)
    asyncio.run(server.call_tool("make_scene", {"instruction": list_texts()[0]}))
    return server, tuple(sorted(tool.name for tool in asyncio.run(server.list_tools())))


def call_tool(rng: random.Random, _folder: Path) -> None:
    """A tool for agents with odd arguments, as the protocol hands them on."""
    from pydantic import ValidationError

    server, names = open_tools()
    name = rng.choice(names)
    (tool,) = (each for each in asyncio.run(server.list_tools()) if each.name == name)
    wanted = tool.input_schema.get("properties", {})
    text = damage_text(rng.choice(list_texts()), rng)[:60]
    told = {key: rng.choice((*ABSURD, *ODD, text, text)) for key in wanted}
    try:
        asyncio.run(server.call_tool(name, told))
    except Exception as error:
        # The protocol wraps what a tool raises, and its own refusal of arguments.
        cause = error.__cause__ or error
        if not isinstance(cause, ValidationError | ScenewrightError):
            raise


@cache
def open_page() -> tuple[Any, str]:
    """A client of the page, and a conversation with one scene."""
    from starlette.testclient import TestClient

    from scenewright.cli.options import SessionOptions
    from scenewright.cli.page.server import Page, build_app

    folder = Path(tempfile.mkdtemp(prefix="scenewright-fuzz-"))
    options = SessionOptions(threads=str(folder / "threads.sqlite"), seed=1)
    page = Page(options, options.model.load(), folder)
    app = build_app(page, token="t", hosts=frozenset({"127.0.0.1:1"}))
    client = TestClient(app, base_url="http://127.0.0.1:1", headers={"x-token": "t"})
    thread = client.post("/api/threads", json={"intersection": "amsterdam_120"}).json()["thread"]
    client.post(f"/api/threads/{thread}/turn", json={"action": "say", "argument": list_texts()[0]})
    return client, thread


def request_page(rng: random.Random, _folder: Path) -> None:
    """A damaged request to the page; an answer of 500 or more is a fault."""
    client, thread = open_page()
    routes = [
        ("GET", f"/api/threads/{thread}", None),
        ("GET", f"/api/threads/{thread}/compare?a=1&b=1", None),
        ("GET", f"/api/threads/{thread}/made?version=1", None),
        ("GET", f"/api/threads/{thread}/handles?version=1", None),
        ("GET", f"/api/threads/{thread}/page.html?version=1&over=1", None),
        ("GET", "/api/batches/batch-1?after=0", None),
        ("GET", "/api/batches/batch-1/1/page.html", None),
        ("GET", f"/api/threads/{thread}/scene.json", None),
        ("GET", "/api/intersections/amsterdam_120.png", None),
        ("POST", "/api/threads", {"intersection": "amsterdam_120"}),
        ("POST", f"/api/threads/{thread}/turn", {"action": "goto", "argument": "1"}),
        ("POST", f"/api/threads/{thread}/turn", {"action": "undo", "argument": ""}),
        ("POST", "/api/settings/backend", {"backend": "builtin", "base_url": ""}),
        ("POST", "/api/maps/0123456789abcdef.osm/import", {"name": "small", "junction": "1"}),
    ]
    method, path, body = rng.choice(routes)
    if body is None or rng.random() < 0.3:
        path = "/" + quote(damage_text(path[1:], rng), safe="/?=&%<>.", errors="replace")
    data = b"" if body is None else json.dumps(damage_json(body, rng)).encode()
    if data and rng.random() < 0.3:
        data = damage_bytes(data, rng)
    answer = client.request(method, path, content=data)
    if answer.status_code >= 500:
        raise RuntimeError(f"{method} {path!r} {data!r}: {answer.status_code} {answer.text[:200]}")


TURNS = (
    *EDITS, "remove vehicle-3", "remove the last pedestrian", "the van goes first instead", "undo",
    "redo", "make it a collision at 30 km/h", "turn it into a yield", "remove all pedestrians",
    "add a parked truck that hides the pedestrian", "add a cyclist from the north", "swap the two",
    "now the pedestrian crosses on the east crosswalk", "make the second one a bus",
    "make the first vehicle come from the north", "make it a truck", "he does not react",
    "make him brake hard", "go back to version 1", "let it happen 3 seconds later", "who yields?",
    "make it night and add three cars", "add an ambulance that runs a red light", "what happens?",
    "make it quieter",
)  # fmt: skip


def hold_conversation(rng: random.Random, _folder: Path) -> None:
    """An everyday request and four turns, which may end in any answer; half of them refined."""
    from scenewright.authoring.session import Session
    from scenewright.backends import load_backend
    from scenewright.memory.threads import Threads

    refiner = rng.choice(("none", "trajnet"))
    setting: Any = {"intersection": "amsterdam_120", "seed": rng.randrange(99), "refiner": refiner}
    session = Session(Threads(":memory:"), "talk", backend=load_backend("builtin"), setting=setting)
    first = rng.choice((*list_texts(), *list_everyday_texts()))
    for words in (first, *rng.choices(TURNS, k=4)):
        session.say(words)


@cache
def list_everyday_texts() -> tuple[str, ...]:
    """The texts of the everyday requests."""
    return tuple(json.loads(line)["text"] for line in ROWS.read_text("utf-8").splitlines())


PARTS: Mapping[str, tuple[Callable[[random.Random, Path], None], float]] = {
    "planner": (plan_text, 0.2),
    "constraints": (parse_program, 0.2),
    "scenes": (read_scene, 0.1),
    "tracks": (read_track_file, 0.35),
    "maps": (read_map, 0.01),
    "bundles": (use_bundle, 0.005),
    "exports": (write_export, 0.05),
    "mcp": (call_tool, 0.04),
    "page": (request_page, 0.05),
    "conversations": (hold_conversation, 0.002),
}
"""Part -> what one case does, and its share of the cases."""
MAKE_SCENES = ("bundles", "mcp", "conversations")
"""Parts whose cases may take as long as a scene may."""


def run_case(part: str, n: int, seed: int) -> str | None:
    """What is wrong with one case; None if it is in order."""
    rng = random.Random(f"{seed}/{part}/{n}")
    with tempfile.TemporaryDirectory() as folder:
        try:
            PARTS[part][0](rng, Path(folder))
        except ScenewrightError as error:
            lines = str(error).splitlines()
            return None if len(lines) <= 1 else f"{len(lines)} lines: {error!r}"[:2000]
        except Exception:
            return traceback.format_exc(limit=-4)
    return None


def main() -> None:
    """Runs the cases, and says which fail."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--only", type=int, help="Number of the one case of each part.")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    report: dict[str, Any] = {}
    for part in asked.parts.split(","):
        count = max(int(asked.cases * PARTS[part][1]), 1)
        numbers = [asked.only] if asked.only is not None else range(count)
        report[part] = run_part(part, list(numbers), asked.seed)
    if asked.json:
        asked.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    sys.exit(1 if any(each["faults"] for each in report.values()) else 0)


def run_part(part: str, numbers: list[int], seed: int) -> dict[str, Any]:
    """The report of one part; prints a line, and each kind of fault once."""
    faults: dict[int, str] = {}
    slowest, begin = (0.0, 0), time.perf_counter()
    for n in numbers:
        start = time.process_time()
        fault = run_case(part, n, seed)
        took = time.process_time() - start
        slowest = max(slowest, (took, n))
        if fault is None and took > SLOWEST and part not in MAKE_SCENES and n != numbers[0]:
            fault = f"{took:.1f} s of processor time"
        if fault is not None:
            faults[n] = fault
    took = time.perf_counter() - begin
    print(
        f"{part}: {len(numbers)} cases, {len(faults)} faults; {took:.1f} s, slowest "
        f"{slowest[0]:.2f} s (case {slowest[1]})",
        flush=True,
    )
    kinds = {fault.strip().splitlines()[-1][:60]: n for n, fault in reversed(faults.items())}
    for n in kinds.values():
        print(f"  case {n}: {faults[n]}")
    shown = {str(n): fault for n, fault in faults.items()}
    return {"cases": len(numbers), "faults": shown, "seconds": round(took, 2)}


if __name__ == "__main__":
    main()
