"""The card of a shipped network: where it comes from, what it reaches, its hash."""

import json
from pathlib import Path

from blake3 import blake3

from .atomic import write_atomically
from .checkpoint import Checkpoint
from .configuration import TEST_SEED, TRAINING_SEED, VALIDATION_SEED
from .network import build_network, parameter_count, stage_features
from .trainer import CHECKPOINT

#: What the generator says about a folder of shards, if it wrote it down.
SHARDS_MANIFEST = "shards.json"
LICENCE = "MIT OR Apache-2.0"


def write_card(output: Path, model: Path, *, runs: list[Path], shards: Path, scores: Path | None) -> None:
    """Writes the card of `model` as JSON, from the checkpoints of its runs and the scores of `evaluate`."""
    checkpoints = [Checkpoint.load(run / CHECKPOINT) for run in runs]
    if not checkpoints:
        raise ValueError("a card needs the run that made the network")
    width = checkpoints[-1].config.width
    manifest = shards / SHARDS_MANIFEST
    generator = json.loads(manifest.read_text()) if manifest.exists() else {}
    generator.pop("shards", None)
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
        "generator": generator,
        "runs": [
            {"name": run.name, "steps": checkpoint.step, "images": max(checkpoint.pool_at.values(), default=0),
             "settings": checkpoint.config.to_dict()}
            for run, checkpoint in zip(runs, checkpoints, strict=True)
        ],
        "scores": _summaries(scores) if scores is not None else None,
    }
    write_atomically(output, lambda temporary: temporary.write_text(json.dumps(card, indent=1) + "\n"))


def _summaries(scores: Path) -> dict:
    document = json.loads(scores.read_text())
    methods = {
        name: {"failures": method["failures"], **method["summary"]} for name, method in document["methods"].items()
    }
    return {"origin": document["origin"], "methods": methods}
