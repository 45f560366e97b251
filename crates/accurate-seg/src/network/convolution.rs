use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// A convolution with a square kernel of odd side, as much zero padding as keeps the middle of the kernel
/// in the image, and one stride for both directions.
///
/// For each place of the kernel the matrix of its weights is multiplied with the image shifted there, and
/// all are summed: columns of a shifted image lie in memory one after another, so that nothing is gathered.
pub(super) struct Convolution {
    /// Of each place of the kernel, row by row, a matrix of input times output channels, column-major.
    places: Vec<f32>,
    bias: Vec<f32>,
    /// Input and output.
    channels: [usize; 2],
    side: usize,
    stride: usize,
}

/// Values of a band of output rows, as they are summed: half of a level-2 cache together with what they are
/// made of.
const BAND_VALUES: usize = 1 << 15;
/// Bands of an image at least, however few its values: for so many threads.
const BANDS: usize = 8;

impl Convolution {
    /// Of weights of shape (output channels, input channels, side, side); `None` if `weights` or `bias` have
    /// other lengths, or the side is even.
    pub(super) fn new(
        weights: &[f32],
        bias: Option<&[f32]>,
        [outputs, inputs, side]: [usize; 3],
        stride: usize,
    ) -> Option<Self> {
        let bias = bias.map_or_else(|| vec![0.0; outputs], <[f32]>::to_vec);
        let per_place = inputs * outputs;
        let fits = weights.len() == per_place * side * side && bias.len() == outputs;
        if !fits || side % 2 == 0 || per_place * stride == 0 {
            return None;
        }
        // (output, input, place) to (place, output, input).
        let kernel = side * side;
        let places = (0..kernel * per_place)
            .map(|at| weights[(at % per_place) * kernel + at / per_place])
            .collect();
        Some(Self { places, bias, channels: [inputs, outputs], side, stride })
    }

    /// The input channels, of all images together.
    pub(super) fn inputs(&self) -> usize {
        self.channels[0]
    }

    /// The output channels of the images' input channels, each row by row, and the output's rows and columns. The
    /// channels of several images are taken one after another.
    ///
    /// The same bits for any number of threads of the pool that it runs in.
    pub(super) fn apply(
        &self,
        images: &[&[f32]],
        [rows, columns]: [usize; 2],
    ) -> (Vec<f32>, [usize; 2]) {
        let channels: Vec<_> =
            images.iter().flat_map(|image| image.chunks(rows * columns)).collect();
        let (outputs, stride) = (self.channels[1], self.stride);
        let [out_rows, out_columns] = [rows, columns].map(|n| (n - 1) / stride + 1);
        let mut output = vec![0.0; outputs * out_rows * out_columns];
        let width = out_columns + (self.side - 1) / stride;
        let by_cache = BAND_VALUES / (width * self.channels[0].max(outputs));
        let band_rows = by_cache.min(out_rows.div_ceil(BANDS)).max(1);

        let mut bands: Vec<Vec<&mut [f32]>> = Vec::new();
        bands.resize_with(out_rows.div_ceil(band_rows), || Vec::with_capacity(outputs));
        for channel in output.chunks_mut(out_rows * out_columns) {
            for (band, part) in bands.iter_mut().zip(channel.chunks_mut(band_rows * out_columns)) {
                band.push(part);
            }
        }
        let work = |(shifted, sums): &mut (Vec<f32>, Vec<f32>),
                    (index, mut parts): (usize, Vec<&mut [f32]>)| {
            let band =
                Band { first_row: index * band_rows, rows: parts[0].len() / out_columns, width };
            self.lay_out(&channels, [rows, columns], &band, shifted);
            self.sum(shifted, &band, sums);
            for (part, sums) in parts.iter_mut().zip(sums.chunks(band.rows * width)) {
                for (row, sums) in part.chunks_mut(out_columns).zip(sums.chunks(width)) {
                    row.copy_from_slice(&sums[..out_columns]);
                }
            }
        };
        bands.into_par_iter().enumerate().for_each_init(Default::default, work);
        (output, [out_rows, out_columns])
    }

    /// The padded rows that a band of the output is made of. With a stride they are dealt into as many images
    /// in each direction, in which the places of the kernel are shifts again.
    fn lay_out(
        &self,
        channels: &[&[f32]],
        [rows, columns]: [usize; 2],
        band: &Band,
        shifted: &mut Vec<f32>,
    ) {
        let (inputs, stride, pad) = (self.channels[0], self.stride, self.side / 2);
        let plane = self.plane(band);
        shifted.clear();
        shifted.resize(stride * stride * inputs * plane, 0.0);
        for (index, plane) in shifted.chunks_mut(plane).enumerate() {
            let (phase, channel) = (index / inputs, channels[index % inputs]);
            let (below, right) = (phase / stride, phase % stride);
            for (q, target) in plane.chunks_mut(band.width).enumerate() {
                let Some(row) = (stride * (band.first_row + q) + below).checked_sub(pad) else {
                    continue;
                };
                if row >= rows {
                    continue;
                }
                let source = &channel[row * columns..][..columns];
                // The first column that is not padding, and where it lies in the image.
                let first = pad.saturating_sub(right).div_ceil(stride);
                let from = stride * first + right - pad;
                let Some(target) = target.get_mut(first..) else { continue };
                if stride == 1 {
                    let count = target.len().min(columns);
                    target[..count].copy_from_slice(&source[..count]);
                } else if let Some(source) = source.get(from..) {
                    let values = source.iter().step_by(stride);
                    target.iter_mut().zip(values).for_each(|(t, v)| *t = *v);
                }
            }
        }
    }

    /// Values of one channel of one image that is laid out: the last shift ends so much after the last row.
    fn plane(&self, band: &Band) -> usize {
        let reach = (self.side - 1) / self.stride;
        (band.rows + reach) * band.width + reach
    }

    /// Columns beyond the output's are sums of what lies there, and mean nothing.
    fn sum(&self, shifted: &[f32], band: &Band, sums: &mut Vec<f32>) {
        let ([inputs, outputs], stride) = (self.channels, self.stride);
        let (plane, values) = (self.plane(band), band.rows * band.width);
        sums.clear();
        sums.extend(self.bias.iter().flat_map(|bias| std::iter::repeat_n(*bias, values)));
        for (place, weights) in self.places.chunks(inputs * outputs).enumerate() {
            let (y, x) = (place / self.side, place % self.side);
            let phase = (y % stride) * stride + x % stride;
            let shift = (y / stride) * band.width + x / stride;
            let image = &shifted[phase * inputs * plane + shift..];
            let image = MatRef::from_column_major_slice_with_stride(image, values, inputs, plane);
            let weights = MatRef::from_column_major_slice(weights, inputs, outputs);
            let target = MatMut::from_column_major_slice_mut(sums, values, outputs);
            matmul(target, Accum::Add, image, weights, 1.0, Par::Seq);
        }
    }
}

/// Rows of the output that are made together.
struct Band {
    first_row: usize,
    rows: usize,
    /// Columns of a row as it is laid out: the output's and as many more as the kernel reaches.
    width: usize,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The sum as it is written.
    fn written(
        image: &[f32],
        weights: &[f32],
        bias: &[f32],
        [rows, columns]: [usize; 2],
        [outputs, inputs, side]: [usize; 3],
        stride: usize,
    ) -> Vec<f64> {
        let pad = side / 2;
        let mut output = Vec::new();
        for o in 0..outputs {
            for y in (0..rows).step_by(stride) {
                for x in (0..columns).step_by(stride) {
                    let mut sum = f64::from(bias[o]);
                    for i in 0..inputs {
                        for (ky, kx) in (0..side * side).map(|k| (k / side, k % side)) {
                            let (Some(r), Some(c)) =
                                ((y + ky).checked_sub(pad), (x + kx).checked_sub(pad))
                            else {
                                continue;
                            };
                            if r < rows && c < columns {
                                let weight = weights[((o * inputs + i) * side + ky) * side + kx];
                                let value = image[(i * rows + r) * columns + c];
                                sum += f64::from(weight) * f64::from(value);
                            }
                        }
                    }
                    output.push(sum);
                }
            }
        }
        output
    }

    /// Whole numbers from -4 to 4: every sum of them is exact.
    fn numbers(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed;
        let next = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((state >> 33) % 9) as f32 - 4.0
        };
        (0..count).map(next).collect()
    }

    proptest! {
        #[test]
        fn it_is_the_sum_as_it_is_written(
            sides in [1..40_usize, 1..40_usize],
            channels in [1..5_usize, 1..5_usize],
            side in prop::sample::select(vec![1_usize, 3, 5]),
            stride in 1..4_usize,
            seed: u64,
        ) {
            let [outputs, inputs] = channels;
            let image = numbers(inputs * sides[0] * sides[1], seed);
            let weights = numbers(outputs * inputs * side * side, seed ^ 1);
            let bias = numbers(outputs, seed ^ 2);
            let shape = [outputs, inputs, side];
            let convolution = Convolution::new(&weights, Some(&bias), shape, stride).unwrap();
            let split = (inputs / 2) * sides[0] * sides[1];
            let images = [&image[..split], &image[split..]];
            let (found, out_sides) = convolution.apply(&images, sides);
            prop_assert_eq!(out_sides, sides.map(|n| n.div_ceil(stride)));
            let found: Vec<f64> = found.into_iter().map(f64::from).collect();
            prop_assert_eq!(found, written(&image, &weights, &bias, sides, shape, stride));
        }
    }

    #[test]
    fn an_image_of_many_bands_is_the_same_for_any_number_of_threads() {
        let (shape, sides) = ([24, 40, 3], [70, 300]);
        let numbers = |count| numbers(count, 7).into_iter().map(|n| 0.1 * n).collect::<Vec<_>>();
        let image = numbers(shape[1] * sides[0] * sides[1]);
        let weights = numbers(shape[0] * shape[1] * 9);
        let convolution = Convolution::new(&weights, None, shape, 1).unwrap();
        let by = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| convolution.apply(&[&image], sides).0)
        };
        let one = by(1);
        assert!(one == by(2) && one == by(5));
        let expected = written(&image, &weights, &[0.0; 24], sides, shape, 1);
        // 360 products of at most 0.16 each, rounded as they are summed.
        let most = 360.0 * 360.0 * 0.16 * f64::from(f32::EPSILON);
        assert!(one.iter().zip(&expected).all(|(a, b)| (f64::from(*a) - b).abs() < most));
    }

    #[test]
    fn what_does_not_fit_is_none() {
        let weights = [1.0; 18];
        assert!(Convolution::new(&weights, None, [1, 2, 3], 1).is_some());
        assert!(Convolution::new(&weights, None, [2, 2, 3], 1).is_none());
        assert!(Convolution::new(&weights, Some(&[1.0; 2]), [1, 2, 3], 1).is_none());
        assert!(Convolution::new(&weights[..16], None, [1, 4, 2], 1).is_none());
        assert!(Convolution::new(&weights, None, [1, 2, 3], 0).is_none());
        assert!(Convolution::new(&[], None, [0, 2, 3], 1).is_none());
    }
}
