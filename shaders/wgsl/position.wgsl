// Grid position: which cells surround a texel of a mip. See isa/src/position.rs.

struct AxisPosition {
    first: i32, // cells; may lie outside the grid
    stride: u32, // cells
    phase: u32, // sixteenths, 0..16
}

struct Corners {
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

fn position(grid: u32, request: Request) -> Corners {
    let shape = header.grids[grid];
    let x = axis_position(request.x, request.mip, shape.scale_log2, header.snap);
    let y = axis_position(request.y, request.mip, shape.scale_log2, header.snap);
    let columns = axis_corners(x, shape.width, header.address_mode);
    let rows = axis_corners(y, shape.height, header.address_mode);
    tap(shape.tap, x.first);
    tap(shape.tap + 1u, bitcast<i32>(x.stride));
    tap(shape.tap + 2u, bitcast<i32>(x.phase));
    tap(shape.tap + 3u, y.first);
    tap(shape.tap + 4u, bitcast<i32>(y.stride));
    tap(shape.tap + 5u, bitcast<i32>(y.phase));
    tap(shape.tap + 6u, bitcast<i32>(columns.x));
    tap(shape.tap + 7u, bitcast<i32>(columns.y));
    tap(shape.tap + 8u, bitcast<i32>(rows.x));
    tap(shape.tap + 9u, bitcast<i32>(rows.y));
    return Corners(x, y, columns, rows);
}
