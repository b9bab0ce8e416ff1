"""Training of the refiner: deterministic on one machine, and resumed after a kill."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from pydantic import Field
from torch import Tensor

from scenewright.errors import InputError
from scenewright.scene.base import Model
from scenewright.tools.track_io import Recording, cut_windows
from scenewright.tools.trajnet_refiner.config import CLASSES, RefinerConfig
from scenewright.tools.trajnet_refiner.model import Prediction, Refiner, Scenes, turn_back
from scenewright.tools.trajnet_refiner.separation import add_halfway
from scenewright.tools.trajnet_refiner.store import read_tensors, write_tensors
from scenewright.tools.trajnet_refiner.windows import Variation, Window, build_batches

Batches = Callable[..., Iterator[tuple[Scenes, Tensor, Tensor]]]
"""Makes batches of windows, as `windows.batches` does."""

APART = 0.35
"""Pedestrians who walk do not come nearer to one another than this, from middle to middle [m]."""
_REAL = 0.5
"""Weight of coming too near to where another really was, beside that of where it is predicted."""
_NO_CHANGE = Variation(stretch=0.0, noise=0.0, unseen=0.0, goals=0.0)


class Recipe(Model):
    """How a network is trained.

    Attributes:
        epochs: how often every window is seen; share: part of the windows drawn per epoch.
        agents: agents per batch; rate: the highest learning rate; decay: of the weights.
        likelihood: weight of the Gaussian's likelihood beside the mean distance.
        apart: weight of how far predicted pedestrians come below `APART` of one another.
        average: of the weights that are kept, over about 1 / (1 - average) batches.
        stretch, noise, unseen, goals: see `Variation`.
        seed: of the first weights and of every draw.
    """

    epochs: int = Field(default=12, ge=1)
    share: float = Field(default=1.0, gt=0, le=1)
    agents: int = Field(default=192, ge=1)
    rate: float = Field(default=4e-3, gt=0)
    decay: float = Field(default=1e-4, ge=0)
    likelihood: float = Field(default=0.05, ge=0)
    apart: float = Field(default=0.0, ge=0)
    average: float = Field(default=0.99, ge=0, lt=1)
    stretch: float = Field(default=0.25, ge=0, lt=1)
    noise: float = Field(default=0.0, ge=0)
    unseen: float = Field(default=0.1, ge=0, le=1)
    goals: float = Field(default=0.4, ge=0, le=1)
    seed: int = Field(default=0, ge=0)


class Epoch(NamedTuple):
    """What came of an epoch.

    Attributes:
        number: from 1; loss: mean over its batches; seconds: it took.
        ade: mean distance on the validation windows [m]; None without any.
    """

    number: int
    loss: float
    seconds: float
    ade: float | None


ProgressCallback = Callable[[int, int], None]
"""Called after every batch with the number of batches done, and of how many."""


def train(
    windows: Sequence[Window],
    *,
    config: RefinerConfig,
    recipe: Recipe,
    held_out: Sequence[Window] = (),
    checkpoint: Path | None = None,
    device: str | None = None,
    log: ProgressCallback | None = None,
    after_epoch: Callable[[Epoch], None] | None = None,
    make: Batches = build_batches,
    start: Refiner | None = None,
) -> Refiner:
    """A network trained on windows; the same windows, recipe and machine make the same one.

    Args:
        held_out: windows to validate on after every epoch; they decide nothing.
        checkpoint: file kept up to date after every epoch; if it is there, training goes on from
            it and ends as if it had never been interrupted.
        device: "cpu", "cuda"…; a GPU if there is one.
        make: how windows become batches; those of held_out, too.
        start: a network of this configuration whose weights are the first; drawn if None.

    Raises:
        InputError: no windows, or the checkpoint is of another training.
    """
    if not windows:
        raise InputError("there is nothing to train on")
    # About how many batches the whole training has; the learning rate falls along them.
    padded = sum(len(w.xy) for w in windows) * recipe.share
    batches = max(1, math.ceil(recipe.epochs * padded / recipe.agents))
    run = _Run(config, recipe, batches, device, start)
    if checkpoint is not None and checkpoint.exists():
        run.restore(checkpoint)
    while run.epochs < recipe.epochs:
        began = time.perf_counter()
        with torch.random.fork_rng():
            loss = run.run_epoch(windows, log, make)
        if checkpoint is not None:
            run.store(checkpoint)
        if after_epoch is not None:
            ade = validate(run.build_averaged(), held_out, make=make) if held_out else None
            after_epoch(Epoch(run.epochs, loss, time.perf_counter() - began, ade))
    return run.build_averaged()


def validate(net: Refiner, windows: Sequence[Window], *, make: Batches = build_batches) -> float:
    """Weighted mean distance [m] between predicted and true future positions, without goals."""
    rng = np.random.default_rng(0)
    device = next(net.parameters()).device
    total = count = 0.0
    with torch.no_grad():
        for scenes, future, weight in make(
            windows, observed=net.config.observed, agents=2048, variation=_NO_CHANGE, rng=rng
        ):
            error, share = _compute_errors(
                net(scenes.to(device)), future.to(device), weight.to(device)
            )
            total += float((error * share).sum())
            count += float(share.sum())
    return total / max(count, 1e-9)


def compute_crowding(
    predicted: Prediction, future: Tensor, weight: Tensor, walkers: Tensor
) -> Tensor:
    """Weighted mean of how far a pedestrian's prediction lacks `APART` from those of others [m].

    Where the others really were counts less. Distances are taken at the steps and halfway between
    them, as the benchmark's collisions are.

    Args:
        future: [B, N, P, 2] true positions, NaN where unknown; weight, walkers: [B, N].
    """
    there = walkers & ~predicted.xy.isnan().flatten(2).any(-1)
    known = there & ~future.isnan().flatten(2).any(-1)
    xy, truth = torch.nan_to_num(predicted.xy), torch.nan_to_num(future)
    lacking = _sum_lacking(xy, xy, there, there) + _REAL * _sum_lacking(xy, truth, there, known)
    counted = weight * there
    return (lacking * counted).sum() / counted.sum().clamp_min(1e-6)


def _sum_lacking(xy: Tensor, others: Tensor, there: Tensor, known: Tensor) -> Tensor:
    """[B, N] what the distances to all others lack, summed over them, mean over time [m]."""
    away = add_halfway(xy)[:, :, None] - add_halfway(others)[:, None]
    lacking = (APART - (away.square().sum(-1) + 1e-6).sqrt()).clamp_min(0.0)
    pairs = there[:, :, None] & known[:, None]
    pairs &= ~torch.eye(there.shape[1], dtype=torch.bool, device=there.device)
    return torch.where(pairs[..., None], lacking, 0.0).sum(2).mean(-1)


def compute_negative_log_density(predicted: Prediction, future: Tensor) -> Tensor:
    """[B, N, P] -log density of the truth under the predicted Gaussians [nats]; 0 if unknown."""
    known = ~(future.isnan() | predicted.xy.isnan()).any(-1)
    off = torch.nan_to_num(future) - torch.nan_to_num(predicted.xy)
    off = turn_back(off, predicted.along[:, :, None].expand_as(off))
    log_x, log_y, rho = predicted.spread.unbind(-1)
    x, y = off[..., 0] / log_x.exp(), off[..., 1] / log_y.exp()
    rest = 1.0 - rho.square()
    square = (x.square() - 2 * rho * x * y + y.square()) / rest
    density = log_x + log_y + 0.5 * rest.log() + math.log(2 * math.pi) + 0.5 * square
    return torch.where(known, density, 0.0)


def _compute_errors(predicted: Prediction, future: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """[B, N, P] distances [m], 0 where unknown, and the weight of each, 0 where unknown."""
    known = ~(future.isnan() | predicted.xy.isnan()).any(-1)
    off = torch.nan_to_num(future) - torch.nan_to_num(predicted.xy)
    distance = (off.square().sum(-1) + 1e-6).sqrt()
    return torch.where(known, distance, 0.0), known * weight[..., None]


class _Run:
    """A training under way: weights, their running average, the optimiser, epochs done."""

    def __init__(
        self,
        config: RefinerConfig,
        recipe: Recipe,
        total: int,
        device: str | None,
        start: Refiner | None = None,
    ) -> None:
        self.recipe, self.total = recipe, total
        self.device = torch.device(device or ("cuda" if torch.cuda.is_available() else "cpu"))
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(recipe.seed)
            self.net = Refiner(config).to(self.device)
        if start is not None:
            self.net.load_state_dict(start.state_dict())
        self.mean = {name: p.detach().clone() for name, p in self.net.named_parameters()}
        self.optimiser = torch.optim.AdamW(
            self.net.parameters(), lr=recipe.rate, weight_decay=recipe.decay
        )
        self.epochs = self.batches = 0

    def run_epoch(
        self, windows: Sequence[Window], log: ProgressCallback | None, make: Batches = build_batches
    ) -> float:
        """One pass over the windows; the mean loss of its batches."""
        recipe = self.recipe
        rng = np.random.default_rng([recipe.seed, self.epochs])
        torch.manual_seed(int(rng.integers(2**62)))
        count = max(1, round(recipe.share * len(windows)))
        drawn = [windows[i] for i in np.sort(rng.permutation(len(windows))[:count])]
        self.net.train()
        losses = []
        for scenes, future, weight in make(
            drawn,
            observed=self.net.config.observed,
            agents=recipe.agents,
            variation=Variation(recipe.stretch, recipe.noise, recipe.unseen, recipe.goals),
            rng=rng,
        ):
            losses.append(self._step(scenes, future, weight))
            if log is not None:
                log(min(self.batches, self.total), self.total)
        self.epochs += 1
        return float(np.mean(losses))

    def _step(self, scenes: Scenes, future: Tensor, weight: Tensor) -> float:
        for group in self.optimiser.param_groups:
            group["lr"] = self.recipe.rate * _warm_then_cosine(self.batches / self.total)
        scenes = scenes.to(self.device)
        future, weight = future.to(self.device), weight.to(self.device)
        predicted = self.net(scenes)
        # The distance, which is the benchmark's measure, and the Gaussian's -log density.
        error, share = _compute_errors(predicted, future, weight)
        surprise = compute_negative_log_density(predicted, future)
        lost = error + self.recipe.likelihood * torch.where(share > 0, surprise, 0.0)
        loss = (lost * share).sum() / share.sum().clamp_min(1e-6)
        if self.recipe.apart > 0.0:
            walkers = scenes.classes == CLASSES.index("pedestrian")
            loss += self.recipe.apart * compute_crowding(predicted, future, weight, walkers)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        self.optimiser.step()
        self.batches += 1
        keep = min(self.recipe.average, self.batches / (self.batches + 10))
        with torch.no_grad():
            for name, parameter in self.net.named_parameters():
                self.mean[name].lerp_(parameter, 1.0 - keep)
        return float(loss.detach())

    def build_averaged(self) -> Refiner:
        """A network with the averaged weights, ready to predict."""
        net = Refiner(self.net.config).to(self.device)
        net.load_state_dict(self.mean)
        return net.eval()

    def store(self, path: Path) -> None:
        """Everything that the next epoch needs."""
        tensors = dict[str, Tensor](self.net.named_parameters(prefix="net"))
        tensors |= {f"mean.{name}": p for name, p in self.mean.items()}
        for name, parameter in self.net.named_parameters():
            for key, value in self.optimiser.state[parameter].items():
                tensors[f"adam.{key}.{name}"] = value
        arrays = {name: each.detach().cpu().numpy() for name, each in tensors.items()}
        write_tensors(path, arrays, facts={**self._get_identity(), "epochs": self.epochs,
                                            "batches": self.batches})  # fmt: skip

    def restore(self, path: Path) -> None:
        """Goes on where `store` was called.

        Raises:
            InputError: the file is of another training.
        """
        arrays, facts = read_tensors(path)
        if any(facts.get(key) != value for key, value in self._get_identity().items()):
            raise InputError(f"{path}: a checkpoint of another training; remove it to start anew")
        tensors = {name: torch.from_numpy(each) for name, each in arrays.items()}
        moved = {name: tensor.to(self.device) for name, tensor in tensors.items()}
        with torch.no_grad():
            for name, parameter in self.net.named_parameters():
                parameter.copy_(moved[f"net.{name}"])
                self.mean[name].copy_(moved[f"mean.{name}"])
                self.optimiser.state[parameter] = {
                    "step": tensors[f"adam.step.{name}"],
                    "exp_avg": moved[f"adam.exp_avg.{name}"],
                    "exp_avg_sq": moved[f"adam.exp_avg_sq.{name}"],
                }
        self.epochs, self.batches = int(facts["epochs"]), int(facts["batches"])

    def _get_identity(self) -> dict[str, object]:
        return {
            "config": self.net.config.model_dump(mode="json"),
            "recipe": self.recipe.model_dump(mode="json"),
            "total": self.total,
        }


def _warm_then_cosine(part: float) -> float:
    """Share of the highest learning rate after a part of the training; at least 1 %."""
    warm = 0.05
    if part < warm:
        return 0.05 + 0.95 * part / warm
    falling = min(1.0, (part - warm) / (1 - warm))
    return 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * falling))


_STANDING = 0.25
"""Weight of agents that stand all the while: there is little to learn from them."""
_STANDS = 0.5
"""Who gets no further than that [m] in a window stands."""
RECIPE = Recipe(
    epochs=12, agents=192, rate=3e-3, likelihood=0.1, stretch=0.1, unseen=0.1, goals=0.9
)
"""How the networks of bundles are trained."""


def cut_recorded_windows(
    recordings: Sequence[Recording], *, observed: int, predicted: int, stride: int | None = None
) -> list[Window]:
    """Stretches of recordings for training, with a second horizon behind the first for waypoints.

    Args:
        stride: network steps from one stretch's start to the next; None for `predicted`, so that
            every moment is predicted once.
    """
    steps, every = observed + 2 * predicted, 4
    windows = []
    for recording in recordings:
        for cut in cut_windows(
            recording, steps=steps, every=every, stride=every * (stride or predicted), least_whole=0
        ):
            now = cut.present[:, observed - 1] & cut.present[:, observed]
            if not now.any():
                continue
            xy = np.where(cut.present[now][..., None], cut.xy[now], np.nan)
            kinds = [recording.agents[i].shape.type for i in cut.members[now]]
            way = np.nanmax(xy, axis=1) - np.nanmin(xy, axis=1)
            ends = [recording.agents[i].track.xy[-1] for i in cut.members[now]]
            windows.append(
                Window(
                    xy,
                    np.array([CLASSES.index(kind) for kind in kinds], dtype=np.int64),
                    np.array(ends),
                    np.where(way.max(axis=1) < _STANDS, _STANDING, 1.0),
                )
            )
    return windows


def reverse_windows(windows: Sequence[Window], *, observed: int) -> list[Window]:
    """The same stretches backwards in time, as far as agents are seen at the present then.

    People who walk backwards keep clear of one another as they did.
    """
    turned = []
    for window in windows:
        xy = window.xy[:, ::-1]
        now = ~np.isnan(xy[:, observed - 1 : observed + 1]).any(axis=(1, 2))
        if now.any():
            xy = np.ascontiguousarray(xy[now])
            turned.append(Window(xy, window.classes[now], window.xy[now, 0], window.weight[now]))
    return turned


def build_supervised_batches(
    windows: Sequence[Window], **how: Any
) -> Iterator[tuple[Scenes, Tensor, Tensor]]:
    """As `build_batches`, for windows with a second horizon, a share of them with waypoints."""
    return build_batches(windows, rows=True, **how)
