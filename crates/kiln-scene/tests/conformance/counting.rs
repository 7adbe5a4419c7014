//! The system's allocator, with an account of what is out and what was at most.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

struct Counting;

static CURRENT: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

impl Counting {
    fn take(size: usize) {
        PEAK.fetch_max(CURRENT.fetch_add(size, Relaxed) + size, Relaxed);
    }

    fn give(size: usize) {
        CURRENT.fetch_sub(size, Relaxed);
    }
}

// SAFETY: every call goes to `System` unchanged; the account allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::take(layout.size());
        // SAFETY: the caller's promise is `System`'s condition.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::take(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Self::give(layout.size());
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both are there while the system copies.
        Self::take(size);
        Self::give(layout.size());
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `step` makes, and the most memory that was out meanwhile.
pub(crate) fn peak_of<T>(step: impl FnOnce() -> T) -> (T, usize) {
    let floor = CURRENT.load(Relaxed);
    PEAK.store(floor, Relaxed);
    let made = step();
    (made, PEAK.load(Relaxed).saturating_sub(floor))
}
