"""Elements of OpenStreetMap files: XML, packed with gzip or not, and protocol buffers (.pbf)."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import IO, Any, Literal
from xml.etree.ElementTree import ParseError, XMLPullParser

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.track_io.protobuf_schema import build_messages

MOST_BYTES = 2_000_000_000
"""Of a file once unpacked [bytes]: a city has less."""
MOST_NODES = 30_000_000
_BLOCK = 1 << 20
_LARGEST_BLOB = 33_554_432
_SCHEMA = """
BlobHeader: type 1 string, datasize 3 int32
Blob: raw 1 bytes, raw_size 2 int32, zlib_data 3 bytes
StringTable: s 1 *bytes
Node: id 1 sint64, keys 2 *uint32, vals 3 *uint32, lat 8 sint64, lon 9 sint64
DenseNodes: id 1 *sint64, lat 8 *sint64, lon 9 *sint64, keys_vals 10 *int32
Way: id 1 int64, keys 2 *uint32, vals 3 *uint32, refs 8 *sint64
Relation: id 1 int64, keys 2 *uint32, vals 3 *uint32, roles_sid 8 *int32, memids 9 *sint64, types 10 *int32
PrimitiveGroup: nodes 1 *Node, dense 2 DenseNodes, ways 3 *Way, relations 4 *Relation
PrimitiveBlock: stringtable 1 StringTable, primitivegroup 2 *PrimitiveGroup, granularity 17 int32, lat_offset 19 int64, lon_offset 20 int64
"""  # noqa: E501
_MEMBERS: tuple[Literal["node", "way", "relation"], ...] = ("node", "way", "relation")


@dataclass(frozen=True, eq=False)
class OsmNodes:
    """Nodes of one block.

    Attributes:
        ids: [N]; degrees: [N, 2] latitude and longitude; tags: of the few that have some.
    """

    ids: Any
    degrees: FloatArray
    tags: dict[int, dict[str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class OsmWay:
    """A way along nodes."""

    id: int
    nodes: tuple[int, ...]
    tags: dict[str, str]


@dataclass(frozen=True)
class OsmRelation:
    """A relation; members are (type, id, role)."""

    id: int
    members: tuple[tuple[str, int, str], ...]
    tags: dict[str, str]


OsmElement = OsmNodes | OsmWay | OsmRelation


def is_pbf(file: Path) -> bool:
    """Whether a file begins like an OpenStreetMap file of protocol buffers."""
    with file.open("rb") as stream:
        return b"OSMHeader" in stream.read(64)


def open_packed(file: Path) -> IO[bytes]:
    """The bytes of a file, unpacked where it is packed with gzip."""
    with file.open("rb") as stream:
        packed = stream.read(2) == b"\x1f\x8b"
    return gzip.open(file) if packed else file.open("rb")  # type: ignore[return-value]


def iterate_elements(file: Path) -> Iterator[OsmElement]:
    """The elements of a file in its order, nodes in blocks.

    Raises:
        InputError: damaged, or larger than a city.
    """
    try:
        yield from _iterate_pbf(file) if is_pbf(file) else _iterate_xml(file)
    except (EOFError, zlib.error, gzip.BadGzipFile) as fault:
        raise InputError(f"{file} is damaged: {str(fault)[:80]}; is it cut off?") from None
    except OSError as fault:
        raise InputError(f"cannot read {file}: {fault.strerror or fault}") from None


@cache
def _read_messages() -> dict[str, Any]:
    return build_messages("osmpbf", _SCHEMA)


def _iterate_pbf(file: Path) -> Iterator[OsmElement]:
    from google.protobuf.message import DecodeError

    total = 0
    with file.open("rb") as stream:
        while head := stream.read(4):
            try:
                header = _read_messages()["BlobHeader"].FromString(
                    _take(stream, int.from_bytes(head), file)
                )
                blob = _read_messages()["Blob"].FromString(_take(stream, header.datasize, file))
                data = _unpack(blob, file)
                total += len(data)
                if total > MOST_BYTES:
                    raise _refuse_large(file)
                if header.type == "OSMData":
                    yield from _read_block(_read_messages()["PrimitiveBlock"].FromString(data))
            except (DecodeError, IndexError, UnicodeDecodeError) as fault:
                raise InputError(f"{file} is no OpenStreetMap .pbf: {str(fault)[:80]}") from None


def _take(stream: IO[bytes], count: int, file: Path) -> bytes:
    data = stream.read(count) if 0 <= count <= _LARGEST_BLOB else b""
    if len(data) != count:
        raise InputError(f"{file} is no whole OpenStreetMap .pbf: a block is cut off or too large")
    return data


def _unpack(blob: Any, file: Path) -> bytes:
    if blob.HasField("raw"):
        return bytes(blob.raw)
    if not blob.HasField("zlib_data"):
        raise InputError(f"{file} is packed in another way than zlib; convert it with osmium first")
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(blob.zlib_data, _LARGEST_BLOB)
    if unpacker.unconsumed_tail:
        raise InputError(f"{file} has a block larger than {_LARGEST_BLOB / 1e6:.0f} MB")
    return data


def _read_block(block: Any) -> Iterator[OsmElement]:
    strings = [each.decode("utf-8", "replace") for each in block.stringtable.s]
    scale = 1e-9 * (block.granularity or 100)
    offset = 1e-9 * np.array([block.lat_offset, block.lon_offset])

    def read_tags(part: Any) -> dict[str, str]:
        pairs = zip(part.keys, part.vals, strict=True)
        return {strings[key]: strings[value] for key, value in pairs}

    for group in block.primitivegroup:
        if group.dense.id:
            yield _read_dense(group.dense, strings, scale, offset)
        if group.nodes:
            degrees = np.array([(each.lat, each.lon) for each in group.nodes]) * scale + offset
            tags = {each.id: read_tags(each) for each in group.nodes if each.keys}
            yield OsmNodes(np.array([each.id for each in group.nodes]), degrees, tags)
        for way in group.ways:
            yield OsmWay(way.id, tuple(np.cumsum(way.refs).tolist()), read_tags(way))
        for each in group.relations:
            ids = np.cumsum(each.memids).tolist()
            members = tuple(
                (_MEMBERS[kind], number, strings[role])
                for kind, number, role in zip(each.types, ids, each.roles_sid, strict=True)
            )
            yield OsmRelation(each.id, members, read_tags(each))


def _read_dense(dense: Any, strings: list[str], scale: float, offset: FloatArray) -> OsmNodes:
    ids = np.cumsum(np.array(dense.id, dtype=np.int64))
    steps = np.stack([np.array(dense.lat), np.array(dense.lon)], axis=1)
    tags: dict[int, dict[str, str]] = {}
    found = np.array(dense.keys_vals, dtype=np.int64)
    if found.any():
        node, at, values = 0, 0, found.tolist()
        while at < len(values):
            if values[at] == 0:
                node, at = node + 1, at + 1
                continue
            tags.setdefault(int(ids[node]), {})[strings[values[at]]] = strings[values[at + 1]]
            at += 2
    return OsmNodes(ids, np.cumsum(steps, axis=0) * scale + offset, tags)


def _iterate_xml(file: Path) -> Iterator[OsmElement]:
    parser: Any = XMLPullParser(("start", "end"))
    root: Any = None
    total = 0
    degrees: dict[int, tuple[float, float]] = {}
    tagged: dict[int, dict[str, str]] = {}

    def take_nodes() -> Iterator[OsmNodes]:
        if degrees:
            yield OsmNodes(np.array([*degrees]), np.array([*degrees.values()]), dict(tagged))
            degrees.clear()
            tagged.clear()

    with open_packed(file) as stream:
        try:
            while block := stream.read(_BLOCK):
                total += len(block)
                if total > MOST_BYTES:
                    raise _refuse_large(file)
                parser.feed(block)
                for event, each in parser.read_events():
                    root = each if root is None else root
                    if event == "start" or each.tag not in _MEMBERS:
                        continue
                    number = int(each.attrib["id"])
                    tags = {tag.attrib["k"]: tag.attrib["v"] for tag in each.iter("tag")}
                    if each.tag == "node":
                        degrees[number] = float(each.attrib["lat"]), float(each.attrib["lon"])
                        tagged |= {number: tags} if tags else {}
                    elif each.tag == "way":
                        yield from take_nodes()
                        refs = (int(node.attrib["ref"]) for node in each.iter("nd"))
                        yield OsmWay(number, tuple(refs), tags)
                    else:
                        yield from take_nodes()
                        members = (
                            (own.attrib["type"], int(own.attrib["ref"]), own.get("role", ""))
                            for own in each.iter("member")
                        )
                        yield OsmRelation(number, tuple(members), tags)
                    root.clear()  # what was read is not kept
            parser.close()
        except (KeyError, ValueError) as fault:
            raise InputError(
                f"{file} is no OpenStreetMap file: {str(fault)[:60]} is missing or wrong"
            ) from None
        except ParseError as fault:
            raise InputError(f"{file} is not well-formed XML (line {fault.position[0]})") from None
    yield from take_nodes()


def _refuse_large(file: Path) -> InputError:
    return InputError(
        f"{file} is larger than a city; cut out the surroundings of the junction first"
    )
