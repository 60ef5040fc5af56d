//! Body of rows: what follows sums that lie in memory, one row of a tile after the other.
//!
//! Compiled once for each instruction set, in the scope of `body`; plain loops, which the compiler
//! turns into that set's vectors.

macro_rules! row_kernels {
    ($(#[$feature:meta])*) => {
        /// Activation and rescaling, in place.
        $(#[$feature])*
        pub(super) fn finish_rows(finish: &Finish, rows: &mut [Sums]) {
            let step = splat_step(&finish.step);
            let scales = finish.scales.as_flattened();
            assert!(rows.len() <= scales.len(), "rows");
            for (row, scale) in rows.iter_mut().zip(scales) {
                let scale = splat_scale(scale);
                for lanes in row.0.as_chunks_mut::<LANES>().0 {
                    let sum = load(lanes);
                    let result = match (finish.step, finish.high) {
                        (Step::Identity, true) => finished::<IDENTITY, true>(sum, &scale, &step),
                        (Step::Relu, true) => finished::<RELU, true>(sum, &scale, &step),
                        (Step::Leaky { .. }, true) => finished::<LEAKY, true>(sum, &scale, &step),
                        (Step::Gate { .. }, true) => finished::<GATE, true>(sum, &scale, &step),
                        (Step::Identity, false) => finished::<IDENTITY, false>(sum, &scale, &step),
                        (Step::Relu, false) => finished::<RELU, false>(sum, &scale, &step),
                        (Step::Leaky { .. }, false) => finished::<LEAKY, false>(sum, &scale, &step),
                        (Step::Gate { .. }, false) => finished::<GATE, false>(sum, &scale, &step),
                    };
                    store(result, lanes);
                }
            }
        }

        /// Adds a rescaled source.
        $(#[$feature])*
        pub(super) fn add_rows(skip: Scale, source: Integers<'_>, rows: &mut [Sums]) {
            let mut values = [0; TILE];
            for (lane, row) in rows.iter_mut().enumerate() {
                source.lane(lane, &mut values);
                for (result, &value) in row.0.iter_mut().zip(&values) {
                    *result += skip.apply(value);
                }
            }
        }

        /// Results as stored bytes.
        $(#[$feature])*
        pub(super) fn pack_quads(rows: &[Sums], (low, high): (i32, i32), output: &mut [Quad]) {
            for (rows, quad) in rows.chunks(4).zip(output) {
                for (lane, row) in rows.iter().enumerate() {
                    for (texel, &value) in quad.0.iter_mut().zip(&row.0) {
                        texel[lane] = (value.clamp(low, high) + 128) as u8;
                    }
                }
            }
        }

        /// Results as words.
        $(#[$feature])*
        pub(super) fn pack_pairs(rows: &[Sums], (low, high): (i32, i32), output: &mut [Pair]) {
            for (rows, pair) in rows.chunks(2).zip(output) {
                for (lane, row) in rows.iter().enumerate() {
                    for (texel, &value) in pair.0.iter_mut().zip(&row.0) {
                        texel[lane] = value.clamp(low, high) as i16;
                    }
                }
            }
        }
    };
}

/// Texel after texel becomes lane after lane, for sets that have no better way.
macro_rules! bring_kernel {
    ($(#[$feature:meta])*) => {
        $(#[$feature])*
        pub(super) fn bring(inputs: &[i8], count: usize, output: &mut [Quad]) {
            for (texel, row) in inputs.chunks_exact(count).take(TILE).enumerate() {
                let (whole, rest) = row.as_chunks::<4>();
                for (quad, lanes) in output.iter_mut().zip(whole) {
                    quad.0[texel] = lanes.map(|lane| lane as u8 ^ 0x80);
                }
                if !rest.is_empty() {
                    for (to, &lane) in output[whole.len()].0[texel].iter_mut().zip(rest) {
                        *to = lane as u8 ^ 0x80;
                    }
                }
            }
        }
    };
}

pub(super) use {bring_kernel, row_kernels};
