"""The demand of `amsterdam_120` from raw counts: NYC DOT's of vehicles, Utah's of pedestrians."""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from datetime import datetime
from pathlib import Path

from scenewright.errors import InputError
from scenewright.scene.base import Compass
from scenewright.tools.simulation.sumo_run import HOURS, Demand, Hourly

_BUSIEST_SIGNALS = 10
_LEAST_MINUTES, _MOST_MINUTES = 45.0, 75.0
_WEEKEND = 5


def derive_demand(counts: Path) -> Demand:
    """The demand from raw counts: NYC DOT `Traffic_Volume_Counts*.csv` and Utah's `dat.csv`.

    `counts` is searched recursively. InputError where files or streets are missing.
    """
    rows = _read_volume_rows(counts)
    by_leg: dict[Compass, list[Hourly]] = {
        "south": _select_days(rows, "AMSTERDAM", ("118", "119"), "NB"),
        "north": _select_days(rows, "AMSTERDAM", ("118", "119"), "SB"),
        "east": _select_days(rows, "MORNINGSIDE", ("120", "121"), "WB"),
        "west": _select_days(rows, "MORNINGSIDE", ("120", "121"), "EB"),
    }
    level = float(Demand.model_fields["pedestrian_level"].default)
    walkers = tuple(round(level * n, 2) for n in _read_crossings(counts))
    return Demand(
        vehicles={leg: _average_days(days) for leg, days in by_leg.items()},
        day_spread={leg: _measure_day_spread(days) for leg, days in by_leg.items()},
        pedestrians=walkers,
    )


def _read_volume_rows(counts: Path) -> list[list[str]]:
    files = sorted(counts.rglob("Traffic_Volume_Counts*.csv"))
    if not files:
        raise InputError(f"no Traffic_Volume_Counts*.csv under {counts}")
    rows: list[list[str]] = []
    for file in files:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            rows += list(csv.reader(stream))[1:]
    return rows


def _select_days(
    rows: list[list[str]], road: str, between: tuple[str, str], direction: str
) -> list[Hourly]:
    """[days][24] counts of working days on one block, in one direction."""
    days = [
        tuple(float(n) for n in row[7 : 7 + HOURS])
        for row in rows
        if row[2].strip().upper().startswith(road)
        and all(any(name in end for end in row[3:5]) for name in between)
        and row[5].strip() == direction
        and datetime.strptime(row[6], "%m/%d/%Y").weekday() < _WEEKEND
    ]
    if not days:
        raise InputError(f"no {direction} counts of {road.title()} {'-'.join(between)} Street")
    return days


def _average_days(days: list[Hourly]) -> Hourly:
    return tuple(round(sum(hour) / len(days), 1) for hour in zip(*days, strict=True))


def _measure_day_spread(days: list[Hourly]) -> float:
    """Relative spread between days beyond what chance arrivals explain."""
    parts: list[float] = []
    for hour in zip(*days, strict=True):
        mean = sum(hour) / len(days)
        variance = sum((n - mean) ** 2 for n in hour) / max(len(days) - 1, 1)
        parts.append(max(variance - mean, 0.0) / mean**2)
    return round(math.sqrt(sum(parts) / len(parts)), 3)


def _read_crossings(counts: Path) -> Hourly:
    """[24] mean crossings per hour and crosswalk at the busiest signals."""
    files = [f for f in sorted(counts.rglob("dat.csv")) if "ped" in f.parent.name]
    if not files:
        raise InputError(f"no pedestrian counts dat.csv under {counts}")
    observed: dict[str, dict[int, list[tuple[float, float]]]] = defaultdict(
        lambda: defaultdict(list)
    )
    with files[0].open(newline="", encoding="utf-8-sig") as stream:
        for row in csv.DictReader(stream):
            minutes = float(row["TDIFF"])
            if _LEAST_MINUTES < minutes < _MOST_MINUTES and row["DIR"] in set("NESW"):
                hour = datetime.fromisoformat(row["TIME1"]).hour
                observed[row["SIGNAL"]][hour].append((float(row["PED"]), minutes))
    complete = [by_hour for by_hour in observed.values() if len(by_hour) == HOURS]
    busiest = sorted(complete, key=_sum_daily_rate, reverse=True)[:_BUSIEST_SIGNALS]
    return tuple(sum(_compute_rate(s[h]) for s in busiest) / len(busiest) for h in range(HOURS))


def _compute_rate(observations: list[tuple[float, float]]) -> float:
    return 60.0 * sum(n for n, _ in observations) / sum(minutes for _, minutes in observations)


def _sum_daily_rate(by_hour: dict[int, list[tuple[float, float]]]) -> float:
    return sum(_compute_rate(observations) for observations in by_hour.values())
