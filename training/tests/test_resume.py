"""A run that was cut is the run that was not."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from accurate_training.__main__ import main
from accurate_training.checkpoint import Checkpoint, CheckpointError
from accurate_training.configuration import TrainConfig
from accurate_training.curves import read_curve
from accurate_training.shards import ShardError
from accurate_training.trainer import CHECKPOINT, STEP_CURVE, VALIDATION_CURVE, Trainer

from tests.conftest import write_shard

CONFIG = TrainConfig(
    width=2, steps=6, crop_px=256, batch=2, final_share=0.34, final_crop_px=256, final_batch=1,
    warm_up=2, refresh_steps=2, validate_steps=3, validation_images=1,
)


def flat(value, prefix=""):
    """Every leaf of a nested state as (path, value)."""
    if isinstance(value, dict):
        for key in value:
            yield from flat(value[key], f"{prefix}/{key}")
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            yield from flat(item, f"{prefix}/{index}")
    else:
        yield prefix, value


def same(a: Checkpoint, b: Checkpoint) -> bool:
    """Bit for bit."""
    left, right = dict(flat(vars(a))), dict(flat(vars(b)))
    return left.keys() == right.keys() and all(
        torch.equal(value, right[path]) if isinstance(value, torch.Tensor) else value == right[path]
        for path, value in left.items()
    )


def losses(run: Path) -> list[dict]:
    return [{k: v for k, v in row.items() if k != "seconds"} for row in read_curve(run / STEP_CURVE)]


@pytest.mark.parametrize(("bfloat16", "ema_decay"), [(True, 0.0), (False, 0.9)])
def test_three_steps_and_three_more_are_six_steps(shards, tmp_path, bfloat16, ema_decay):
    config = replace(CONFIG, bfloat16=bfloat16, ema_decay=ema_decay)
    Trainer(config, shards=[shards], validation=shards, run=tmp_path / "whole").train()
    assert Trainer(config, shards=[shards], validation=shards, run=tmp_path / "cut").train(until=3) == 3
    assert Trainer(config, shards=[shards], validation=shards, run=tmp_path / "cut").train() == 6
    whole, cut = (Checkpoint.load(tmp_path / name / CHECKPOINT) for name in ("whole", "cut"))
    assert whole.step == 6 and same(whole, cut)
    assert losses(tmp_path / "whole") == losses(tmp_path / "cut")
    validations = [(tmp_path / name / VALIDATION_CURVE).read_bytes() for name in ("whole", "cut")]
    assert validations[0] == validations[1]


def test_the_average_is_that_of_the_weights_after_every_step(shards, tmp_path):
    config = replace(CONFIG, ema_decay=0.3)
    trainer = Trainer(config, shards=[shards], run=tmp_path / "run")
    expected = {name: value.clone() for name, value in trainer.network.state_dict().items()}
    # A rise of 1/10, 2/11, 3/12, 4/13, then the decay itself.
    for step, decay in enumerate([1 / 10, 2 / 11, 3 / 12, 0.3, 0.3, 0.3], 1):
        trainer.train(until=step)
        for name, value in trainer.network.state_dict().items():
            expected[name] = decay * expected[name] + (1 - decay) * value
    average = Checkpoint.load(tmp_path / "run" / CHECKPOINT).ema
    assert all(torch.allclose(average[name], value, rtol=1e-5, atol=1e-7) for name, value in expected.items())
    last = trainer.network.state_dict()
    assert any(not torch.allclose(average[name], last[name], rtol=1e-5, atol=1e-7) for name in last)


def test_without_decay_the_average_is_the_network(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=2)
    checkpoint = Checkpoint.load(tmp_path / "run" / CHECKPOINT)
    assert all(torch.equal(checkpoint.ema[name], value) for name, value in checkpoint.network.items())


def test_a_checkpoint_of_before_there_was_an_average_is_read(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=1)
    path = tmp_path / "run" / CHECKPOINT
    state = torch.load(path, weights_only=True)
    del state["ema"], state["config"]["ema_decay"]
    torch.save({**state, "format": 1}, path)
    checkpoint = Checkpoint.load(path)
    assert all(torch.equal(checkpoint.ema[name], value) for name, value in checkpoint.network.items())
    assert Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=2) == 2


def test_another_seed_is_another_run(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "a").train(until=1)
    Trainer(replace(CONFIG, seed=2), shards=[shards], run=tmp_path / "b").train(until=1)
    a, b = (Checkpoint.load(tmp_path / name / CHECKPOINT).network for name in "ab")
    assert a.keys() == b.keys()
    assert any(not torch.equal(a[name], b[name]) for name in a)


def test_steps_after_the_checkpoint_are_repeated_not_doubled(shards, tmp_path):
    trainer = Trainer(CONFIG, shards=[shards], run=tmp_path / "run")
    trainer.train(until=2)
    early = (tmp_path / "run" / CHECKPOINT).read_bytes()
    trainer.train(until=4)
    whole = losses(tmp_path / "run")
    # A crash between two checkpoints: the curve is ahead of the state.
    (tmp_path / "run" / CHECKPOINT).write_bytes(early)
    Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=4)
    assert losses(tmp_path / "run") == whole


def test_new_shards_are_drawn_from_and_resuming_remembers_when(tmp_path):
    folder = tmp_path / "shards"
    write_shard(folder, 0, count=2, side=272)
    trainer = Trainer(CONFIG, shards=[folder], run=tmp_path / "run")
    trainer.train(until=2)
    write_shard(folder, 1, count=3, side=272)
    trainer.train(until=5)
    assert [row["images"] for row in losses(tmp_path / "run")] == [2, 2, 5, 5, 5]
    write_shard(folder, 2, count=1, side=272)
    Trainer(CONFIG, shards=[folder], run=tmp_path / "run").train()
    # Step 5 shares a block of two steps with step 4, which was drawn from five images.
    assert losses(tmp_path / "run")[5]["images"] == 5


def test_a_run_whose_shards_are_gone_is_refused(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=1)
    (shards / "shard-000000.npy").rename(shards / "shard-000009.npy")
    with pytest.raises(ShardError, match="no longer the first"):
        Trainer(CONFIG, shards=[shards], run=tmp_path / "run")


def test_a_run_with_other_settings_is_refused(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=1)
    with pytest.raises(CheckpointError, match="learning_rate: 0.002 there, 0.5 here"):
        Trainer(replace(CONFIG, learning_rate=0.5), shards=[shards], run=tmp_path / "run")


def test_a_torn_checkpoint_is_refused(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "run").train(until=1)
    path = tmp_path / "run" / CHECKPOINT
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match="not a checkpoint"):
        Trainer(CONFIG, shards=[shards], run=tmp_path / "run")


def test_initial_weights_come_from_another_run(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "first").train(until=2)
    first = Checkpoint.load(tmp_path / "first" / CHECKPOINT)
    second = Trainer(CONFIG, shards=[shards], run=tmp_path / "second", init_from=tmp_path / "first" / CHECKPOINT)
    assert second.step == 0 and second.inherited_steps == 2
    assert all(torch.equal(second.network.state_dict()[name], value) for name, value in first.ema.items())
    with pytest.raises(CheckpointError, match="width 2 do not fit width 3"):
        Trainer(
            replace(CONFIG, width=3), shards=[shards], run=tmp_path / "third", init_from=tmp_path / "first" / CHECKPOINT
        )


def test_float32_is_a_setting_of_the_run(shards: Path, tmp_path: Path):
    run = tmp_path / "run"

    def train(*more: str) -> int:
        return main(["train", "--shards", str(shards), "--run", str(run), "--width", "2", "--final-share", "0", *more])

    assert train("--steps", "1", "--float32") == 0
    assert not Checkpoint.load(run / CHECKPOINT).config.bfloat16
    # Going on in another precision is no resumption.
    assert train("--steps", "2") == 2
    assert train("--steps", "2", "--float32") == 0
    assert Checkpoint.load(run / CHECKPOINT).step == 2
