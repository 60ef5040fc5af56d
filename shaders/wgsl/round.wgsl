// Rounding: the only place where an integer loses its low bits. See isa/src/round.rs.

// Whether the floor of a quotient goes up by one. `half` is the first bit that is lost, `rest`
// tells whether any bit after it is set: together they place the quotient below, on or above the
// tie, whatever its sign.
fn rounding_up(mode: u32, half: bool, rest: bool, floor_is_odd: bool, is_negative: bool) -> bool {
    switch mode {
        case ROUNDING_HALF_UP: {
            return half;
        }
        case ROUNDING_HALF_EVEN: {
            return half && (rest || floor_is_odd);
        }
        case ROUNDING_HALF_AWAY: {
            return half && (rest || !is_negative);
        }
        default: { // ROUNDING_FLOOR
            return false;
        }
    }
}

// value / 2^shift, 0 ≤ shift < 32.
fn rounding_shift(mode: u32, value: i32, shift: u32) -> i32 {
    if (shift == 0u) {
        return value;
    }
    let bits = bitcast<u32>(value);
    let half = 1u << (shift - 1u);
    let floor = value >> shift;
    let up = rounding_up(
        mode,
        (bits & half) != 0u,
        (bits & (half - 1u)) != 0u,
        (floor & 1) != 0,
        value < 0,
    );
    return floor + select(0, 1, up);
}

// value / 2^shift, 0 ≤ shift ≤ 62.
fn rounding_shift_wide(mode: u32, value: Wide, shift: u32) -> Wide {
    if (shift == 0u) {
        return value;
    }
    let doubled = wide_shift_floor(value, shift - 1u);
    let floor = wide_shift_floor(doubled, 1u);
    let up = rounding_up(
        mode,
        (doubled.low & 1u) != 0u,
        wide_any_below(value, shift - 1u),
        (floor.low & 1u) != 0u,
        wide_is_negative(value),
    );
    return wide_add(floor, Wide(select(0u, 1u, up), 0u));
}

// a + b, saturated to 32 bits.
fn saturating_add(a: i32, b: i32) -> i32 {
    return wide_saturate(wide_add(wide(a), wide(b)));
}
