"""The grey values that the network sees: z-scored over the whole image."""

import numpy as np

#: A flat image is not divided by zero.
STD_FLOOR = 1e-6


def grey_statistics(image: np.ndarray) -> tuple[float, float]:
    """Mean and (population) standard deviation of a whole image, the latter at least `STD_FLOOR`."""
    return float(image.mean(dtype=np.float64)), max(float(image.std(dtype=np.float64)), STD_FLOOR)


def z_score(image: np.ndarray) -> np.ndarray:
    """(image - mean) / std as float32, over the whole image."""
    mean, std = grey_statistics(image)
    return ((image.astype(np.float32) - np.float32(mean)) / np.float32(std)).astype(np.float32)
