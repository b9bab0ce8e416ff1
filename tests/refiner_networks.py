"""Small refiner networks without training, shared by the tests of the refiner."""

from __future__ import annotations

import torch

from scenewright.tools.trajnet_refiner.config import RefinerConfig
from scenewright.tools.trajnet_refiner.model import Refiner
from scenewright.tools.trajnet_refiner.network import RefinerNetwork


def build_random_network(config: RefinerConfig, seed: int = 0) -> Refiner:
    """Build an untrained network whose last layer is random, unlike that of a new one."""
    torch.manual_seed(seed)
    net = Refiner(config)
    torch.nn.init.normal_(net.output.weight, std=0.3)
    return net.eval()


def build_zero_network(config: RefinerConfig) -> Refiner:
    """Build a network whose last layer is 0, so that it predicts constant velocity."""
    net = Refiner(config).eval()
    torch.nn.init.zeros_(net.output.weight)
    return net


def convert_network(net: Refiner) -> RefinerNetwork:
    """The same network for inference, as scenes have it: neither mirrored nor kept apart."""
    config = net.config.model_copy(update={"mirrored": False, "apart": None})
    return RefinerNetwork(config, net.list_weights())
