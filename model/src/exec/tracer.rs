//! Tracer: where a program's decodes touch memory, without their values.

use super::{fetch, position};
use crate::place::Place;
use crate::trace::{Addresses, Fetch};
use ntmu_isa::instruction::Instruction;
use ntmu_isa::layout::Layout;
use ntmu_isa::position::PHASE_BITS;
use ntmu_isa::{Asset, Program};

/// The memory side of a program: nothing but `position` and `fetch` touches it.
#[derive(Clone, Debug)]
pub struct Tracer<'a> {
    asset: &'a Asset,
    layout: Layout,
    /// The grids that the program fetches, in its order.
    grids: Vec<usize>,
}

impl<'a> Tracer<'a> {
    /// The memory side of a program that was compiled for the asset, or linked to it.
    #[must_use]
    pub fn new(asset: &'a Asset, program: &Program) -> Tracer<'a> {
        let grid = |instruction: &Instruction| {
            if let Instruction::Fetch { grid } = *instruction {
                Some(usize::from(grid))
            } else {
                None
            }
        };
        Tracer {
            asset,
            layout: program.layout(),
            grids: program.instructions().iter().filter_map(grid).collect(),
        }
    }
}

impl Addresses for Tracer<'_> {
    fn fetches(&self, place: &Place, fetches: &mut Vec<Fetch>) {
        for &grid in &self.grids {
            // The phase does not move a corner.
            let corners = position::corners(&self.asset.shape, grid, place, PHASE_BITS);
            fetches.push(fetch::addresses(
                &self.asset.shape,
                self.layout,
                grid,
                &corners,
            ));
        }
    }

    fn bytes(&self) -> u64 {
        self.layout.total_bytes(&self.asset.shape)
    }

    fn mip_size(&self, mip: u8) -> (u32, u32) {
        self.asset.shape.mip_size(mip)
    }
}
