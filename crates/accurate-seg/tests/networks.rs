//! Networks from the bundle to the mask: engines against each other and against arithmetic, images of
//! any size, mirroring, windows, progress, threads.
#![cfg(all(feature = "rten", feature = "ort"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr)]

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use accurate_seg::network::{
    Engine, Manifest, Mirroring, ModelBundle, ModelError, NetworkOptions, NetworkSegmenter,
    OrtEngine, OrtRuntime, RtenEngine,
};
use accurate_seg::{Mask, Polarity, PostProcessing, Progress, SegError, Segmenter, unwatched};
use ndarray::Array2;
use rayon::prelude::*;

const DARK: &[u8] = include_bytes!("fixtures/dark.onnx");
const UNET: &[u8] = include_bytes!("fixtures/unet.onnx");

fn manifest() -> Manifest {
    Manifest::from_json(include_bytes!("fixtures/dark.json")).unwrap()
}

fn bundle(network: &'static [u8], change: impl FnOnce(&mut Manifest)) -> ModelBundle {
    let mut manifest = manifest();
    change(&mut manifest);
    ModelBundle::new(manifest, network.into()).unwrap()
}

fn segmenter(bundle: &ModelBundle, threads: usize, options: NetworkOptions) -> NetworkSegmenter {
    let engine = Box::new(RtenEngine::new(bundle, threads).unwrap());
    NetworkSegmenter::new(bundle, engine, options).unwrap()
}

/// A dark wavy strand on a slope with seeded noise.
fn picture(height: usize, width: usize) -> Array2<f32> {
    let mut state = 12_345_u32;
    Array2::from_shape_fn((height, width), |(row, col)| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 16) as f32 / 65_536.0;
        let middle = height as f32 / 2.0 + 0.2 * height as f32 * (col as f32 / 17.0).sin();
        let body = if (row as f32 - middle).abs() < 1.6 { -120.0 } else { 0.0 };
        140.0 + 0.1 * col as f32 + 6.0 * noise + body
    })
}

#[test]
fn a_one_by_one_network_gives_the_softmax_of_its_formula() {
    let image = picture(40, 56);
    let found = segmenter(&bundle(DARK, |_| {}), 1, NetworkOptions::DEFAULT)
        .probability(&image, &unwatched);
    let n = image.len() as f64;
    let mean = image.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let std = (image.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n).sqrt();
    for (got, grey) in found.unwrap().iter().zip(&image) {
        let logit = -4.0 * (f64::from(*grey) - mean) / std - 4.0;
        let expected = 1.0 / (1.0 + (-logit).exp());
        // A logit of up to 20 in f32 is right to 20 x 2^-23; the slope of the sigmoid is at most 1/4.
        let tolerance = 20.0 * f64::from(f32::EPSILON);
        assert!((f64::from(*got) - expected).abs() <= tolerance, "{got} {expected}");
    }
}

#[test]
fn sides_that_are_no_multiples_of_the_networks_are_padded_and_cut_back() {
    // Pixel by pixel, so that the surroundings do not matter: any size must give the formula above.
    let segmenter = segmenter(&bundle(DARK, |_| {}), 1, NetworkOptions::DEFAULT);
    for (height, width) in [(1, 9), (3, 3), (8, 8), (17, 40), (100, 33)] {
        let image = picture(height, width);
        let found = segmenter.segment(&image, &unwatched).unwrap();
        assert_eq!(found.probability.dim(), (height, width));
        assert_eq!(found.mask.shape(), (height, width));
        let n = image.len() as f64;
        let mean = image.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let std = (image.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n).sqrt();
        for (at, got) in found.probability.indexed_iter() {
            let logit = -4.0 * (f64::from(image[at]) - mean) / std - 4.0;
            let expected = 1.0 / (1.0 + (-logit).exp());
            // As above.
            let tolerance = 20.0 * f64::from(f32::EPSILON);
            assert!(
                (f64::from(*got) - expected).abs() <= tolerance,
                "{height} x {width} at {at:?}: {got} {expected}"
            );
        }
    }
}

#[test]
fn windows_give_what_the_whole_image_gives_for_a_network_without_surroundings() {
    let image = picture(150, 210);
    let whole = segmenter(&bundle(DARK, |_| {}), 1, NetworkOptions::DEFAULT)
        .probability(&image, &unwatched);
    let cut = bundle(DARK, |m| m.tiling.whole_up_to_px = 0);
    for mirroring in [Mirroring::Never, Mirroring::Opposite, Mirroring::All] {
        let options = NetworkOptions { mirroring, ..NetworkOptions::DEFAULT };
        let windows = segmenter(&cut, 1, options).probability(&image, &unwatched).unwrap();
        for (a, b) in whole.as_ref().unwrap().iter().zip(&windows) {
            // A weighted mean of up to nine windows by four mirror images, all equal to rounding.
            assert!((a - b).abs() <= 36.0 * f32::EPSILON, "{a} {b}");
        }
    }
}

#[test]
fn mirroring_makes_the_answer_to_a_mirrored_image_the_mirrored_answer() {
    let image = picture(48, 64);
    let bundle = bundle(UNET, |_| {});
    let flip = |a: &Array2<f32>, axes: &[usize]| {
        let mut view = a.view();
        axes.iter().for_each(|axis| view.invert_axis(ndarray::Axis(*axis)));
        view.as_standard_layout().into_owned()
    };
    let difference = |mirroring: Mirroring, axes: &[usize]| {
        let options = NetworkOptions { mirroring, ..NetworkOptions::DEFAULT };
        let s = segmenter(&bundle, 1, options);
        let straight = s.probability(&image, &unwatched).unwrap();
        let turned = flip(&s.probability(&flip(&image, axes), &unwatched).unwrap(), axes);
        straight.iter().zip(&turned).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    // Means in another order; the normalisation's sum runs in another order too.
    let both = [0, 1];
    let same = [
        difference(Mirroring::All, &both[1..]),
        difference(Mirroring::All, &both),
        difference(Mirroring::Opposite, &both),
    ];
    assert!(same.iter().all(|d| *d < 1e-4), "{same:?}");
    // The network has a preferred side.
    let other = [difference(Mirroring::Never, &both), difference(Mirroring::Opposite, &both[1..])];
    assert!(other.iter().all(|d| *d > 1e-2), "{other:?}");
}

/// What is done where a result is in doubt, unless it is done anyway.
#[test]
fn more_care_is_all_mirror_images_of_which_only_the_missing_are_run() {
    let image = picture(48, 64);
    let with = |mirroring, bundle: &ModelBundle| {
        segmenter(bundle, 1, NetworkOptions { mirroring, ..NetworkOptions::DEFAULT })
    };
    let again = |mirroring, bundle: &ModelBundle| {
        let segmenter = with(mirroring, bundle);
        let before = segmenter.segment(&image, &unwatched).unwrap().probability;
        let runs = AtomicUsize::new(0);
        let watch = |Progress { total, .. }| {
            runs.store(total, Ordering::Relaxed);
            ControlFlow::Continue(())
        };
        let again = segmenter.segment_again(&image, &before, &watch).unwrap();
        (again, runs.into_inner())
    };
    let mirrored = bundle(UNET, |_| {});
    let all = with(Mirroring::All, &mirrored).segment(&image, &unwatched).unwrap();
    for (mirroring, missing) in [(Mirroring::Never, 3), (Mirroring::Opposite, 2)] {
        let (found, runs) = again(mirroring, &mirrored);
        assert_eq!(runs, missing);
        let found = found.unwrap();
        assert_eq!(found.mask, all.mask);
        // Two means of at most four numbers up to 1, each rounded less than eight times.
        for (a, b) in found.probability.iter().zip(&all.probability) {
            assert!((a - b).abs() <= 8.0 * f32::EPSILON, "{a} {b}");
        }
    }
    assert_eq!(again(Mirroring::All, &mirrored), (None, 0));
    let one_way = bundle(UNET, |m| m.mirror_axes.clear());
    assert_eq!(again(Mirroring::Opposite, &one_way), (None, 0));

    let refused = with(Mirroring::Opposite, &mirrored).segment_again(
        &image,
        &Array2::zeros((64, 48)),
        &unwatched,
    );
    assert!(matches!(refused, Err(SegError::WrongShape { expected: (48, 64), found: (64, 48) })));
}

#[test]
fn the_bytes_are_the_same_for_any_number_of_threads() {
    let image = picture(200, 264);
    // The mean of several is all above one half.
    let options = NetworkOptions { mirroring: Mirroring::Never, ..NetworkOptions::DEFAULT };
    for network in [UNET, DARK] {
        let bundle = bundle(network, |_| {});
        let of =
            |threads| segmenter(&bundle, threads, options).probability(&image, &unwatched).unwrap();
        let one = of(1);
        assert!(one.iter().any(|p| *p > 0.5) && one.iter().any(|p| *p < 0.5));
        for threads in [2, 3, 8] {
            assert_eq!(one, of(threads), "{threads} threads");
        }
        let Some(runtime) = runtime() else { continue };
        let of = |threads| {
            let engine = Box::new(OrtEngine::new(&runtime, &bundle, threads).unwrap());
            NetworkSegmenter::new(&bundle, engine, options)
                .unwrap()
                .probability(&image, &unwatched)
                .unwrap()
        };
        let one = of(1);
        for threads in [2, 3, 8] {
            assert_eq!(one, of(threads), "{threads} threads of ONNX Runtime");
        }
    }
}

#[test]
fn a_worker_that_waits_for_the_network_begins_no_other_image() {
    let bundle = bundle(UNET, |_| {});
    let engine = RtenEngine::new(&bundle, 2).unwrap();
    let input = picture(64, 64);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let (begun, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
    pool.install(|| {
        (0..64).into_par_iter().for_each(|_| {
            most.fetch_max(begun.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            engine.logits(&input).unwrap();
            begun.fetch_sub(1, Ordering::SeqCst);
        });
    });
    assert!(most.into_inner() <= 2);
}

#[test]
fn both_engines_agree() {
    let Some(runtime) = runtime() else { return };
    let bundle = bundle(UNET, |_| {});
    let input = picture(64, 96).mapv(|v| (v - 140.0) / 30.0);
    let a = RtenEngine::new(&bundle, 2).unwrap().logits(&input).unwrap();
    let b = OrtEngine::new(&runtime, &bundle, 2).unwrap().logits(&input).unwrap();
    let largest = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let range = a.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    // Three normalised convolutions of at most 54 products each: some hundred roundings of values of
    // this range.
    assert!(largest <= 200.0 * f32::EPSILON * range.max(1.0), "{largest} of {range}");
}

#[test]
fn a_library_that_is_none_is_refused_without_a_panic() {
    for path in ["/nowhere/libonnxruntime.so", "relative.so", env!("CARGO_MANIFEST_DIR")] {
        let error = OrtRuntime::load(Path::new(path)).unwrap_err();
        assert!(matches!(error, ModelError::Engine { engine: "ONNX Runtime", .. }), "{error}");
    }
}

#[test]
fn progress_is_told_and_the_caller_may_end_it() {
    let cut = bundle(DARK, |m| m.tiling.whole_up_to_px = 0);
    let segmenter = segmenter(&cut, 1, NetworkOptions::DEFAULT);
    let image = picture(150, 210);
    let heard = Mutex::new(Vec::new());
    segmenter
        .segment(&image, &|p| {
            heard.lock().unwrap().push((p.done, p.total));
            ControlFlow::Continue(())
        })
        .unwrap();
    let heard = heard.into_inner().unwrap();
    let total = heard[0].1;
    assert!(total > 4);
    assert_eq!(heard, (0..=total).map(|done| (done, total)).collect::<Vec<_>>());
    let stopped = segmenter.segment(&image, &|p| {
        if p.done == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(stopped, Err(SegError::Cancelled { done: 3, total }));
}

#[test]
fn the_strand_is_found_dark_or_bright_at_either_depth() {
    let bundle = bundle(DARK, |_| {});
    let image = picture(120, 200);
    let truth = PostProcessing::PAPER;
    let segmenter = segmenter(&bundle, 1, NetworkOptions::DEFAULT);
    let of = |image: &Array2<f32>, polarity: Polarity| {
        segmenter.segment(&polarity.with_body_dark(image.clone()), &unwatched).unwrap()
    };
    let found = of(&image, Polarity::BodyDark);
    assert!(found.mask.count() > 400 && truth.mask_of(&found.probability).is_ok());
    let sixteen = of(&image.mapv(|v| v * 257.0), Polarity::BodyDark);
    let bright = of(&image.mapv(|v| 255.0 - v), Polarity::BodyBright);
    let differing = |other: &Mask| {
        let pairs = found.mask.as_array().iter().zip(other.as_array());
        pairs.filter(|(a, b)| a != b).count()
    };
    assert_eq!(differing(&sixteen.mask), 0);
    assert_eq!(differing(&bright.mask), 0);
}

#[test]
fn an_engine_of_another_shape_is_refused() {
    #[derive(Debug)]
    struct Wrong;
    impl Engine for Wrong {
        fn logits(&self, input: &Array2<f32>) -> Result<ndarray::Array3<f32>, SegError> {
            Ok(ndarray::Array3::zeros((3, input.nrows(), input.ncols())))
        }
        fn describe(&self) -> String {
            "wrong".to_owned()
        }
    }
    let bundle = bundle(DARK, |_| {});
    let segmenter =
        NetworkSegmenter::new(&bundle, Box::new(Wrong), NetworkOptions::DEFAULT).unwrap();
    let error = segmenter.segment(&picture(8, 8), &unwatched).unwrap_err();
    assert!(error.to_string().contains("(3, 8, 8); expected (2, 8, 8)"), "{error}");
}

/// ONNX Runtime where its library is named; a test without it says so.
fn runtime() -> Option<OrtRuntime> {
    match std::env::var_os("ORT_DYLIB_PATH") {
        Some(path) => Some(OrtRuntime::load(Path::new(&path)).expect("ORT_DYLIB_PATH")),
        None => {
            eprintln!("skipped: ORT_DYLIB_PATH names no ONNX Runtime");
            None
        }
    }
}
