//! The verbs, one file each.

mod analyse;
mod asm;
mod certify;
mod compare;
mod conform;
mod convert;
mod curve;
mod decode;
mod disasm;
mod encode;
mod evaluate;
mod generate;
mod info;
mod microprogram;
mod profile;
mod program;
mod sample;
mod settle;
mod simulate;
mod study;
mod texel;
mod throughput;
mod unit;

use crate::Verdict;
use clap::{Parser, Subcommand};

/// Model of a texture unit that decodes neural-compressed textures: bit-exact values, cycles,
/// training, conformance vectors.
#[derive(Parser)]
#[command(version, propagate_version = true, arg_required_else_help = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    verb: Verb,
    /// Print the result as JSON on stdout instead of tables.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Verb {
    /// Decode, check, time and sweep an asset, and write a report; the built-in one by default.
    Study(study::Study),
    /// Train an asset on a texture set.
    Encode(Box<encode::Encode>),
    /// Code sets by several codecs at several rates, and compare them: tables, curves, BD-rates.
    Evaluate(evaluate::Evaluate),
    /// Decode an asset to image files.
    Decode(decode::Decode),
    /// Show what an asset holds.
    Info(info::Info),
    /// Decode one texel and show every value on the way.
    Texel(texel::Texel),
    /// Sample an asset at normalised coordinates, as a shader would.
    Sample(sample::Sample),
    /// Count a unit's cycles for a scene, a texel scan or a trace file, and say what they are spent on.
    Simulate(Box<simulate::Simulate>),
    /// Prove what holds for every latent and texel: accumulator widths, safe rescalings, distances.
    Certify(certify::Certify),
    /// Print the microprogram of an asset, and what is proven of it.
    Program(program::Program),
    /// Turn assembly into a program image.
    Asm(asm::Asm),
    /// Turn a program image, or words, into assembly.
    Disasm(disasm::Disasm),
    /// Compare an asset, or a decoded folder, with its source.
    Compare(compare::Compare),
    /// Compare rate-distortion curves: Bjøntegaard deltas, plots, tables.
    Curve(curve::CurveVerb),
    /// Look into the grids of an asset: how alike their levels are, which frequencies they hold.
    Analyse(analyse::Analyse),
    /// Write an asset in other numbers: fewer bits, fp16, another profile.
    Convert(convert::Convert),
    /// Let the latents of an asset settle on its source: codes move where it then decodes better.
    Settle(settle::Settle),
    /// List the profiles, or print one: the choices that implementations make differently.
    Profile(profile::Profile),
    /// List the units, or print one: hardware configurations with the reason for every number.
    Unit(unit::UnitVerb),
    /// What a texel block costs: every preset on every unit, with BC7 beside them.
    Throughput(throughput::Throughput),
    /// Run conformance vectors on a device.
    Conform(conform::Conform),
    /// Write the built-in texture set as image files.
    Generate(generate::Generate),
}

impl Arguments {
    pub(crate) fn run(self) -> anyhow::Result<Verdict> {
        let json = self.json;
        match self.verb {
            Verb::Study(verb) => verb.run(json),
            Verb::Encode(verb) => verb.run(json),
            Verb::Evaluate(verb) => verb.run(json),
            Verb::Decode(verb) => verb.run(json),
            Verb::Info(verb) => verb.run(json),
            Verb::Texel(verb) => verb.run(json),
            Verb::Sample(verb) => verb.run(json),
            Verb::Simulate(verb) => verb.run(json),
            Verb::Certify(verb) => verb.run(json),
            Verb::Program(verb) => verb.run(json),
            Verb::Asm(verb) => verb.run(json),
            Verb::Disasm(verb) => verb.run(json),
            Verb::Compare(verb) => verb.run(json),
            Verb::Curve(verb) => verb.run(json),
            Verb::Analyse(verb) => verb.run(json),
            Verb::Conform(verb) => verb.run(json),
            Verb::Convert(verb) => verb.run(json),
            Verb::Settle(verb) => verb.run(json),
            Verb::Profile(verb) => verb.run(json),
            Verb::Unit(verb) => verb.run(json),
            Verb::Throughput(verb) => verb.run(json),
            Verb::Generate(verb) => verb.run(json),
        }
    }
}
