//! Body of halves: the kernels of fp16 layers, in the scope of `body`.
//!
//! A product of two fp16 values is exact in `f32`, so a fused multiply-add and a multiplication with
//! an addition give the same bits, the sign of a zero included.

macro_rules! half_kernels {
    ($(#[$feature:meta])*) => {
        /// The sums of one fp16 layer of a tile, bias first, groups of products ascending.
        $(#[$feature])*
        pub(super) fn half_sums(layer: &DenseHalf, input: &[Halves], output: &mut [Halves]) {
            match layer.order {
                HalfOrder::Sequential => half_sums_as::<1>(layer, input, output),
                HalfOrder::Tree4 => half_sums_as::<4>(layer, input, output),
                HalfOrder::Tree8 => half_sums_as::<8>(layer, input, output),
            }
        }

        $(#[$feature])*
        fn half_sums_as<const GROUP: usize>(
            layer: &DenseHalf,
            input: &[Halves],
            output: &mut [Halves],
        ) {
            assert!(input.len() <= layer.inputs, "inputs");
            let weights = layer.weights.chunks_exact(layer.inputs);
            for (block, (weights, bias)) in weights.zip(&layer.bias).enumerate() {
                for part in 0..TILE / PART {
                    let mut sums = [[splat_f32(0.0); VECTORS]; BLOCK_ROWS];
                    for r in 0..BLOCK_ROWS {
                        sums[r] = [splat_f32(bias[r]); VECTORS];
                    }
                    for (lanes, weights) in input.chunks(GROUP).zip(weights.chunks_exact(GROUP)) {
                        if GROUP == 1 {
                            let x = half_lanes(&lanes[0], part);
                            each_row!(R => {
                                let w = splat_f32(weights[0][R]);
                                for v in 0..VECTORS {
                                    sums[R][v] = multiply_add(x[v], w, sums[R][v]);
                                }
                            });
                            continue;
                        }
                        let mut x = [[splat_f32(0.0); VECTORS]; GROUP];
                        for (x, lane) in x.iter_mut().zip(lanes) {
                            *x = half_lanes(lane, part);
                        }
                        each_row!(R => {
                            for v in 0..VECTORS {
                                let pair = |k: usize| {
                                    let first = multiply_f32(x[k][v], splat_f32(weights[k][R]));
                                    multiply_add(x[k + 1][v], splat_f32(weights[k + 1][R]), first)
                                };
                                let four = |k: usize| add_f32(pair(k), pair(k + 2));
                                let group = if GROUP == 8 { add_f32(four(0), four(4)) } else { four(0) };
                                sums[R][v] = add_f32(sums[R][v], group);
                            }
                        });
                    }
                    let rows = output.iter_mut().skip(block * BLOCK_ROWS).zip(&sums);
                    for (row, sums) in rows {
                        let lanes: &mut [[f32; LANES]] = row.0.as_chunks_mut().0;
                        for (lanes, &sum) in lanes[part * VECTORS..].iter_mut().zip(sums) {
                            store_f32(sum, lanes);
                        }
                    }
                }
            }
        }

        $(#[$feature])*
        #[inline]
        fn half_lanes(lane: &Halves, part: usize) -> [F; VECTORS] {
            let texels: &[[f32; LANES]] = lane.0.as_chunks().0;
            let texels = &texels[part * VECTORS..][..VECTORS];
            let mut x = [splat_f32(0.0); VECTORS];
            for v in 0..VECTORS {
                x[v] = load_f32(&texels[v]);
            }
            x
        }

        /// Activation, skip path, and the rounding to fp16 if there is one.
        $(#[$feature])*
        pub(super) fn half_finish(
            step: HalfStep,
            source: Option<&[Halves]>,
            is_rounded: bool,
            rows: &mut [Halves],
        ) {
            for (lane, row) in rows.iter_mut().enumerate() {
                match step {
                    HalfStep::Identity => {}
                    HalfStep::Relu => row.0.iter_mut().for_each(|x| *x = HalfStep::relu(*x)),
                    HalfStep::Leaky { slope } => {
                        row.0.iter_mut().for_each(|x| *x = HalfStep::leaky(*x, slope));
                    }
                    HalfStep::Gate { limit } => {
                        row.0.iter_mut().for_each(|x| *x = HalfStep::gate(*x, limit));
                    }
                }
                if let Some(source) = source {
                    row.0.iter_mut().zip(&source[lane].0).for_each(|(x, from)| *x += from);
                }
                if is_rounded {
                    for lanes in row.0.as_chunks_mut::<LANES>().0 {
                        round_lanes(lanes);
                    }
                }
            }
        }

        /// Finished sums as integers.
        $(#[$feature])*
        pub(super) fn half_integers(rule: HalfToInteger, sums: &Halves, output: &mut Sums) {
            for (value, &sum) in output.0.iter_mut().zip(&sums.0) {
                *value = rule.apply(sum);
            }
        }

        /// Integers as fp16 values. Less its zero an integer has 17 bits: exact in `f32`, as is its
        /// product with a power of two.
        $(#[$feature])*
        pub(super) fn half_inputs(
            input: Integers<'_>,
            zero: i32,
            factor: f32,
            output: &mut [Halves],
        ) {
            let mut values = [0; TILE];
            for (lane, halves) in output.iter_mut().enumerate() {
                input.lane(lane, &mut values);
                for (half, &value) in halves.0.iter_mut().zip(&values) {
                    *half = (value - zero) as f32 * factor;
                }
                // Less its zero a byte has nine bits, which fp16 holds exactly.
                if let Integers::Pairs(_) = input {
                    for lanes in halves.0.as_chunks_mut::<LANES>().0 {
                        round_lanes(lanes);
                    }
                }
            }
        }
    };
}

/// Rounding to fp16, for sets without an instruction for it.
macro_rules! round_kernel {
    ($(#[$feature:meta])*) => {
        $(#[$feature])*
        #[inline]
        fn round_lanes(lanes: &mut [f32; LANES]) {
            for lane in lanes {
                *lane = crate::engine::kernel::half::round_to_half(*lane);
            }
        }
    };
}

pub(super) use {half_kernels, round_kernel};
