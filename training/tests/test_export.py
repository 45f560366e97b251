"""The exported file: the same numbers in another engine, and the contract with the Rust side."""

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from accurate_training.__main__ import main
from accurate_training.checkpoint import Checkpoint
from accurate_training.export import OPSET, ExportError, export_onnx
from accurate_training.import_weights import WeightError, load_onnx_weights
from accurate_training.network import build_network, parameter_count, stage_features
from accurate_training.trainer import CHECKPOINT, Trainer
from onnx import TensorProto

from tests.test_resume import CONFIG


def run(path, image):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(["logits"], {"image": image})[0]


def logits_of(network, image):
    network.eval()
    with torch.no_grad():
        return network(torch.from_numpy(image)).numpy()


@pytest.fixture
def image():
    return np.random.default_rng(4).standard_normal((2, 1, 256, 384)).astype(np.float32)


def test_sixteen_wide_has_the_published_number_of_parameters():
    assert stage_features(32) == (32, 64, 128, 256, 256, 256, 256, 256)
    # 3.7 M, and at two bytes each under the 8 MB that may be shipped.
    assert parameter_count(build_network(16, 0)) == 3_701_090


def test_initial_weights_depend_on_the_seed_alone():
    torch.manual_seed(99)
    before = torch.get_rng_state()
    first, second, other = (build_network(2, seed).state_dict() for seed in (3, 3, 4))
    assert torch.equal(before, torch.get_rng_state())
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert any(not torch.equal(first[name], other[name]) for name in first)


def test_onnx_runtime_repeats_torch(tmp_path, image):
    network = build_network(4, 1)
    export_onnx(network, tmp_path / "net.onnx", half_weights=False, metadata={})
    expected = logits_of(network, image)
    # Some 40 convolutions in float32, summed in another order: about 40 * sqrt(1000) ulps of 1.
    assert np.abs(run(tmp_path / "net.onnx", image) - expected).max() < 2e-4 * np.abs(expected).max()


def test_half_weights_are_exactly_the_rounded_network(tmp_path, image):
    network = build_network(4, 1)
    export_onnx(network, tmp_path / "half.onnx", half_weights=True, metadata={})
    rounded = build_network(4, 1)
    with torch.no_grad():
        for parameter in rounded.parameters():
            parameter.copy_(parameter.half().float())
    expected = logits_of(rounded, image)
    assert np.abs(run(tmp_path / "half.onnx", image) - expected).max() < 2e-4 * np.abs(expected).max()


def test_the_contract_of_the_file(tmp_path):
    export_onnx(build_network(2, 1), tmp_path / "net.onnx", half_weights=True, metadata={"accurate.steps": "7"})
    model = onnx.load(tmp_path / "net.onnx")
    assert [(entry.domain, entry.version) for entry in model.opset_import] == [("", OPSET)]
    shape = lambda value: [d.dim_param or d.dim_value for d in value.type.tensor_type.shape.dim]  # noqa: E731
    assert [(i.name, shape(i)) for i in model.graph.input] == [("image", ["N", 1, "H", "W"])]
    assert [(o.name, shape(o)) for o in model.graph.output] == [("logits", ["N", 2, "H", "W"])]
    assert {node.op_type for node in model.graph.node} == {
        "Cast", "Conv", "ConvTranspose", "InstanceNormalization", "LeakyRelu", "Concat",
    }
    assert {initializer.data_type for initializer in model.graph.initializer} == {TensorProto.FLOAT16}
    assert all(not initializer.external_data for initializer in model.graph.initializer)
    assert {entry.key: entry.value for entry in model.metadata_props} == {"accurate.steps": "7"}


def test_a_weight_beyond_float16_is_refused_and_leaves_no_file(tmp_path):
    network = build_network(2, 1)
    with torch.no_grad():
        next(network.parameters()).flatten()[0] = 1e6
    with pytest.raises(ExportError, match="1000000.0"):
        export_onnx(network, tmp_path / "net.onnx", half_weights=True, metadata={})
    assert list(tmp_path.iterdir()) == []


def test_shipped_weights_start_a_new_run(shards, tmp_path):
    Trainer(CONFIG, shards=[shards], run=tmp_path / "first").train(until=2)
    for form, flags in (("full", ["--full-weights"]), ("half", [])):
        out = tmp_path / f"{form}.onnx"
        assert main(["export", str(tmp_path / "first" / CHECKPOINT), str(out), *flags]) == 0
        second = Trainer(CONFIG, shards=[shards], run=tmp_path / form, init_from=out)
        assert second.step == 0 and second.inherited_steps == 2
        weights = dict(second.network.named_parameters())
        first = Checkpoint.load(tmp_path / "first" / CHECKPOINT).network
        for name, value in weights.items():
            kept = first[name] if form == "full" else first[name].half().float()
            assert torch.equal(value, kept), name


def test_weights_of_another_width_are_refused(tmp_path):
    export_onnx(build_network(2, 1), tmp_path / "net.onnx", half_weights=True, metadata={})
    with pytest.raises(WeightError, match="expected"):
        load_onnx_weights(build_network(3, 1), tmp_path / "net.onnx")


def test_a_missing_checkpoint_is_exit_code_two(tmp_path, capsys):
    assert main(["export", str(tmp_path / "none.pt"), str(tmp_path / "out.onnx")]) == 2
    assert "none.pt" in capsys.readouterr().err


def test_an_average_lies_between_two_networks_and_refuses_another_shape(tmp_path):
    paths = []
    for seed in (1, 2):
        path = tmp_path / f"{seed}.onnx"
        export_onnx(build_network(4, seed), path, half_weights=True, metadata={})
        paths.append(path)

    def weights(path):
        return {i.name: onnx.numpy_helper.to_array(i) for i in onnx.load(path).graph.initializer}

    for share, same_as in [("0", paths[0]), ("1", paths[1])]:
        main(["average", *map(str, paths), str(tmp_path / "same.onnx"), "--share", share])
        expected = weights(same_as)
        assert all(np.array_equal(value, expected[name]) for name, value in weights(tmp_path / "same.onnx").items())
    main(["average", *map(str, paths), str(tmp_path / "mean.onnx"), "--share", "0.25"])
    first, second, mean = (weights(path) for path in [*paths, tmp_path / "mean.onnx"])
    for name, value in mean.items():
        if value.dtype == np.float16:
            exact = 0.75 * first[name].astype(np.float64) + 0.25 * second[name]
            assert np.abs(value - exact).max() <= 2.0**-11 * np.abs(exact).max()
    export_onnx(build_network(8, 1), tmp_path / "wider.onnx", half_weights=True, metadata={})
    assert main(["average", str(tmp_path / "wider.onnx"), str(paths[1]), str(tmp_path / "none.onnx")]) != 0
    assert not (tmp_path / "none.onnx").exists()
