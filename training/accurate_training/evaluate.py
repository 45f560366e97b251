"""The table of held-out scores: networks and classical filters on the same images."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .atomic import write_atomically
from .export import INPUT
from .metrics import MaskScores, score_mask
from .network import WIRE
from .normalise import z_score
from .predict import THRESHOLD, pad_to_multiple
from .shards import ShardError, ShardPool

#: Seed and size of the bootstrap over images.
BOOTSTRAP_SEED, BOOTSTRAP_DRAWS = 20260, 2000

COLUMNS: dict[str, Callable[[MaskScores], float | None]] = {
    "recall 1 px": lambda score: score.skeleton_recall[1],
    "recall 2 px": lambda score: score.skeleton_recall[2],
    "recall 3 px": lambda score: score.skeleton_recall[3],
    "precision 1 px": lambda score: score.skeleton_precision[1],
    "precision 2 px": lambda score: score.skeleton_precision[2],
    "precision 3 px": lambda score: score.skeleton_precision[3],
    "clDice": lambda score: score.cl_dice,
    "Dice": lambda score: score.dice,
    "Betti-0 error": lambda score: score.betti0_error,
    "centreline px": lambda score: score.centreline_distance_px,
}


@dataclass(frozen=True)
class Estimate:
    """A mean over images with its bootstrap 95 % interval; `defined` images have the score at all."""

    mean: float
    low: float
    high: float
    defined: int


def onnx_segmenter(path: Path, threads: int = 1) -> Callable[[np.ndarray], np.ndarray]:
    """Image to mask through ONNX Runtime: the file that is shipped, not the network that was trained."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])

    def segment(image: np.ndarray) -> np.ndarray:
        (logits,) = session.run(None, {INPUT: pad_to_multiple(z_score(image))[None, None]})
        height, width = image.shape
        # softmax(wire) >= t for two classes: a difference of logits.
        margin = logits[0, WIRE, :height, :width] - logits[0, 1 - WIRE, :height, :width]
        return margin >= np.log(THRESHOLD / (1 - THRESHOLD))

    return segment


def held_out(folder: Path, count: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The first `count` images of a folder that have a wire, with their masks."""
    pool, images, masks = ShardPool(folder), [], []
    for index in range(len(pool)):
        if len(images) == count:
            break
        case = pool.case(index)
        if case.mask.any():
            images.append(np.array(case.image))
            masks.append(np.array(case.mask))
    if len(images) < count:
        raise ShardError(f"{folder}: {len(images)} images with a wire, {count} wanted")
    return images, masks


def score_method(
    segment: Callable[[np.ndarray], np.ndarray], images: list[np.ndarray], masks: list[np.ndarray]
) -> list[MaskScores]:
    """Scores of one method, image by image."""
    return [score_mask(segment(image), mask) for image, mask in zip(images, masks, strict=True)]


def bootstrap(values: list[float | None]) -> Estimate | None:
    """Mean and percentile interval over the images whose score is defined; None if there are none."""
    defined = np.array([value for value in values if value is not None], dtype=float)
    if defined.size == 0:
        return None
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    means = defined[rng.integers(defined.size, size=(BOOTSTRAP_DRAWS, defined.size))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return Estimate(float(defined.mean()), float(low), float(high), int(defined.size))


def summarise(scores: list[MaskScores]) -> dict[str, Estimate | None]:
    """An estimate per column."""
    return {name: bootstrap([column(score) for score in scores]) for name, column in COLUMNS.items()}


def markdown_table(results: dict[str, list[MaskScores]], columns: list[str]) -> str:
    """One row per method: mean [low, high]; `failures` are images in which nothing was found."""
    lines = ["| method | " + " | ".join(columns) + " | failures |", "|---|" + "---:|" * (len(columns) + 1)]
    for method, scores in results.items():
        summary = summarise(scores)
        cells = [_cell(summary[column]) for column in columns]
        failures = sum(score.failed for score in scores)
        lines.append(f"| {method} | " + " | ".join(cells) + f" | {failures} of {len(scores)} |")
    return "\n".join(lines)


def write_results(path: Path, results: dict[str, list[MaskScores]], origin: dict[str, object]) -> None:
    """Every summary and every image's scores as JSON."""
    document = {
        "origin": origin,
        "methods": {
            method: {
                "summary": {name: value and vars(value) for name, value in summarise(scores).items()},
                "failures": sum(score.failed for score in scores),
                "images": [{name: column(score) for name, column in COLUMNS.items()} for score in scores],
            }
            for method, scores in results.items()
        },
    }
    write_atomically(path, lambda temporary: temporary.write_text(json.dumps(document, indent=1) + "\n"))


def _cell(estimate: Estimate | None) -> str:
    if estimate is None:
        return "undefined"
    digits = 3 if estimate.mean < 10 else 1
    return f"{estimate.mean:.{digits}f} [{estimate.low:.{digits}f}, {estimate.high:.{digits}f}]"
