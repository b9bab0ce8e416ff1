"""What a thread's file takes and gives back: plain values, and products to the last bit."""

from __future__ import annotations

import json
import multiprocessing
import sqlite3
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from conversations import first_version

from scenewright.errors import InputError
from scenewright.memory.products import deserialize_version, serialize_version
from scenewright.memory.threads import PlainSerializer, Threads


def test_products_come_back_to_the_last_bit() -> None:
    earlier = first_version()
    data = serialize_version(earlier)
    again = deserialize_version(data)
    assert serialize_version(again) == data
    for name, each in earlier.agents.items():
        other = again.agents[name]
        assert each.track.xy.tobytes() == other.track.xy.tobytes()
        path, other_path = each.agent.candidate.path, other.agent.candidate.path
        assert path.curvature.tobytes() == other_path.curvature.tobytes()
        assert each.agent.stops == other.agent.stops


def test_no_field_of_an_agent_is_forgotten() -> None:
    earlier = first_version()
    name, agent = next(iter(earlier.agents.items()))
    led = replace(agent, agent=replace(agent.agent, group="pedestrian-9", exact=True))
    again = deserialize_version(serialize_version(replace(earlier, agents={name: led})))
    assert (again.agents[name].agent.group, again.agents[name].agent.exact) == (
        "pedestrian-9",
        True,
    )


@pytest.mark.parametrize(
    "data",
    [b"", b"junk", zlib.compress(b"[]"), zlib.compress(b'{"version": 2}'), zlib.compress(b"{}")],
)
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(InputError):
        deserialize_version(data)


def test_products_name_no_class() -> None:
    value = json.loads(zlib.decompress(serialize_version(first_version())))
    value["agents"][0]["track"]["xy"] = {"__class__": "os.system", "args": ["true"]}
    with pytest.raises(InputError):
        deserialize_version(zlib.compress(json.dumps(value).encode()))


def test_a_checkpoint_takes_plain_values_alone() -> None:
    serde = PlainSerializer()
    value = {"a": [1, 2.5, None, True, "ü"], "b": {"c": []}}
    assert serde.loads_typed(serde.dumps_typed(value)) == value
    for other in (object(), {1: 2}, {"a": b"bytes"}, float("nan"), Path("/")):
        with pytest.raises((TypeError, ValueError)):
            serde.dumps_typed(other)
    for form in ("pickle", "msgpack", "bytes"):
        with pytest.raises(ValueError, match="not read"):
            serde.loads_typed((form, b"cos\nsystem\n(S'true'\ntR."))


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "t.sqlite"
    threads = Threads(file)
    key = threads.keep(b"something")
    assert threads.get_bytes(key) == b"something"
    threads.close()
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE kept SET body = x'00'")
    connection.close()
    threads = Threads(file)
    with pytest.raises(InputError, match="damaged"):
        threads.get_bytes(key)
    threads.close()
    (tmp_path / "no.sqlite").write_bytes(b"this is no database, but long enough to be read as one")
    with pytest.raises(InputError, match="cannot use"):
        Threads(tmp_path / "no.sqlite")


def _held(file: str) -> str:
    threads = Threads(file)
    try:
        threads.hold("mine")
    except InputError as error:
        return str(error)
    finally:
        threads.close()
    return ""


def test_one_thread_is_open_once(tmp_path: Path) -> None:
    file = str(tmp_path / "t.sqlite")
    threads = Threads(file)
    threads.hold("mine")
    spawn = multiprocessing.get_context("spawn")
    with spawn.Pool(1) as pool:
        assert "open in another process" in pool.apply(_held, (file,))
        threads.close()
        assert pool.apply(_held, (file,)) == ""
