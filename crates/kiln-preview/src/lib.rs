//! Shows a published scene: in a window with panels, or headless into pictures. A client like any other.
//!
//! Start at [`HeadlessViewer`]: revisions in, pictures out. [`run_window`] and [`run_headless`] put a connection to
//! the daemon in front of it. In a window three threads work: one talks to the daemon, one prepares device
//! resources for the newest revision, one draws what was prepared last; a revision that cannot be used never takes
//! the picture away. Three more wait for what frames must not wait for: their end, differences, files.
//!
//! Conventions: right-handed, +Y up; shaders are bound by name as `docs/shader-interface.md` says; radiance is
//! linear until the tonemap shader, whose output is sRGB-encoded; depth 0 is near.
//!
//! Not here: compiling shaders (`kiln-shader`), baking maps (`kiln-bake`), reading glTF (`kiln-scene`), the device
//! itself (`kiln-gpu`), the wire (`kiln-link`).

#![expect(
    clippy::result_large_err,
    reason = "a diagnostic is made at most once for a target, never in a loop"
)]

pub use assignment::{Assignment, RefusedParameter};
pub use camera::OrbitCamera;
pub use channel::{Channel, Encoding};
pub use faults::FaultCounts;
pub use headless::HeadlessViewer;
pub use inspect::{Inspection, InspectionState};
pub use look::{LOOK_BYTES_MAX, Look, LookSheet};
pub use material_list::ListedMaterial;
pub use parameter::{OfferedParameter, ParameterValues};
pub use pass_timer::PassTime;
pub use probe::PixelProbe;
pub use report::{ApplyReport, OfferedAnimation};
pub use run::{HeadlessOptions, HeadlessReport, run_headless};
pub use upload::Uploaded;
pub use view::{AnimationTime, Background, DiffuseSource, Ground, Selection, View};
pub use window::{WindowOptions, run_window};

mod assignment;
mod backdrop;
mod binding;
mod camera;
mod channel;
mod connection;
mod draw_list;
mod faults;
mod frame_watcher;
mod ground;
mod harmonics;
mod headless;
mod history;
mod inspect;
mod inspector;
mod keeper;
mod lights;
mod live_picture;
mod live_probe;
mod look;
mod loss;
mod material_list;
mod measurer;
mod memory;
mod mip;
mod neutral;
mod own;
mod panel;
mod parameter;
mod pass_timer;
mod pick;
mod picture;
mod pose;
mod prepare;
mod probe;
mod program;
mod readout;
mod renderer;
mod report;
mod run;
mod saved;
mod scaling;
mod scene_color;
mod scene_gpu;
mod shadow;
mod shot;
mod side_picture;
mod slot;
mod sun;
mod target;
#[cfg(test)]
mod tests;
mod texture;
mod theme;
mod uniform;
mod upload;
mod vertex_input;
mod view;
mod window;
mod worker;
