//! Runner: suites against a device, one outcome per case.

use crate::device::{Device, DeviceError};
use crate::stage::{Divergence, first_divergence};
use crate::vector::{Answer, Case, Expectation, Query, VectorFile};
use ntmu_isa::Asset;
use ntmu_model::Request;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What became of one case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "lowercase", deny_unknown_fields)]
pub enum Outcome {
    /// As it must be.
    Pass,
    /// Another answer, or none.
    Fail {
        /// The answer, if there was one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        found: Option<Answer>,
        /// What it must be; none where the device had to refuse.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        expected: Option<Answer>,
        /// In words.
        reason: String,
        /// The first stage with another value, where the device offers taps and parts there.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        divergence: Option<Divergence>,
    },
    /// The device does not offer what the case asks for.
    Unsupported {
        /// What is missing.
        reason: String,
    },
}

/// One case and what became of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CaseReport {
    /// The case.
    pub id: String,
    /// Its comment.
    pub comment: String,
    /// Its flags: what a failure points at.
    pub flags: Vec<String>,
    /// Name and hash of the profile that it was decided under.
    pub profile: String,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What became of a suite.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteSummary {
    /// The suite.
    pub suite: String,
    /// Names and hashes of the profiles of its cases, each once, sorted.
    pub profiles: Vec<String>,
    /// Cases that passed.
    pub passed: usize,
    /// Cases that failed.
    pub failed: usize,
    /// Cases that the device does not offer.
    pub unsupported: usize,
    /// The first stage that parts, and in how many failed cases.
    pub diverging_stages: BTreeMap<String, usize>,
    /// Every case, in the suite's order.
    pub cases: Vec<CaseReport>,
}

/// What became of a run.
#[must_use]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// The device's name.
    pub device: String,
    /// One entry per suite, in the order of the run.
    pub suites: Vec<SuiteSummary>,
}

impl Summary {
    /// Cases that passed, failed, and are not offered, over all suites.
    #[must_use]
    pub fn totals(&self) -> (usize, usize, usize) {
        self.suites
            .iter()
            .fold((0, 0, 0), |(passed, failed, unsupported), suite| {
                (
                    passed + suite.passed,
                    failed + suite.failed,
                    unsupported + suite.unsupported,
                )
            })
    }

    /// No case failed and at least one passed: a device that offers nothing does not conform.
    #[must_use]
    pub fn conforms(&self) -> bool {
        let (passed, failed, _) = self.totals();
        failed == 0 && passed > 0
    }
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    /// The suite under way.
    pub suite: &'a str,
    /// Its cases done.
    pub done: usize,
    /// Its cases.
    pub total: usize,
}

/// Runs suites against a device; calls `progress` after every case. A case that breaks the device
/// fails by itself, the others are still asked.
pub fn run(
    suites: &[VectorFile],
    device: &mut dyn Device,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Summary {
    let suites = suites
        .iter()
        .map(|file| run_suite(file, device, progress))
        .collect();
    Summary {
        device: device.name(),
        suites,
    }
}

fn run_suite(
    file: &VectorFile,
    device: &mut dyn Device,
    progress: &mut dyn FnMut(Progress<'_>),
) -> SuiteSummary {
    let mut texels = Texels::new(file, device);
    let mut summary = SuiteSummary {
        suite: file.suite.clone(),
        profiles: Vec::new(),
        passed: 0,
        failed: 0,
        unsupported: 0,
        diverging_stages: BTreeMap::new(),
        cases: Vec::new(),
    };
    let mut profiles = BTreeSet::new();
    for (index, case) in file.cases.iter().enumerate() {
        let outcome = match ask(case, index, &mut texels, device) {
            Ok(found) => judge(case, found, &texels, device),
            Err(DeviceError::Unsupported { reason }) => Outcome::Unsupported { reason },
            Err(DeviceError::Failed { reason }) => Outcome::Fail {
                found: None,
                expected: case.answer.clone(),
                reason,
                divergence: None,
            },
        };
        match &outcome {
            Outcome::Pass => summary.passed += 1,
            Outcome::Unsupported { .. } => summary.unsupported += 1,
            Outcome::Fail { divergence, .. } => {
                summary.failed += 1;
                if let Some(divergence) = divergence {
                    let stage = divergence.stage.to_string();
                    *summary.diverging_stages.entry(stage).or_default() += 1;
                }
            }
        }
        let profile = profile(file, case).to_owned();
        profiles.insert(profile.clone());
        summary.cases.push(CaseReport {
            id: case.id.clone(),
            comment: case.comment.clone(),
            flags: case.flags.clone(),
            profile,
            outcome,
        });
        progress(Progress {
            suite: &file.suite,
            done: index + 1,
            total: file.cases.len(),
        });
    }
    summary.profiles = profiles.into_iter().collect();
    summary
}

/// The profile of a case: its asset's, or the file's.
fn profile<'f>(file: &'f VectorFile, case: &Case) -> &'f str {
    let asset = match &case.request {
        Query::Texel(query) => file.assets.iter().find(|asset| asset.name == query.asset),
        Query::Rescale(_) | Query::Position(_) | Query::Open(_) => None,
    };
    &asset.map_or(&file.profile, |asset| &asset.profile).identity
}

fn ask(
    case: &Case,
    index: usize,
    texels: &mut Texels,
    device: &mut dyn Device,
) -> Result<Answer, DeviceError> {
    match &case.request {
        Query::Rescale(query) => device.rescale(query).map(Answer::Value),
        Query::Position(query) => device.position(query).map(Answer::Position),
        Query::Open(query) => device.open(&query.ntx).map(Answer::Accepted),
        Query::Texel(_) => texels.take(index).map(Answer::Channels),
    }
}

fn judge(case: &Case, found: Answer, texels: &Texels, device: &mut dyn Device) -> Outcome {
    let reason = match (case.result, &case.answer) {
        (Expectation::Exact, Some(expected)) if *expected == found => return Outcome::Pass,
        (Expectation::Refuse, _) if found == Answer::Accepted(false) => return Outcome::Pass,
        (Expectation::Exact, _) => "another answer",
        (Expectation::Refuse, _) => "accepted what must be refused",
    };
    let divergence = match &case.request {
        Query::Texel(query) => texels
            .request(&query.asset, query.x, query.y, query.mip)
            .and_then(|(asset, request)| {
                first_divergence(&case.taps, &device.taps(asset, request).ok()?)
            }),
        Query::Rescale(_) | Query::Position(_) | Query::Open(_) => None,
    };
    Outcome::Fail {
        found: Some(found),
        expected: case.answer.clone(),
        reason: reason.to_owned(),
        divergence,
    }
}

/// The texels of a suite, decoded asset by asset: a device that starts a kernel or a process is
/// asked once per asset.
struct Texels {
    assets: BTreeMap<String, Result<Asset, String>>,
    answers: BTreeMap<usize, Result<Vec<i32>, DeviceError>>,
}

impl Texels {
    fn new(file: &VectorFile, device: &mut dyn Device) -> Texels {
        let open = |ntx: &[u8]| Asset::from_bytes(ntx).map_err(|error| error.to_string());
        let assets = file
            .assets
            .iter()
            .map(|asset| (asset.name.clone(), open(&asset.ntx)));
        let mut texels = Texels {
            assets: assets.collect(),
            answers: BTreeMap::new(),
        };
        for record in &file.assets {
            let mut batch: Vec<(usize, Request)> = Vec::new();
            for (index, case) in file.cases.iter().enumerate() {
                if let Query::Texel(query) = &case.request
                    && query.asset == record.name
                {
                    match texels.request(&query.asset, query.x, query.y, query.mip) {
                        Some((_, request)) => batch.push((index, request)),
                        None => {
                            let reason = "the vector file asks for a texel that does not exist";
                            texels
                                .answers
                                .insert(index, Err(DeviceError::failed(reason)));
                        }
                    }
                }
            }
            if let Some(Ok(asset)) = texels.assets.get(&record.name) {
                let answers = decode(asset, &batch, device);
                texels
                    .answers
                    .extend(batch.iter().map(|(index, _)| *index).zip(answers));
            }
        }
        texels
    }

    fn take(&mut self, index: usize) -> Result<Vec<i32>, DeviceError> {
        let none = || Err(DeviceError::failed("the vector file names no such asset"));
        self.answers.remove(&index).unwrap_or_else(none)
    }

    fn request(&self, asset: &str, x: u32, y: u32, mip: u8) -> Option<(&Asset, Request)> {
        let asset = self.assets.get(asset)?.as_ref().ok()?;
        Some((asset, Request::new(&asset.shape, x, y, mip).ok()?))
    }
}

/// One answer per request of the batch.
fn decode(
    asset: &Asset,
    batch: &[(usize, Request)],
    device: &mut dyn Device,
) -> Vec<Result<Vec<i32>, DeviceError>> {
    let requests: Vec<Request> = batch.iter().map(|(_, request)| *request).collect();
    match device.texel_codes(asset, &requests) {
        Ok(codes) if codes.len() == requests.len() => codes.into_iter().map(Ok).collect(),
        Err(error @ DeviceError::Unsupported { .. }) => vec![Err(error); requests.len()],
        // One texel that breaks the device must not take the others with it.
        Ok(_) | Err(DeviceError::Failed { .. }) => requests
            .iter()
            .map(|request| {
                let codes = device.texel_codes(asset, std::slice::from_ref(request))?;
                match <[Vec<i32>; 1]>::try_from(codes) {
                    Ok([codes]) => Ok(codes),
                    Err(codes) => {
                        let found = codes.len();
                        Err(DeviceError::failed(format!(
                            "{found} answers to one request"
                        )))
                    }
                }
            })
            .collect(),
    }
}
