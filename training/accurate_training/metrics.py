"""Scores of a mask against the truth, the same definitions as in `accurate-eval`.

All take 0/1 arrays of one shape. A score that the input leaves undefined (an empty prediction has no
centreline) is `None`, a failure to be counted; it is never a zero in a mean.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from skimage.morphology import skeletonize

EIGHT_NEIGHBOURS = np.ones((3, 3), dtype=int)


@dataclass(frozen=True)
class MaskScores:
    """Scores of one image; distances in pixels."""

    dice: float
    cl_dice: float | None
    skeleton_recall: dict[int, float]
    skeleton_precision: dict[int, float | None]
    betti0_error: int
    centreline_distance_px: float | None

    @property
    def failed(self) -> bool:
        """Nothing was found."""
        return self.centreline_distance_px is None


def score_mask(predicted: np.ndarray, truth: np.ndarray, tolerances_px: tuple[int, ...] = (1, 2, 3)) -> MaskScores:
    """Scores a predicted mask; the truth must not be empty."""
    if predicted.shape != truth.shape:
        raise ValueError(f"prediction {predicted.shape}, truth {truth.shape}")
    predicted, truth = predicted.astype(bool), truth.astype(bool)
    if not truth.any():
        raise ValueError("the truth has no wire: recall is undefined")
    skeleton, true_skeleton = skeletonize(predicted), skeletonize(truth)
    return MaskScores(
        dice=dice(predicted, truth),
        cl_dice=cl_dice(predicted, skeleton, truth, true_skeleton),
        skeleton_recall={t: near_share(true_skeleton, skeleton, t) or 0.0 for t in tolerances_px},
        skeleton_precision={t: near_share(skeleton, true_skeleton, t) for t in tolerances_px},
        betti0_error=betti0_error(predicted, truth),
        centreline_distance_px=centreline_distance(skeleton, true_skeleton),
    )


def dice(predicted: np.ndarray, truth: np.ndarray) -> float:
    """2 |P and V| / (|P| + |V|)."""
    return float(2 * np.count_nonzero(predicted & truth) / (np.count_nonzero(predicted) + np.count_nonzero(truth)))


def cl_dice(
    predicted: np.ndarray, skeleton: np.ndarray, truth: np.ndarray, true_skeleton: np.ndarray
) -> float | None:
    """Harmonic mean of |S_P and V_L| / |S_P| and |S_L and V_P| / |S_L| (Shit et al. 2021)."""
    if not skeleton.any():
        return None
    precision = np.count_nonzero(skeleton & truth) / np.count_nonzero(skeleton)
    sensitivity = np.count_nonzero(true_skeleton & predicted) / np.count_nonzero(true_skeleton)
    total = precision + sensitivity
    return float(2 * precision * sensitivity / total) if total > 0 else 0.0


def near_share(of: np.ndarray, to: np.ndarray, tolerance_px: float) -> float | None:
    """Share of the pixels of `of` that have a pixel of `to` within `tolerance_px`; None if `of` is empty."""
    if not of.any():
        return None
    if not to.any():
        return 0.0
    return float(np.mean(distance_transform_edt(~to)[of] <= tolerance_px))


def centreline_distance(skeleton: np.ndarray, true_skeleton: np.ndarray) -> float | None:
    """Mean of the two mean distances between skeletons, each to the nearest pixel of the other."""
    if not skeleton.any() or not true_skeleton.any():
        return None
    there = distance_transform_edt(~true_skeleton)[skeleton].mean()
    back = distance_transform_edt(~skeleton)[true_skeleton].mean()
    return float((there + back) / 2)


def betti0_error(predicted: np.ndarray, truth: np.ndarray) -> int:
    """Difference of the numbers of 8-connected components."""
    return abs(label(predicted, EIGHT_NEIGHBOURS)[1] - label(truth, EIGHT_NEIGHBOURS)[1])
