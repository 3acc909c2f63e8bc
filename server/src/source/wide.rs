//! The same function twice: for every processor of the kind, and for those with wider vectors.

/// Calls `function(arguments)` (an `#[inline(always)]` function without a result), compiled for AVX2 where the
/// processor has it. Fused multiply-adds are not enabled, so the bits are the same either way.
macro_rules! wide {
    ($function:ident($($name:ident: $kind:ty = $value:expr),+ $(,)?)) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2")]
        fn with_avx2($($name: $kind),+) {
            $function($($name),+);
        }
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2: that was asked just above.
            unsafe { with_avx2($($value),+) }
        } else {
            $function($($value),+);
        }
        #[cfg(not(target_arch = "x86_64"))]
        $function($($value),+);
    }};
}

pub(crate) use wide;
