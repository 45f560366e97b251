"""Curves of one or more runs as a picture."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from .atomic import write_atomically
from .curves import read_curve
from .trainer import STEP_CURVE, VALIDATION_CURVE

#: Width of the running mean over steps.
SMOOTHING = 50


def plot_runs(runs: list[Path], picture: Path) -> None:
    """Draws losses (running mean), held-out scores and the learning rate; runs follow one another."""
    figure, (losses, scores, rates) = plt.subplots(3, 1, figsize=(8, 9), sharex=True, height_ratios=[3, 3, 1])
    offset = 0
    for run in runs:
        steps = read_curve(run / STEP_CURVE)
        if not steps:
            raise ValueError(f"{run / STEP_CURVE}: no step")
        losses.set_prop_cycle(None)
        for name in ("cross_entropy", "skeleton_recall", "cl_dice", "dice"):
            points = [(row["step"] + offset, row[name]) for row in steps if name in row]
            if points:
                x, y = np.array(points).T
                width = min(SMOOTHING, len(y))
                smooth = np.convolve(y, np.ones(width) / width, mode="valid")
                losses.plot(x[width - 1 :], smooth, label=_once(losses, name.replace("_", " ")))
        rates.plot([row["step"] + offset for row in steps], [row["rate"] for row in steps], color="black")
        scores.set_prop_cycle(None)
        validation = read_curve(run / VALIDATION_CURVE)
        for name in ("recall_2px", "precision_2px", "cl_dice", "dice"):
            points = [(row["step"] + offset, row[name]) for row in validation if name in row]
            if points:
                x, y = np.array(points).T
                label = {"recall_2px": "skeleton recall 2 px", "precision_2px": "skeleton precision 2 px",
                         "cl_dice": "clDice", "dice": "Dice"}[name]
                scores.plot(x, y, marker=".", label=_once(scores, label))
        offset += steps[-1]["step"] + 1
    losses.set(ylabel=f"training loss (mean of {SMOOTHING} steps)", yscale="log")
    scores.set(ylabel="validation images", ylim=(0.0, 1.0))
    rates.set(ylabel="learning rate", xlabel="step")
    for axes in (losses, scores):
        axes.legend()
        axes.grid(alpha=0.3)
    figure.tight_layout()
    write_atomically(picture, lambda temporary: figure.savefig(temporary, dpi=90))
    plt.close(figure)


def _once(axes: plt.Axes, label: str) -> str | None:
    """The label, unless a line of an earlier run has it."""
    return None if label in axes.get_legend_handles_labels()[1] else label
