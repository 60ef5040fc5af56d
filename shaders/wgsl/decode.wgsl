// Decode: one request an invocation, the stages in the order of the texel's journey.

@compute @workgroup_size(WORKGROUP)
fn decode(@builtin(global_invocation_id) id: vec3<u32>) {
    let texel = id.x;
    if (texel >= arrayLength(&requests)) {
        return;
    }
    let request = requests[texel];
    tap_texel(texel);
    vector_start(texel);

    if (part.first_layer == 0u && part.first_row == 0u) {
        embed(request);
    }
    for (var index = part.first_layer; index < part.end_layer; index++) {
        run_layer(index, texel, part.first_row, part.end_row);
    }
}

fn embed(request: Request) {
    let corners0 = position(0u, request);
    let corners1 = position(1u, request);
    var lane = sample(0u, SAMPLING_GRID0, corners0, 0u);
    lane = sample(1u, SAMPLING_GRID1, corners1, lane);
    lane = waves(request, lane);
    lane = level(request, lane);
    padding(lane);
}
