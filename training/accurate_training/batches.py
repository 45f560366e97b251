"""Batches as a pure function of (seed, step, number of images): resuming needs no state of a generator."""

from dataclasses import dataclass

import numpy as np
from skimage.morphology import skeletonize

from .augment import AugmentParams, bend_greys, enlarge, turn
from .normalise import grey_statistics
from .shards import Case, ShardError, ShardPool

#: Share of crops that are centred on a pixel of the wire; the rest lie anywhere.
ON_THE_WIRE = 2 / 3


@dataclass(frozen=True)
class Batch:
    """`image` float32 (N, 1, S, S), z-scored; `mask`, `tube`, `skeleton` uint8 (N, S, S) of 0 and 1.

    `tube` and `skeleton` lie in `mask`.
    """

    image: np.ndarray
    mask: np.ndarray
    tube: np.ndarray
    skeleton: np.ndarray


def draw_batch(
    pool: ShardPool, images: int, *, seed: int, step: int, size: int, side: int, params: AugmentParams
) -> Batch:
    """Batch number `step` of a run: `size` crops of `side` x `side` out of the first `images` images."""
    rng = np.random.default_rng([seed, step])
    crops = [_draw_crop(pool.case(int(rng.integers(images))), side, rng, params) for _ in range(size)]
    image, mask, tube = (np.stack(planes) for planes in zip(*crops, strict=True))
    # The tube is cut to the label, as skeleton recall's authors do: outside, it would ask for what the
    # cross entropy forbids, and wires of one or two pixels would come out too wide.
    tube &= mask
    skeleton = np.stack([skeletonize(plane.astype(bool)) for plane in mask]).astype(np.uint8)
    return Batch(image[:, None], mask, tube, skeleton)


def _draw_crop(case: Case, side: int, rng: np.random.Generator, params: AugmentParams):
    height, width = case.image.shape
    if side > min(height, width):
        raise ShardError(f"a crop of {side} px does not fit an image of {height} x {width}")
    window = side
    if rng.random() < params.zoom_probability:
        window = int(round(side / rng.uniform(1.0, params.largest_zoom)))
    top, left = _corner(case.mask, window, rng)
    region = np.s_[top : top + window, left : left + window]
    mean, std = grey_statistics(case.image)
    image = (case.image[region].astype(np.float32) - np.float32(mean)) / np.float32(std)
    mask, tube = case.mask[region], case.tube[region]
    if window != side:
        image = enlarge(image, side, label=False)
        mask, tube = (enlarge(plane, side, label=True) for plane in (mask, tube))
    image, mask, tube = turn([image, mask, tube], rng)
    return bend_greys(image, rng, params), np.ascontiguousarray(mask), np.ascontiguousarray(tube)


def _corner(mask: np.ndarray, window: int, rng: np.random.Generator) -> tuple[int, int]:
    height, width = mask.shape
    if rng.random() < ON_THE_WIRE:
        wire = np.flatnonzero(mask)
        if wire.size:
            row, column = divmod(int(wire[rng.integers(wire.size)]), width)
            top, left = row - window // 2, column - window // 2
            return min(max(top, 0), height - window), min(max(left, 0), width - window)
    return int(rng.integers(height - window + 1)), int(rng.integers(width - window + 1))
