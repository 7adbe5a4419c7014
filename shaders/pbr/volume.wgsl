// What a medium swallows of the light that passes it. KHR_materials_volume.

import lib::volume::volume_attenuation;
import super::interface::{draw, material};

// Along the thickness, which is given in the object's units. Of a scale that differs between axes the first counts.
fn medium_transmittance() -> vec3f {
    let distance = material.thickness_factor * length(draw.world_from_object[0].xyz);
    return volume_attenuation(distance, material.attenuation_color, material.attenuation_distance);
}
