use pulp::bytemuck::{cast, cast_slice, pod_read_unaligned};
use pulp::{Scalar256b, Simd};

/// What the wavefront needs of an instruction set beyond [`Simd`]: a vector is a run of
/// [`Simd::F64_LANES`] neighbouring rows, 4 or 8.
pub(super) trait Lanes: Simd {
    /// Every row of `v` sees the row above it: lane 0 gets the last lane of `above`.
    fn shifted_down(self, above: Self::f64s, v: Self::f64s) -> Self::f64s;

    /// The last lane, which is the lowest row.
    fn last(self, v: Self::f64s) -> f64;

    /// One bit per lane, lane 0 lowest: whether `a == b` there.
    fn equal_bits(self, a: Self::f64s, b: Self::f64s) -> u8;

    /// `values[at..][..F64_LANES]`.
    #[inline(always)]
    fn load(self, values: &[f64], at: usize) -> Self::f64s {
        pod_read_unaligned(cast_slice(&values[at..at + Self::F64_LANES]))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86_64 {
    use std::arch::x86_64::{__m256d, __m512i};

    use pulp::x86::{V3, V4};

    use super::{Lanes, Simd, cast};

    impl Lanes for V4 {
        #[inline(always)]
        fn shifted_down(self, above: Self::f64s, v: Self::f64s) -> Self::f64s {
            let (v, above): (__m512i, __m512i) = (cast(v), cast(above));
            cast(self.avx512f._mm512_alignr_epi64::<7>(v, above))
        }

        #[inline(always)]
        fn last(self, v: Self::f64s) -> f64 {
            let v: [f64; 8] = cast(v);
            v[7]
        }

        #[inline(always)]
        fn equal_bits(self, a: Self::f64s, b: Self::f64s) -> u8 {
            self.equal_f64s(a, b).0
        }
    }

    impl Lanes for V3 {
        #[inline(always)]
        fn shifted_down(self, above: Self::f64s, v: Self::f64s) -> Self::f64s {
            // Both turned by one lane, then lane 0 of the one and lanes 1 to 3 of the other.
            const TURN: i32 = 0b10_01_00_11;
            let (v, above): (__m256d, __m256d) = (cast(v), cast(above));
            let v = self.avx2._mm256_permute4x64_pd::<TURN>(v);
            let above = self.avx2._mm256_permute4x64_pd::<TURN>(above);
            cast(self.avx._mm256_blend_pd::<1>(v, above))
        }

        #[inline(always)]
        fn last(self, v: Self::f64s) -> f64 {
            let v: [f64; 4] = cast(v);
            v[3]
        }

        #[inline(always)]
        fn equal_bits(self, a: Self::f64s, b: Self::f64s) -> u8 {
            let mask: __m256d = cast(self.equal_f64s(a, b));
            self.avx._mm256_movemask_pd(mask) as u8
        }
    }
}

/// For every other machine: four rows at a time, in whatever vectors the compiler finds.
impl Lanes for Scalar256b {
    #[inline(always)]
    fn shifted_down(self, above: Self::f64s, v: Self::f64s) -> Self::f64s {
        let (v, above): ([f64; 4], [f64; 4]) = (cast(v), cast(above));
        cast([above[3], v[0], v[1], v[2]])
    }

    #[inline(always)]
    fn last(self, v: Self::f64s) -> f64 {
        let v: [f64; 4] = cast(v);
        v[3]
    }

    #[inline(always)]
    fn equal_bits(self, a: Self::f64s, b: Self::f64s) -> u8 {
        let (a, b): ([f64; 4], [f64; 4]) = (cast(a), cast(b));
        (0..4).fold(0, |bits, k| bits | u8::from(a[k] == b[k]) << k)
    }
}
