"""Figures of the ladder, of remedies compared, and of a margin found."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from testbed.report.style import BLACK, BLUE, GREEN, LIMIT, PAGE, VERMILION, drawing, save, style

if TYPE_CHECKING:
    import pandas as pd

    from testbed.studies.ladder.ladder import Account
    from testbed.studies.margin.margin import Margin


def ladder(table: pd.DataFrame, distance: Account, h: Account, d_safe: float, folder: Path) -> list[Path]:
    """Least distance and h on every rung: each run a dot, the mean a bar."""
    with drawing() as pyplot:
        figure, axes = pyplot.subplots(2, 1, figsize=(PAGE, 4.8), sharex=True, layout="constrained")
        names = [s.rung for s in distance.steps]
        for a, account, column, limit, label in (
            (axes[0], distance, "distance_m", d_safe, "least distance [m]"),
            (axes[1], h, "h_m", 0.0, "least h [m]"),
        ):
            for k, name in enumerate(names):
                values = table[table.rung == name][column].astype(float).dropna().to_numpy()
                x = k + np.linspace(-0.18, 0.18, len(values))
                lost = values < limit
                a.plot(x[~lost], values[~lost], "o", ms=2.5, color=BLUE, alpha=0.6)
                a.plot(x[lost], values[lost], "x", ms=3.5, color=VERMILION)
            a.plot(range(len(names)), [s.value for s in account.steps], "_", ms=18, color=BLACK, mew=2)
            a.axhline(limit, **LIMIT)
            a.set_ylabel(label)
        axes[0].set_title("The fidelity ladder: every run (cross: lost), the mean a bar, the bound dotted")
        axes[1].set_xticks(range(len(names)), names, rotation=25, ha="right")
        return save(figure, folder, "ladder")


def remedies(table: pd.DataFrame, d_safe: float, folder: Path) -> list[Path]:
    """Violation rate with its interval, and least and median distance, remedy by remedy."""
    with drawing() as pyplot:
        figure, axes = pyplot.subplots(
            1, 2, figsize=(PAGE, 0.28 * len(table) + 1.0), sharey=True, layout="constrained"
        )
        y = np.arange(len(table))[::-1]
        rate = 100 * table.rate.to_numpy()
        low, high = 100 * table.rate_low.to_numpy(), 100 * table.rate_high.to_numpy()
        axes[0].errorbar(rate, y, xerr=[rate - low, high - rate], fmt="o", ms=3.5, color=VERMILION, capsize=2)
        axes[0].set(xlabel="runs that lose Ds [%], 95 % interval", xlim=(-2, 102))
        axes[0].set_yticks(y, table.remedy)
        axes[1].plot(table.least_distance_m, y, "x", color=VERMILION, label="least of all runs")
        axes[1].plot(table.median_distance_m, y, "o", ms=3.5, color=BLUE, label="median")
        axes[1].axvline(d_safe, **LIMIT)
        axes[1].set(xlabel="least distance [m] (dotted: Ds)", ylim=(-0.6, len(table) - 0.4))
        figure.legend(loc="outside upper right", ncols=2)
        return save(figure, folder, "remedies")


def margin(found: Margin, folder: Path) -> list[Path]:
    """Against the knob: the violation rate with intervals, and what the setting costs in path and time."""
    with drawing() as pyplot:
        figure, (a, cost) = pyplot.subplots(
            2, 1, figsize=(PAGE * 0.75, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2)
        )
        for stage, colour, marker in (
            ("sweep", BLUE, "o"),
            ("bisect", GREEN, "s"),
            ("certify", VERMILION, "D"),
        ):
            points = [p for p in found.points if p.stage.startswith(stage)]
            if not points:
                continue
            x = [p.setting for p in points]
            y = np.array([100 * p.violations / p.runs for p in points])
            low = np.array([100 * p.rate_low for p in points])
            high = np.array([100 * p.rate_high for p in points])
            a.errorbar(
                x, y, yerr=[y - low, high - y], fmt=marker, ms=3.5, color=colour, capsize=2, label=stage
            )
        a.axhline(100 * found.target_rate, **LIMIT)
        a.set(ylabel="runs that lose Ds [%], 95 % interval")
        # Above the panels: within, it hides an interval of one knob or another.
        figure.legend(loc="outside upper center", ncols=3)
        swept = sorted((p for p in found.points if p.stage == "sweep"), key=lambda p: p.setting)
        time = cost.twinx()
        time.grid(False)
        for axes, name, colour, mark in (
            (cost, "path_added_m", BLUE, "o-"),
            (time, "time_added_s", GREEN, "s--"),
        ):
            known = [(p.setting, getattr(p, name)) for p in swept if getattr(p, name) is not None]
            if known:
                axes.plot(*zip(*known, strict=True), mark, ms=3, color=colour)
        cost.set_ylabel("path added [m], solid", color=BLUE)
        time.set_ylabel("time added [s], dashed", color=GREEN)
        cost.set(xlabel=f"{found.knob} [{found.unit}]")
        return save(figure, folder, "margin")


def answer(table: pd.DataFrame, folder: Path) -> list[Path]:
    """Share of runs that lose Ds, by case, with intervals."""
    with drawing() as pyplot:
        figure, a = pyplot.subplots(figsize=(PAGE, 0.2 * len(table) + 0.9), layout="constrained")
        y = np.arange(len(table))[::-1]
        rate = 100 * table.lost / table.runs
        low, high = rate - 100 * table.rate_low, 100 * table.rate_high - rate
        for vehicle, marker in zip(dict.fromkeys(table.vehicle), cycle("osD^v"), strict=False):
            of = (table.vehicle == vehicle).to_numpy()
            a.errorbar(
                rate[of],
                y[of],
                xerr=[low[of].clip(0), high[of].clip(0)],
                fmt=marker,
                ms=3.5,
                capsize=2,
                color=style(vehicle)["color"],
                label=vehicle,
            )
        names = [f"{r.number} {r.vehicle}, {r.weather}, {r.remedy}" for r in table.itertuples()]
        a.set_yticks(y, names)
        a.set(xlabel="runs that lose Ds [%], 95 % interval", xlim=(-2, 102), ylim=(-0.7, len(table) - 0.3))
        figure.legend(loc="outside upper right", ncols=4)
        return save(figure, folder, "answer")
