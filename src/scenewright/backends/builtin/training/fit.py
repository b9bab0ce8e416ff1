"""Train the reader on annotated instructions: resumable, on CPU, the same for the same seed."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import cross_entropy

from scenewright.backends.builtin.reader.annotation import AnnotatedText
from scenewright.backends.builtin.reader.encoder import (
    SCALE,
    dequantize,
    load_encoder_weights,
    quantize,
)
from scenewright.backends.builtin.reader.tokens import load_tokenizer
from scenewright.backends.builtin.training.augmentation import (
    augment,
    collect_spans,
    drop_duplicates,
)
from scenewright.backends.builtin.training.batches import TokenBatch, encode_row, make_batch
from scenewright.backends.builtin.training.corpus import read_corpus
from scenewright.backends.builtin.training.model import ReaderNetwork, load_minilm
from scenewright.errors import InputError

_SMALLEST = 64
"""Matrices with a side shorter than this stay in float32."""


def export_weights(state: Mapping[str, torch.Tensor], out: Path) -> None:
    """Write the state of a network as int8 safetensors."""
    from safetensors.numpy import save_file

    found: dict[str, NDArray[Any]] = {}
    for name, tensor in state.items():
        value = tensor.float().numpy()
        if value.ndim == 2 and min(value.shape) >= _SMALLEST:
            found[name], found[name + SCALE] = quantize(value)
        else:
            found[name] = np.ascontiguousarray(value)
    save_file(found, out)


def load_exported(network: ReaderNetwork, weights: Mapping[str, NDArray[Any]]) -> None:
    """Start a network from exported weights."""
    state = {
        name: torch.from_numpy(dequantize(weights, name))
        for name in weights
        if not name.endswith(SCALE)
    }
    network.load_state_dict(state)


BATCH, WINDOW = 32, 20
"""Rows of a step; batches that are sorted by length together."""

ENCODER_RATE, HEAD_RATE = 2.5e-4, 1e-3


def total_loss(network: ReaderNetwork, batch: TokenBatch) -> Tensor:
    """The sum of the losses of tags, links and span attributes, each a mean over its items."""
    x = network.encode(batch.ids, batch.parts, batch.mask)
    tags = network.tags(x).float()
    flat = batch.tags.view(-1)
    loss = cross_entropy(tags.view(len(flat), -1), flat, ignore_index=-1, label_smoothing=0.02) * 6
    loss = loss + 0.3 * cross_entropy(network.kind(x[:, 0]).float(), batch.kinds)
    if not len(batch.spans):
        return loss
    spans = network.represent(x, batch.spans, batch.span_labels)
    loss = loss + 0.5 * cross_entropy(network.negated(spans).float(), batch.negated)
    if len(batch.sided):
        loss = loss + 0.3 * cross_entropy(network.side(spans[batch.sided]).float(), batch.sides)
    if len(batch.counted):
        counts = network.count(spans[batch.counted]).float()
        loss = loss + 0.3 * cross_entropy(counts, batch.counts)
    if len(batch.pairs):
        users = spans[batch.pairs[:, 1]] + network.member(batch.pairs[:, 2]).to(spans.dtype)
        scores = network.score_links(spans[batch.pairs[:, 0]], users, batch.distances).float()
        loss = loss + 3 * cross_entropy(scores, batch.links, label_smoothing=0.01)
    return loss


def draw_batches(rows: Sequence[AnnotatedText], tokenizer: Any, seed: int) -> Iterator[TokenBatch]:
    """Batches of varied rows without end; every row once before any comes again."""
    rng, bank = random.Random(seed), collect_spans(rows)
    order: list[int] = []
    while True:
        while len(order) < BATCH * WINDOW:
            order += rng.sample(range(len(rows)), len(rows))
        taken, order = order[: BATCH * WINDOW], order[BATCH * WINDOW :]
        varied = sorted((augment(rows[at], rng, bank) for at in taken), key=lambda r: len(r.text))
        groups = [varied[at : at + BATCH] for at in range(0, len(varied), BATCH)]
        rng.shuffle(groups)
        for group in groups:
            yield make_batch([encode_row(r, tokenizer) for r in group], [r.text for r in group])


def train_reader(
    paths: Sequence[Path],
    *,
    own: Sequence[Path],
    out: Path,
    minilm: Path | None,
    steps: int,
    seed: int,
    log: Callable[[str], None],
) -> int:
    """Train on files of annotated instructions and write int8 weights; go on with a stopped run.

    Args:
        own: those of the paths whose rows count ten times.
        minilm: folder with all-MiniLM-L6-v2's model.safetensors to begin from; None: from the
            weights of the package.

    Returns:
        The number of rows.

    Raises:
        InputError: a file that cannot be read, or no such model.
    """
    rows = drop_duplicates(read_corpus(paths))
    weighted = rows + [row for _ in range(9) for row in read_corpus(own)]
    network = ReaderNetwork()
    if minilm is None:
        load_exported(network, load_encoder_weights())
    elif not (minilm / "model.safetensors").is_file():
        raise InputError(f"{minilm} holds no model.safetensors of all-MiniLM-L6-v2")
    else:
        load_minilm(network, minilm)
    checkpoint = out.with_suffix(".checkpoint.pt")
    fit(network, weighted, checkpoint, steps=steps, seed=seed, log=log)
    export_weights(network.state_dict(), out)
    checkpoint.unlink()
    return len(rows)


def fit(
    network: ReaderNetwork,
    rows: Sequence[AnnotatedText],
    checkpoint: Path,
    *,
    steps: int,
    seed: int,
    log: Callable[[str], None],
) -> None:
    """Train for so many steps, saving every 200, and go on from the checkpoint if there is one."""
    torch.manual_seed(seed)
    network.train()
    optimizer, schedule = _make_optimizer(network, steps)
    done = _resume_training(checkpoint, network, optimizer, schedule)
    batches, average, began = draw_batches(rows, load_tokenizer(), seed + done), None, time.time()
    for step in range(done + 1, steps + 1):
        with torch.autocast("cpu", torch.bfloat16):
            loss = total_loss(network, next(batches))
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        average = loss.item() if average is None else 0.97 * average + 0.03 * loss.item()
        if step % 50 == 0:
            log(f"step {step} of {steps}: loss {average:.3f}, {time.time() - began:.0f} s")
        if step % 200 == 0 or step == steps:
            _save(checkpoint, network, optimizer, schedule, step)


def _make_optimizer(network: ReaderNetwork, steps: int) -> tuple[Any, Any]:
    trained = [(n, p) for n, p in network.named_parameters() if p.requires_grad]
    encoder = [p for n, p in trained if n.startswith(("layers.", "norm", "part"))]
    heads = [p for n, p in trained if not n.startswith(("layers.", "norm", "part"))]
    groups = [{"params": encoder, "lr": ENCODER_RATE}, {"params": heads, "lr": HEAD_RATE}]
    optimizer = torch.optim.AdamW(groups, weight_decay=0.01, fused=True)
    warm = max(1, steps // 20)

    def rate(step: int) -> float:
        cooled = 0.5 * (1 + math.cos(math.pi * max(0, step - warm) / max(1, steps - warm)))
        return min(1.0, (step + 1) / warm) * max(0.01, cooled)

    return optimizer, torch.optim.lr_scheduler.LambdaLR(optimizer, rate)


def _save(out: Path, network: ReaderNetwork, optimizer: Any, schedule: Any, step: int) -> None:
    state = {"network": network.state_dict(), "step": step}
    torch.save(
        {**state, "optimizer": optimizer.state_dict(), "schedule": schedule.state_dict()}, out
    )


def _resume_training(out: Path, network: ReaderNetwork, optimizer: Any, schedule: Any) -> int:
    if not out.exists():
        return 0
    state = torch.load(out, weights_only=True)
    network.load_state_dict(state["network"])
    optimizer.load_state_dict(state["optimizer"])
    schedule.load_state_dict(state["schedule"])
    return int(state["step"])
