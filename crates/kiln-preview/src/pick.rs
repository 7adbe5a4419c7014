//! Which draw lies below a place of the picture.

use glam::Vec3;
use kiln_scene::Bounds;

use crate::pose::{Pose, Stand};

/// The box of the nearest visible draw that a ray meets. Boxes stand for what is in them: the geometry itself is on the
/// device only. Those that the eye is in are passed over, so that a room does not hide what stands in it.
pub(crate) fn pick(pose: &Pose, origin: Vec3, direction: Vec3) -> Option<Bounds> {
    let visible = pose.draws.iter().filter(|stand| stand.visible);
    let hits = visible.filter_map(|stand| Some((entry(stand, origin, direction)?, stand)));
    let (_, stand) = hits.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
    Some(Bounds { min: stand.center - stand.half, max: stand.center + stand.half })
}

/// Where a ray enters a draw's box, in lengths of `direction`: the slab method.
fn entry(stand: &Stand, origin: Vec3, direction: Vec3) -> Option<f32> {
    let inverse = direction.recip();
    let to_box = stand.center - origin;
    let (middle, reach) = (to_box * inverse, (stand.half * inverse).abs());
    let (enter, leave) = ((middle - reach).max_element(), (middle + reach).min_element());
    // Written so that NaN, of a ray along a box's face, misses.
    (enter > 0.0 && enter <= leave).then_some(enter)
}
