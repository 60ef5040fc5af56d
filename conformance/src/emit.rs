//! Emit: a vector file as bytes, and back. The same suite always gives the same bytes.

use crate::flag::Flag;
use crate::stage::Taps;
use crate::vector::{
    Answer, AssetRecord, Case, Expectation, Note, OpenQuery, ProfileRecord, Query, SCHEMA,
    TexelQuery, VectorFile,
};
use ntmu_isa::Asset;
use ntmu_isa::profile::Profile;
use std::collections::{BTreeMap, BTreeSet};

/// Why a vector file is none, or a suite makes none.
#[derive(Debug, thiserror::Error)]
pub enum VectorError {
    /// The text is no JSON of this format.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    /// A field holds what it must not.
    #[error("{field}: found {found}; allowed: {allowed}")]
    Field {
        /// Where.
        field: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
}

fn refuse(
    field: impl Into<String>,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> VectorError {
    VectorError::Field {
        field: field.into(),
        found: found.into(),
        allowed: allowed.into(),
    }
}

/// Collects the cases of a suite; assigns ids, explains flags.
#[derive(Debug)]
pub struct Builder {
    file: VectorFile,
}

impl Builder {
    /// An empty suite.
    #[must_use]
    pub fn new(suite: &str, about: &str) -> Builder {
        let (major, minor) = ntmu_isa::format::VERSION;
        Builder {
            file: VectorFile {
                schema: SCHEMA.to_owned(),
                suite: suite.to_owned(),
                about: about.to_owned(),
                // All crates of the workspace have one version.
                isa: env!("CARGO_PKG_VERSION").to_owned(),
                format: format!("{major}.{minor}"),
                generator: concat!("ntmu-conformance ", env!("CARGO_PKG_VERSION")).to_owned(),
                profile: Profile::NORMATIVE.into(),
                notes: BTreeMap::new(),
                assets: Vec::new(),
                case_count: 0,
                cases: Vec::new(),
            },
        }
    }

    /// Adds an asset that cases may name.
    pub fn asset(&mut self, name: &str, comment: &str, asset: &Asset) {
        let ntx = asset.to_bytes();
        self.file.assets.push(AssetRecord {
            name: name.to_owned(),
            comment: comment.to_owned(),
            profile: ProfileRecord::from(asset.profile),
            crc32: format!("{:08x}", crc32fast::hash(&ntx)),
            ntx,
        });
    }

    /// Adds a case with an answer.
    pub fn exact(&mut self, comment: &str, flags: &[Flag], request: Query, answer: Answer) {
        self.push(comment, flags, request, Some(answer), Taps::new());
    }

    /// Adds a case with an answer and the values on the way to it.
    pub fn tapped(
        &mut self,
        comment: &str,
        flags: &[Flag],
        request: TexelQuery,
        answer: Answer,
        taps: Taps,
    ) {
        self.push(comment, flags, Query::Texel(request), Some(answer), taps);
    }

    /// Adds bytes that must be refused.
    pub fn refused(&mut self, comment: &str, flags: &[Flag], ntx: Vec<u8>) {
        self.push(
            comment,
            flags,
            Query::Open(OpenQuery { ntx }),
            None,
            Taps::new(),
        );
    }

    fn push(
        &mut self,
        comment: &str,
        flags: &[Flag],
        request: Query,
        answer: Option<Answer>,
        taps: Taps,
    ) {
        for flag in flags {
            let (kind, description) = (flag.kind.to_owned(), flag.description.to_owned());
            self.file
                .notes
                .insert(flag.name.to_owned(), Note { kind, description });
        }
        let id = self.id(&request);
        // Two roads to the same request say the same; the first one's words stay.
        if self.file.cases.iter().any(|case| case.request == request) {
            return;
        }
        let result = if answer.is_some() {
            Expectation::Exact
        } else {
            Expectation::Refuse
        };
        self.file.cases.push(Case {
            id,
            comment: comment.to_owned(),
            flags: flags.iter().map(|flag| flag.name.to_owned()).collect(),
            request,
            result,
            answer,
            taps,
        });
        self.file.case_count = self.file.cases.len();
    }

    /// The id of a request. A texel's request counts with the bytes of its asset, not its name.
    fn id(&self, request: &Query) -> String {
        let hash = match request {
            Query::Texel(texel) => {
                let asset = self
                    .file
                    .assets
                    .iter()
                    .find(|asset| asset.name == texel.asset);
                let ntx = asset.map_or(&[][..], |asset| &asset.ntx);
                let place = format!("{} {} {}", texel.x, texel.y, texel.mip);
                fnv1a(&[ntx, place.as_bytes()])
            }
            Query::Open(open) => fnv1a(&[&open.ntx]),
            // Integers and names: nothing that JSON could refuse.
            Query::Rescale(_) | Query::Position(_) => fnv1a(&[serde_json::to_string(request)
                .unwrap_or_default()
                .as_bytes()]),
        };
        format!("{}-{hash:016x}", self.file.suite)
    }

    /// The suite as a file.
    #[must_use]
    pub fn build(self) -> VectorFile {
        self.file
    }
}

/// FNV-1a, 64 bits. A CRC-32 would not do: an `.ntx` file holds CRC-32 of its parts, and files
/// that differ in a part and in its CRC-32 have the same CRC-32 as a whole.
fn fnv1a(parts: &[&[u8]]) -> u64 {
    parts
        .iter()
        .flat_map(|part| part.iter())
        .fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
}

/// The file as text: the header's fields one a line, then one asset, note or case a line, LF.
///
/// # Errors
/// When the file contradicts itself; see [`check`].
pub fn to_json(file: &VectorFile) -> Result<String, VectorError> {
    check(file)?;
    // Taken apart so that a new field cannot be forgotten here.
    let VectorFile {
        schema,
        suite,
        about,
        isa,
        format,
        generator,
        profile,
        notes,
        assets,
        case_count,
        cases,
    } = file;
    let mut text = String::from("{\n");
    let mut line = |name: &str, json: String| text.push_str(&format!("\"{name}\": {json},\n"));
    line("schema", serde_json::to_string(schema)?);
    line("suite", serde_json::to_string(suite)?);
    line("about", serde_json::to_string(about)?);
    line("isa", serde_json::to_string(isa)?);
    line("format", serde_json::to_string(format)?);
    line("generator", serde_json::to_string(generator)?);
    line("profile", serde_json::to_string(profile)?);
    let notes = notes.iter().map(|(name, note)| {
        Ok(format!(
            "{}: {}",
            serde_json::to_string(name)?,
            serde_json::to_string(note)?
        ))
    });
    let notes: Vec<String> = notes.collect::<Result<_, serde_json::Error>>()?;
    line("notes", format!("{{\n{}\n}}", notes.join(",\n")));
    line("assets", lines(assets)?);
    line("case_count", serde_json::to_string(case_count)?);
    text.push_str(&format!("\"cases\": {}\n}}\n", lines(cases)?));
    Ok(text)
}

fn lines<T: serde::Serialize>(items: &[T]) -> Result<String, serde_json::Error> {
    if items.is_empty() {
        return Ok("[]".to_owned());
    }
    let items: Vec<String> = items
        .iter()
        .map(serde_json::to_string)
        .collect::<Result<_, _>>()?;
    Ok(format!("[\n{}\n]", items.join(",\n")))
}

/// The file in a text.
///
/// # Errors
/// When the text is no JSON of this format, or contradicts itself; see [`check`].
pub fn from_json(text: &str) -> Result<VectorFile, VectorError> {
    let file: VectorFile = serde_json::from_str(text)?;
    check(&file)?;
    Ok(file)
}

/// Whether a file keeps its own promises: the schema's name, ids used once, flags explained once
/// and used, profiles that bear their own name and hash, assets whole and present, answers where
/// there must be some.
///
/// # Errors
/// The first promise that is broken.
pub fn check(file: &VectorFile) -> Result<(), VectorError> {
    if file.schema != SCHEMA {
        return Err(refuse("schema", &file.schema, SCHEMA));
    }
    if file.case_count != file.cases.len() {
        let found = file.case_count.to_string();
        return Err(refuse("case_count", found, file.cases.len().to_string()));
    }
    check_profile("profile", &file.profile)?;
    for asset in &file.assets {
        check_profile(&format!("assets.{}.profile", asset.name), &asset.profile)?;
        let computed = format!("{:08x}", crc32fast::hash(&asset.ntx));
        if asset.crc32 != computed {
            return Err(refuse(
                format!("assets.{}.crc32", asset.name),
                &asset.crc32,
                computed,
            ));
        }
    }
    let mut ids = BTreeSet::new();
    let mut used = BTreeSet::new();
    for case in &file.cases {
        if !ids.insert(case.id.as_str()) {
            return Err(refuse("cases.id", &case.id, "each id once"));
        }
        if let Some(flag) = case
            .flags
            .iter()
            .find(|flag| !file.notes.contains_key(*flag))
        {
            return Err(refuse(
                format!("{}.flags", case.id),
                flag,
                "a flag with a note",
            ));
        }
        used.extend(case.flags.iter().map(String::as_str));
        check_case(file, case)?;
    }
    match file.notes.keys().find(|flag| !used.contains(flag.as_str())) {
        Some(flag) => Err(refuse("notes", flag, "a flag that a case has")),
        None => Ok(()),
    }
}

/// A profile's name and hash are those of its choices, and its numbers are in range.
fn check_profile(field: &str, profile: &ProfileRecord) -> Result<(), VectorError> {
    if let Some((name, found, low, high)) = profile.choices.out_of_range() {
        return Err(refuse(
            format!("{field}.choices.{name}"),
            found.to_string(),
            format!("{low}..={high}"),
        ));
    }
    let identity = profile.choices.identity();
    if profile.identity == identity {
        Ok(())
    } else {
        Err(refuse(
            format!("{field}.identity"),
            &profile.identity,
            identity,
        ))
    }
}

fn check_case(file: &VectorFile, case: &Case) -> Result<(), VectorError> {
    let fits = match (&case.request, case.result, &case.answer) {
        (Query::Rescale(_), Expectation::Exact, Some(Answer::Value(_)))
        | (Query::Position(_), Expectation::Exact, Some(Answer::Position(_)))
        | (Query::Texel(_), Expectation::Exact, Some(Answer::Channels(_)))
        | (Query::Open(_), Expectation::Exact, Some(Answer::Accepted(true)))
        | (Query::Open(_), Expectation::Refuse, None) => true,
        (Query::Rescale(_) | Query::Position(_) | Query::Texel(_) | Query::Open(_), _, _) => false,
    };
    if !fits {
        let allowed = "an answer of the request's kind, or `refuse` of an open and none";
        return Err(refuse(
            &case.id,
            format!("{:?}, {:?}", case.result, case.answer),
            allowed,
        ));
    }
    if let Query::Texel(texel) = &case.request
        && !file.assets.iter().any(|asset| asset.name == texel.asset)
    {
        return Err(refuse(
            format!("{}.request", case.id),
            &texel.asset,
            "an asset of the file",
        ));
    }
    Ok(())
}
