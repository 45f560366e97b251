"""The file that leaves Python: an ONNX network that any engine can run.

Contract with the Rust side (docs/training.md): opset 17; input `image`, float32 (N, 1, H, W), z-scored
over the whole image; output `logits`, float32 (N, 2, H, W); softmax channel 1 is the wire; H and W are
multiples of 128; N, H and W are free.
"""

import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from .atomic import write_atomically
from .network import SIDE_MULTIPLE

OPSET = 17
INPUT = "image"
OUTPUT = "logits"
#: Metadata entry: steps that the weights have been trained for.
STEPS_KEY = "accurate.steps"


class ExportError(RuntimeError):
    """A network that cannot be exported under the contract."""


def export_onnx(network: nn.Module, path: Path, *, half_weights: bool, metadata: dict[str, str]) -> None:
    """Writes `network` to `path`; with `half_weights` its weights are stored as float16.

    The compute stays float32: every float16 initialiser is followed by a Cast, so an engine needs no
    float16 kernel.
    """
    was_training = network.training
    network.eval()

    def write(temporary: Path) -> None:
        model = to_onnx(network, temporary)
        if half_weights:
            store_weights_as_half(model)
        helper.set_model_props(model, metadata)
        onnx.checker.check_model(model, full_check=True)
        onnx.save(model, temporary)

    try:
        write_atomically(path, write)
    finally:
        network.train(was_training)


def to_onnx(network: nn.Module, scratch: Path) -> onnx.ModelProto:
    """The network as an ONNX model with free batch and sides; `scratch` is overwritten."""
    free = {0: "N", 2: "H", 3: "W"}
    with warnings.catch_warnings():
        # The exporter warns that it is the older one, and that instance norm uses the statistics of its
        # input: both are what we want.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network,
            (torch.zeros(1, 1, SIDE_MULTIPLE * 2, SIDE_MULTIPLE * 2),),
            str(scratch),
            input_names=[INPUT],
            output_names=[OUTPUT],
            opset_version=OPSET,
            dynamo=False,
            dynamic_axes={INPUT: free, OUTPUT: free},
        )
    model = onnx.load(scratch)
    drop_identities(model)
    return model


def drop_identities(model: onnx.ModelProto) -> None:
    """Removes Identity nodes, the exporter's way of storing equal initialisers once.

    Each becomes an initialiser of its own, so that every parameter is found under its name.
    """
    graph = model.graph
    stored = {initializer.name: initializer for initializer in graph.initializer}
    kept = []
    for node in graph.node:
        if node.op_type != "Identity":
            kept.append(node)
            continue
        (source,), (name,) = node.input, node.output
        if source not in stored:
            raise ExportError(f"Identity {node.name} of {source}, which is no weight")
        copy = graph.initializer.add()
        copy.CopyFrom(stored[source])
        copy.name = name
    del graph.node[:]
    graph.node.extend(kept)


def store_weights_as_half(model: onnx.ModelProto) -> None:
    """Turns each float32 initialiser into a float16 one with a Cast to float32 behind it."""
    graph = model.graph
    casts = []
    for initializer in graph.initializer:
        if initializer.data_type != TensorProto.FLOAT:
            continue
        values = numpy_helper.to_array(initializer)
        with np.errstate(over="ignore"):
            half = values.astype(np.float16)
        if not np.isfinite(half).all():
            worst = float(np.abs(values).max())
            raise ExportError(f"weight {initializer.name}: |{worst}| does not fit float16 (at most 65504)")
        name = initializer.name
        stored = f"{name}.half"
        initializer.CopyFrom(numpy_helper.from_array(half, stored))
        casts.append(helper.make_node("Cast", [stored], [name], name=f"{name}.cast", to=TensorProto.FLOAT))
    nodes = casts + list(graph.node)
    del graph.node[:]
    graph.node.extend(nodes)
