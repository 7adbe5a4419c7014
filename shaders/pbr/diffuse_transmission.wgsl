// Leaves, paper, wax: light that comes through diffusely. KHR_materials_diffuse_transmission.

import lib::environment::irradiance_over_pi;
import super::interface::material;

// The diffuse light of a surface of which a share scatters to the other side. `weight` is what the specular layer and the metal
// leave of white.
fn with_light_from_behind(front: vec3f, normal: vec3f, weight: f32) -> vec3f {
    let behind = weight * saturate(material.diffuse_transmission_color_factor) * irradiance_over_pi(-normal);
    return mix(front, behind, saturate(material.diffuse_transmission_factor));
}
