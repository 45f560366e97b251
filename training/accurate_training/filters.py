"""Classical ridge filters for comparison: Frangi and Sato of scikit-image."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from skimage.filters import frangi, sato

from .metrics import EIGHT_NEIGHBOURS, dice
from .normalise import z_score

#: Half widths of wires of 2 to 7 px.
SIGMAS_PX = (1.0, 2.0, 3.0)
#: Candidates for the threshold, as quantiles of an image's response.
QUANTILES = (0.9, 0.94, 0.96, 0.97, 0.98, 0.985, 0.99, 0.995)
#: Candidates for the smallest component that is kept.
SMALLEST_PX = (1, 50, 150, 300)
FILTERS: dict[str, Callable[..., np.ndarray]] = {"Frangi": frangi, "Sato": sato}


@dataclass(frozen=True)
class RidgeFilter:
    """A filter with the settings that suited the tuning images best."""

    name: str
    either_polarity: bool
    quantile: float
    smallest_px: int

    def mask(self, image: np.ndarray) -> np.ndarray:
        """The wire's mask in an image, bool (H, W)."""
        response = ridge_response(self.name, image, either_polarity=self.either_polarity)
        return threshold(response, self.quantile, self.smallest_px)


def ridge_response(name: str, image: np.ndarray, *, either_polarity: bool) -> np.ndarray:
    """Response to dark ridges, or to the stronger of dark and bright ones."""
    greys = z_score(image).astype(np.float64)
    response = FILTERS[name](greys, sigmas=SIGMAS_PX, black_ridges=True)
    if either_polarity:
        response = np.maximum(response, FILTERS[name](greys, sigmas=SIGMAS_PX, black_ridges=False))
    return response


def threshold(response: np.ndarray, quantile: float, smallest_px: int) -> np.ndarray:
    """Pixels above a quantile of the response, without components smaller than `smallest_px`."""
    mask = response > np.quantile(response, quantile)
    components, _ = label(mask, EIGHT_NEIGHBOURS)
    sizes = np.bincount(components.ravel())
    sizes[0] = 0
    return (sizes >= smallest_px)[components]


def tune_filter(name: str, images: list[np.ndarray], masks: list[np.ndarray]) -> RidgeFilter:
    """The settings of the grid with the best mean Dice on the tuning images."""
    best, best_score = None, -1.0
    for either in (False, True):
        responses = [ridge_response(name, image, either_polarity=either) for image in images]
        for quantile in QUANTILES:
            for smallest in SMALLEST_PX:
                score = np.mean([
                    dice(threshold(response, quantile, smallest), mask.astype(bool))
                    for response, mask in zip(responses, masks, strict=True)
                ])
                if score > best_score:
                    best, best_score = RidgeFilter(name, either, quantile, smallest), score
    if best is None:
        raise ValueError("no tuning image")
    return best
