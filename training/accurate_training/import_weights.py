"""Weights back from a shipped ONNX file: later training starts where the shipped network stopped."""

from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import nn

from .export import STEPS_KEY

HALF_SUFFIX = ".half"


class WeightError(ValueError):
    """An ONNX file whose weights are not those of this network."""


def load_onnx_weights(network: nn.Module, path: Path) -> int:
    """Copies the initialisers of an exported network into `network`, whose names and shapes must agree.

    Float16 weights are widened: half the digits are lost, the optimiser's state is not there at all.
    Returns the number of steps that the weights have been trained for.
    """
    model = onnx.load(path)
    stored = {
        initializer.name.removesuffix(HALF_SUFFIX): numpy_helper.to_array(initializer)
        for initializer in model.graph.initializer
    }
    parameters = dict(network.named_parameters())
    missing = sorted(set(parameters) - set(stored))
    if missing:
        raise WeightError(f"{path}: no weight for {missing[0]} and {len(missing) - 1} more")
    for name, parameter in parameters.items():
        if stored[name].shape != tuple(parameter.shape):
            raise WeightError(f"{path}: {name} has shape {stored[name].shape}, expected {tuple(parameter.shape)}")
        with torch.no_grad():
            parameter.copy_(torch.from_numpy(stored[name].copy()))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    return int(metadata.get(STEPS_KEY, "0"))
