"""Between two networks of one course of training: what the later one learnt, with less forgotten."""

from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from .atomic import write_atomically
from .import_weights import WeightError


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
    write_atomically(output, lambda temporary: onnx.save(second, temporary))
