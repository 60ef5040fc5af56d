//! `ntmu profile`: the choices that an implementation may make differently.

use crate::Verdict;
use crate::console;
use anyhow::Context as _;
use ntmu::isa::Asset;
use ntmu::isa::profile::{NAMED, NamedProfile, ProfileError};
use serde_json::json;
use std::path::Path;

#[derive(clap::Args)]
pub(crate) struct Profile {
    /// Print this one as TOML, to start a file from: a built-in's name, or a file. All built-in
    /// ones are listed without it.
    name: Option<String>,
}

/// The option of every verb that decodes.
#[derive(clap::Args)]
pub(crate) struct ProfileChoice {
    /// Decode by another profile than the asset's: the name of a built-in one (see `ntmu
    /// profile`), or a TOML file.
    #[arg(long, value_name = "PROFILE")]
    profile: Option<String>,
}

impl ProfileChoice {
    /// The asset with the chosen profile; unchanged without a choice.
    pub(crate) fn apply(&self, asset: Asset) -> anyhow::Result<Asset> {
        let Some(name) = &self.profile else {
            return Ok(asset);
        };
        let mut parts = asset.into_parts();
        parts.profile = find(name)?.profile;
        Asset::new(parts).with_context(|| format!("the asset with profile {name}"))
    }
}

/// A built-in profile by its name, else a file.
pub(crate) fn find(name: &str) -> anyhow::Result<NamedProfile> {
    match NamedProfile::named(name) {
        Err(error @ ProfileError::Unknown { .. }) => {
            let path = Path::new(name);
            if !path.is_file() {
                return Err(anyhow::Error::new(error).context("neither a file nor a built-in one"));
            }
            let text = std::fs::read_to_string(path).with_context(|| name.to_owned())?;
            NamedProfile::from_toml(&text).with_context(|| name.to_owned())
        }
        found => Ok(found?),
    }
}

impl Profile {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        match self.name {
            Some(name) => one(&name, json)?,
            None => all(json)?,
        }
        Ok(Verdict::Fine)
    }
}

fn one(name: &str, json: bool) -> anyhow::Result<()> {
    let named = find(name)?;
    if json {
        return console::print_json(&json!({
            "identity": named.profile.identity(), "profile": named,
        }));
    }
    match NAMED.iter().find(|(built_in, _)| *built_in == name) {
        Some((_, text)) => console::print(text),
        None => console::print(&toml::to_string(&named)?),
    }
    Ok(())
}

fn all(json: bool) -> anyhow::Result<()> {
    let profiles = NamedProfile::all()?;
    if json {
        let described: Vec<_> = profiles
            .iter()
            .map(|named| json!({ "identity": named.profile.identity(), "profile": named }))
            .collect();
        return console::print_json(&described);
    }
    let mut table = console::table(&["profile", "hash", "stands for"]);
    for named in &profiles {
        table.add_row([&named.name, &named.profile.hash(), &named.about]);
    }
    console::print(&table.to_string());
    Ok(())
}
