//! Laws of the labelled X-ray images: the labels are the drawn curve, and an index is an image.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate_geom::Point2;
use accurate_synth::{SynthError, TUBE_RADIUS_PX, XrayDomain, XraySample, draw_xray};

fn small() -> XrayDomain {
    XrayDomain { side_px: 128, ..XrayDomain::default() }
}

/// Distance of a pixel to the nearest point of the visible centreline, with the radius there, by
/// looking at every segment.
fn nearest(sample: &XraySample, x: f64, y: f64) -> Option<(f64, f64)> {
    let at = Point2::new(x, y);
    let mut best: Option<(f64, f64)> = None;
    for piece in &sample.centreline {
        for (ends, radii) in piece.points.windows(2).zip(piece.radius_px.windows(2)) {
            let along = ends[1] - ends[0];
            let t = ((at - ends[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            let distance = (at - (ends[0] + along * t)).norm();
            if best.is_none_or(|(d, _)| distance < d) {
                best = Some((distance, radii[0].max(radii[1])));
            }
        }
    }
    best
}

#[test]
fn pictures_of_pairs_show_the_wire_where_the_labels_are() {
    let domain = XrayDomain { side_px: 256, pair_probability: 1.0, ..XrayDomain::default() };
    for index in 0..8 {
        let sample = draw_xray(&domain, 1500, index).unwrap();
        let mean = |wanted: bool| {
            let near = |row: usize, column: usize| sample.tube[[row, column]];
            let values: Vec<f64> = sample
                .image
                .indexed_iter()
                .filter(|((row, column), _)| {
                    // The ring of 6 px around the wire against the wire itself.
                    let around = (row.saturating_sub(6)..(row + 7).min(256)).any(|r| {
                        (column.saturating_sub(6)..(column + 7).min(256)).any(|c| near(r, c))
                    });
                    if wanted {
                        sample.mask[[*row, *column]]
                    } else {
                        around && !sample.mask[[*row, *column]]
                    }
                })
                .map(|(_, value)| f64::from(*value))
                .collect();
            assert!(values.len() > 100, "image {index}: {} px", values.len());
            values.iter().sum::<f64>() / values.len() as f64
        };
        let darker = mean(false) - mean(true);
        assert!(if sample.inverted { darker < 0.0 } else { darker > 0.0 }, "{index}: {darker}");
    }
}

#[test]
fn labels_are_the_tube_around_the_projected_centreline() {
    let mut labelled = 0;
    for index in 0..12 {
        let sample = draw_xray(&small(), 1500, index).unwrap();
        let widest = sample
            .centreline
            .iter()
            .flat_map(|p| &p.radius_px)
            .fold(0.5_f64, |widest, radius| widest.max(*radius));
        for ((row, column), set) in sample.mask.indexed_iter() {
            let Some((distance, _)) = nearest(&sample, column as f64, row as f64) else {
                assert!(!set && !sample.tube[[row, column]]);
                continue;
            };
            // A wider stretch may reach past the nearest one: the widest bounds both.
            assert!(!set || distance <= widest + 1e-9, "image {index} ({column}, {row})");
            let in_tube = sample.tube[[row, column]];
            // The rim itself may round either way.
            if (distance - TUBE_RADIUS_PX).abs() > 1e-9 {
                assert_eq!(in_tube, distance < TUBE_RADIUS_PX, "image {index} ({column}, {row})");
            }
            labelled += usize::from(*set);
        }
        for point in sample.centreline.iter().flat_map(|p| &p.points) {
            let (x, y) = (point.x.round(), point.y.round());
            if (0.0..128.0).contains(&x) && (0.0..128.0).contains(&y) {
                assert!(sample.tube[[y as usize, x as usize]]);
            }
        }
    }
    assert!(labelled > 500, "hardly a wire in twelve images: {labelled} px");
}

#[test]
fn an_index_is_an_image_whatever_is_drawn_around_it() {
    let alone = draw_xray(&small(), 1500, 7).unwrap();
    let handle = std::thread::spawn(|| (6..9).map(|k| draw_xray(&small(), 1500, k).unwrap()));
    let among: Vec<_> = handle.join().unwrap().collect();
    assert_eq!(alone, among[1]);
    assert_ne!(alone.image, among[0].image);
    assert_ne!(alone.image, draw_xray(&small(), 1501, 7).unwrap().image);
}

#[test]
fn a_wire_can_be_seen_in_its_image() {
    // Along the centreline the image differs from beside it, in the direction of the polarity, for
    // nearly every wire; crossings and blades make exceptions of single ones.
    let domain = XrayDomain {
        wire_depth: 0.8..=1.8,
        dose_photons_per_px: 2000.0..=6000.0,
        background: 0.1..=0.3,
        empty_probability: 0.0,
        motion_probability: 0.0,
        ..small()
    };
    let (mut seen, mut drawn) = (0, 0);
    for index in 0..30 {
        let sample = draw_xray(&domain, 1500, index).unwrap();
        let mean = |wanted: &dyn Fn(usize, usize) -> bool| {
            let values: Vec<_> = sample
                .image
                .indexed_iter()
                .filter(|((r, c), _)| wanted(*r, *c))
                .map(|(_, v)| f64::from(*v))
                .collect();
            (values.len() > 20).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let on = mean(&|r, c| sample.mask[[r, c]]);
        let beside = mean(&|r, c| {
            !sample.mask[[r, c]]
                && nearest(&sample, c as f64, r as f64)
                    .is_some_and(|(d, radius)| (radius + 3.0..radius + 8.0).contains(&d))
        });
        if let (Some(on), Some(beside)) = (on, beside) {
            drawn += 1;
            seen += usize::from((on > beside) == sample.inverted);
        }
    }
    assert!(drawn >= 15, "{drawn}");
    assert!(seen * 10 >= drawn * 9, "{seen} of {drawn}");
}

#[test]
fn bad_ranges_are_named() {
    let bad = [
        ("side_px", XrayDomain { side_px: 63, ..small() }),
        ("width_px", XrayDomain { width_px: 0.5..=2.0, ..small() }),
        ("width_px", XrayDomain { width_px: 3.0..=2.0, ..small() }),
        ("wire_depth", XrayDomain { wire_depth: f64::NAN..=1.0, ..small() }),
        ("dose_photons_per_px", XrayDomain { dose_photons_per_px: 0.0..=9.0, ..small() }),
        ("jpeg_quality", XrayDomain { jpeg_quality: 0..=50, ..small() }),
        ("empty_probability", XrayDomain { empty_probability: 1.1, ..small() }),
        ("least_contrast_to_noise", XrayDomain { least_contrast_to_noise: -1.0, ..small() }),
        ("pair_probability", XrayDomain { pair_probability: 1.5, ..small() }),
        ("pair_families", XrayDomain { pair_families: Vec::new(), ..small() }),
        ("pair_width_px", XrayDomain { pair_width_px: 0.5..=5.0, ..small() }),
    ];
    for (expected, domain) in bad {
        match draw_xray(&domain, 0, 0) {
            Err(SynthError::BadOption { name, .. }) => assert_eq!(name, expected),
            other => panic!("{expected}: {:?}", other.map(|s| s.inverted)),
        }
    }
}
