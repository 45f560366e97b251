"""The card of a shipped network: where it comes from, what it reaches, its hash."""

import json
from collections.abc import Sequence
from pathlib import Path

import onnx
from blake3 import blake3

from .atomic import write_atomically
from .average import AVERAGE_KEY
from .checkpoint import Checkpoint
from .configuration import TEST_SEED, TRAINING_SEED, VALIDATION_SEED
from .export import STEPS_KEY
from .network import build_network, parameter_count, stage_features
from .trainer import CHECKPOINT

#: What the generator says about a folder of shards, if it wrote it down.
SHARDS_MANIFEST = "shards.json"
LICENCE = "MIT OR Apache-2.0"


def write_card(
    output: Path,
    model: Path,
    *,
    run: Path,
    shards: Sequence[Path],
    went_on_from: Path | None,
    scores: Path | None,
) -> None:
    """Writes the card of `model` as JSON.

    From the checkpoint of its last `run` and the folders of `shards` that it drew from, the card of the
    network that it `went_on_from` (whose runs come first), and the scores of `evaluate`. An average of
    networks is known by its metadata.
    """
    checkpoint = Checkpoint.load(run / CHECKPOINT)
    width = checkpoint.config.width
    earlier = json.loads(went_on_from.read_text())["runs"] if went_on_from is not None else []
    last = {
        "name": run.name,
        "steps": checkpoint.step,
        "images": max(checkpoint.pool_at.values(), default=0),
        "generators": [_generator(folder) for folder in shards],
        "settings": checkpoint.config.to_dict(),
    }
    metadata = {entry.key: entry.value for entry in onnx.load(model).metadata_props}
    if AVERAGE_KEY in metadata:
        last["average"] = json.loads(metadata[AVERAGE_KEY])
    data = model.read_bytes()
    card = {
        "file": model.name,
        "bytes": len(data),
        "blake3": blake3(data).hexdigest(),
        "licence": LICENCE,
        "network": {
            "architecture": "PlainConvUNet, 8 stages, 2 convolutions per stage, instance norm, leaky ReLU",
            "features": list(stage_features(width)),
            "parameters": parameter_count(build_network(width, 0)),
        },
        "seeds": {"training": TRAINING_SEED, "validation": VALIDATION_SEED, "test": TEST_SEED},
        "runs": [*earlier, last],
        "scores": _summaries(scores) if scores is not None else None,
    }
    steps = sum(each["steps"] for each in card["runs"])
    if metadata.get(STEPS_KEY) != str(steps):
        raise ValueError(f"{model} says {metadata.get(STEPS_KEY)} steps, its runs make {steps}")
    write_atomically(output, lambda temporary: temporary.write_text(json.dumps(card, indent=1) + "\n"))


def _generator(shards: Path) -> dict:
    """What made a folder of shards, if its generator wrote it down."""
    manifest = shards / SHARDS_MANIFEST
    if not manifest.exists():
        return {}
    described = json.loads(manifest.read_text())
    described.pop("shards", None)
    return described


def _summaries(scores: Path) -> dict:
    document = json.loads(scores.read_text())
    methods = {
        name: {"failures": method["failures"], **method["summary"]} for name, method in document["methods"].items()
    }
    return {"origin": document["origin"], "methods": methods}
