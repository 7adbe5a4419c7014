struct Sample { @align(16) value: f32, weight: f32 }

@group(0) @binding(0) var<storage, read> samples: array<Sample>;
@group(0) @binding(1) var<storage, read_write> sum: f32;
@group(0) @binding(2) var output: texture_storage_2d<rgba16float, write>;

var<workgroup> partial: array<f32, 64>;

@compute @workgroup_size(64)
fn cs_main(@builtin(local_invocation_index) index: u32) {
    partial[index] = samples[index].value * samples[index].weight;
    workgroupBarrier();
    if index == 0u {
        for (var i = 0u; i < 64u; i++) {
            sum += partial[i];
        }
        textureStore(output, vec2u(0u), vec4f(sum));
    }
}
