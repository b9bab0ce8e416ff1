"""MCAP files of messages on topics (extra `exports`)."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class Topic:
    """One channel.

    Attributes:
        schema: name of the message type; encoding: of its definition.
        definition: the type; message_encoding: `protobuf` or `json`.
    """

    name: str
    schema: str
    encoding: str
    definition: bytes
    message_encoding: str


def write_mcap(
    messages: Iterable[tuple[Topic, int, bytes]],
    *,
    metadata: Mapping[str, Mapping[str, str]],
    channel_metadata: Mapping[str, str] | None = None,
) -> bytes:
    """The content of an MCAP file.

    Args:
        messages: (topic, time [ns], content), in order of time.
        metadata: records by name.
    """
    stream = io.BytesIO()
    writer = import_module("mcap.writer").Writer(stream)
    writer.start(profile="", library="scenewright")
    for name, values in metadata.items():
        writer.add_metadata(name, dict(values))
    channels: dict[str, int] = {}
    for topic, time, content in messages:
        if topic.name not in channels:
            schema = writer.register_schema(topic.schema, topic.encoding, topic.definition)
            channels[topic.name] = writer.register_channel(
                topic.name, topic.message_encoding, schema, dict(channel_metadata or {})
            )
        writer.add_message(channels[topic.name], time, content, time)
    writer.finish()
    return stream.getvalue()
