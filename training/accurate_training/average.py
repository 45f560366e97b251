"""Between two networks of one course of training: what the later one learnt, with less forgotten."""

import json
from pathlib import Path

import numpy as np
import onnx
from blake3 import blake3
from onnx import helper, numpy_helper

from .atomic import write_atomically
from .import_weights import WeightError

#: Metadata entry: what was averaged, as JSON (`of`: BLAKE3 of both files; `weights`).
AVERAGE_KEY = "accurate.average"


def average_weights(before: Path, after: Path, share: float, output: Path) -> None:
    """Writes the network whose weights are `1 - share` times those of `before` plus `share` times those of `after`.

    Both are exported networks of the same names and shapes; all else is that of `after`. Averages of a
    network and of what it became on other data keep most of what both know (Wortsman et al., CVPR 2022).
    """
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"a share of {share} is not within 0 to 1")
    first, second = onnx.load(before), onnx.load(after)
    stored = {initializer.name: numpy_helper.to_array(initializer) for initializer in first.graph.initializer}
    for initializer in second.graph.initializer:
        new = numpy_helper.to_array(initializer)
        old = stored.get(initializer.name)
        if old is None or old.shape != new.shape or old.dtype != new.dtype:
            raise WeightError(f"{before}: no weight like {initializer.name} of {after}")
        if np.issubdtype(new.dtype, np.floating):
            mean = (1.0 - share) * old.astype(np.float32) + share * new.astype(np.float32)
            initializer.CopyFrom(numpy_helper.from_array(mean.astype(new.dtype), initializer.name))
    files = [blake3(path.read_bytes()).hexdigest() for path in (before, after)]
    metadata = {entry.key: entry.value for entry in second.metadata_props}
    metadata[AVERAGE_KEY] = json.dumps({"of": files, "weights": [1.0 - share, share]})
    helper.set_model_props(second, metadata)
    write_atomically(output, lambda temporary: onnx.save(second, temporary))
