//! What the wall is made of: height, colour and roughness of a place.

use super::masonry::{COURSES, Place, locate};
use super::noise::{Cell, cellular, fractal, gradient, hash, mix, smooth, unit};

/// The wall at one place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// 0 (deep) to 1.
    pub(super) height: f64,
    /// sRGB codes, 0 to 255, as real numbers.
    pub(super) color: [f64; 3],
    /// 0 (mirror) to 1.
    pub(super) roughness: f64,
}

/// Fired clay, as sRGB codes.
const CLAY: [[f64; 3]; 7] = [
    [150.0, 82.0, 64.0],
    [130.0, 66.0, 54.0],
    [164.0, 100.0, 74.0],
    [112.0, 68.0, 60.0],
    [176.0, 124.0, 96.0],
    [140.0, 74.0, 66.0],
    [92.0, 68.0, 64.0],
];
const MORTAR: [f64; 3] = [170.0, 161.0, 146.0];
const SALT: [f64; 3] = [206.0, 199.0, 190.0];
const SOOT: [f64; 3] = [58.0, 52.0, 49.0];
const MOSS: [[f64; 3]; 2] = [[58.0, 72.0, 30.0], [124.0, 132.0, 62.0]];

/// The wall at (`u`, `v`), both in tiles, for an image of `size` texels a tile.
pub(super) fn at(seed: u64, u: f64, v: f64, size: u32) -> Surface {
    let place = locate(seed, u, v);
    let on_brick = smooth(-place.edge / 0.085);
    let clay = brick(&place);
    let joint = mortar(seed, u, v, place.edge, size);
    let mut surface = Surface {
        height: mix(joint.height, clay.height, on_brick * (2.0 - on_brick)),
        color: blend(joint.color, clay.color, smooth(-place.edge / 0.03)),
        roughness: mix(joint.roughness, clay.roughness, smooth(-place.edge / 0.03)),
    };
    // Worn edges are lighter than the fired face.
    let arris = smooth(-place.edge / 0.04) * (1.0 - smooth((-place.edge - 0.03) / 0.07));
    surface.color = surface.color.map(|c| c * (1.0 + 0.13 * arris));
    crack(seed, u, v, &mut surface);
    weather(seed, u, v, on_brick, &mut surface);
    moss(seed, u, v, &place, size, &mut surface);
    grain(seed, u, v, size, &mut surface);
    surface
}

fn blend(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    [mix(a[0], b[0], t), mix(a[1], b[1], t), mix(a[2], b[2], t)]
}

fn brick(place: &Place) -> Surface {
    let &Place {
        brick, x, y, along, ..
    } = place;
    let batch = hash(brick, 10, 0);
    let face = hash(brick, 11, 0);
    let pick = |lane: u32| CLAY[(unit(batch, lane) * CLAY.len() as f64) as usize];
    let base = blend(pick(0), pick(1), 0.5 * unit(batch, 2));
    let clouds = fractal(hash(brick, 12, 0), x * 1.3, y * 1.6, None, 5);
    let fine = fractal(hash(brick, 13, 0), x * 9.0, y * 9.0, None, 3);
    let mut shade = (0.86 + 0.28 * unit(batch, 3)) * (1.0 + 0.20 * clouds + 0.09 * fine);
    // Ends that touched the fire are burnt dark on some bricks.
    let burnt = if unit(face, 0) < 0.35 {
        smooth((along.abs() + 0.35 * clouds - 0.45) / 0.6) * 0.5
    } else {
        0.0
    };
    shade *= 1.0 - 0.45 * burnt;
    let mut color = base.map(|c| c * shade);

    let mut height = 0.76 + 0.09 * (unit(face, 1) - 0.5);
    height += 0.035 * (unit(face, 2) - 0.5) * x + 0.09 * (unit(face, 3) - 0.5) * y;
    height += 0.040 * clouds + 0.030 * fine;
    let cut = hash(brick, 14, 0);
    if unit(cut, 0) < 0.45 {
        // Drag marks of the cutting wire.
        height += 0.014 * gradient(cut, x * 1.1, y * 15.0 + 0.6 * clouds, None);
    }
    // Few pores are large and most places have none; noise takes away their roundness.
    let ragged = 0.16 * fine;
    let pores = cellular(hash(brick, 15, 0), x * 5.0, y * 5.0, None);
    let chance = unit(pores.word, 2) / (0.10 + 0.30 * unit(cut, 1));
    let pore = 1.0 - smooth((pores.nearest + ragged - 0.24 * (1.0 - chance)) / 0.12 + 0.5);
    height -= 0.15 * pore;
    color = color.map(|c| c * (1.0 - 0.45 * pore));
    let specks = cellular(hash(brick, 16, 0), x * 12.0, y * 12.0, None);
    let reach = 0.30 * unit(specks.word, 3) * unit(specks.word, 3);
    let speck = 1.0 - smooth((specks.nearest + ragged - reach) / 0.14 + 0.5);
    color = match unit(specks.word, 2) {
        iron if iron < 0.30 => blend(color, SOOT, 0.65 * speck),
        grog if grog > 0.70 => blend(color, [206.0, 170.0, 142.0], 0.55 * speck),
        _ => color,
    };
    // Where the fired skin has come off, rough paler clay shows.
    let spall = gradient(hash(brick, 17, 0), x * 1.9, y * 1.9, None) + 0.35 * fine;
    let skin = smooth((spall - 0.42) / 0.10);
    height -= skin * (0.07 - 0.05 * fine);
    color = blend(
        color,
        base.map(|c| 0.80 * c + 34.0 + 26.0 * fine),
        0.6 * skin,
    );
    let glaze = if unit(cut, 2) < 0.22 { 0.20 } else { 0.0 };
    let sheen = (glaze + 0.16 * burnt) * (1.0 - skin);
    let roughness = 0.74 - sheen + 0.07 * clouds + 0.06 * fine + 0.15 * pore + 0.10 * skin;
    Surface {
        height,
        color,
        roughness,
    }
}

fn mortar(seed: u64, u: f64, v: f64, edge: f64, size: u32) -> Surface {
    let lumps = fractal(seed ^ 0x21, u * 16.0, v * 16.0, Some((16, 16)), 4);
    let sand = sand(seed ^ 0x22, u, v, size);
    let bump = 1.0 - smooth(sand.nearest / 0.75);
    let kind = unit(sand.word, 2);
    let tone = 0.90 + 0.16 * unit(sand.word, 3) + 0.10 * lumps;
    let mut color = MORTAR.map(|c| c * tone);
    color = match kind {
        dark if dark < 0.10 => blend(color, [92.0, 84.0, 76.0], 0.75 * bump),
        warm if warm < 0.24 => blend(color, [188.0, 152.0, 112.0], 0.6 * bump),
        quartz if quartz > 0.90 => blend(color, [226.0, 221.0, 212.0], 0.7 * bump),
        _ => color,
    };
    // Struck joints: hollow in the middle, drawn up where they meet the brick.
    let rise = 1.0 - smooth(edge / 0.05);
    Surface {
        height: 0.38 + 0.055 * rise + 0.075 * lumps + 0.07 * bump * (0.4 + kind),
        color,
        roughness: 0.90 + 0.05 * lumps - 0.14 * bump * smooth((kind - 0.85) / 0.1),
    }
}

/// Sand grains of 1/96 tile, or the finest that an image of this size can show.
fn sand(seed: u64, u: f64, v: f64, size: u32) -> Cell {
    let cells = (i64::from(size) / 2).clamp(1, 96);
    cellular(
        seed,
        u * cells as f64,
        v * cells as f64,
        Some((cells, cells)),
    )
}

fn crack(seed: u64, u: f64, v: f64, surface: &mut Surface) {
    let jag = |salt: u64| fractal(seed ^ salt, u * 12.0, v * 12.0, Some((12, 12)), 4);
    let (x, y) = (u * 3.0 + 0.14 * jag(0x31), v * 3.0 + 0.14 * jag(0x32));
    let cell = cellular(seed ^ 0x33, x, y, Some((3, 3)));
    let reach = gradient(seed ^ 0x34, u * 4.0, v * 4.0, Some((4, 4)));
    let width = 0.022 * smooth((reach - 0.05) / 0.25);
    if width > 0.0 {
        let open = 1.0 - smooth((cell.second - cell.nearest) / width);
        surface.height -= 0.24 * open;
        surface.color = blend(surface.color, SOOT, 0.7 * open);
        surface.roughness = mix(surface.roughness, 0.95, open);
    }
}

/// Rain streaks, soot and the salts that water leaves.
fn weather(seed: u64, u: f64, v: f64, on_brick: f64, surface: &mut Surface) {
    let wide = fractal(seed ^ 0x41, u * 3.0, v * 2.0, Some((3, 2)), 3);
    let streaks = fractal(seed ^ 0x42, u * 22.0, v * 3.0, Some((22, 3)), 3);
    let wet = smooth((wide + 0.55 * streaks - 0.05) / 0.7);
    surface.color = blend(surface.color, SOOT, 0.42 * wet);
    surface.roughness -= 0.10 * wet * on_brick;
    let bloom = fractal(seed ^ 0x43, u * 5.0, v * 5.0, Some((5, 5)), 5);
    let powder = fractal(seed ^ 0x44, u * 40.0, v * 40.0, Some((40, 40)), 2);
    let salt = smooth((bloom + 0.30 * powder - 0.34) / 0.34) * (1.0 - wet);
    surface.color = blend(surface.color, SALT, 0.50 * salt);
    surface.roughness = mix(surface.roughness, 0.88, salt);
}

/// Moss starts in joints and on ledges, where water stays.
fn moss(seed: u64, u: f64, v: f64, place: &Place, size: u32, surface: &mut Surface) {
    let region = fractal(seed ^ 0x51, u * 3.0, v * 3.0, Some((3, 3)), 4);
    let tufts = fractal(seed ^ 0x52, u * 30.0, v * 30.0, Some((30, 30)), 3);
    let joint = 1.0 - smooth((-place.edge + 0.02) / 0.12);
    let ledge = smooth((-place.y - 0.18) / 0.3) * joint;
    let cover = smooth((region + 0.30 * joint + 0.16 * ledge + 0.22 * tufts - 0.46) / 0.26);
    if cover > 0.0 {
        let leaf = sand(seed ^ 0x53, u, v, size);
        let round = 1.0 - smooth(leaf.nearest / 0.8);
        let tone = (0.35 * unit(leaf.word, 2) + 0.45 * round + 0.25 * tufts).clamp(0.0, 1.0);
        surface.color = blend(surface.color, blend(MOSS[0], MOSS[1], tone), 0.92 * cover);
        surface.height += cover * (0.045 + 0.055 * round + 0.03 * tufts);
        surface.roughness = mix(surface.roughness, 0.95 - 0.06 * round, cover);
    }
}

/// Grain down to single texels: the part that no smooth model catches.
fn grain(seed: u64, u: f64, v: f64, size: u32, surface: &mut Surface) {
    // Texels are numbered around the tile, so that grain repeats with it.
    let texel = |t: f64| ((t * f64::from(size)).floor() as i64).rem_euclid(i64::from(size));
    let word = hash(seed ^ 0x61, texel(u), texel(v));
    let noise = unit(word, 0) + unit(word, 1) - 1.0;
    let octaves = (size / COURSES as u32).max(1).ilog2().min(6);
    let fabric = fractal(seed ^ 0x62, u * 8.0, v * 8.0, Some((8, 8)), octaves);
    surface.color = surface
        .color
        .map(|c| c * (1.0 + 0.035 * noise + 0.04 * fabric));
    surface.height += 0.006 * noise + 0.012 * fabric;
    surface.roughness += 0.025 * noise;
    if unit(word, 2) < 0.006 {
        // A mica flake.
        surface.roughness -= 0.25;
    }
}
