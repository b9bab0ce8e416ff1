"""Time gaps (PET) and the TTC of following by omega-prime.

Knows rectangles only. The least time gap is searched over all pairs of samples; time to collision
is the distance of the centres along the ego's line over the difference of speeds along it.
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from typing import Any

import numpy as np
import polars as pl
from omega_prime import Recording
from omega_prime.metrics import MetricManager

NANOS = 1_000_000_000
ZERO = ("z", "vel_z", "acc_x", "acc_y", "acc_z", "roll", "pitch")


def table(agents: list[dict[str, Any]]) -> pl.DataFrame:
    """One row per agent and sample, as omega-prime wants it."""
    return pl.concat([_rows(agent) for agent in agents])


def _rows(agent: dict[str, Any]) -> pl.DataFrame:
    x, y = np.array(agent["x"]), np.array(agent["y"])
    time = agent["start"] + agent["step"] * np.arange(len(x))
    yaw = np.remainder(np.array(agent["heading"]) + np.pi, 2 * np.pi) - np.pi
    columns = {
        "total_nanos": np.rint(time * NANOS).astype(np.int64), "x": x, "y": y, "yaw": yaw,
        "vel_x": np.gradient(x, agent["step"]), "vel_y": np.gradient(y, agent["step"]),
    }  # fmt: skip
    same = {"length": agent["length"], "width": agent["width"], "height": 1.5}
    return pl.DataFrame(columns).with_columns(
        *(pl.lit(0.0).alias(name) for name in ZERO),
        *(pl.lit(float(value)).alias(name) for name, value in same.items()),
        *(pl.lit(value, dtype=pl.Int64).alias(name)
          for name, value in (("idx", agent["id"]), ("type", 2), ("role", 1), ("subtype", 4))),
    )  # fmt: skip


def measures(agents: list[dict[str, Any]], buffer: float) -> dict[str, Any]:
    """PET of two agents and the TTC of the first towards the second, by time."""
    recording = Recording(df=table(agents), validate=False)
    _, found = MetricManager().compute(
        recording, ego_id=agents[0]["id"], time_buffer=buffer * NANOS
    )
    gaps = found["min_timegaps"]["min_timegap"].to_list()
    rows = found["ttc_and_thw"].select("total_nanos_ego", "TTC").drop_nulls().rows()
    ttc = [[nanos / NANOS, value] for nanos, value in rows]
    return {"pet": abs(gaps[0]) if gaps else None, "ttc": ttc}


def main() -> None:
    request = json.load(sys.stdin)
    answers = [measures(agents, request["buffer"]) for agents in request["pairs"]]
    json.dump({"version": version("omega-prime"), "pairs": answers}, sys.stdout)


if __name__ == "__main__":
    main()
