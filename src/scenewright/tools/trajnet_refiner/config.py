"""What a network of the refiner is made of; stored beside its weights."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from scenewright.scene.base import Model

CLASSES = ("pedestrian", "vehicle")
"""Class ids of the network: the place in this tuple."""
GOAL_FEATURES, PAIR_FEATURES, OUTPUTS = 7, 17, 5
BEFORE = 4
"""Steps before the first prediction of the earlier place that neighbours see of an agent."""
LATE = 3
"""Steps over which the latest change of a move is taken."""


class RefinerConfig(Model):
    """What a network is made of; stored beside its weights.

    Attributes:
        step: [s] between samples; observed, predicted: samples per window.
        stride: predicted samples per decoder step, after which all agents are observed again.
        neighbours: how many of the nearest are pooled; reach: up to which distance [m], by class.
        pace: a usual speed [m/s] by class, the unit of every velocity inside.
        dropout: share of what is read and remembered that training leaves out at random.
        pooling, goals: what the ablations switch off.
        mirrored: whether `predict` takes the mean with the mirror image of what is predicted for
            the mirror image of a scene, so that left and right are alike.
        apart: distance [m] that predicted pedestrians keep from each other; None leaves the
            network's output as it is.
        walking: share of the learned slowing that a pedestrian takes, and nothing else of what
            was learned then; None for all. That people slow down for others carries over to other
            places, how they speed up and turn does not.
    """

    step: float = Field(default=0.4, gt=0)
    observed: int = Field(default=9, ge=2)
    predicted: int = Field(default=12, ge=1)
    stride: int = Field(default=2, ge=1)
    hidden: int = Field(default=192, ge=1)
    embedding: int = Field(default=64, ge=1)
    pooled: int = Field(default=128, ge=1)
    neighbours: int = Field(default=16, ge=1)
    reach: tuple[float, float] = (10.0, 30.0)
    pace: tuple[float, float] = (1.25, 8.0)
    dropout: float = Field(default=0.1, ge=0, lt=1)
    pooling: bool = True
    goals: bool = True
    mirrored: bool = True
    apart: float | None = Field(default=0.26, gt=0)
    walking: float | None = Field(default=None, ge=0, le=1)
    kind: Literal["lstm"] = "lstm"


def list_shapes(config: RefinerConfig) -> dict[str, tuple[int, ...]]:
    """The shape of each array of weights, by its name."""
    c = config
    shapes: dict[str, tuple[int, ...]] = {"class_embedding.weight": (len(CLASSES), c.embedding)}
    linear = {
        "past_embedding": (c.embedding, 5),
        "shortcut": (c.hidden, 5 * (c.observed - 1)),
        "motion_embedding": (c.embedding, 3 + (GOAL_FEATURES if c.goals else 0)),
        "output": (OUTPUTS * c.stride, c.hidden),
    }
    width = c.embedding
    if c.pooling:
        width += c.pooled
        shapes["memory.weight"] = (c.pooled, c.hidden)
        linear |= {
            "pair": (c.pooled, PAIR_FEATURES),
            "impression": (c.pooled, c.pooled),
            "pool": (c.pooled, c.pooled),
        }
    for name, shape in linear.items():
        shapes |= {f"{name}.weight": shape, f"{name}.bias": shape[:1]}
    for cell, read, end in (("encoder", c.embedding, "_l0"), ("decoder", width, "")):
        for part, columns in (("ih", read), ("hh", c.hidden)):
            shapes[f"{cell}.weight_{part}{end}"] = (4 * c.hidden, columns)
            shapes[f"{cell}.bias_{part}{end}"] = (4 * c.hidden,)
    return shapes
