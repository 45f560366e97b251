"""What is varied on top of the generator's own randomisation.

The generator varies physics (dose, blur, anatomy, devices); here the same crop is turned, enlarged and
its grey values bent, so that an image that is drawn twice is not seen twice.
"""

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from scipy.ndimage import gaussian_filter


@dataclass(frozen=True)
class AugmentParams:
    """Probabilities and ranges; grey values are in standard deviations of the whole image."""

    # Only enlarged: shrinking would break masks that are one pixel wide.
    zoom_probability: float = 0.2
    largest_zoom: float = 1.4
    polarity_probability: float = 0.15
    gamma_probability: float = 0.25
    gamma: tuple[float, float] = (0.7, 1.5)
    contrast_probability: float = 0.25
    contrast: tuple[float, float] = (0.7, 1.4)
    blur_probability: float = 0.15
    blur_sigma_px: tuple[float, float] = (0.4, 1.0)
    noise_probability: float = 0.25
    largest_noise: float = 0.25
    # The statistics of a real image are not those of a generated one.
    shift_sigma: float = 0.1
    log_scale_sigma: float = 0.1


def turn(planes: list[np.ndarray], rng: np.random.Generator) -> list[np.ndarray]:
    """One of the eight turns and reflections of the square, the same for every plane."""
    quarters, mirrored = int(rng.integers(4)), bool(rng.integers(2))
    turned = [np.rot90(plane, quarters) for plane in planes]
    return [plane[:, ::-1] if mirrored else plane for plane in turned]


def enlarge(plane: np.ndarray, side: int, *, label: bool) -> np.ndarray:
    """`plane` resampled to `side` x `side`, no fewer than it has: bilinearly, a label by nearest pixels.

    Every pixel of a label is there again beside its neighbours, so that its pieces stay what they were;
    a bilinear label cut at one half would fall to dashes where it is a slanted line of one pixel.
    """
    tensor = torch.from_numpy(np.ascontiguousarray(plane, dtype=np.float32))[None, None]
    if label:
        return F.interpolate(tensor, size=(side, side), mode="nearest-exact")[0, 0].numpy().astype(np.uint8)
    return F.interpolate(tensor, size=(side, side), mode="bilinear", align_corners=False)[0, 0].numpy()


def bend_greys(greys: np.ndarray, rng: np.random.Generator, params: AugmentParams) -> np.ndarray:
    """Gamma, contrast, blur, noise, polarity and a shifted normalisation of z-scored grey values."""
    bent = greys.astype(np.float32)
    if rng.random() < params.gamma_probability:
        low, high = float(bent.min()), float(bent.max())
        if high > low:
            unit = (bent - low) / (high - low)
            bent = unit ** rng.uniform(*params.gamma) * (high - low) + low
    if rng.random() < params.contrast_probability:
        middle = bent.mean()
        bent = (bent - middle) * rng.uniform(*params.contrast) + middle
    if rng.random() < params.blur_probability:
        bent = gaussian_filter(bent, rng.uniform(*params.blur_sigma_px), mode="nearest")
    if rng.random() < params.noise_probability:
        bent = bent + rng.standard_normal(bent.shape, dtype=np.float32) * rng.uniform(0, params.largest_noise)
    if rng.random() < params.polarity_probability:
        bent = -bent
    scale = np.exp(rng.normal(0, params.log_scale_sigma))
    return (bent * scale + rng.normal(0, params.shift_sigma)).astype(np.float32)
