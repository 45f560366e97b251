//! Rigs and pairs for the tests, made from a number alone.
#![allow(dead_code, reason = "each test file uses its part")]

pub mod files;

use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Rig};
use accurate_io::{BitDepth, GreyImage, PairContents};
use ndarray::Array2;

/// Two cameras 70 degrees apart that look at the origin from 500; view 2 has a negative f_y.
pub fn rig(sizes: [ImageSize; 2], unit: LengthUnit) -> Rig {
    let camera = |size: ImageSize, angle_rad: f64, sign: f64| {
        let (cx, cy) = (f64::from(size.width) / 2.0, f64::from(size.height) / 2.0);
        let k = Matrix3::new(50.1, 0.3, cx, 0.0, sign * 50.7, cy, 0.0, 0.0, 1.0);
        let r = Rotation3::from_axis_angle(&Vector3::y_axis(), angle_rad).into_inner();
        Camera::new(k, r, Vector3::new(0.1, -0.2, 500.0), size).unwrap()
    };
    Rig::new(camera(sizes[0], 0.0, 1.0), camera(sizes[1], 1.2217, -1.0), unit).unwrap()
}

/// A SplitMix64 stream: the same numbers on every machine.
pub struct Stream(pub u64);

impl Stream {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A pair folder with every part, 40 x 30 px.
pub fn contents(seed: u64) -> PairContents {
    let mut stream = Stream(seed);
    let size = ImageSize { width: 40, height: 30 };
    let shape = (30, 40);
    let points1 = (0..9).map(|i| Pixel::new(f64::from(i) + stream.unit(), stream.unit())).collect();
    let points2 = (0..7).map(|i| Pixel::new(-stream.unit() / 3.0, f64::from(i) * 1.1)).collect();
    let mut mask = || Array2::from_shape_fn(shape, |i| i == (3, 4) || stream.below(4) == 0);
    let masks = [mask(), mask()];
    let images = [BitDepth::Eight, BitDepth::Sixteen].map(|depth| GreyImage {
        values: Array2::from_shape_fn(shape, |_| {
            stream.below(1 + depth.max_value() as usize) as f32
        }),
        depth,
    });
    let truth = (0..12)
        .map(|i| Point3::new(f64::from(i) + stream.unit(), stream.unit() / 7.0, -stream.unit()))
        .collect();
    PairContents {
        case_id: format!("case_{seed:03}"),
        rig: rig([size; 2], LengthUnit::Millimetre),
        points: Some((points1, points2)),
        masks: Some(masks),
        images: Some(images),
        truth: Some(truth),
        source: Some("made by a test".into()),
    }
}
