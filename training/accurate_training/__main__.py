"""`python -m accurate_training train|export|average|evaluate|ablate|plot|card|fixture`."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from .checkpoint import CheckpointError
from .configuration import TrainConfig
from .export import ExportError
from .shards import ShardError
from .trainer import TrainingError


def main(arguments: list[str] | None = None) -> int:
    """Runs one command; 0, or 2 with a message on stderr for what the caller can mend."""
    options = _parser().parse_args(arguments)
    try:
        options.run_command(options)
    except (ShardError, CheckpointError, ExportError, FileNotFoundError, TrainingError, ValueError) as error:
        print(f"accurate_training: {error}", file=sys.stderr)
        return 2
    return 0


def _train(options: argparse.Namespace) -> None:
    import torch

    from .trainer import Trainer

    torch.set_num_threads(options.threads)
    config = replace(TrainConfig(), **{
        name: getattr(options, name)
        for name in ("width", "steps", "seed", "learning_rate", "final_share", "final_batch", "ema_decay")
        if getattr(options, name) is not None
    })
    if options.float32:
        config = replace(config, bfloat16=False)
    if options.dice is not None:
        config = replace(config, loss=replace(config.loss, dice=options.dice))
    trainer = Trainer(
        config,
        shards=options.shards,
        validation=options.validation,
        run=options.run,
        init_from=options.init_from,
    )
    reached = trainer.train(until=options.until)
    print(f"{options.run}: step {reached} of {config.steps}", file=sys.stderr)


def _export(options: argparse.Namespace) -> None:
    from .checkpoint import Checkpoint
    from .export import STEPS_KEY, export_onnx
    from .network import build_network

    checkpoint = Checkpoint.load(options.checkpoint)
    network = build_network(checkpoint.config.width, checkpoint.config.seed)
    network.load_state_dict(checkpoint.ema)
    metadata = {
        "accurate.width": str(checkpoint.config.width),
        STEPS_KEY: str(checkpoint.step + checkpoint.inherited_steps),
        "accurate.normalisation": "z-score over the whole image, population standard deviation, floor 1e-6",
        "accurate.wire_channel": "1",
        "accurate.side_multiple": "128",
    }
    export_onnx(network, options.output, half_weights=not options.full_weights, metadata=metadata)


def _evaluate(options: argparse.Namespace) -> None:
    from .ablate import checkpoint_segmenter
    from .evaluate import held_out, markdown_table, onnx_segmenter, score_method, write_results
    from .filters import FILTERS, tune_filter

    images, masks = held_out(options.shards, options.count)
    results = {}
    for named in options.model:
        name, _, path = named.rpartition("=")
        segment = checkpoint_segmenter(Path(path)) if path.endswith(".pt") else onnx_segmenter(Path(path))
        results[name or Path(path).stem] = score_method(segment, images, masks)
    if options.tuning is not None:
        tuning = held_out(options.tuning, options.tuning_count)
        for name in FILTERS:
            chosen = tune_filter(name, *tuning)
            print(f"{chosen}", file=sys.stderr)
            results[name] = score_method(chosen.mask, images, masks)
    print(markdown_table(results, options.columns.split(",")))
    if options.output is not None:
        write_results(options.output, results, {"shards": options.shards.name, "images": len(images)})


def _average(options: argparse.Namespace) -> None:
    from .average import average_weights

    average_weights(options.before, options.after, options.share, options.output)


def _ablate(options: argparse.Namespace) -> None:
    import torch

    from .ablate import ARMS, run_ablation
    from .evaluate import markdown_table, write_results

    torch.set_num_threads(options.threads)
    results = run_ablation(
        list(ARMS), shards=options.shards, test=options.test, folder=options.run, count=options.count,
        width=options.width, steps=options.steps, crop_px=options.crop,
    )
    print(markdown_table(results, ["recall 2 px", "precision 2 px", "clDice", "Dice", "Betti-0 error"]))
    write_results(options.run / "ablation.json", results, {"test": options.test.name, "steps": options.steps})


def _plot(options: argparse.Namespace) -> None:
    from .plot import plot_runs

    plot_runs(options.run, options.output)


def _card(options: argparse.Namespace) -> None:
    from .card import write_card

    write_card(
        options.output, options.model, run=options.run, shards=options.shards,
        went_on_from=options.went_on_from, scores=options.scores,
    )


def _fixture(options: argparse.Namespace) -> None:
    from .fixture import write_fixture

    write_fixture(options.folder)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="accurate_training", description=__doc__)
    commands = parser.add_subparsers(required=True)

    train = commands.add_parser("train", help="train, or resume the run of a folder")
    train.add_argument("--shards", type=Path, nargs="+", required=True, help="folders of training shards")
    train.add_argument("--validation", type=Path, help="folder of validation shards")
    train.add_argument("--run", type=Path, required=True, help="folder of the run; resumed if it has a checkpoint")
    train.add_argument("--init-from", type=Path, help="checkpoint or ONNX file whose weights start a new run")
    train.add_argument("--width", type=int)
    train.add_argument("--steps", type=int, help="length of the schedule; may differ on resuming")
    train.add_argument("--seed", type=int)
    train.add_argument("--learning-rate", type=float)
    train.add_argument("--final-share", type=float, help="share of the steps at whole images")
    train.add_argument("--final-batch", type=int)
    train.add_argument(
        "--ema-decay", type=float, help="decay a step of the moving average of the weights that is exported (0: the last ones)"
    )
    train.add_argument("--dice", type=float, help="weight of a soft Dice term beside the paper's loss (0)")
    train.add_argument(
        "--float32", action="store_true",
        help="no bfloat16: faster by far on a processor without instructions for it",
    )
    train.add_argument("--until", type=int, help="stop at this step, with a checkpoint")
    train.add_argument("--threads", type=int, default=1)
    train.set_defaults(run_command=_train)

    export = commands.add_parser("export", help="write a checkpoint's network as ONNX")
    export.add_argument("checkpoint", type=Path)
    export.add_argument("output", type=Path)
    export.add_argument("--full-weights", action="store_true", help="store float32 weights, not float16")
    export.set_defaults(run_command=_export)

    evaluate = commands.add_parser("evaluate", help="score networks and ridge filters on held-out shards")
    evaluate.add_argument("--shards", type=Path, required=True)
    evaluate.add_argument("--count", type=int, default=100, help="images with a wire to score")
    evaluate.add_argument("--model", action="append", default=[], metavar="[NAME=]PATH", help=".onnx or .pt; repeat")
    evaluate.add_argument("--tuning", type=Path, help="shards on which Frangi and Sato choose their thresholds")
    evaluate.add_argument("--tuning-count", type=int, default=24)
    evaluate.add_argument("--columns", default="recall 2 px,precision 2 px,clDice,Dice,Betti-0 error,centreline px")
    evaluate.add_argument("--output", type=Path, help="JSON with every image's scores")
    evaluate.set_defaults(run_command=_evaluate)

    average = commands.add_parser("average", help="write the network between two of one course of training")
    average.add_argument("before", type=Path)
    average.add_argument("after", type=Path)
    average.add_argument("output", type=Path)
    average.add_argument("--share", type=float, default=0.75, help="of the later network")
    average.set_defaults(run_command=_average)

    ablate = commands.add_parser("ablate", help="train short runs with different losses and score them")
    ablate.add_argument("--shards", type=Path, required=True)
    ablate.add_argument("--test", type=Path, required=True)
    ablate.add_argument("--run", type=Path, required=True, help="folder for the arms' runs")
    ablate.add_argument("--count", type=int, default=64)
    ablate.add_argument("--width", type=int, default=8)
    ablate.add_argument("--steps", type=int, default=500)
    ablate.add_argument("--crop", type=int, default=256)
    ablate.add_argument("--threads", type=int, default=1)
    ablate.set_defaults(run_command=_ablate)

    plot = commands.add_parser("plot", help="draw the curves of one run or of runs that follow one another")
    plot.add_argument("run", type=Path, nargs="+")
    plot.add_argument("--output", type=Path, required=True)
    plot.set_defaults(run_command=_plot)

    card = commands.add_parser("card", help="write the card of an exported network")
    card.add_argument("model", type=Path)
    card.add_argument("output", type=Path)
    card.add_argument("--run", type=Path, required=True, help="its last run")
    card.add_argument("--shards", type=Path, nargs="+", required=True, help="folders of that run's shards")
    card.add_argument("--went-on-from", type=Path, help="card of the network that the run started from")
    card.add_argument("--scores", type=Path, help="JSON of `evaluate`")
    card.set_defaults(run_command=_card)

    fixture = commands.add_parser("fixture", help="write the tiny network for the Rust engines")
    fixture.add_argument("folder", type=Path)
    fixture.set_defaults(run_command=_fixture)
    return parser


if __name__ == "__main__":
    sys.exit(main())
