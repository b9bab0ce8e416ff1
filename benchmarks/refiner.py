"""Predicted agent-frames per second by batch size: `python benchmarks/refiner.py [W.safetensors]`.

Scenes of sixteen agents, nine steps observed, twelve predicted, pedestrians kept apart. One
agent-frame is one agent at one predicted step. Without weights an untrained network is timed; it
is as fast. A GPU is used if there is one.
"""

from __future__ import annotations

import os
import platform
import statistics
import sys
import time
from pathlib import Path

import torch

from scenewright.tools.trajnet_refiner.model import Refiner, RefinerConfig, Scenes, predict
from scenewright.tools.trajnet_refiner.store import load_refiner

AGENTS, REPEATS = 16, 5
BATCHES = (1, 4, 16, 64, 256, 1024)


def build_scenes(count: int) -> Scenes:
    """Pedestrians at about 1.3 m/s in a square of 12 m, and four vehicles."""
    draw = torch.Generator().manual_seed(0)
    start = torch.rand(count, AGENTS, 1, 2, generator=draw) * 12
    move = torch.randn(count, AGENTS, 1, 2, generator=draw) * 0.4
    classes = torch.zeros(count, AGENTS, dtype=torch.long)
    classes[:, :4] = 1
    goal = torch.rand(count, AGENTS, 2, generator=draw) * 12
    return Scenes(start + move * torch.arange(9.0)[:, None], classes, goal)


def main() -> None:
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    net = load_refiner(Path(sys.argv[1])) if len(sys.argv) > 1 else Refiner(RefinerConfig()).eval()
    net = net.to(device)
    print(
        f"{device.type}, {torch.get_num_threads()} threads of {os.cpu_count()}, torch "
        f"{torch.__version__}, {platform.machine()}; {AGENTS} agents a scene, "
        f"{sum(p.numel() for p in net.parameters())} weights"
    )
    for count in BATCHES:
        batch, times = build_scenes(count).to(device), []
        predict(net, batch)
        for _ in range(REPEATS):
            began = time.perf_counter()
            predict(net, batch).xy.cpu()
            times.append(time.perf_counter() - began)
        median = statistics.median(times)
        frames = count * AGENTS * net.config.predicted / median
        print(f"batch {count:5d}: {1e3 * median:8.1f} ms, {frames:10.0f} agent-frames/s")


if __name__ == "__main__":
    main()
