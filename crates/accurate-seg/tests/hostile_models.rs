//! Damaged and hostile models: a typed refusal or a model that runs, never a panic.
#![cfg(feature = "rten")]
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate_seg::network::{Engine, Manifest, ModelBundle, ModelError, RtenEngine};
use ndarray::Array2;
use proptest::prelude::*;

const UNET: &[u8] = include_bytes!("fixtures/unet.onnx");
const DARK: &[u8] = include_bytes!("fixtures/dark.onnx");
const MANIFEST: &[u8] = include_bytes!("fixtures/dark.json");

fn manifest() -> Manifest {
    Manifest::from_json(MANIFEST).unwrap()
}

fn with_network(network: Vec<u8>) -> Result<ModelBundle, ModelError> {
    ModelBundle::new(manifest(), network.into())
}

fn file() -> Vec<u8> {
    with_network(UNET.to_vec()).unwrap().to_bytes().unwrap()
}

#[test]
fn a_bundle_is_read_back_as_it_was_written() {
    let bundle = with_network(UNET.to_vec()).unwrap();
    let again = ModelBundle::read(file().into()).unwrap();
    assert_eq!(again.manifest(), bundle.manifest());
    assert_eq!(again.network(), bundle.network());
    assert_eq!((again.hash(), again.facts()), (bundle.hash(), bundle.facts()));
    assert_eq!(again.to_bytes().unwrap(), file());
    // 3 blocks, 2 upsampling and 2 head tensors, counted by hand.
    let block = |i: u64, o: u64| 9 * i * o + 3 * o;
    let expected = block(1, 3) + block(3, 4) + 4 * 3 * 4 + block(6, 3) + 2 * 3 + 2;
    assert_eq!(bundle.facts().parameters, expected);
}

#[test]
fn every_truncation_is_refused() {
    let file = file();
    for length in 0..file.len() {
        let error = ModelBundle::read(file[..length].to_vec().into()).unwrap_err();
        let expected =
            matches!(error, ModelError::NotAModel { .. } | ModelError::WrongLength { .. });
        assert!(expected, "{length} bytes: {error}");
    }
    let mut longer = file.clone();
    longer.push(0);
    assert!(matches!(ModelBundle::read(longer.into()), Err(ModelError::WrongLength { .. })));
}

#[test]
fn every_flipped_bit_is_noticed() {
    let file = file();
    for at in 0..file.len() {
        let mut flipped = file.clone();
        flipped[at] ^= 1 << (at % 8);
        let refused = ModelBundle::read(flipped.into());
        assert!(refused.is_err(), "byte {at}");
    }
}

#[test]
fn every_truncation_of_the_network_is_refused() {
    for length in 0..DARK.len() {
        assert!(with_network(DARK[..length].to_vec()).is_err(), "{length} bytes");
    }
}

/// What passes the check must load and run, or be refused in the engine's words.
fn runs_or_is_refused(network: Vec<u8>) {
    let Ok(bundle) = with_network(network) else { return };
    let Ok(engine) = RtenEngine::new(&bundle, 1) else { return };
    let sides = bundle.facts().fixed_size.unwrap_or([16, 16]).map(|s| s as usize);
    if let Ok(logits) = engine.logits(&Array2::from_elem((sides[0], sides[1]), 0.5)) {
        assert_eq!(logits.dim(), (2, sides[0], sides[1]));
    }
}

#[test]
fn a_network_with_any_byte_changed_runs_or_is_refused() {
    for at in 0..UNET.len() {
        for value in [0x00, 0xff, UNET[at] ^ 0x01, UNET[at] ^ 0x80] {
            let mut changed = UNET.to_vec();
            changed[at] = value;
            runs_or_is_refused(changed);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_network_with_a_stretch_moved_or_repeated_runs_or_is_refused(
        from in 0..UNET.len(), to in 0..UNET.len(), length in 1_usize..400, replace in any::<bool>(),
    ) {
        let stretch: Vec<u8> = UNET[from..(from + length).min(UNET.len())].to_vec();
        let end = if replace { (to + stretch.len()).min(UNET.len()) } else { to };
        let mut changed = UNET[..to].to_vec();
        changed.extend(&stretch);
        changed.extend(&UNET[end..]);
        runs_or_is_refused(changed);
    }

    #[test]
    fn a_manifest_with_any_byte_changed_is_read_or_refused(at in 0..MANIFEST.len(), value in any::<u8>()) {
        let mut changed = MANIFEST.to_vec();
        changed[at] = value;
        if let Ok(manifest) = Manifest::from_json(&changed) {
            prop_assert!(manifest.check().is_ok());
        }
    }
}

/// Replaces the only place where `from` stands in `bytes`; lengths must agree.
fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let at: Vec<usize> =
        (0..=bytes.len() - from.len()).filter(|&k| bytes[k..].starts_with(from)).collect();
    assert!(!at.is_empty(), "{from:?} stands nowhere");
    let mut changed = bytes.to_vec();
    for k in at {
        changed[k..k + to.len()].copy_from_slice(to);
    }
    changed
}

#[test]
fn operations_that_are_not_known_are_refused_by_name() {
    let error = with_network(replaced(UNET, b"LeakyRelu", b"LeakyFoo\x41")).unwrap_err();
    assert!(error.to_string().contains("operation LeakyFoo"), "{error}");
}

#[test]
fn weights_that_are_no_numbers_are_refused_with_their_place() {
    // The bias of dark.onnx: 0 and -4, float32.
    let bias = [0.0_f32.to_le_bytes(), (-4.0_f32).to_le_bytes()].concat();
    for (bad, text) in [(f32::NAN, "NaN"), (f32::NEG_INFINITY, "-inf")] {
        let broken = [0.0_f32.to_le_bytes(), bad.to_le_bytes()].concat();
        match with_network(replaced(DARK, &bias, &broken)) {
            Err(ModelError::NotFinite { index: 1, value, .. }) => assert_eq!(value, text),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn external_data_is_refused() {
    // Field 14 of a tensor (data_location) = 1, appended to the first tensor of a network that is
    // built here from nothing but that.
    let mut tensor = vec![0x08, 1, 0x10, 1, 0x42, 1, b'w', 0x70, 1];
    tensor.extend([0x6a, 0]);
    let mut graph = vec![0x2a, tensor.len() as u8];
    graph.extend(tensor);
    let mut model = vec![0x08, 8, 0x3a, graph.len() as u8];
    model.extend(graph);
    model.extend([0x42, 2, 0x10, 17]);
    let error = with_network(model).unwrap_err();
    assert!(error.to_string().contains("external data"), "{error}");
}

#[test]
fn names_and_shapes_that_are_not_the_descriptions_are_refused() {
    let refusal = |change: fn(&mut Manifest)| {
        let mut manifest = manifest();
        change(&mut manifest);
        ModelBundle::new(manifest, UNET.into()).unwrap_err().to_string()
    };
    assert!(refusal(|m| m.network.input = "picture".into()).contains("`image`"));
    assert!(refusal(|m| m.network.output = "mask".into()).contains("`logits`"));
    assert!(refusal(|m| m.network.classes = 3).contains("3 classes"));
    // Two stages: a side of 3 x 2 px comes out as 4.
    assert!(
        refusal(|m| {
            m.network.multiple_px = 3;
            m.tiling.window_px = [3, 3];
        })
        .contains("joins")
    );
}

#[test]
fn descriptions_that_contradict_themselves_are_refused() {
    let changes: [fn(&mut Manifest); 8] = [
        |m| m.name.clear(),
        |m| m.network.foreground = vec![0, 1],
        |m| m.network.foreground = vec![7],
        |m| m.network.multiple_px = 0,
        |m| m.tiling.window_px = [65, 64],
        |m| m.tiling.whole_up_to_px = u64::MAX,
        |m| m.mirror_axes = vec![2],
        |m| m.postprocessing.low = 0.9,
    ];
    for (k, change) in changes.iter().enumerate() {
        let mut manifest = manifest();
        change(&mut manifest);
        assert!(matches!(manifest.check(), Err(ModelError::BadManifest { .. })), "change {k}");
    }
    let unknown = String::from_utf8(MANIFEST.to_vec()).unwrap().replace("\"card\"", "\"cart\"");
    assert!(Manifest::from_json(unknown.as_bytes()).is_err());
}
