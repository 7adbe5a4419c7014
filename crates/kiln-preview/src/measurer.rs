//! The thread that measures how much two pictures differ: frames never wait for it.

use std::sync::mpsc::{Receiver, Sender, channel};

use anyhow::Context as _;
use egui::ColorImage;
use kiln_gpu::{Gpu, GpuError, Submitted};
use kiln_image::compare::{Comparison, Picture, compare, heat_map};

use crate::panel::compare::Numbers;
use crate::readout::{COPY_LIMIT, Rgb, read_rgb};

/// Two copies of pictures, and which frames they are.
pub(crate) struct Pair {
    pub pictures: [wgpu::Texture; 2],
    /// When they are there.
    pub copied: Submitted,
    pub frames: [u64; 2],
}

/// What came of a pair.
pub(crate) struct Measured {
    pub frames: [u64; 2],
    pub numbers: Numbers,
    /// FLIP of each pixel in colours.
    pub heat_map: ColorImage,
}

/// Measures one pair after another.
pub(crate) struct Measurer {
    pairs: Sender<Pair>,
    measured: Receiver<Option<Measured>>,
    is_busy: bool,
}

impl Measurer {
    /// Starts the thread; `wake` is called whenever [`Measurer::take`] has something new.
    pub fn spawn(gpu: Gpu, wake: impl Fn() + Send + 'static) -> anyhow::Result<Self> {
        let (pairs, asked) = channel::<Pair>();
        let (sender, measured) = channel();
        let measure = move || {
            for pair in asked {
                // What a lost device does not give is not measured; the window says that it is lost.
                if sender.send(measure(&gpu, &pair).ok()).is_err() {
                    return;
                }
                wake();
            }
        };
        std::thread::Builder::new().name("measure".into()).spawn(measure).context("starting a thread")?;
        Ok(Measurer { pairs, measured, is_busy: false })
    }

    /// Whether a pair is being measured.
    pub fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Measures a pair, one at a time.
    pub fn measure(&mut self, pair: Pair) {
        // The thread ends only with the window.
        self.is_busy = self.pairs.send(pair).is_ok();
    }

    /// What was measured last, once.
    pub fn take(&mut self) -> Option<Measured> {
        let measured = self.measured.try_recv().ok()?;
        self.is_busy = false;
        measured
    }
}

fn measure(gpu: &Gpu, pair: &Pair) -> Result<Measured, GpuError> {
    // Reading waits with a lock that frames need: not for what is not there yet.
    pair.copied.wait(COPY_LIMIT);
    let (a, b) = (read_rgb(gpu, &pair.pictures[0])?, read_rgb(gpu, &pair.pictures[1])?);
    let comparison = compare_pictures(&a, &b)?;
    let heat_map = ColorImage::from_rgb([a.width, a.height], &heat_map(&comparison.flip_map));
    Ok(Measured { frames: pair.frames, numbers: Numbers::from(&comparison), heat_map })
}

/// How much two pictures of one size differ.
pub(crate) fn compare_pictures(a: &Rgb, b: &Rgb) -> Result<Comparison, GpuError> {
    let [a, b] =
        [a, b].map(|Rgb { width, height, bytes }| Picture { width: *width, height: *height, rgb: bytes });
    compare(a, b).map_err(|error| GpuError::Readback { reason: error.to_string() })
}

impl From<&Comparison> for Numbers {
    fn from(comparison: &Comparison) -> Self {
        let Comparison { rmse, psnr_db, flip_mean, flip_max, difference_max, .. } = *comparison;
        Numbers { rmse, psnr_db, flip_mean, flip_max, difference_max }
    }
}
