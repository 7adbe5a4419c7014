//! The vector instructions of this machine, chosen while running.
//!
//! A plain build knows SSE2 or NEON alone. [`dispatch`] runs code that was compiled for AVX2 and AVX-512 too, where
//! the machine has them. Which one ran decides no bit of a result: lanes are independent outputs or sums of a fixed
//! order, and Rust never contracts a product and a sum into one rounding.

use pulp::Arch;
use std::sync::atomic::{AtomicU8, Ordering};

/// What [`dispatch`] may use at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Instructions {
    /// What every machine of the target has.
    Baseline,
    /// AVX2 on x86-64; elsewhere as `Baseline`.
    Avx2,
    /// All there is: AVX-512 on x86-64 that has it.
    Best,
}

static LIMIT: AtomicU8 = AtomicU8::new(Instructions::Best as u8);

/// Limits this process from now on: for tests that compare, and benches that tell what vectors bring.
pub fn limit_to(instructions: Instructions) {
    LIMIT.store(instructions as u8, Ordering::Relaxed);
}

/// The best that this machine has, within the limit.
pub fn available() -> &'static str {
    match arch() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(_) => "AVX-512",
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) => "AVX2",
        _ => "baseline",
    }
}

fn arch() -> Arch {
    let limit = LIMIT.load(Ordering::Relaxed);
    if limit == Instructions::Baseline as u8 {
        return Arch::Scalar;
    }
    let best = Arch::new();
    #[cfg(target_arch = "x86_64")]
    if limit == Instructions::Avx2 as u8 {
        return pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3);
    }
    best
}

/// Runs `work` compiled for the machine's vectors. Everything in it that is to profit must be inlined into it.
#[inline]
pub fn dispatch<R>(work: impl FnOnce() -> R) -> R {
    arch().dispatch(work)
}
