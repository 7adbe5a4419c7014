// What the scene's own lights (KHR_lights_punctual) and the environment's sun make of each layer. Only the sun casts shadows, and
// occlusion is the environment's alone.

@if(anisotropy) import lib::anisotropy::anisotropic_alpha;
import lib::brdf::{diffuse_lambert, f_schlick};
@if(punctual_lights) import lib::frame::{LIGHT_COUNT_MAX, lights};
@if(sun) import lib::frame::sun;
@if(sheen) import lib::punctual::charlie_reflected;
@if(anisotropy) import lib::punctual::ggx_reflected_anisotropic;
@if(!anisotropy || clearcoat) import lib::punctual::ggx_reflected;
@if(transmission) import lib::punctual::ggx_transmitted;
import lib::punctual::{half_vector, IncidentLight, punctual_alpha};
@if(punctual_lights) import lib::punctual::incident_light;
@if(transmission) import lib::volume::roughness_refracted;
import super::base::{Base, Direct};
@if(clearcoat) import super::clearcoat::Coat;
@if(iridescence) import super::iridescence::iridescent_reflectance;
@if(sheen) import super::sheen::Sheen;

// Where direct light arrives.
struct LitPoint {
    position: vec3f,
    // Irradiance of a surface that faces the sun, behind what stands before it.
    @if(sun) sunlight: vec3f,
}

@if(punctual_lights)
fn punctual_count() -> u32 {
    return min(lights.count, LIGHT_COUNT_MAX);
}

// The scene's own lights, then the sun.
fn light_count() -> u32 {
    @if(punctual_lights && sun) return punctual_count() + 1u;
    @elif(sun) return 1u;
    @else return punctual_count();
}

fn arriving(index: u32, point: LitPoint) -> IncidentLight {
    @if(punctual_lights && sun) {
        if index == punctual_count() {
            return IncidentLight(sun.direction, point.sunlight);
        }
    }
    @if(punctual_lights) return incident_light(lights.items[index], point.position);
    @else return IncidentLight(sun.direction, point.sunlight);
}

// Width of a lobe under a light: a mirror shows the sun as wide as its disc, since a reflection turns by twice the half vector's angle.
fn alpha_under(index: u32, perceptual_roughness: f32) -> f32 {
    let alpha = punctual_alpha(perceptual_roughness);
    @if(sun) {
        if index + 1u == light_count() {
            return max(alpha, min(0.5 * sun.angular_radius, 1.0));
        }
    }
    return alpha;
}

// Fresnel's term of one direction, which the split sum has averaged over the lobe.
fn base_reflectance(base: Base, v_dot_h: f32) -> vec3f {
    @if(iridescence) return iridescent_reflectance(base.film, base.f0, base.f90, v_dot_h);
    @else return f_schlick(base.f0, base.f90, v_dot_h);
}

fn direct_light(base: Base, point: LitPoint) -> Direct {
    @if(anisotropy) let tbn_v = base.view * base.brush.frame;
    @if(transmission) let refracted = roughness_refracted(base.perceptual_roughness, max(base.ior, 1.0));
    var direct: Direct;
    for (var index = 0u; index < light_count(); index++) {
        let light = arriving(index, point);
        let alpha = alpha_under(index, base.perceptual_roughness);
        @if(anisotropy) let alpha_tb = anisotropic_alpha(alpha, base.brush.strength);
        @if(anisotropy) let lobe = ggx_reflected_anisotropic(tbn_v, light.direction * base.brush.frame, alpha_tb);
        @else let lobe = ggx_reflected(base.normal, base.view, light.direction, alpha);
        let v_dot_h = saturate(dot(base.view, half_vector(light.direction, base.view, base.normal)));
        direct.specular += base_reflectance(base, v_dot_h) * (lobe * light.irradiance);
        let n_dot_l = dot(base.normal, light.direction);
        direct.irradiance_over_pi += saturate(n_dot_l) * diffuse_lambert() * light.irradiance;
        @if(diffuse_transmission) direct.behind_over_pi += saturate(-n_dot_l) * diffuse_lambert() * light.irradiance;
        @if(transmission) {
            let through = ggx_transmitted(base.normal, base.view, light.direction, alpha_under(index, refracted));
            direct.through += through * light.irradiance;
        }
    }
    return direct;
}

@if(sheen)
fn direct_sheen(sheen: Sheen, normal: vec3f, view: vec3f, point: LitPoint) -> vec3f {
    var sum = vec3f(0.0);
    for (var index = 0u; index < light_count(); index++) {
        let light = arriving(index, point);
        let alpha = alpha_under(index, sheen.perceptual_roughness);
        sum += charlie_reflected(normal, view, light.direction, alpha) * light.irradiance;
    }
    return sheen.color * sum;
}

@if(clearcoat)
fn direct_coat(coat: Coat, view: vec3f, point: LitPoint) -> vec3f {
    var sum = vec3f(0.0);
    for (var index = 0u; index < light_count(); index++) {
        let light = arriving(index, point);
        let alpha = alpha_under(index, coat.perceptual_roughness);
        let v_dot_h = saturate(dot(view, half_vector(light.direction, view, coat.normal)));
        let reflectance = f_schlick(vec3f(0.04), 1.0, v_dot_h).x;
        sum += reflectance * ggx_reflected(coat.normal, view, light.direction, alpha) * light.irradiance;
    }
    return coat.weight * sum;
}
