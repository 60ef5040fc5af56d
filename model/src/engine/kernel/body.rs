//! Body: the kernels, written once over the primitives of an instruction set.
//!
//! A module that invokes [`kernels`] has in scope: `LANES`, `VECTORS`, the types `V` (lanes of
//! `i32`), `Q` (quads of bytes, ready to multiply), `W` (a row's four weights, ready to multiply),
//! `F` (lanes of `f32`), and the functions on them. `VECTORS · BLOCK_ROWS` accumulators fit the
//! registers. The attribute names the features that all of them need.

/// The block once for each row of a block of rows, with its number as a constant. A loop of this size
/// is not unrolled by the compiler, and sums that a loop indexes live in memory.
macro_rules! each_row {
    ($row:ident => $body:block) => {{
        each_row!(@ $row 0 $body);
        each_row!(@ $row 1 $body);
        each_row!(@ $row 2 $body);
        each_row!(@ $row 3 $body);
    }};
    (@ $row:ident $number:literal $body:block) => {{
        const $row: usize = $number;
        $body
    }};
}

macro_rules! kernels {
    ($(#[$feature:meta])*) => {
        use crate::engine::kernel::tile::{
            BLOCK_ROWS, Finish, GROUP_ROWS, Halves, Integers, Pair, Quad, Scale, ScaleGroup, Step, Sums,
            TILE,
        };
        use crate::engine::kernel::weights::{Dense16, Dense8, DenseHalf, HalfOrder};
        use crate::engine::kernel::half::{HalfStep, HalfToInteger};

        const IDENTITY: u8 = 0;
        const RELU: u8 = 1;
        const LEAKY: u8 = 2;
        const GATE: u8 = 3;

        type Accumulators = [[V; VECTORS]; BLOCK_ROWS];

        /// Texels of a tile that are in registers at once.
        const PART: usize = LANES * VECTORS;

        $(#[$feature])*
        #[inline]
        fn sums8(weights: &[PackedWeights], bias: &[i32; BLOCK_ROWS], input: &[Quad], part: usize)
            -> Accumulators
        {
            let mut sums: Accumulators = [[splat(0); VECTORS]; BLOCK_ROWS];
            each_row!(R => { sums[R] = [splat(bias[R]); VECTORS]; });
            for (quad, weights) in input.iter().zip(weights) {
                let texels: &[[[u8; 4]; LANES]] = quad.0.as_chunks().0;
                let texels = &texels[part * VECTORS..][..VECTORS];
                let mut x = [load_quads(&texels[0]); VECTORS];
                for v in 0..VECTORS {
                    x[v] = load_quads(&texels[v]);
                }
                each_row!(R => {
                    let w = splat_weights(&weights[R]);
                    for v in 0..VECTORS {
                        sums[R][v] = dot(sums[R][v], x[v], w);
                    }
                });
            }
            sums
        }

        $(#[$feature])*
        #[inline]
        fn sums16(
            weights: &[[[i16; 2]; BLOCK_ROWS]],
            bias: &[i32; BLOCK_ROWS],
            input: &[Pair],
            part: usize,
        ) -> Accumulators {
            let mut sums: Accumulators = [[splat(0); VECTORS]; BLOCK_ROWS];
            for r in 0..BLOCK_ROWS {
                sums[r] = [splat(bias[r]); VECTORS];
            }
            for (pair, weights) in input.iter().zip(weights) {
                let texels: &[[[i16; 2]; LANES]] = pair.0.as_chunks().0;
                let texels = &texels[part * VECTORS..][..VECTORS];
                let mut x = [load_pairs(&texels[0]); VECTORS];
                for v in 0..VECTORS {
                    x[v] = load_pairs(&texels[v]);
                }
                for r in 0..BLOCK_ROWS {
                    let w = splat_pair(weights[r]);
                    for v in 0..VECTORS {
                        sums[r][v] = dot_pairs(sums[r][v], x[v], w);
                    }
                }
            }
            sums
        }

        /// Activation and rescaling of one vector; the step and whether all shifts are at least 32
        /// are known when this is compiled.
        $(#[$feature])*
        #[inline]
        fn finished<const STEP: u8, const HIGH: bool>(sum: V, scale: &Splat, step: &SplatStep) -> V {
            match STEP {
                RELU => rescale::<HIGH>(max(sum, splat(0)), scale),
                LEAKY => {
                    let leaked = shift_lanes(add(sum, step.half), step.shift);
                    rescale::<HIGH>(max(sum, leaked), scale)
                }
                GATE => rescale::<HIGH>(gate(rescale::<HIGH>(sum, scale), step.limit), &step.gate),
                _ => rescale::<HIGH>(sum, scale),
            }
        }

        /// The parameters of a step in every lane.
        struct SplatStep {
            half: V,
            shift: V,
            gate: Splat,
            limit: V,
        }

        $(#[$feature])*
        #[inline]
        fn splat_step(step: &Step) -> SplatStep {
            let (half, shift, gate, limit) = match step {
                Step::Identity | Step::Relu => (0, 0, &Scale::NONE, 0),
                Step::Leaky { shift, half } => (*half, *shift, &Scale::NONE, 0),
                Step::Gate { scale, limit } => (0, 0, scale, *limit),
            };
            SplatStep {
                half: splat(half),
                shift: splat(shift as i32),
                gate: splat_scale(gate),
                limit: splat(limit),
            }
        }

        /// Activation and rescaling of a block, where speed matters less.
        $(#[$feature])*
        fn activate<const HIGH: bool>(sums: &mut Accumulators, finish: &Finish, block: usize) {
            let step = splat_step(&finish.step);
            for (row, scale) in sums.iter_mut().zip(&finish.scales[block]) {
                let scale = splat_scale(scale);
                for sum in row {
                    *sum = match finish.step {
                        Step::Identity => finished::<IDENTITY, HIGH>(*sum, &scale, &step),
                        Step::Relu => finished::<RELU, HIGH>(*sum, &scale, &step),
                        Step::Leaky { .. } => finished::<LEAKY, HIGH>(*sum, &scale, &step),
                        Step::Gate { .. } => finished::<GATE, HIGH>(*sum, &scale, &step),
                    };
                }
            }
        }

        /// The product of a hard GELU, see `ntmu_isa::activation::gate`.
        $(#[$feature])*
        #[inline]
        fn gate(argument: V, limit: V) -> V {
            let x = max(min(argument, limit), splat(-32_768));
            let six_gates = max(min(add(add(x, x), splat(768)), splat(1536)), splat(0));
            multiply(x, six_gates)
        }

        /// One 8-bit layer of a tile, 8-bit results.
        $(#[$feature])*
        pub(super) fn dense8(
            layer: &Dense8,
            finish: &Finish,
            input: &[Quad],
            source: Option<&[Quad]>,
            output: &mut [Quad],
        ) {
            let run = match (finish.step, finish.high) {
                (Step::Identity, true) => dense8_as::<IDENTITY, true>,
                (Step::Relu, true) => dense8_as::<RELU, true>,
                (Step::Leaky { .. }, true) => dense8_as::<LEAKY, true>,
                (Step::Gate { .. }, true) => dense8_as::<GATE, true>,
                (Step::Identity, false) => dense8_as::<IDENTITY, false>,
                (Step::Relu, false) => dense8_as::<RELU, false>,
                (Step::Leaky { .. }, false) => dense8_as::<LEAKY, false>,
                (Step::Gate { .. }, false) => dense8_as::<GATE, false>,
            };
            run(layer, finish, input, source, output);
        }

        $(#[$feature])*
        fn dense8_as<const STEP: u8, const HIGH: bool>(
            layer: &Dense8,
            finish: &Finish,
            input: &[Quad],
            source: Option<&[Quad]>,
            output: &mut [Quad],
        ) {
            let step = splat_step(&finish.step);
            let skip = finish.skip.as_ref().map(|scale| splat_scale(scale));
            let weights = packed(layer).chunks_exact(layer.quads);
            for (block, (weights, bias)) in weights.zip(&layer.bias).enumerate() {
                let scales = &finish.scales[block];
                let results: &mut [[[u8; 4]; LANES]] = output[block].0.as_chunks_mut().0;
                for (part, results) in results.chunks_exact_mut(VECTORS).enumerate() {
                    let mut sums = sums8(weights, bias, input, part);
                    each_row!(R => {
                        let scale = splat_scale(&scales[R]);
                        for v in 0..VECTORS {
                            sums[R][v] = finished::<STEP, HIGH>(sums[R][v], &scale, &step);
                        }
                    });
                    if let (Some(scale), Some(source)) = (&skip, source) {
                        let texels: &[[[u8; 4]; LANES]] = source[block].0.as_chunks().0;
                        let texels = &texels[part * VECTORS..][..VECTORS];
                        each_row!(R => {
                            for v in 0..VECTORS {
                                let byte = upper_byte::<R>(load_bytes(&texels[v]));
                                sums[R][v] = add(sums[R][v], rescale_byte(byte, scale));
                            }
                        });
                    }
                    if finish.clamps {
                        clamp(&mut sums, finish, block);
                    }
                    for v in 0..VECTORS {
                        store_bytes([sums[0][v], sums[1][v], sums[2][v], sums[3][v]], &mut results[v]);
                    }
                }
            }
        }

        /// Byte `ROW` of the quads at bits 16..24 of its lane, see `Scale::fold_skip`.
        $(#[$feature])*
        #[inline]
        fn upper_byte<const ROW: usize>(quads: V) -> V {
            let shifted = match ROW {
                0 => shift_left_16(quads),
                1 => shift_left_8(quads),
                2 => quads,
                _ => shift_right_8(quads),
            };
            and(shifted, splat(0xff_0000))
        }

        $(#[$feature])*
        #[inline]
        fn rescale<const HIGH: bool>(value: V, scale: &Splat) -> V {
            if HIGH { rescale_high(value, scale) } else { rescale_low(value, scale) }
        }

        /// One 8-bit layer of a tile, results at 32 bits clamped to the rows' ranges.
        $(#[$feature])*
        pub(super) fn emit8(layer: &Dense8, finish: &Finish, input: &[Quad], output: &mut [Sums]) {
            let weights = packed(layer).chunks_exact(layer.quads);
            for (block, (weights, bias)) in weights.zip(&layer.bias).enumerate() {
                for part in 0..TILE / PART {
                    let mut sums = sums8(weights, bias, input, part);
                    match finish.high {
                        true => activate::<true>(&mut sums, finish, block),
                        false => activate::<false>(&mut sums, finish, block),
                    }
                    clamp(&mut sums, finish, block);
                    store_rows(&sums, block, part, output);
                }
            }
        }

        /// The sums of one 8-bit layer of a tile.
        $(#[$feature])*
        pub(super) fn raw8(layer: &Dense8, input: &[Quad], output: &mut [Sums]) {
            let weights = packed(layer).chunks_exact(layer.quads);
            for (block, (weights, bias)) in weights.zip(&layer.bias).enumerate() {
                for part in 0..TILE / PART {
                    let sums = sums8(weights, bias, input, part);
                    store_rows(&sums, block, part, output);
                }
            }
        }

        $(#[$feature])*
        #[inline]
        fn clamp(sums: &mut Accumulators, finish: &Finish, block: usize) {
            for r in 0..BLOCK_ROWS {
                let (low, high) = finish.clamp[block][r];
                for v in 0..VECTORS {
                    sums[r][v] = max(min(sums[r][v], splat(high)), splat(low));
                }
            }
        }

        $(#[$feature])*
        #[inline]
        fn store_rows(sums: &Accumulators, block: usize, part: usize, output: &mut [Sums]) {
            let rows = output.iter_mut().skip(block * BLOCK_ROWS).zip(sums);
            for (row, sums) in rows {
                let lanes: &mut [[i32; LANES]] = row.0.as_chunks_mut().0;
                for (lanes, &sum) in lanes[part * VECTORS..].iter_mut().zip(sums) {
                    store(sum, lanes);
                }
            }
        }

        /// One layer of a tile with values of up to 16 bits, results clamped to the rows' ranges.
        $(#[$feature])*
        pub(super) fn dense16(
            layer: &Dense16,
            finish: &Finish,
            input: &[Pair],
            output: &mut [Pair],
        ) {
            let weights = layer.weights.chunks_exact(layer.pairs);
            for (block, (weights, bias)) in weights.zip(&layer.bias).enumerate() {
                for part in 0..TILE / PART {
                    let mut sums = sums16(weights, bias, input, part);
                    match finish.high {
                        true => activate::<true>(&mut sums, finish, block),
                        false => activate::<false>(&mut sums, finish, block),
                    }
                    clamp(&mut sums, finish, block);
                    for (pair, rows) in output.iter_mut().skip(2 * block).zip([[0, 1], [2, 3]]) {
                        let lanes: &mut [[[i16; 2]; LANES]] = pair.0.as_chunks_mut().0;
                        let lanes = &mut lanes[part * VECTORS..][..VECTORS];
                        for v in 0..VECTORS {
                            store_pairs(sums[rows[0]][v], sums[rows[1]][v], &mut lanes[v]);
                        }
                    }
                }
            }
        }

        /// The sums of one layer of a tile with values of up to 16 bits, modulo 2^32.
        $(#[$feature])*
        pub(super) fn raw16(layer: &Dense16, input: &[Pair], output: &mut [Sums]) {
            let weights = layer.weights.chunks_exact(layer.pairs);
            for (block, (weights, bias)) in weights.zip(&layer.bias).enumerate() {
                for part in 0..TILE / PART {
                    let sums = sums16(weights, bias, input, part);
                    store_rows(&sums, block, part, output);
                }
            }
        }

        /// The sums of one 8-bit layer of one texel; `input` are stored bytes.
        $(#[$feature])*
        pub(super) fn row_sums(layer: &Dense8, input: &[[u8; 4]], output: &mut [[i32; GROUP_ROWS]]) {
            const PARTS: usize = GROUP_ROWS / LANES;
            let groups = layer.groups.chunks_exact(layer.quads).zip(&layer.group_bias);
            for ((weights, bias), output) in groups.zip(output) {
                let bias: &[[i32; LANES]] = bias.as_chunks().0;
                let mut sums = [splat(0); PARTS];
                for p in 0..PARTS {
                    sums[p] = load(&bias[p]);
                }
                for (&x, weights) in input.iter().zip(weights) {
                    let x = splat_quad(x);
                    let rows: &[[[i8; 4]; LANES]] = weights.as_chunks().0;
                    for p in 0..PARTS {
                        sums[p] = dot_rows(sums[p], x, &rows[p]);
                    }
                }
                let lanes: &mut [[i32; LANES]] = output.as_chunks_mut().0;
                for p in 0..PARTS {
                    store(sums[p], &mut lanes[p]);
                }
            }
        }

        /// Activation, rescaling and skip path of one texel, in place; clamps nothing.
        $(#[$feature])*
        pub(super) fn row_finish(
            finish: &Finish,
            source: Option<&[u8]>,
            sums: &mut [[i32; GROUP_ROWS]],
        ) {
            let step = splat_step(&finish.step);
            let skip = finish.skip.as_ref().map(|scale| splat_scale(scale));
            for (index, (sums, group)) in sums.iter_mut().zip(&finish.groups).enumerate() {
                for (part, lanes) in sums.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                    let mut sum = load(lanes);
                    sum = match finish.step {
                        Step::Identity | Step::Gate { .. } => sum,
                        Step::Relu => max(sum, splat(0)),
                        Step::Leaky { .. } => {
                            max(sum, shift_lanes(add(sum, step.half), step.shift))
                        }
                    };
                    sum = rescale_rows(sum, group, part);
                    if let Step::Gate { .. } = &finish.step {
                        sum = match finish.high {
                            true => rescale::<true>(gate(sum, step.limit), &step.gate),
                            false => rescale::<false>(gate(sum, step.limit), &step.gate),
                        };
                    }
                    if let (Some(scale), Some(source)) = (&skip, source) {
                        let mut bytes = [0; LANES];
                        let source = &source[index * GROUP_ROWS + part * LANES..];
                        for (lane, &byte) in bytes.iter_mut().zip(source) {
                            *lane = i32::from(byte) << 16;
                        }
                        sum = add(sum, rescale_byte(load(&bytes), scale));
                    }
                    store(sum, lanes);
                }
            }
        }

        /// Σ weight · code of four cells, plus `addend`, shifted down: stored bytes of one texel.
        ///
        /// The weights are in 1/256 and sum to 256, so a sum of codes fits 16 bits.
        $(#[$feature])*
        pub(super) fn interpolate(
            cells: [&[u8]; 4],
            weights: [u16; 4],
            addend: i32,
            shift: u32,
            output: &mut [u8],
        ) {
            let n = output.len();
            let (a, b) = (&cells[0][..n], &cells[1][..n]);
            let (c, d) = (&cells[2][..n], &cells[3][..n]);
            for at in 0..n {
                let sum = weights[0] * u16::from(a[at])
                    + weights[1] * u16::from(b[at])
                    + weights[2] * u16::from(c[at])
                    + weights[3] * u16::from(d[at]);
                output[at] = ((i32::from(sum) + addend) >> shift) as u8;
            }
        }
    };
}

pub(super) use {each_row, kernels};
