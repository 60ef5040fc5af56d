// Fetch: the code of one channel of one cell, of levels that are linear and follow each other.

// The byte addresses of the four corners (0,0), (1,0), (0,1), (1,1) within their grid.
fn corner_addresses(grid: u32, corners: Corners) -> vec4<u32> {
    let width = corners.level.x;
    let cells = corners.level.z + vec4<u32>(
        corners.rows.x * width + corners.columns.x,
        corners.rows.x * width + corners.columns.y,
        corners.rows.y * width + corners.columns.x,
        corners.rows.y * width + corners.columns.y,
    );
    return cells * header.grids[grid].cell_bytes;
}

fn grid_word(grid: u32, index: u32) -> u32 {
    if (grid == 0u) {
        return grid0[index];
    }
    return grid1[index];
}

// The code of a channel of the cell at a byte address; `corner` is 0..4, for the tap.
fn fetch(grid: u32, address: u32, channel: u32, corner: u32) -> u32 {
    let bits = header.grids[grid].bits;
    // Byte and bit are kept apart: the bit address of a large grid needs more than 32 bits.
    let bit = (address & 3u) * 8u + channel * bits;
    let word = (address >> 2u) + (bit >> 5u);
    let offset = bit & 31u;
    let low = grid_word(grid, word);
    var high = 0u;
    if (offset + bits > 32u) {
        high = grid_word(grid, word + 1u);
    }
    let code = unpack(low, high, offset, bits);
    let place = corner * header.grids[grid].channels + channel;
    tap(header.grids[grid].tap + TAP_CORNER_WORDS + place, bitcast<i32>(code));
    return code;
}
