//! Output: accumulators of an integer layer become channel codes.

use ntmu_isa::half::Half;
use ntmu_isa::layer::IntegerParameters;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::saturate;
use ntmu_isa::shape::OutputFormat;

pub(super) fn emit(
    accumulators: &[i32],
    parameters: &IntegerParameters,
    formats: &[OutputFormat],
    requantizer: Requantizer,
    codes: &mut [i32],
) {
    let rows = accumulators.iter().zip(&parameters.scales).zip(formats);
    for (code, ((&accumulator, &scale), format)) in codes.iter_mut().zip(rows) {
        let (low, high) = format.range();
        *code = match format {
            OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                saturate(i64::from(requantizer.apply(accumulator, scale)), low, high)
            }
            OutputFormat::Float16 => {
                let product = i128::from(accumulator) * i128::from(scale.mantissa());
                i32::from(Half::from_fixed(product, u32::from(scale.shift())).bits())
            }
        };
    }
}
