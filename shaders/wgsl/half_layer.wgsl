// fp16 layers: halves in, binary32 sums, halves or integers out. See isa/src/layer.rs,
// `HalfParameters`, and isa/src/half.rs, `SumOrder` and `activation`.

fn half_bias(layer: Layer, row: u32) -> vec4<u32> {
    return vec4<u32>(integer_bias(layer, row));
}

// The weights of four rows for one lane.
fn half_weights(layer: Layer, row: u32, lane: u32) -> vec4<u32> {
    let at = layer.weight + row * layer.steps + (lane >> 3u) * 4u;
    let word = (lane >> 1u) & 3u;
    let words = vec4<u32>(
        weights[at][word], weights[at + 1u][word], weights[at + 2u][word], weights[at + 3u][word],
    );
    return extractBits(words, (lane & 1u) * 16u, 16u);
}

// A lane as an fp16 layer reads it: integers as reals of -1 to 1.
fn half_input(layer: Layer, source: u32, lane: u32) -> u32 {
    let value = read_lane(source, layer.input_lanes, lane);
    if (layer.input_lanes == LANES_HALVES) {
        return bitcast<u32>(value) & 0xffffu;
    }
    return half_from_fixed(wide(value - layer.input_zero_point), layer.input_bits - 1u);
}

// The products of four rows with one lane; +0 past the last lane.
fn half_products(layer: Layer, source: u32, row: u32, lane: u32) -> vec4<u32> {
    if (lane >= layer.inputs) {
        return vec4<u32>(0u, 0u, 0u, 0u);
    }
    let input = half_input(layer, source, lane);
    let factors = half_weights(layer, row, lane);
    return vec4<u32>(
        half_product(factors.x, input),
        half_product(factors.y, input),
        half_product(factors.z, input),
        half_product(factors.w, input),
    );
}

// The sums of four rows.
fn float_add4(a: vec4<u32>, b: vec4<u32>) -> vec4<u32> {
    return vec4<u32>(
        float_add(a.x, b.x), float_add(a.y, b.y), float_add(a.z, b.z), float_add(a.w, b.w),
    );
}

// log2 of the lanes that are summed as a balanced tree before they are added.
fn tree_levels() -> u32 {
    switch PROFILE_SUM {
        case SUM_TREE4: {
            return 2u;
        }
        case SUM_TREE8: {
            return 3u;
        }
        default: { // SUM_SEQUENTIAL
            return 0u;
        }
    }
}

// The bias, then tree by tree. `trees` holds at most one finished tree of each size; two of a size
// make the next, the earlier lanes first, as a carry goes through a counter.
fn dense_tree(layer: Layer, source: u32, row: u32) -> vec4<u32> {
    let bias = half_bias(layer, row);
    var sums = vec4<u32>(
        half_to_float(bias.x), half_to_float(bias.y), half_to_float(bias.z), half_to_float(bias.w),
    );
    let levels = tree_levels();
    let width = 1u << levels;
    let end = (layer.inputs + width - 1u) & ~(width - 1u);
    var trees: array<vec4<u32>, 3>;
    for (var lane = 0u; lane < end; lane++) {
        var tree = half_products(layer, source, row, lane);
        var level = 0u;
        while (level < levels && ((lane >> level) & 1u) != 0u) {
            tree = float_add4(trees[level], tree);
            level++;
        }
        if (level == levels) {
            sums = float_add4(sums, tree);
        } else {
            trees[level] = tree;
        }
    }
    return sums;
}

// Every step a fused multiply-add to fp16.
fn dense_fused(layer: Layer, source: u32, row: u32) -> vec4<u32> {
    var sums = half_bias(layer, row);
    for (var lane = 0u; lane < layer.inputs; lane++) {
        let input = half_input(layer, source, lane);
        let factors = half_weights(layer, row, lane);
        sums = vec4<u32>(
            half_fused(factors.x, input, sums.x),
            half_fused(factors.y, input, sums.y),
            half_fused(factors.z, input, sums.z),
            half_fused(factors.w, input, sums.w),
        );
    }
    return vec4<u32>(
        half_to_float(sums.x), half_to_float(sums.y), half_to_float(sums.z), half_to_float(sums.w),
    );
}

// The binary32 sums of an fp16 layer.
fn dense_half(layer: Layer, source: u32, row: u32) -> vec4<u32> {
    if (PROFILE_SUM == SUM_FUSED) {
        return dense_fused(layer, source, row);
    }
    return dense_tree(layer, source, row);
}

// A zero of either sign gives +0.
fn relu_half(sum: u32) -> u32 {
    return select(sum, 0u, (sum & FLOAT_SIGN) != 0u);
}

fn leak_half(sum: u32, shift: u32) -> u32 {
    return select(sum, float_scale(sum, -bitcast<i32>(shift)), float_is_negative(sum));
}

// (x · clamp(2x + 3, 0, 6)) · 1/6, each operation rounded.
fn gate_half(sum: u32, is_clamped: bool) -> u32 {
    let x = select(sum, FLOAT_THREE, is_clamped && float_is_above(sum, FLOAT_THREE));
    var six_gates = float_add(float_scale(x, 1), FLOAT_THREE);
    if (float_is_negative(six_gates)) {
        six_gates = 0u;
    }
    if (float_is_above(six_gates, FLOAT_SIX)) {
        six_gates = FLOAT_SIX;
    }
    return float_multiply(float_multiply(x, six_gates), FLOAT_SIXTH);
}

// The sum after the layer's activation.
fn activate_half(layer: Layer, sum: u32) -> u32 {
    if (has_activation(layer, ACTIVATION_RELU)) {
        return relu_half(sum);
    }
    if (has_activation(layer, ACTIVATION_LEAKY)) {
        return leak_half(sum, layer.leak_shift);
    }
    if (is_gated(layer)) {
        return gate_half(sum, has_activation(layer, ACTIVATION_HARD_GELU_3));
    }
    return sum;
}

// One row of hidden fp16 layer `index`, from sum to activation. The source of its skip path holds
// halves.
fn finish_half(layer: Layer, index: u32, row: u32, sum: u32) {
    let activated = activate_half(layer, sum);
    var joined = activated;
    if (layer.skip_span != 0u) {
        let source = index + 1u - layer.skip_span;
        let half = bitcast<u32>(read_lane(source, layer.skip_lanes, row)) & 0xffffu;
        joined = float_add(activated, half_to_float(half));
    }
    var output = 0i;
    if (layer.output_lanes == LANES_HALVES) {
        // As a register's lane is read: with its first bit as a sign.
        output = extractBits(bitcast<i32>(half_round(joined)), 0u, 16u);
    } else {
        let value = float_to_integer(PROFILE_CONVERT, joined, 1u, layer.quantize_exponent);
        output = to_activation(value, 0, layer.zero_point, layer.output_bits);
    }
    put(layer, index, row, bitcast<i32>(sum), bitcast<i32>(activated), output);
}

// Of an fp16 layer's sum; the largest code of an integer format stands for 1.
fn output_code_half(format: u32, sum: u32) -> i32 {
    if (format == OUTPUT_FLOAT16) {
        return bitcast<i32>(half_round(sum));
    }
    let range = output_range(format);
    let largest = bitcast<u32>(range.y);
    return clamp(float_to_integer(PROFILE_CONVERT, sum, largest, 0), range.x, range.y);
}
