//! Texel scans: which texels, in which order.

use super::*;

#[test]
fn a_scan_in_any_order_meets_every_texel_of_every_mip_once() {
    for (width, height) in SIZES {
        let materials = [trilinear(width, height), trilinear(height, width)];
        let expected: BTreeSet<(u16, Place)> = materials
            .iter()
            .enumerate()
            .flat_map(|(material, sampled)| {
                let shape = sampled.shape();
                let chain = 0..shape.mip_count;
                let texels = chain.flat_map(|mip| Request::blocks(shape, mip));
                let texels: Vec<Request> = texels.collect();
                texels
                    .into_iter()
                    .map(move |r| (material as u16, Place::of(r)))
            })
            .collect();
        for order in ORDERS {
            let found = scan(order, &materials);
            assert_eq!(found.len(), expected.len(), "{order} {width}x{height}");
            assert!(found.iter().all(|d| d.places.len() == 1 && d.weights == 1));
            let found: BTreeSet<(u16, Place)> =
                found.iter().map(|d| (d.material, d.places[0])).collect();
            assert_eq!(found, expected, "{order} {width}x{height}");
        }
    }
}

#[test]
fn a_scan_in_blocks_is_the_order_of_request_blocks() {
    for (width, height) in SIZES {
        let materials = [trilinear(width, height)];
        let shape = materials[0].shape();
        for mip in 0..shape.mip_count {
            let expected: Vec<Demand> = Request::blocks(shape, mip)
                .map(|r| texel(r.x(), r.y(), mip, 0, shape))
                .collect();
            assert_eq!(scan(&format!("blocks:mip={mip}"), &materials), expected);
        }
    }
}

#[test]
fn a_raster_scan_is_quads_from_left_to_right_and_pairs_of_rows_downwards() {
    let materials = [trilinear(100, 36)];
    let mut expected = Vec::new();
    for (row, column) in (0..18).flat_map(|row| (0..50).map(move |column| (row, column))) {
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            expected.push(texel(
                2 * column + x,
                2 * row + y,
                0,
                0,
                materials[0].shape(),
            ));
        }
    }
    assert_eq!(scan("raster:mip=0", &materials), expected);
}

#[test]
fn random_texels_are_the_seeds_and_every_texel_can_be_drawn() {
    let materials = [trilinear(8, 8), trilinear(4, 2)];
    let draw = |seed: u64| scan(&format!("random:seed={seed},count=20000"), &materials);
    assert_eq!(draw(7), draw(7));
    assert_ne!(draw(7), draw(8));
    let mut counts: BTreeMap<(u16, Place), u32> = BTreeMap::new();
    for demand in draw(7) {
        *counts
            .entry((demand.material, demand.places[0]))
            .or_default() += 1;
    }
    let texels = materials.iter().map(|m| m.shape().texel_count());
    assert_eq!(counts.len() as u64, texels.sum::<u64>());
}
