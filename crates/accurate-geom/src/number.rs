//! Numbers one by one or side by side: formulas that are written once for both.

use std::ops::{Add, Div, Mul, Sub};

use pulp::Simd;

/// A number, or several side by side: formulas are written once for both.
///
/// Every operation is the one of `f64`, lane by lane and never fused: the same bits whatever the
/// width.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// `value` in all lanes.
    fn all(self, value: f64) -> Self;
    /// The square root; NaN of negative numbers.
    fn sqrt(self) -> Self;
    /// Without the sign.
    fn abs(self) -> Self;
    /// The larger; `other` where `self` is NaN.
    fn larger(self, other: Self) -> Self;
    /// The smaller; `other` where `self` is NaN.
    fn smaller(self, other: Self) -> Self;
    /// `then` where `self > 0`, `otherwise` elsewhere and where `self` is NaN.
    fn if_positive(self, then: Self, otherwise: Self) -> Self;
    /// Whether `self <= limit` in all lanes.
    fn all_at_most(self, limit: f64) -> bool;
}

impl Number for f64 {
    #[inline(always)]
    fn all(self, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn if_positive(self, then: Self, otherwise: Self) -> Self {
        if self > 0.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn all_at_most(self, limit: f64) -> bool {
        self <= limit
    }
}

/// A vector register of an instruction set.
#[derive(Debug, Clone, Copy)]
pub struct Vector<S: Simd> {
    /// The instruction set.
    pub simd: S,
    /// The numbers.
    pub lanes: S::f64s,
}

impl<S: Simd> Vector<S> {
    /// Numbers `which * S::F64_LANES` to that many more of `numbers`, whose count is a multiple of it.
    #[inline(always)]
    pub fn load(simd: S, numbers: &[f64], which: usize) -> Self {
        Self { simd, lanes: S::as_simd_f64s(numbers).0[which] }
    }

    /// Writes them where [`load`](Self::load) takes them from.
    #[inline(always)]
    pub fn store(self, numbers: &mut [f64], which: usize) {
        S::as_mut_simd_f64s(numbers).0[which] = self.lanes;
    }

    #[inline(always)]
    fn with(self, lanes: S::f64s) -> Self {
        Self { simd: self.simd, lanes }
    }
}

impl<S: Simd> Add for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> Sub for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> Mul for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> Div for Vector<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(self.simd.div_f64s(self.lanes, other.lanes))
    }
}

impl<S: Simd> Number for Vector<S> {
    #[inline(always)]
    fn all(self, value: f64) -> Self {
        self.with(self.simd.splat_f64s(value))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.lanes))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.lanes))
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        let larger = self.simd.greater_than_f64s(self.lanes, other.lanes);
        self.with(select(self.simd, larger, self.lanes, other.lanes))
    }
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        let smaller = self.simd.less_than_f64s(self.lanes, other.lanes);
        self.with(select(self.simd, smaller, self.lanes, other.lanes))
    }
    #[inline(always)]
    fn if_positive(self, then: Self, otherwise: Self) -> Self {
        let positive = self.simd.greater_than_f64s(self.lanes, self.simd.splat_f64s(0.0));
        self.with(select(self.simd, positive, then.lanes, otherwise.lanes))
    }
    #[inline(always)]
    fn all_at_most(self, limit: f64) -> bool {
        let simd = self.simd;
        let within = simd.less_than_or_equal_f64s(self.lanes, simd.splat_f64s(limit));
        let beyond = select(simd, within, simd.splat_f64s(0.0), simd.splat_f64s(1.0));
        simd.reduce_max_f64s(beyond) == 0.0
    }
}

/// As `select_f64s`, which is no part of its caller's code unless the program is linked as a whole, and
/// then takes most of the time of a search.
#[inline(always)]
fn select<S: Simd>(simd: S, mask: S::m64s, then: S::f64s, otherwise: S::f64s) -> S::f64s {
    let bits = |lanes| simd.transmute_u64s_f64s(lanes);
    simd.transmute_f64s_u64s(simd.select_u64s(mask, bits(then), bits(otherwise)))
}

/// Two numbers in step: while one waits for a division, the other goes on.
#[derive(Debug, Clone, Copy)]
pub struct Two<N>(pub N, pub N);

impl<N: Number> Add for Two<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}

impl<N: Number> Sub for Two<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}

impl<N: Number> Mul for Two<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0, self.1 * other.1)
    }
}

impl<N: Number> Div for Two<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0 / other.0, self.1 / other.1)
    }
}

impl<N: Number> Number for Two<N> {
    #[inline(always)]
    fn all(self, value: f64) -> Self {
        Self(self.0.all(value), self.1.all(value))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self(self.0.larger(other.0), self.1.larger(other.1))
    }
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self(self.0.smaller(other.0), self.1.smaller(other.1))
    }
    #[inline(always)]
    fn if_positive(self, then: Self, otherwise: Self) -> Self {
        Self(self.0.if_positive(then.0, otherwise.0), self.1.if_positive(then.1, otherwise.1))
    }
    #[inline(always)]
    fn all_at_most(self, limit: f64) -> bool {
        self.0.all_at_most(limit) && self.1.all_at_most(limit)
    }
}

/// `a · b`.
#[inline(always)]
pub fn dot<N: Number, const K: usize>(a: &[N; K], b: &[N; K]) -> N {
    let mut sum = a[0] * b[0];
    for k in 1..K {
        sum = sum + a[k] * b[k];
    }
    sum
}

/// `a x b`.
#[inline(always)]
pub fn cross<N: Number>(a: &[N; 3], b: &[N; 3]) -> [N; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a + s b`.
#[inline(always)]
pub fn add_scaled<N: Number, const K: usize>(a: &[N; K], s: N, b: &[N; K]) -> [N; K] {
    let mut sum = *a;
    for k in 0..K {
        sum[k] = sum[k] + s * b[k];
    }
    sum
}

/// `s a`.
#[inline(always)]
pub fn scaled<N: Number, const K: usize>(s: N, a: &[N; K]) -> [N; K] {
    let mut product = *a;
    for k in 0..K {
        product[k] = s * product[k];
    }
    product
}

/// A constant vector in all lanes of numbers like `like`.
#[inline(always)]
pub fn constant<N: Number, const K: usize>(like: N, values: &[f64; K]) -> [N; K] {
    let mut all = [like; K];
    for k in 0..K {
        all[k] = like.all(values[k]);
    }
    all
}
