"""The network that is trained: a MiniLM encoder with heads for spans, links and kinds of text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from scenewright.backends.builtin.reader.annotation import KINDS
from scenewright.backends.builtin.reader.labels import COMPASS, LABELS, LINKS, MOST_MEMBERS

WIDTH, LAYERS, HEADS, INNER = 384, 6, 12, 1536
HIDDEN = 256
DISTANCES = 16
"""Buckets of the distance in tokens between a span and the mention of a road user."""


class EncoderLayer(nn.Module):
    """One transformer layer as BERT has it (Devlin et al. 2019)."""

    def __init__(self, dropout: float) -> None:
        super().__init__()
        self.qkv, self.out = nn.Linear(WIDTH, 3 * WIDTH), nn.Linear(WIDTH, WIDTH)
        self.norm1, self.norm2 = nn.LayerNorm(WIDTH, 1e-12), nn.LayerNorm(WIDTH, 1e-12)
        self.up, self.down = nn.Linear(WIDTH, INNER), nn.Linear(INNER, WIDTH)
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """The layer's output [batch, tokens, WIDTH]; `mask` is added to attention scores."""
        batch, tokens, _ = x.shape
        shape = (batch, tokens, 3, HEADS, WIDTH // HEADS)
        query, key, value = self.qkv(x).view(shape).permute(2, 0, 3, 1, 4)
        # Written out: on CPU, the backward pass of torch's fused attention takes twice as long.
        alike = query @ key.transpose(-1, -2) / (WIDTH // HEADS) ** 0.5 + mask
        seen = alike.softmax(-1).to(value.dtype) @ value
        x = self.norm1(x + self.out(seen.transpose(1, 2).reshape(x.shape)))
        inner = self.down(functional.gelu(self.up(x), approximate="tanh"))
        result: Tensor = self.norm2(x + self.dropout(inner))
        return result


class ReaderNetwork(nn.Module):
    """Token tags, span attributes and span-to-mention links of an instruction."""

    def __init__(self, dropout: float = 0.1) -> None:
        super().__init__()
        self.word, self.position = nn.Embedding(30522, WIDTH), nn.Embedding(512, WIDTH)
        self.part, self.norm = nn.Embedding(2, WIDTH), nn.LayerNorm(WIDTH, 1e-12)
        self.layers = nn.ModuleList(EncoderLayer(dropout) for _ in range(LAYERS))
        self.dropout = nn.Dropout(dropout)
        self.tags = _make_head(1 + 2 * len(LABELS), dropout)
        self.kind = _make_head(len(KINDS), dropout)
        self.label = nn.Embedding(len(LABELS), WIDTH)
        self.negated, self.side = _make_head(2, dropout), _make_head(len(COMPASS), dropout)
        self.count = _make_head(MOST_MEMBERS, dropout)
        self.member = nn.Embedding(MOST_MEMBERS + 1, WIDTH)
        self.span_in, self.user_in = nn.Linear(WIDTH, HIDDEN), nn.Linear(WIDTH, HIDDEN)
        self.span_gate, self.user_gate = nn.Linear(WIDTH, HIDDEN), nn.Linear(WIDTH, HIDDEN)
        self.distance = nn.Embedding(DISTANCES, HIDDEN)
        self.link = nn.Linear(2 * HIDDEN, len(LINKS))
        for table in (self.label, self.member, self.distance):
            nn.init.normal_(table.weight, std=0.02)
        for frozen in (self.word, self.position):
            frozen.weight.requires_grad_(False)

    def encode(self, ids: Tensor, parts: Tensor, mask: Tensor) -> Tensor:
        """Token representations [batch, tokens, WIDTH]; `mask` is True where there is a token."""
        x = self.word(ids) + self.position.weight[: ids.shape[1]] + self.part(parts)
        x = self.dropout(self.norm(x))
        bias = torch.zeros(mask.shape, dtype=x.dtype).masked_fill(~mask, -1e4)[:, None, None]
        for layer in self.layers:
            x = layer(x, bias)
        result: Tensor = x
        return result

    def represent(self, x: Tensor, spans: Tensor, labels: Tensor) -> Tensor:
        """Mean token of each span plus its label; `spans` is [n, 3]: row, first, last token."""
        positions = torch.arange(x.shape[1])
        inside = (positions >= spans[:, 1:2]) & (positions <= spans[:, 2:3])
        weights = inside.to(x.dtype) / inside.sum(1, keepdim=True)
        means = torch.bmm(weights[:, None], x[spans[:, 0]])[:, 0]
        result: Tensor = means + self.label(labels).to(x.dtype)
        return result

    def score_links(self, spans: Tensor, users: Tensor, distances: Tensor) -> Tensor:
        """Scores of LINKS for pairs of span and road user; each [n, WIDTH], distances [n]."""
        summed = self.span_in(spans) + self.user_in(users) + self.distance(distances)
        summed = functional.gelu(summed, approximate="tanh")
        gated = self.span_gate(spans) * self.user_gate(users)
        result: Tensor = self.link(torch.cat([summed, gated.to(summed.dtype)], -1))
        return result


def _make_head(outputs: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(WIDTH, HIDDEN), nn.GELU("tanh"), nn.Dropout(dropout), nn.Linear(HIDDEN, outputs)
    )


def load_minilm(network: ReaderNetwork, folder: Path) -> None:
    """Start the encoder from the weights of all-MiniLM-L6-v2 (Apache-2.0) in a folder."""
    from safetensors.torch import load_file

    weights = load_file(folder / "model.safetensors")
    tables = {"word": "word", "position": "position", "part": "token_type"}
    with torch.no_grad():
        for name, theirs in tables.items():
            getattr(network, name).weight.copy_(weights[f"embeddings.{theirs}_embeddings.weight"])
        _copy(network.norm, weights, "embeddings.LayerNorm")
        for index, layer in enumerate(network.layers):
            _load_layer(layer, weights, f"encoder.layer.{index}.")


def _load_layer(layer: Any, weights: dict[str, Tensor], at: str) -> None:
    for kind in ("weight", "bias"):
        names = ("query", "key", "value")
        parts = [weights[f"{at}attention.self.{name}.{kind}"] for name in names]
        getattr(layer.qkv, kind).copy_(torch.cat(parts))
    _copy(layer.out, weights, f"{at}attention.output.dense")
    _copy(layer.norm1, weights, f"{at}attention.output.LayerNorm")
    _copy(layer.up, weights, f"{at}intermediate.dense")
    _copy(layer.down, weights, f"{at}output.dense")
    _copy(layer.norm2, weights, f"{at}output.LayerNorm")


def _copy(module: nn.Module, weights: dict[str, Tensor], name: str) -> None:
    for kind in ("weight", "bias"):
        getattr(module, kind).copy_(weights[f"{name}.{kind}"])
