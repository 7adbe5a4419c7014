//! Ending a long computation early, and without a long goodbye.

use std::error::Error;
use std::fmt;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering::Relaxed};

/// Whether a result is still wanted. Long functions take it as their last parameter and look at it often.
///
/// It never decides a value: a function returns the same bits as ever, or [`Cancelled`]. Between two looks lie a
/// few milliseconds of one core at most, unless the function's documentation names what it cannot interrupt.
#[derive(Clone, Copy, Debug)]
pub struct Cancel<'a>(Wish<'a>);

#[derive(Clone, Copy, Debug)]
enum Wish<'a> {
    Never,
    Flag(&'a AtomicBool),
    Countdown(&'a AtomicI64),
}

/// The result is not wanted any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cancelled;

impl<'a> Cancel<'a> {
    /// The result is wanted whatever happens.
    pub const NEVER: Cancel<'static> = Cancel(Wish::Never);

    /// Ends the work soon after `flag` has become true.
    pub fn when(flag: &'a AtomicBool) -> Self {
        Self(Wish::Flag(flag))
    }

    /// Ends the work at the first check that finds `left` at 0 or below; every check takes one away.
    ///
    /// For tests: it places a cancellation exactly, without a clock, and tells how many checks there were.
    pub fn countdown(left: &'a AtomicI64) -> Self {
        Self(Wish::Countdown(left))
    }

    /// `Err` if the result is not wanted any more. Costs a load.
    #[inline]
    pub fn check(self) -> Result<(), Cancelled> {
        let is_cancelled = match self.0 {
            Wish::Never => false,
            Wish::Flag(flag) => flag.load(Relaxed),
            Wish::Countdown(left) => left.fetch_sub(1, Relaxed) <= 0,
        };
        if is_cancelled { Err(Cancelled) } else { Ok(()) }
    }
}

impl fmt::Display for Cancelled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the result is not wanted any more")
    }
}

impl Error for Cancelled {}

/// Something large that another thread frees: handing 300 MB back to the system takes 20 ms, longer than a cancelled
/// step may go on. Its memory is therefore gone a little after it, when a worker of rayon finds time.
#[derive(Clone, Debug, PartialEq)]
pub struct Bulk<T: Send + 'static>(Option<T>);

impl<T: Send + 'static> Bulk<T> {
    /// Takes `value` into care.
    pub fn new(value: T) -> Self {
        Self(Some(value))
    }

    /// Gives the value back.
    pub fn into_inner(mut self) -> T {
        self.0.take().expect(PRESENT)
    }
}

/// Only the two functions that end a [`Bulk`] take its value.
const PRESENT: &str = "the value is there until the end";

impl<T: Send + 'static> Deref for Bulk<T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.0.as_ref().expect(PRESENT)
    }
}

impl<T: Send + 'static> DerefMut for Bulk<T> {
    fn deref_mut(&mut self) -> &mut T {
        self.0.as_mut().expect(PRESENT)
    }
}

impl<T: Send + 'static> Drop for Bulk<T> {
    fn drop(&mut self) {
        if let Some(value) = self.0.take() {
            rayon::spawn(move || drop(value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Bulk, Cancel, Cancelled};
    use std::sync::atomic::{AtomicBool, AtomicI64};
    use std::sync::mpsc;
    use std::time::Duration;

    #[test]
    fn flag_cancels_from_the_moment_it_is_set() {
        let flag = AtomicBool::new(false);
        let cancel = Cancel::when(&flag);
        assert_eq!([cancel.check(), Cancel::NEVER.check()], [Ok(()); 2]);
        flag.store(true, std::sync::atomic::Ordering::Relaxed);
        assert_eq!([cancel.check(), Cancel::NEVER.check()], [Err(Cancelled), Ok(())]);
    }

    #[test]
    fn countdown_cancels_at_its_end_and_stays_cancelled() {
        let left = AtomicI64::new(2);
        let cancel = Cancel::countdown(&left);
        assert_eq!([(); 4].map(|()| cancel.check().is_ok()), [true, true, false, false]);
        assert_eq!(left.into_inner(), -2, "every check counts");
    }

    /// Says on which thread it was dropped.
    struct Witness(mpsc::Sender<std::thread::ThreadId>);

    impl Drop for Witness {
        fn drop(&mut self) {
            // Nobody listens where the value was given back.
            let _ = self.0.send(std::thread::current().id());
        }
    }

    #[test]
    fn bulk_is_freed_elsewhere_unless_it_is_given_back() {
        let (sender, receiver) = mpsc::channel();
        drop(Bulk::new(Witness(sender.clone())));
        let freed_by = receiver.recv_timeout(Duration::from_secs(60)).expect("it is freed");
        assert_ne!(freed_by, std::thread::current().id());
        drop(Bulk::new(Witness(sender)).into_inner());
        assert_eq!(receiver.recv(), Ok(std::thread::current().id()));
    }
}
