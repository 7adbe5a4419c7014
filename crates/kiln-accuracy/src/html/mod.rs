//! The report as one HTML file: no script, no other file, light and dark as the reader's system has it.

mod plot;

use std::fmt::Write as _;

use kiln_image::compare::heat_map;
use kiln_image::png::encode_rgb8;

use crate::curve::{Curve, Point};
use crate::estimator::Knob;
use crate::ladder::{Ladder, Price};
use crate::norms::ErrorNorms;
use crate::pictures::{HEAT, Pictures};
use crate::report::{Environment, LobeReport, TableReport, number};

const STYLE: &str = include_str!("style.css");

/// The report of environments with their pictures.
pub fn page(environments: &[(Environment, Pictures)]) -> String {
    let mut out = String::new();
    let names: Vec<&str> = environments.iter().map(|(environment, _)| environment.name.as_str()).collect();
    let title = escape(&names.join(", "));
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>Accuracy of {title}</title><style>{STYLE}</style></head><body>\n<main>\n<h1>What accuracy costs in time</h1>\n"
    );
    for (environment, pictures) in environments {
        section(&mut out, environment, pictures);
    }
    if let Some((environment, _)) =
        environments.first().filter(|(environment, _)| !environment.tables.is_empty())
    {
        tables(&mut out, &environment.tables);
    }
    out.push_str(
        "<footer>Errors are relative: RMS to the exact map's RMS over the sphere; 95 % and the largest to a direction's own value plus \
         a hundredth of the mean radiance. Exact is brute force in double precision at probes, the hidden places included: sun, its \
         90° circle and antipode, poles, wrap column, cube edges and corners. Seconds are of one core of the machine that made this \
         report; operations are counted by a model and equal everywhere.</footer>\n</main></body></html>\n",
    );
    out
}

fn section(out: &mut String, environment: &Environment, pictures: &Pictures) {
    let Environment { name, width, height, peak, face_size, law, choice, .. } = environment;
    let mean = environment.mean.iter().sum::<f64>() / 3.0;
    let _ = writeln!(
        out,
        "<section><h2>{}</h2><p class=\"facts\">{width} × {height} texels, brightest {peak:.4}, mean {mean:.3}; chain from faces of \
         {face_size}, roughness {law}</p>",
        escape(name)
    );
    let _ = writeln!(
        out,
        "<div class=\"choice\"><h3>What Kiln bakes: {}, error {}, {}</h3><ul>",
        choice.estimator.name(),
        number(choice.error),
        escape(&choice.format)
    );
    for reason in &choice.reasons {
        let _ = writeln!(out, "<li>{}</li>", escape(reason));
    }
    out.push_str("</ul></div>\n");
    if let Some(ladder) = &environment.ladder {
        ladder_section(out, ladder);
    }
    for lobe in &environment.lobes {
        lobe_section(out, lobe, pictures);
    }
    out.push_str("</section>\n");
}

fn ladder_section(out: &mut String, ladder: &Ladder) {
    out.push_str("<h3>The ladder of errors</h3><p>Each rung alone, the others exact. The bars are logarithmic.</p><table class=\"ladder\">\n");
    for rung in &ladder.rungs {
        // 1e-6 … 1.
        let share = ((rung.rms.max(1e-6).log10() + 6.0) / 6.0).clamp(0.01, 1.0) * 100.0;
        let price = match rung.price {
            Price::Time => "time buys it",
            Price::Bytes => "bytes buy it",
            Price::Source => "a finer source buys it",
            Price::Nothing => "no bake buys it",
        };
        let class = if rung.name == ladder.dominant { " class=\"dominant\"" } else { "" };
        let _ = writeln!(
            out,
            "<tr{class}><th>{}</th><td class=\"bar\"><span style=\"width:{share:.1}%\"></span></td><td class=\"n\">{:.1e}</td>\
             <td>{price}</td><td class=\"what\">{}</td></tr>",
            escape(&rung.name),
            rung.rms,
            escape(&rung.what)
        );
    }
    out.push_str("</table>\n<table><tr><th>Texels</th><th>error of encoding</th><th>bytes of the GGX chain</th></tr>\n");
    for encoding in &ladder.encodings {
        let Encoded { format, rms, bytes } = encoding.into();
        let _ = writeln!(
            out,
            "<tr><td>{format}</td><td class=\"n\">{rms:.1e}</td><td class=\"n\">{bytes}</td></tr>"
        );
    }
    out.push_str("</table>\n");
}

/// An encoding as it is shown.
struct Encoded {
    format: String,
    rms: f64,
    bytes: String,
}

impl From<&crate::ladder::Encoding> for Encoded {
    fn from(encoding: &crate::ladder::Encoding) -> Encoded {
        Encoded { format: escape(&encoding.format), rms: encoding.rms, bytes: grouped(encoding.bytes) }
    }
}

fn lobe_section(out: &mut String, lobe: &LobeReport, pictures: &Pictures) {
    let sizes: Vec<String> = lobe.levels.iter().map(|level| level.face_size.to_string()).collect();
    let name = match lobe.lobe {
        crate::LobeKind::Ggx => "GGX: specular reflection",
        crate::LobeKind::Lambert => "Lambert: irradiance",
        crate::LobeKind::Charlie => "Charlie: sheen",
    };
    let _ = writeln!(
        out,
        "<h3>{name}</h3><p>Faces of {} texels. Lower and further left is better.</p>",
        sizes.join(", ")
    );
    out.push_str(&plot::time_error(&lobe.curves));
    pictures_of(out, lobe, pictures);
    out.push_str("<details><summary>All numbers</summary>\n");
    for curve in &lobe.curves {
        numbers(out, lobe, curve);
    }
    out.push_str("</details>\n");
}

fn numbers(out: &mut String, lobe: &LobeReport, curve: &Curve) {
    let knob = match curve.knob {
        Knob::Error => "error asked for",
        Knob::Samples => "samples",
        Knob::Quality => "quality",
        Knob::Step => "step, radians",
    };
    let mips: String = lobe.levels.iter().map(|level| format!("<th>mip {}</th>", level.mip)).collect();
    let _ = writeln!(
        out,
        "<h4>{}</h4><table><tr><th>{knob}</th><th>RMS</th><th>95 %</th><th>largest</th><th>seconds</th><th>operations</th>\
         <th>texels read</th>{mips}</tr>",
        escape(curve.estimator.title())
    );
    for Point { knob, error: ErrorNorms { rms, p95, max }, levels, seconds, work } in &curve.points {
        let levels: String =
            levels.iter().map(|level| format!("<td class=\"n\">{:.1e}</td>", level.rms)).collect();
        let _ = writeln!(
            out,
            "<tr><td class=\"n\">{}</td><td class=\"n\">{rms:.1e}</td><td class=\"n\">{p95:.1e}</td><td class=\"n\">{max:.1e}</td>\
             <td class=\"n\">{seconds:.3}</td><td class=\"n\">{:.1e}</td><td class=\"n\">{:.1e}</td>{levels}</tr>",
            number(*knob),
            work.flops as f64,
            work.texel_reads as f64
        );
    }
    out.push_str("</table>\n");
}

fn pictures_of(out: &mut String, lobe: &LobeReport, pictures: &Pictures) {
    let own: Vec<_> = pictures.0.iter().filter(|picture| picture.lobe == lobe.lobe).collect();
    if own.is_empty() {
        return;
    }
    out.push_str("<div class=\"pictures\">\n");
    for picture in own {
        let _ = write!(
            out,
            "<figure><figcaption>{}</figcaption>{}",
            escape(&picture.title),
            image(&picture.faces, "faces")
        );
        out.push_str(&picture.heat.as_ref().map_or_else(String::new, |heat| image(heat, "error")));
        out.push_str("</figure>\n");
    }
    let _ = writeln!(out, "</div>{}", scale_bar());
}

/// What the colours of all heat maps mean.
fn scale_bar() -> String {
    let values: Vec<f32> = (0..256).map(|i| i as f32 / 255.0).collect();
    let bar = image(&encode_rgb8(256, 1, &heat_map(&values)), "scale");
    let [low, high] = HEAT.map(|power| format!("1e{power:.0}"));
    format!(
        "<div class=\"scale\"><span>{low}</span>{bar}<span>{high}</span> error of a texel, the same for all maps; faces +X −X +Y −Y +Z −Z</div>"
    )
}

fn tables(out: &mut String, tables: &[TableReport]) {
    out.push_str(
        "<section><h2>BRDF tables</h2><p>They do not depend on the environment. Errors are absolute; the second pair also counts \
         another masking term than height-correlated Smith, which glTF's renderers assume.</p><table><tr><th>Table</th><th>RMS</th>\
         <th>largest</th><th>RMS beside Smith</th><th>largest beside Smith</th></tr>\n",
    );
    for TableReport { title, error, beside_smith, .. } in tables {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td class=\"n\">{:.1e}</td><td class=\"n\">{:.1e}</td><td class=\"n\">{:.1e}</td><td class=\"n\">{:.1e}</td></tr>",
            escape(title),
            error.rms,
            error.max,
            beside_smith.rms,
            beside_smith.max
        );
    }
    out.push_str("</table></section>\n");
}

fn image(png: &[u8], class: &str) -> String {
    format!("<img class=\"{class}\" alt=\"{class}\" src=\"data:image/png;base64,{}\">", base64(png))
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits =
            three.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        for index in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * index) & 63) as usize];
            text.push(if index > three.len() { '=' } else { char::from(letter) });
        }
    }
    text
}

/// Thousands apart.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::{base64, escape, grouped};

    #[test]
    fn base64_of_rfc_4648_and_what_html_needs() {
        let of = |text: &str| base64(text.as_bytes());
        assert_eq!(
            [of(""), of("f"), of("fo"), of("foo"), of("foob")],
            ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]
        );
        assert_eq!(escape("<a&\"b\">"), "&lt;a&amp;&quot;b&quot;&gt;");
        assert_eq!([grouped(7), grouped(1_234_567)], ["7", "1\u{202f}234\u{202f}567"]);
    }
}
