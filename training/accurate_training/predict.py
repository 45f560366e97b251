"""Probability maps of whole images."""

import numpy as np
import torch
from torch import nn

from .network import SIDE_MULTIPLE, WIRE
from .normalise import z_score

#: A pixel is wire when that is the likelier class.
THRESHOLD = 0.5


def pad_to_multiple(greys: np.ndarray) -> np.ndarray:
    """Zeros (the mean grey) below and to the right, up to multiples of 128."""
    height, width = greys.shape
    return np.pad(greys, ((0, -height % SIDE_MULTIPLE), (0, -width % SIDE_MULTIPLE)))


@torch.no_grad()
def wire_probability(network: nn.Module, image: np.ndarray, *, bfloat16: bool) -> np.ndarray:
    """Probability of the wire per pixel of an image (H, W) of any grey range; float32 (H, W)."""
    padded = torch.from_numpy(pad_to_multiple(z_score(image)))[None, None]
    with torch.autocast("cpu", torch.bfloat16, enabled=bfloat16):
        logits = network(padded)
    probability = torch.softmax(logits.float(), dim=1)[0, WIRE].numpy()
    return probability[: image.shape[0], : image.shape[1]]
