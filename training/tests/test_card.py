"""The card of a network: every run that led to it."""

import json

from accurate_training.__main__ import main
from accurate_training.configuration import TrainConfig
from accurate_training.trainer import CHECKPOINT, Trainer
from blake3 import blake3

from tests.test_resume import CONFIG


def test_a_card_tells_every_run_and_what_was_averaged(shards, tmp_path):
    (shards / "shards.json").write_text(json.dumps({"generator": "drawn", "seed": 9, "shards": [{"file": "x"}]}))
    exported, cards = [], []
    for number, before in enumerate([None, tmp_path / "0.onnx"]):
        run, out, card = tmp_path / f"run{number}", tmp_path / f"{number}.onnx", tmp_path / f"{number}.json"
        Trainer(CONFIG, shards=[shards], run=run, init_from=before).train(until=2 + number)
        assert main(["export", str(run / CHECKPOINT), str(out)]) == 0
        exported.append(out)
        cards.append(card)
    mean = tmp_path / "mean.onnx"
    assert main(["average", *map(str, exported), str(mean), "--share", "0.75"]) == 0

    def card(model, output, run, *more):
        return main(["card", str(model), str(output), "--run", str(run), "--shards", str(shards), *more])

    assert card(exported[0], cards[0], tmp_path / "run0") == 0
    assert card(mean, cards[1], tmp_path / "run1", "--went-on-from", str(cards[0])) == 0
    told = json.loads(cards[1].read_text())
    assert told["blake3"] == blake3(mean.read_bytes()).hexdigest() and told["bytes"] == mean.stat().st_size
    assert [(run["name"], run["steps"], run["images"]) for run in told["runs"]] == [("run0", 2, 4), ("run1", 3, 4)]
    assert all(run["generators"] == [{"generator": "drawn", "seed": 9}] for run in told["runs"])
    assert all(TrainConfig.from_dict(run["settings"]) == CONFIG for run in told["runs"])
    files = [blake3(path.read_bytes()).hexdigest() for path in exported]
    assert "average" not in told["runs"][0] and told["runs"][1]["average"] == {"of": files, "weights": [0.25, 0.75]}
    # Without the card of the first network the runs do not make the steps that the file names.
    assert card(mean, tmp_path / "none.json", tmp_path / "run1") == 2
    assert not (tmp_path / "none.json").exists()
