//! Options of `kiln render` that look into frames.

use clap::Args as ClapArgs;

#[derive(Debug, ClapArgs)]
pub(crate) struct InspectArgs {
    /// Show this of each pixel in place of the picture: base-color, roughness, shading-normal, uv0, f0, mip, variant, diffuse,
    /// specular … (docs/shader-interface.md lists them); may be given more than once
    #[arg(long, value_name = "NAME")]
    pub(crate) channel: Vec<kiln_preview::Channel>,
    /// Say what each picture holds at a pixel: column and row from the upper left
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel)]
    pub(crate) probe: Option<[u32; 2]>,
    /// Stripe and count pixels with radiance that is no number, infinite, negative, or above this
    #[arg(long, value_name = "RADIANCE", num_args = 0..=1, default_missing_value = "65504", value_parser = parse_limit)]
    pub(crate) mark_faults: Option<f32>,
}

/// Column and row of a pixel.
fn parse_pixel(text: &str) -> Result<[u32; 2], String> {
    let numbers =
        text.split_once(',').and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    numbers.ok_or_else(|| "write it as 640,360".to_owned())
}

/// A radiance above which pixels are marked.
fn parse_limit(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|limit: &f32| limit.is_finite() && *limit >= 0.0);
    number.ok_or_else(|| "it is a radiance of 0 or more".to_owned())
}
