// Grid position: which cells of which level surround a texel of a mip. See isa/src/position.rs.

struct AxisPosition {
    first: i32, // cells; may lie outside the grid
    stride: u32, // cells
    phase: u32, // sixteenths, 0..16
}

struct Corners {
    level: vec4<u32>, // of the grid, as `Grid` has it
    x: AxisPosition,
    y: AxisPosition,
    columns: vec2<u32>,
    rows: vec2<u32>,
}

fn axis_position(texel: u32, mip: u32, scale_log2: u32, snap: u32) -> AxisPosition {
    // One cell is 2^(scale + 1) units of g; the stride is 2^stride_log2 cells.
    let cell_log2 = scale_log2 + 1u;
    let stride_log2 = max(mip, scale_log2) - scale_log2;
    let centre = bitcast<i32>(((texel << 1u) | 1u) << mip) - (1i << scale_log2);
    var first = centre >> cell_log2;
    if (snap == SNAP_STRIDE) {
        first = first & ~((1i << stride_log2) - 1);
    }
    let inside = centre - (first << cell_log2);
    let phase = (inside << PHASE_BITS) >> (cell_log2 + stride_log2);
    return AxisPosition(first, 1u << stride_log2, bitcast<u32>(phase));
}

// The remainder that is never negative.
fn euclid(cell: i32, period: i32) -> i32 {
    let remainder = cell % period;
    return select(remainder, remainder + period, remainder < 0);
}

fn address_resolve(mode: u32, cell: i32, size: u32) -> u32 {
    let count = bitcast<i32>(size);
    switch mode {
        case ADDRESS_WRAP: {
            return bitcast<u32>(euclid(cell, count));
        }
        case ADDRESS_MIRROR: {
            let folded = euclid(cell, 2 * count);
            return bitcast<u32>(min(folded, 2 * count - 1 - folded));
        }
        default: { // ADDRESS_CLAMP
            return bitcast<u32>(clamp(cell, 0, count - 1));
        }
    }
}

fn axis_corners(axis: AxisPosition, size: u32, mode: u32) -> vec2<u32> {
    let second = axis.first + bitcast<i32>(axis.stride);
    return vec2<u32>(address_resolve(mode, axis.first, size), address_resolve(mode, second, size));
}

// The level of the grids that serves a mip, and the mip that lies in level 0 as this one lies in its
// level: each level halves the grid as many times as it serves mips. See isa/src/pyramid.rs.
fn pyramid_level(pyramid: u32, mip: u32) -> vec2<u32> {
    let first = pyramid >> 4u;
    let each = pyramid & 15u;
    if (each == 0u || mip < first) {
        return vec2<u32>(0u, mip);
    }
    let beyond = mip - first;
    return vec2<u32>(beyond / each + 1u, first - each + beyond % each);
}

fn position(grid: u32, request: Request) -> Corners {
    let served = pyramid_level(header.pyramid, request.mip);
    let level = header.grids[grid].levels[served.x];
    let scale_log2 = header.grids[grid].scale_log2;
    let first_tap = header.grids[grid].tap;
    let x = axis_position(request.x, served.y, scale_log2, header.snap);
    let y = axis_position(request.y, served.y, scale_log2, header.snap);
    let columns = axis_corners(x, level.x, header.address_mode);
    let rows = axis_corners(y, level.y, header.address_mode);
    tap(first_tap, x.first);
    tap(first_tap + 1u, bitcast<i32>(x.stride));
    tap(first_tap + 2u, bitcast<i32>(x.phase));
    tap(first_tap + 3u, y.first);
    tap(first_tap + 4u, bitcast<i32>(y.stride));
    tap(first_tap + 5u, bitcast<i32>(y.phase));
    tap(first_tap + 6u, bitcast<i32>(columns.x));
    tap(first_tap + 7u, bitcast<i32>(columns.y));
    tap(first_tap + 8u, bitcast<i32>(rows.x));
    tap(first_tap + 9u, bitcast<i32>(rows.y));
    return Corners(level, x, y, columns, rows);
}
