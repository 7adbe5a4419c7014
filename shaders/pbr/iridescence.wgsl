// A thin film on the base. KHR_materials_iridescence.

import lib::brdf::f0_of_schlick;
import lib::iridescence::f_iridescence;
import super::interface::material;

// The f0 with which Schlick's term gives the film's reflectance at this view: the split sum takes it from there.
fn iridescent_f0(f0: vec3f, f90: f32, n_dot_v: f32) -> vec3f {
    let film = f_iridescence(n_dot_v, f0, material.iridescence_ior, material.iridescence_thickness_maximum);
    return mix(f0, f0_of_schlick(film, f90, n_dot_v), saturate(material.iridescence_factor));
}
