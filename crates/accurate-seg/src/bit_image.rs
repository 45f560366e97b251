use crate::Mask;

/// Pixels in a word.
const BITS: usize = u64::BITS as usize;

/// A mask at one bit per pixel, with a margin of background of one row above and below and one
/// word on either side: every word has its eight neighbours.
#[derive(Debug, Clone)]
pub(crate) struct BitImage {
    /// Row by row; the lowest bit of a word is its leftmost pixel.
    words: Vec<u64>,
    /// Words from one row to the next.
    stride: usize,
}

/// What lies around each of the 64 pixels of a word: bit `k` of `n` is the pixel north of pixel
/// `k`, and so on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Around {
    pub n: u64,
    pub ne: u64,
    pub e: u64,
    pub se: u64,
    pub s: u64,
    pub sw: u64,
    pub w: u64,
    pub nw: u64,
}

impl BitImage {
    pub fn of(mask: &Mask) -> Self {
        let (height, width) = mask.shape();
        let stride = width.div_ceil(BITS) + 2;
        let mut words = vec![0; stride * (height + 2)];
        let lines = words[stride..].chunks_exact_mut(stride);
        for (line, pixels) in lines.zip(mask.raster().chunks(width)) {
            for (word, block) in line[1..].iter_mut().zip(pixels.chunks(BITS)) {
                // A wire covers about 1 % of its image: most blocks need no more than this look.
                if block.iter().fold(false, |any, &pixel| any | pixel) {
                    *word = packed(block);
                }
            }
        }
        Self { words, stride }
    }

    /// Writes the foreground into `background`, an empty mask of the size that this image has.
    pub fn unpack_into(&self, background: &mut Mask) {
        let width = background.width();
        let raster = background.raster_mut();
        let lines = self.words[self.stride..].chunks_exact(self.stride);
        for (line, row) in lines.zip(raster.chunks_mut(width)) {
            for (&word, block) in line[1..].iter().zip(row.chunks_mut(BITS)) {
                let mut left = word;
                while left != 0 {
                    block[left.trailing_zeros() as usize] = true;
                    left &= left - 1;
                }
            }
        }
    }

    /// Number of words, margin included.
    pub fn len(&self) -> usize {
        self.words.len()
    }

    pub fn word(&self, at: usize) -> u64 {
        self.words[at]
    }

    /// Where the words with foreground are, row by row.
    pub fn used(&self) -> Vec<usize> {
        (0..self.words.len()).filter(|&at| self.words[at] != 0).collect()
    }

    /// The surroundings of word `at`, which is not in the margin.
    #[inline]
    pub fn around(&self, at: usize) -> Around {
        let line = |at: usize| -> (u64, u64, u64) {
            let words = &self.words[at - 1..at + 2];
            // The pixels west of those of the word itself, these, and those east of them.
            let west = words[1] << 1 | words[0] >> (BITS - 1);
            let east = words[1] >> 1 | words[2] << (BITS - 1);
            (west, words[1], east)
        };
        let (nw, n, ne) = line(at - self.stride);
        let (w, _, e) = line(at);
        let (sw, s, se) = line(at + self.stride);
        Around { n, ne, e, se, s, sw, w, nw }
    }

    /// Makes these pixels of word `at` background, and calls `seen` for every word of foreground
    /// that has one of them as a neighbour or holds one.
    #[inline]
    pub fn delete(&mut self, at: usize, pixels: u64, mut seen: impl FnMut(usize)) {
        self.words[at] &= !pixels;
        let first = at - usize::from(pixels & 1 != 0);
        let last = at + usize::from(pixels >> (BITS - 1) != 0);
        for row in [at - self.stride, at, at + self.stride] {
            for near in row - (at - first)..=row + (last - at) {
                if self.words[near] != 0 {
                    seen(near);
                }
            }
        }
    }
}

/// At most 64 pixels as bits, the first lowest.
fn packed(block: &[bool]) -> u64 {
    let mut word = 0;
    for (eight, shift) in block.chunks(8).zip((0..).step_by(8)) {
        let mut bytes = [0; 8];
        for (byte, &pixel) in bytes.iter_mut().zip(eight) {
            *byte = u8::from(pixel);
        }
        // Byte k, which is 0 or 1, moves to bit 56 + k; no two products meet in one bit.
        let bits = u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        word |= bits << shift;
    }
    word
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn packing_loses_nothing_and_every_pixel_sees_its_neighbours(
            (height, width) in (1..5usize, 1..140usize),
            seed in prop::collection::vec(any::<bool>(), 700),
        ) {
            let pixels = Array2::from_shape_fn((height, width), |(r, c)| seed[r * width + c]);
            let mask = Mask::from_array(pixels).unwrap();
            let image = BitImage::of(&mask);
            let mut unpacked = mask.cleared();
            image.unpack_into(&mut unpacked);
            prop_assert_eq!(&unpacked, &mask);
            for row in 0..height {
                for col in 0..width {
                    let a = image.around((row + 1) * image.stride + 1 + col / BITS);
                    let found = [a.nw, a.n, a.ne, a.w, a.e, a.sw, a.s, a.se]
                        .map(|word| word >> (col % BITS) & 1 == 1);
                    let expected = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)]
                        .map(|(down, right)| {
                            let (r, c) = ((row + down).checked_sub(1), (col + right).checked_sub(1));
                            r.zip(c).is_some_and(|(r, c)| mask.get(r, c))
                        });
                    prop_assert_eq!(found, expected);
                }
            }
        }
    }
}
