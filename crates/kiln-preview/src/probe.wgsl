// Everything that a frame knows of one pixel.

struct Question {
    pixel: vec2u,
}

struct Answer {
    // Linear, as the pass that drew it left it.
    value: vec4f,
    // sRGB-encoded.
    display: vec4f,
    // Of the nearest of the pixel's samples, and which it is; 1 where there is nothing.
    depth: f32,
    sample: u32,
}

@group(0) @binding(0) var<uniform> question: Question;
@group(0) @binding(1) var values: texture_2d<f32>;
@group(0) @binding(2) var output: texture_2d<f32>;
@group(0) @binding(3) var depth: texture_depth_multisampled_2d;
@group(0) @binding(4) var<storage, read_write> answer: Answer;

@compute @workgroup_size(1)
fn cs_main() {
    let pixel = vec2i(question.pixel);
    answer.value = textureLoad(values, pixel, 0);
    answer.display = textureLoad(output, pixel, 0);
    answer.depth = 1.0;
    answer.sample = 0u;
    for (var index = 0u; index < textureNumSamples(depth); index++) {
        let sample = textureLoad(depth, pixel, index);
        if sample < answer.depth {
            answer.depth = sample;
            answer.sample = index;
        }
    }
}
