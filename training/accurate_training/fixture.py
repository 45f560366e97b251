"""A tiny network with its input and output, by which the Rust engines are checked.

    tsn-tiny.onnx         float16 weights, one channel wide, never trained
    tsn-tiny-image.npy    uint8 (128, 256)
    tsn-tiny-margin.npy   float16 (128, 256): wire's logit minus background's, by PyTorch in float32
"""

from pathlib import Path

import numpy as np
import torch

from .atomic import write_atomically
from .export import export_onnx
from .network import WIRE, build_network
from .normalise import z_score

SEED = 11
SIDES = (128, 256)


def write_fixture(folder: Path) -> None:
    """Writes the three files; the same bytes of the arrays every time on one machine."""
    network = build_network(1, SEED)
    with torch.no_grad():
        # What the file can hold, so that the arrays are the file's own answer.
        for parameter in network.parameters():
            parameter.copy_(parameter.half().float())
    image = fixture_image()
    margin = fixture_margin(network, image).astype(np.float16)
    export_onnx(network, folder / "tsn-tiny.onnx", half_weights=True, metadata={})
    for name, array in (("image", image), ("margin", margin)):
        write_atomically(folder / f"tsn-tiny-{name}.npy", lambda path, array=array: np.save(path, array))


def fixture_image() -> np.ndarray:
    """Noise on a ramp with a dark bar."""
    rng = np.random.default_rng(SEED)
    grey = rng.normal(120, 20, SIDES) + np.linspace(0, 60, SIDES[1])
    grey[60:64, 30:220] -= 70
    return grey.clip(0, 255).astype(np.uint8)


def fixture_margin(network: torch.nn.Module, image: np.ndarray) -> np.ndarray:
    """Wire's logit minus background's."""
    network.eval()
    with torch.no_grad():
        logits = network(torch.from_numpy(z_score(image))[None, None])[0].numpy()
    return logits[WIRE] - logits[1 - WIRE]
