//! The look-dev ball: a shell with a groove around its equator, a core behind the groove, a stand.
//!
//! Unit: the ball's radius is 1. Smooth parts show how light rolls over a surface, the rounded lips of the
//! groove show tight highlights, and core and stand are a neutral grey to judge the shell against.

use crate::profile::{Mapping, Profile, Surface, radians, revolve};

/// Half the groove's height.
const GROOVE: f64 = 0.075;
/// Radius of the lips' rounding.
const LIP: f64 = 0.045;
/// Radius of the core.
const CORE: f64 = 0.86;
/// Height of the ball's centre over the top of its pedestal.
const CENTRE: f64 = 1.15;
/// Texture repeats per radius at the poles.
const REPEATS: f64 = 0.5;
/// Around the axis: at 640×360 a facet is a pixel or two, and a software renderer pays for each triangle.
pub(crate) const SEGMENTS: usize = 64;

/// Shell above the groove, then below it: what the material is shown on.
pub(crate) fn shells() -> [Surface; 2] {
    let mapping = |up| Mapping::Stereographic { centre: CENTRE, up, repeats: REPEATS };
    let (lip, elevation) = lip();
    let centre = [0.0, CENTRE];
    let upper = Profile::default()
        .arc(centre, 1.0, radians(90.0), elevation, 20)
        .arc([lip[0], CENTRE + lip[1]], LIP, elevation, radians(-90.0), 5)
        .line([lip[0], CENTRE + GROOVE], [CORE - 0.02, CENTRE + GROOVE], 1);
    let lower = Profile::default()
        .line([CORE - 0.02, CENTRE - GROOVE], [lip[0], CENTRE - GROOVE], 1)
        .arc([lip[0], CENTRE - lip[1]], LIP, radians(90.0), -elevation, 5)
        .arc(centre, 1.0, -elevation, radians(-72.0), 15);
    [revolve(&upper, SEGMENTS, mapping(true)), revolve(&lower, SEGMENTS, mapping(false))]
}

/// The core behind the groove.
pub(crate) fn core() -> Surface {
    let reach = libm::asin(1.5 * GROOVE / CORE);
    let profile = Profile::default().arc([0.0, CENTRE], CORE, reach, -reach, 4);
    revolve(&profile, SEGMENTS, Mapping::Plain)
}

/// The stand: a collar that holds the ball, and a foot of the given height; the ball's own place is at y = 0.
pub(crate) fn stand(height: f64) -> Surface {
    let (foot, rim) = (0.62, 0.05);
    let top = 0.09;
    let profile = Profile::default()
        .arc([0.37, 0.225], 0.03, radians(90.0), 0.0, 5)
        .line([0.40, 0.225], [0.40, 0.19], 1)
        .arc([0.50, 0.19], -0.10, radians(180.0), radians(270.0), 5)
        .line([0.50, top], [foot - rim, top], 1)
        .arc([foot - rim, top - rim], rim, radians(90.0), 0.0, 5)
        .line([foot, top - rim], [foot, -height], 1);
    revolve(&profile, 48, Mapping::Plain)
}

/// The ground: a disc with a rounded edge, its top at y = 0.
pub(crate) fn ground(radius: f64) -> Surface {
    let edge = 0.12;
    let profile = Profile::default().line([0.0, 0.0], [radius - edge, 0.0], 1).arc(
        [radius - edge, -edge],
        edge,
        radians(90.0),
        radians(-90.0),
        8,
    );
    revolve(&profile, 128, Mapping::Plain)
}

/// Centre of the upper lip's rounding relative to the ball's, and the elevation where it leaves the sphere:
/// a circle that touches the sphere from inside and the groove's wall from above.
fn lip() -> ([f64; 2], f64) {
    let height = GROOVE + LIP;
    let distance = 1.0 - LIP;
    ([libm::sqrt(distance * distance - height * height), height], libm::asin(height / distance))
}
