//! Assemble: from demands to groups and jobs.
//!
//! Everything here depends on the order of the demands alone, not on time: which texels are decoded
//! once for a quad, which are still held decoded, which texels share a group, which groups a job, and
//! which lines a group touches. So the stepped run and the lower bounds are about the same groups.
//!
//! | thing | is | ends |
//! |---|---|---|
//! | quad | successive pixels of one material in one square of 2×2 (of more than four: 4×4) | at `quad_pixels` |
//! | group | decodes and answered pixels of one material | at `coalesced_texels` of either |
//! | job | groups of one material in one bin | at `job_texels` of either, or when its bin is needed |

use super::cost::Cost;
use super::decoded::DecodedTexels;
use super::lines::Lines;
use super::unit::Unit;
use super::weights::WeightStore;
use crate::demand::{Demand, Demands};
use crate::place::Place;
use crate::trace::Fetch;
use std::collections::VecDeque;

/// The lines of one fetch of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FetchLines {
    /// Where they end in the group's lines.
    pub(super) end: usize,
    /// Cycles of the tags for them: those of the bank with most, at least one.
    pub(super) tag_cycles: u64,
}

/// A job, complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Job {
    /// Its number, in the order of the first groups.
    pub(super) number: u64,
    /// Its material.
    pub(super) material: u16,
    /// Its groups.
    pub(super) groups: u64,
    /// Texels that it decodes.
    pub(super) decodes: u64,
    /// Pixels that are answered with it.
    pub(super) pixels: u64,
    /// Codes a channel that the filter adds up for them.
    pub(super) weighted: u64,
    /// Bytes of parameters that have to come in for it, if its material's are not there.
    pub(super) fill_bytes: Option<u64>,
    /// Up to which older job, in the order of completion, the parameters in the way are needed;
    /// none are for 0, the first 1 for 1.
    pub(super) fill_after: u64,
}

/// Texels and pixels that go through the front end together.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    /// Its number.
    pub(super) number: u64,
    /// Its material.
    pub(super) material: u16,
    /// The pixel of its first decode or answer.
    pub(super) pixel: [u32; 2],
    /// Texels that it decodes.
    pub(super) decodes: u64,
    /// Pixels that are answered with it.
    pub(super) pixels: u64,
    /// Codes a channel that the filter adds up for them.
    pub(super) weighted: u64,
    /// Lines of all fetches, those of the first fetch first.
    pub(super) lines: Vec<u64>,
    /// Bytes of its decodes' corners.
    pub(super) corner_bytes: u64,
    /// One entry a fetch.
    pub(super) fetches: Vec<FetchLines>,
    /// The number of its job.
    pub(super) job: u64,
    /// Jobs that are complete with this group, in the order in which the array takes them.
    pub(super) completes: Vec<Job>,
    /// Pixels answered up to and with this group.
    pub(super) answered: u64,
}

/// What a quad asks for, in order.
#[derive(Clone, Copy, Debug)]
enum Item {
    Decode([u32; 2], Place),
    Answer([u32; 2], u32),
}

/// What came of the demands so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Assembled {
    /// Demands taken.
    pub(super) pixels: u64,
    /// Texels asked for, each as often as a pixel needs it.
    pub(super) texels: u64,
    /// Those that another pixel of the quad asked for too.
    pub(super) shared: u64,
    /// Those that were held decoded.
    pub(super) held: u64,
    /// Texels decoded.
    pub(super) decodes: u64,
}

/// Demands on their way to groups and jobs.
pub(super) struct Assembler<'a, 'd, D: Demands> {
    unit: &'a Unit,
    costs: &'a [Cost<'a>],
    demands: &'d mut D,
    /// The next demand, read but not taken.
    ahead: Demand,
    has_ahead: bool,
    items: VecDeque<Item>,
    items_material: u16,
    seen: Seen,
    decoded: Option<DecodedTexels>,
    fetches: Vec<Fetch>,
    lines: Lines,
    /// Open jobs, the oldest first.
    bins: VecDeque<Job>,
    weights: WeightStore,
    held: Option<Group>,
    spare: Vec<Group>,
    groups: u64,
    jobs: u64,
    answered: u64,
    pub(super) assembled: Assembled,
}

impl<'a, 'd, D: Demands> Assembler<'a, 'd, D> {
    /// The demands' groups, for a unit and the materials' costs on it.
    ///
    /// # Errors
    /// When the first demand cannot be read.
    pub(super) fn new(
        unit: &'a Unit,
        costs: &'a [Cost<'a>],
        demands: &'d mut D,
    ) -> Result<Assembler<'a, 'd, D>, D::Error> {
        let mut ahead = Demand::default();
        let has_ahead = demands.advance(&mut ahead)?;
        Ok(Assembler {
            unit,
            costs,
            demands,
            ahead,
            has_ahead,
            items: VecDeque::new(),
            items_material: 0,
            seen: Seen::default(),
            decoded: DecodedTexels::new(unit),
            fetches: Vec::new(),
            lines: Lines::new(unit),
            bins: VecDeque::new(),
            weights: WeightStore::new(unit),
            held: None,
            spare: Vec::new(),
            groups: 0,
            jobs: 0,
            answered: 0,
            assembled: Assembled::default(),
        })
    }

    /// The material of the first demand, if there is one.
    pub(super) fn first_material(&self) -> Option<u16> {
        self.has_ahead.then_some(self.ahead.material)
    }

    /// A group that is not needed any more; its memory is.
    pub(super) fn recycle(&mut self, group: Group) {
        self.spare.push(group);
    }

    /// The next group, with everything that is complete with it.
    ///
    /// # Errors
    /// When a demand cannot be read.
    pub(super) fn next(&mut self) -> Result<Option<Group>, D::Error> {
        loop {
            let Some(mut group) = self.gather()? else {
                // Whatever is open is complete with the last group.
                let mut last = self.held.take();
                while let (Some(group), Some(job)) = (last.as_mut(), self.bins.pop_front()) {
                    group.completes.push(self.weights.place(job, self.costs));
                }
                return Ok(last);
            };
            self.join(&mut group);
            if let Some(before) = self.held.replace(group) {
                return Ok(Some(before));
            }
        }
    }

    /// Finds the group's job, closing what has to be closed for it.
    fn join(&mut self, group: &mut Group) {
        let limit = u64::from(self.unit.job_texels());
        let open = self
            .bins
            .iter()
            .position(|job| job.material == group.material);
        let fits =
            |job: &Job| job.decodes + group.decodes <= limit && job.pixels + group.pixels <= limit;
        let index = match open {
            Some(index) if fits(&self.bins[index]) => index,
            Some(index) => {
                self.close(index);
                self.open(group.material)
            }
            None => {
                if self.bins.len() == self.unit.material_bins as usize {
                    self.close(0);
                }
                self.open(group.material)
            }
        };
        let job = &mut self.bins[index];
        job.groups += 1;
        job.decodes += group.decodes;
        job.pixels += group.pixels;
        job.weighted += group.weighted;
        group.job = job.number;
        if (job.decodes == limit || job.pixels == limit)
            && let Some(job) = self.bins.remove(index)
        {
            group.completes.push(self.weights.place(job, self.costs));
        }
    }

    fn open(&mut self, material: u16) -> usize {
        self.bins.push_back(Job {
            number: self.jobs,
            material,
            groups: 0,
            decodes: 0,
            pixels: 0,
            weighted: 0,
            fill_bytes: None,
            fill_after: 0,
        });
        self.jobs += 1;
        self.bins.len() - 1
    }

    /// Completes an open job with the group before this one.
    fn close(&mut self, index: usize) {
        if let (Some(job), Some(before)) = (self.bins.remove(index), self.held.as_mut()) {
            before.completes.push(self.weights.place(job, self.costs));
        }
    }

    /// The next group without a job.
    fn gather(&mut self) -> Result<Option<Group>, D::Error> {
        if self.items.is_empty() {
            self.take_quad()?;
        }
        let Some(&first) = self.items.front() else {
            return Ok(None);
        };
        let costs = self.costs;
        let mut group = self.spare.pop().unwrap_or_default();
        group.number = self.groups;
        self.groups += 1;
        group.material = self.items_material;
        group.pixel = match first {
            Item::Decode(pixel, _) | Item::Answer(pixel, _) => pixel,
        };
        (group.decodes, group.pixels, group.weighted) = (0, 0, 0);
        group.completes.clear();
        self.fetches.clear();
        let limit = u64::from(self.unit.coalesced_texels);
        let cost = &costs[usize::from(group.material)];
        let addresses = cost.material.addresses();
        loop {
            let Some(&item) = self.items.front() else {
                self.take_quad()?;
                if self.items.is_empty() || self.items_material != group.material {
                    break;
                }
                continue;
            };
            match item {
                Item::Decode(_, place) => {
                    if group.decodes == limit {
                        break;
                    }
                    group.decodes += 1;
                    addresses.fetches(&place, &mut self.fetches);
                }
                Item::Answer(_, weights) => {
                    if group.pixels == limit {
                        break;
                    }
                    group.pixels += 1;
                    // A single texel passes the filter as it is.
                    group.weighted += if weights > 1 { u64::from(weights) } else { 0 };
                }
            }
            self.items.pop_front();
        }
        self.assembled.decodes += group.decodes;
        self.answered += group.pixels;
        group.answered = self.answered;
        self.lines
            .collect(cost.base, group.decodes, &self.fetches, &mut group);
        Ok(Some(group))
    }

    /// Reads the next quad's items.
    fn take_quad(&mut self) -> Result<(), D::Error> {
        if !self.has_ahead {
            return Ok(());
        }
        let material = self.ahead.material;
        self.items_material = material;
        self.seen.clear();
        // The square of pixels that a quad lies in. The sky and a screen's edge leave quads short.
        let side_log2 = if self.unit.quad_pixels > 4 { 2 } else { 1 };
        let square = |pixel: [u32; 2]| pixel.map(|at| at >> side_log2);
        let first = square(self.ahead.pixel);
        for _ in 0..self.unit.quad_pixels {
            let is_next = self.has_ahead && self.ahead.material == material;
            if !is_next || square(self.ahead.pixel) != first {
                break;
            }
            self.take_pixel();
            self.has_ahead = self.demands.advance(&mut self.ahead)?;
        }
        Ok(())
    }

    fn take_pixel(&mut self) {
        let demand = &self.ahead;
        let material = self.items_material;
        self.assembled.pixels += 1;
        self.assembled.texels += demand.places.len() as u64;
        for &place in &demand.places {
            if !self.seen.is_new(place) {
                self.assembled.shared += 1;
                continue;
            }
            let items = &mut self.items;
            let mut decode = |place| items.push_back(Item::Decode(demand.pixel, place));
            match self.decoded.as_mut() {
                None => decode(place),
                Some(decoded) => {
                    let addresses = self.costs[usize::from(material)].material.addresses();
                    if decoded.look_up(material, place, addresses, &mut decode) {
                        self.assembled.held += 1;
                    }
                }
            }
        }
        self.items
            .push_back(Item::Answer(demand.pixel, demand.weights));
    }
}

/// The places that a quad has asked for.
#[derive(Debug, Default)]
struct Seen {
    few: Vec<Place>,
    many: std::collections::HashSet<Place>,
}

/// Places up to which a list is faster than a set.
const FEW: usize = 64;

impl Seen {
    fn clear(&mut self) {
        self.few.clear();
        self.many.clear();
    }

    /// Whether the place is seen for the first time.
    fn is_new(&mut self, place: Place) -> bool {
        if self.many.is_empty() {
            if self.few.contains(&place) {
                return false;
            }
            if self.few.len() < FEW {
                self.few.push(place);
                return true;
            }
            self.many.extend(self.few.iter().copied());
        }
        self.many.insert(place)
    }
}
