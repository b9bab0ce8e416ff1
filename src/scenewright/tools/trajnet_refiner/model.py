"""The trajectory predictor behind the refiner (paper Eq. 7), of the TrajNet++ family.

Every agent of a scene has an LSTM that reads its motion so far, then writes its motion to come,
all agents of all scenes of a batch in step. At each step an agent pools what its nearest
neighbours do (places, velocities, closest approach, their memory) and sees the way to its goal, if
it has one. What is learned is a change of velocity: without any, agents would keep going, or,
with a goal that is due at some time, speed up or turn evenly so as to be there in time.

All of it is expressed in the frame of the agent itself, turned so that it came along +x. Turning
or shifting a scene therefore turns and shifts its prediction, and the order of agents is of no
account. Errors are Gaussian. Missing positions are NaN, at this door only: inside there are masks.

Beside the network, `separation.py` separates predicted pedestrians that would run into each
other. It is part of the model: `predict` applies it unless the configuration says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from scenewright.tools.trajnet_refiner.config import (
    BEFORE,
    CLASSES,
    GOAL_FEATURES,
    LATE,
    OUTPUTS,
    PAIR_FEATURES,
    RefinerConfig,
)
from scenewright.tools.trajnet_refiner.separation import separate


class Scenes(NamedTuple):
    """A batch of scenes, padded to the same number of agents.

    Attributes:
        xy: [B, N, T, 2] observed positions [m], the last one now; NaN where unseen and for
            padding. Of any length: what is older than the network looks back is left out.
        classes: [B, N] places in `CLASSES`.
        goal: [B, N, 2], or [B, N, P, 2] one per predicted step [m]; NaN for none.
        due: [B, N] or [B, N, P] predicted steps from now (1 is the next) at which the goal is to
            be reached; NaN if it does not matter when.
    """

    xy: Tensor
    classes: Tensor
    goal: Tensor | None = None
    due: Tensor | None = None

    def to(self, device: torch.device) -> Scenes:
        """Return the same on another device."""
        return Scenes(*(None if each is None else each.to(device) for each in self))  # type: ignore[arg-type]


class Prediction(NamedTuple):
    """The predicted motion of all agents seen at the last observed step; NaN for the others.

    Attributes:
        xy: [B, N, P, 2] mean positions [m].
        spread: [B, N, P, 3] of the Gaussian in the agent's own frame: log standard deviations
            along and across its direction [log m], and the correlation.
        along: [B, N, 2] unit vector of that direction in the map frame.
    """

    xy: Tensor
    spread: Tensor
    along: Tensor


class _Now(NamedTuple):
    """All agents at one step.

    Attributes:
        xy, move: [B, N, 2] places and moves since the step before [m]; change: how the move has
            changed per step of late [m]; before: places `BEFORE` steps before the first
            prediction [m].
        here, moved, known: [B, N] whether there is a place, a move and a place before.
    """

    xy: Tensor
    move: Tensor
    change: Tensor
    before: Tensor
    here: Tensor
    moved: Tensor
    known: Tensor


class Refiner(nn.Module):
    """The network; `forward` is differentiable and leaves predicted agents where they are."""

    pace: Tensor
    reach: Tensor

    def __init__(self, config: RefinerConfig) -> None:
        super().__init__()
        self.config = config
        c = config
        self.class_embedding = nn.Embedding(len(CLASSES), c.embedding)
        self.past_embedding = nn.Linear(5, c.embedding)
        self.encoder = nn.LSTM(c.embedding, c.hidden, batch_first=True)
        self.shortcut = nn.Linear(5 * (c.observed - 1), c.hidden)
        self.motion_embedding = nn.Linear(3 + (GOAL_FEATURES if c.goals else 0), c.embedding)
        width = c.embedding
        if c.pooling:
            self.memory = nn.Linear(c.hidden, c.pooled, bias=False)
            self.pair = nn.Linear(PAIR_FEATURES, c.pooled)
            self.impression = nn.Linear(c.pooled, c.pooled)
            self.pool = nn.Linear(c.pooled, c.pooled)
            width += c.pooled
        self.decoder = nn.LSTMCell(width, c.hidden)
        self.dropout = nn.Dropout(c.dropout)
        self.output = nn.Linear(c.hidden, OUTPUTS * c.stride)
        nn.init.normal_(self.output.weight, std=1e-2)
        nn.init.zeros_(self.output.bias)
        self.register_buffer("pace", torch.tensor(c.pace) * c.step, persistent=False)
        self.register_buffer("reach", torch.tensor(c.reach), persistent=False)

    def forward(self, scenes: Scenes, steps: int | None = None) -> Prediction:
        """The motion to come, a stride after the other, each from the network's own output.

        Args:
            steps: how many are predicted; as many as the configuration says if None.
        """
        steps = steps or self.config.predicted
        kept = scenes.xy[:, :, -self.config.observed :]
        lacking = self.config.observed - kept.shape[2]
        observed = nn.functional.pad(kept, (0, 0, lacking, 0), value=torch.nan)
        seen = ~observed.isnan().any(-1)
        xy = torch.nan_to_num(observed)
        along = compute_heading(xy, seen)
        unit = self.pace[scenes.classes][..., None]
        both = seen[:, :, 1:] & seen[:, :, :-1]
        moves = torch.where(both[..., None], xy[:, :, 1:] - xy[:, :, :-1], 0.0)
        state = self._encode(moves, both, scenes.classes, along, unit)
        now = _build_present(xy, seen, moves, both)
        places, spreads = [], []
        for step in range(0, steps, self.config.stride):
            state = self._advance(state, now, scenes, step, along, unit)
            out = self.output(self.dropout(state[0])).view(
                *now.here.shape, self.config.stride, OUTPUTS
            )
            own = self._limit_walking(out[..., :2], scenes.classes)
            change = turn(own * (0.5 * unit[..., None]), along[:, :, None])
            change = change + self._compute_even_changes(now, scenes, step)
            path = now.xy[:, :, None] + (now.move[:, :, None] + change).cumsum(2)
            last = change[:, :, -1]
            now = now._replace(
                xy=path[:, :, -1],
                move=now.move + last,
                change=last / self.config.stride,
                moved=now.here,
            )
            places.append(path)
            spreads.append(out[..., 2:])
        spread = torch.cat(spreads, dim=2)[:, :, :steps]
        spread = torch.cat((spread[..., :2].clamp(-6, 4), 0.95 * torch.tanh(spread[..., 2:])), -1)
        absent = ~now.here[..., None, None]
        mean = torch.cat(places, dim=2)[:, :, :steps]
        return Prediction(mean.masked_fill(absent, torch.nan), spread, along)

    def _limit_walking(self, change: Tensor, classes: Tensor) -> Tensor:
        """[B, N, stride, 2] learned changes along and across, of pedestrians as far as they count.

        All of them count while the network learns.
        """
        if self.training or self.config.walking is None:
            return change
        slowing = change.clamp_max(0.0) * change.new_tensor((self.config.walking, 0.0))
        walks = classes[..., None, None] == CLASSES.index("pedestrian")
        return torch.where(walks, slowing, change)

    def _compute_even_changes(self, now: _Now, scenes: Scenes, step: int) -> Tensor:
        """[B, N, stride, 2] changes of the present move that even acceleration makes.

        It brings an agent to its goal when that is due: n steps from now, with a move of v, each
        step adds a = 2 (goal - x - n v) / (n (n + 1)). Zero where no goal is due.
        """
        if not self.config.goals or scenes.goal is None or scenes.due is None:
            return now.xy.new_zeros(*now.xy.shape[:2], 1, 2)
        goal, left = select_next_goal(scenes.goal, scenes.due, step)
        n = torch.nan_to_num(left, nan=1.0)
        lacking = torch.nan_to_num(goal) - now.xy - n * now.move
        added = torch.where(left.isnan() | goal.isnan(), 0.0, 2.0 * lacking / (n * (n + 1.0)))
        k = torch.arange(1, self.config.stride + 1, device=n.device, dtype=n.dtype)
        return torch.minimum(k, n)[..., None] * added[:, :, None]

    def _encode(
        self, moves: Tensor, both: Tensor, classes: Tensor, along: Tensor, unit: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the memory of each agent's past, [B * N, hidden] twice."""
        own = turn_back(moves, along[:, :, None]) / unit[:, :, None]
        change = torch.where(both[:, :, 1:, None] & both[:, :, :-1, None], own.diff(dim=2), 0.0)
        change = nn.functional.pad(change, (0, 0, 1, 0))
        past = torch.cat((own, 5.0 * change, both[..., None]), -1)
        read = torch.relu(self.past_embedding(past) + self.class_embedding(classes)[:, :, None])
        _, (h, c) = self.encoder(read.flatten(0, 1))
        return h[0] + torch.relu(self.shortcut(past.flatten(2))).flatten(0, 1), c[0]

    def _advance(
        self,
        state: tuple[Tensor, Tensor],
        now: _Now,
        scenes: Scenes,
        step: int,
        along: Tensor,
        unit: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Memory after a look at the present: own motion, goal, neighbours."""
        parts = [turn_back(now.move, along) / unit, now.moved[..., None].to(now.xy.dtype)]
        if self.config.goals:
            parts.append(compute_goal_features(now.xy, scenes, step, along, unit))
        embedded = self.motion_embedding(torch.cat(parts, -1))
        read = [torch.relu(embedded + self.class_embedding(scenes.classes))]
        if self.config.pooling:
            read.append(self._pool(state[0], now, scenes.classes, along, unit))
        seen = self.dropout(torch.cat(read, -1).flatten(0, 1))
        new: tuple[Tensor, Tensor] = self.decoder(seen, state)
        return new

    def _pool(
        self, memory: Tensor, now: _Now, classes: Tensor, along: Tensor, unit: Tensor
    ) -> Tensor:
        """[B, N, pooled]: the strongest impressions that the nearest neighbours make."""
        near, who = find_nearest(now.xy, now.here, self.reach[classes], self.config.neighbours)
        messages = self.memory(memory).view(*classes.shape, -1)
        seen = self.pair(pair_features(now, who, classes, along, unit))
        impression = torch.relu(self.impression(torch.relu(seen + pick(messages, who))))
        strongest = impression.masked_fill(~near[..., None], 0.0).amax(dim=2)
        return torch.relu(self.pool(strongest))

    @classmethod
    def from_weights(cls, config: RefinerConfig, weights: Mapping[str, NDArray[Any]]) -> Refiner:
        """A network with weights of the shapes of `config.list_shapes`, ready to predict."""
        net = cls(config)
        net.load_state_dict({name: torch.from_numpy(each) for name, each in weights.items()})
        return net.eval()

    def list_weights(self) -> dict[str, NDArray[Any]]:
        """Copies of the weights by name, as `RefinerNetwork` takes them."""
        tensors = self.state_dict().items()
        return {name: each.detach().cpu().numpy().copy() for name, each in tensors}


@torch.no_grad()
def predict(net: Refiner, scenes: Scenes, *, steps: int | None = None) -> Prediction:
    """Predict all agents' motion, mirrored and kept apart as the configuration says.

    Args:
        steps: how many are predicted; as many as the configuration says if None.
    """
    raw: Prediction = net(scenes, steps)
    if net.config.mirrored:
        swap = raw.xy.new_tensor((1.0, -1.0))  # north and south exchanged
        goal = None if scenes.goal is None else scenes.goal * swap
        other: Prediction = net(scenes._replace(xy=scenes.xy * swap, goal=goal), steps)
        turned = other.spread * other.spread.new_tensor((1.0, 1.0, -1.0))
        xy, spread = 0.5 * (raw.xy + other.xy * swap), 0.5 * (raw.spread + turned)
        raw = raw._replace(xy=xy, spread=spread)
    if net.config.apart is None:
        return raw
    walkers = scenes.classes == CLASSES.index("pedestrian")
    return raw._replace(xy=separate(raw.xy, among=walkers, apart=net.config.apart))


def _build_present(xy: Tensor, seen: Tensor, moves: Tensor, both: Tensor) -> _Now:
    """Build the last observed step; moves and both [B, N, T - 1] between each two."""
    early = -1 - min(LATE, moves.shape[2] - 1)
    steady = both[:, :, early:].all(-1, keepdim=True)
    change = torch.where(steady, (moves[:, :, -1] - moves[:, :, early]) / (-1.0 - early), 0.0)
    past = -1 - min(BEFORE, xy.shape[2] - 1)
    return _Now(
        xy[:, :, -1], moves[:, :, -1], change, xy[:, :, past],
        seen[:, :, -1], both[:, :, -1], seen[:, :, past],
    )  # fmt: skip


def compute_heading(xy: Tensor, seen: Tensor, *, back: int = 4) -> Tensor:
    """Compute unit vectors [B, N, 2] of each agent's motion over its last steps; +x if standing.

    Args:
        xy: [B, N, T, 2] positions, any finite value where unseen; seen: [B, N, T].
    """
    last = xy[:, :, -1]
    first = last
    for k in range(2, min(back, xy.shape[2] - 1) + 2):
        first = torch.where(seen[:, :, -k, None], xy[:, :, -k], first)
    way = torch.where(seen[:, :, -1:], last - first, 0.0)
    length = way.norm(dim=-1, keepdim=True)
    east = torch.zeros_like(way)
    east[..., 0] = 1.0
    return torch.where(length > 1e-6, way / length.clamp_min(1e-6), east)


def turn(vector: Tensor, along: Tensor) -> Tensor:
    """From an agent's own frame, in which `along` is +x, to the map's; [..., 2] both."""
    x, y = vector.unbind(-1)
    c, s = along.unbind(-1)
    return torch.stack((c * x - s * y, s * x + c * y), -1)


def turn_back(vector: Tensor, along: Tensor) -> Tensor:
    """From the map frame to an agent's own, in which `along` is +x; [..., 2] both."""
    x, y = vector.unbind(-1)
    c, s = along.unbind(-1)
    return torch.stack((c * x + s * y, c * y - s * x), -1)


def find_nearest(xy: Tensor, here: Tensor, reach: Tensor, most: int) -> tuple[Tensor, Tensor]:
    """Find the neighbours that each agent pools.

    Args:
        xy: [B, N, 2]; here: [B, N]; reach: [B, N] of the agent that pools [m].

    Returns:
        [B, N, K] whether there is such a neighbour, and [B, N, K] its place among the agents.
    """
    n = xy.shape[1]
    with torch.no_grad():
        apart = torch.cdist(xy, xy, compute_mode="donot_use_mm_for_euclid_dist")
        excluded = ~here[:, None, :] | torch.eye(n, dtype=torch.bool, device=xy.device)
        apart = apart.masked_fill(excluded, torch.inf)
        distance, who = apart.topk(min(most, max(n - 1, 1)), dim=-1, largest=False, sorted=False)
        return distance < reach[..., None], who


def pick(of_all: Tensor, who: Tensor) -> Tensor:
    """[B, N, K, D] what `who` [B, N, K] have in `of_all` [B, N, D]."""
    b, n, k = who.shape
    rows = who + n * torch.arange(b, device=who.device)[:, None, None]
    return of_all.flatten(0, 1).index_select(0, rows.flatten()).view(b, n, k, -1)


def pair_features(now: _Now, who: Tensor, classes: Tensor, along: Tensor, unit: Tensor) -> Tensor:
    """[B, N, K, 17] what an agent notices of a neighbour, in its own frame and bounded.

    Where it is (towards it, by distance), how it moves relative to the agent, when and how close
    they would come if both kept going, whether its motion is known and whether it is a vehicle,
    how its motion changes, and where it was some steps ago, as seen from the agent then.
    """
    facing = along[:, :, None].expand(-1, -1, who.shape[2], -1)
    kind = classes[..., None].to(now.xy.dtype)
    flags = (now.moved[..., None].to(kind), kind, now.known[..., None].to(kind))
    other = pick(torch.cat((now.xy, now.move, now.change, now.before, *flags), -1), who)
    offset = turn_back(other[..., :2] - now.xy[:, :, None], facing)
    relative = turn_back(other[..., 2:4] - now.move[:, :, None], facing)
    change = turn_back(other[..., 4:6], facing)
    then = turn_back(other[..., 6:8] - now.before[:, :, None], facing)
    known = other[..., 10:] * now.known[:, :, None, None]
    then = known * then / (1.0 + then.norm(dim=-1, keepdim=True))
    distance = (offset.square().sum(-1, keepdim=True) + 1e-6).sqrt()
    steps = -(offset * relative).sum(-1, keepdim=True)
    steps = (steps / (relative.square().sum(-1, keepdim=True) + 1e-3)).clamp(0, 12)
    closest = offset + steps * relative
    gap = (closest.square().sum(-1, keepdim=True) + 1e-6).sqrt()
    return torch.cat(
        (
            offset / (1.0 + distance),
            torch.exp(-distance),
            torch.exp(-distance / 4.0),
            relative / unit[:, :, None],
            steps / 12.0,
            torch.exp(-2.0 * gap),
            closest / (0.5 + gap),
            other[..., 8:10],
            5.0 * change / unit[:, :, None],
            then,
            known,
        ),
        dim=-1,
    )


def compute_goal_features(
    xy: Tensor, scenes: Scenes, step: int, along: Tensor, unit: Tensor
) -> Tensor:
    """[B, N, 7] the way to the goal from `xy`, in the agent's own frame; zeros without one.

    The unit vector *towards* the goal, the distance, whether there is a goal; the speed along and
    across that reaches it in time and whether there is such a time.
    """
    if scenes.goal is None:
        return xy.new_zeros(*xy.shape[:2], GOAL_FEATURES)
    goal, left = select_next_goal(scenes.goal, scenes.due, step)
    given = ~goal.isnan().any(-1, keepdim=True)
    way = turn_back(torch.where(given, torch.nan_to_num(goal) - xy, 0.0), along)
    distance = (way.square().sum(-1, keepdim=True) + 1e-6).sqrt()
    towards = way / distance
    timed = given & ~left.isnan()
    pace = torch.where(timed, way / torch.nan_to_num(left, nan=1.0).clamp_min(1.0), 0.0) / unit
    features = torch.cat(
        (towards, torch.log1p(distance / (12 * unit)), given, pace.clamp(-4, 4), timed), -1
    )
    return torch.where(given, features, 0.0)


def select_next_goal(goals: Tensor, due: Tensor | None, step: int) -> tuple[Tensor, Tensor]:
    """The goals that count at a predicted step; goals and due as in `Scenes`.

    Returns:
        [B, N, 2] where they are, NaN for none, and [B, N, 1] in how many steps they are due, 1 or
        more; NaN if it does not matter when, or that time is past.
    """
    goal = goals if goals.ndim == 3 else goals[:, :, step]
    if due is None:
        return goal, torch.full_like(goal[..., :1], torch.nan)
    left = ((due if due.ndim == 2 else due[:, :, step]) - step)[..., None]
    return goal, torch.where(left >= 1, left, torch.nan)
