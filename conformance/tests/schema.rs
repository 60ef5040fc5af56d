//! The JSON schema says what the records say.

use ntmu_conformance::flag;
use ntmu_conformance::suite;
use ntmu_conformance::vector::SCHEMA;
use ntmu_isa::accumulate::Overflow;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::SumOrder;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::{PointSnap, Profile};
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use serde_json::{Value, json};
use std::collections::BTreeSet;

fn schema() -> Value {
    serde_json::from_str(include_str!("../schema/v2.json")).expect("JSON")
}

/// A value against a schema, as far as this schema's words go: type, const, enum, bounds, lengths,
/// properties, references, if and else. A word that is not known here fails.
fn check(root: &Value, schema: &Value, value: &Value, path: &str) -> Result<(), String> {
    let words = schema.as_object().ok_or("a schema is an object")?;
    let refuse = |word: &str| Err(format!("{path}: {word}"));
    for (word, rule) in words {
        let number = rule.as_i64();
        let length = value
            .as_array()
            .map(Vec::len)
            .or(value.as_object().map(serde_json::Map::len));
        let holds = match word.as_str() {
            "$schema" | "$id" | "$defs" | "title" | "description" | "then" | "else" => true,
            "$ref" => {
                let name = rule
                    .as_str()
                    .and_then(|r| r.strip_prefix("#/$defs/"))
                    .unwrap_or("");
                check(root, &root["$defs"][name], value, path)?;
                true
            }
            "type" => match rule.as_str() {
                Some("object") => value.is_object(),
                Some("array") => value.is_array(),
                Some("string") => value.is_string(),
                Some("integer") => value.is_i64(),
                _ => false,
            },
            "const" => value == rule,
            "enum" => rule.as_array().is_some_and(|all| all.contains(value)),
            "minimum" => value.as_i64() >= number,
            "maximum" => value.as_i64() <= number,
            "minItems" | "minProperties" => length.map(|l| l as i64) >= number,
            "maxItems" | "maxProperties" => length.map(|l| l as i64) <= number,
            "required" => {
                let mut names = rule
                    .as_array()
                    .into_iter()
                    .flatten()
                    .filter_map(Value::as_str);
                names.all(|name| value.get(name).is_some())
            }
            "properties" => {
                for (name, rule) in rule.as_object().into_iter().flatten() {
                    if let Some(field) = value.get(name) {
                        check(root, rule, field, &format!("{path}.{name}"))?;
                    }
                }
                true
            }
            "additionalProperties" => {
                let known =
                    |name: &String| words.get("properties").and_then(|p| p.get(name)).is_some();
                let more = value
                    .as_object()
                    .into_iter()
                    .flatten()
                    .filter(|(name, _)| !known(name));
                // Patterns of names are `Stage`'s own test; its values are checked right below.
                for (name, field) in more {
                    if *rule != Value::Bool(false) {
                        check(root, rule, field, &format!("{path}.{name}"))?;
                    } else if !words.contains_key("patternProperties") {
                        return refuse(name);
                    }
                }
                true
            }
            "patternProperties" => {
                for rule in rule.as_object().into_iter().flatten().map(|(_, rule)| rule) {
                    for (name, field) in value.as_object().into_iter().flatten() {
                        check(root, rule, field, &format!("{path}.{name}"))?;
                    }
                }
                true
            }
            "items" => {
                for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                    check(root, rule, item, &format!("{path}[{index}]"))?;
                }
                true
            }
            "if" => {
                let branch = if check(root, rule, value, path).is_ok() {
                    "then"
                } else {
                    "else"
                };
                check(root, &schema[branch], value, path)?;
                true
            }
            "not" => check(root, rule, value, path).is_err(),
            // Digits, which `names::hex` and the ids' own making guarantee.
            "pattern" => value.is_string(),
            _ => return refuse(&format!("unknown word {word}")),
        };
        if !holds {
            return refuse(&format!("{word} {rule}"));
        }
    }
    Ok(())
}

#[test]
fn every_suite_is_valid_under_the_schema() {
    let schema = schema();
    for file in suite::all().unwrap() {
        let value = serde_json::to_value(&file).unwrap();
        check(&schema, &schema, &value, &file.suite).unwrap();
    }
}

#[test]
fn what_the_records_refuse_the_schema_refuses() {
    let schema = schema();
    let file = serde_json::to_value(suite::rescale::suite().unwrap()).unwrap();
    let broken: [fn(&mut Value); 11] = [
        |f| f["more"] = json!(1),
        |f| f["schema"] = json!("ntmu-vectors/1"),
        |f| f["cases"][0]["more"] = json!(1),
        |f| f["profile"]["choices"]["sum"] = json!("tree16"),
        |f| f["profile"]["choices"]["accumulator"]["bits"] = json!(33),
        |f| drop(f["profile"].as_object_mut().unwrap().remove("identity")),
        |f| f["cases"][0]["request"]["rescale"]["shift"] = json!(63),
        |f| f["cases"][0]["request"]["rescale"]["value"] = json!(1.5),
        |f| f["cases"][0]["request"]["rescale"]["requantizer"] = json!("triple"),
        |f| drop(f["cases"][0].as_object_mut().unwrap().remove("answer")),
        |f| f["cases"][0]["result"] = json!("refuse"),
    ];
    for (index, change) in broken.into_iter().enumerate() {
        let mut file = file.clone();
        change(&mut file);
        assert!(
            check(&schema, &schema, &file, "file").is_err(),
            "change {index}"
        );
    }
}

#[test]
fn the_schemas_names_are_the_specifications() {
    let schema = schema();
    let defs = &schema["$defs"];
    let position = &defs["request"]["properties"]["position"]["properties"];
    assert_eq!(schema["properties"]["schema"]["const"], SCHEMA);
    assert_eq!(
        defs["rounding"]["enum"],
        json!(Rounding::ALL.map(Rounding::name))
    );
    assert_eq!(
        defs["requantizer"]["enum"],
        json!(Requantizer::ALL.map(Requantizer::name))
    );
    assert_eq!(
        position["snap"]["enum"],
        json!(CornerSnap::ALL.map(CornerSnap::name))
    );
    assert_eq!(
        position["address_mode"]["enum"],
        json!(AddressMode::ALL.map(AddressMode::name))
    );
    assert_eq!(
        defs["filter_rule"]["enum"],
        json!(FilterRule::ALL.map(FilterRule::name))
    );
    let choices = &defs["choices"]["properties"];
    assert_eq!(
        choices["point_snap"]["enum"],
        json!(PointSnap::ALL.map(PointSnap::name))
    );
    assert_eq!(
        choices["accumulator"]["properties"]["overflow"]["enum"],
        json!(Overflow::ALL.map(Overflow::name))
    );
    assert_eq!(
        choices["sum"]["enum"],
        json!(SumOrder::ALL.map(SumOrder::name))
    );
    // Every choice of the profile, and no other.
    let profile = serde_json::to_value(Profile::NORMATIVE).unwrap();
    let names = |value: &Value| {
        let names = value.as_object().unwrap().keys();
        names.cloned().collect::<BTreeSet<_>>()
    };
    assert_eq!(names(choices), names(&profile));
    let required = defs["choices"]["required"].as_array().unwrap().iter();
    assert_eq!(
        required
            .map(|n| n.as_str().unwrap().to_owned())
            .collect::<BTreeSet<_>>(),
        names(&profile)
    );
    let suites: Vec<String> = suite::all()
        .unwrap()
        .into_iter()
        .map(|file| file.suite)
        .collect();
    assert_eq!(schema["properties"]["suite"]["enum"], json!(suites));
}

#[test]
fn no_two_flags_share_a_name() {
    let names: BTreeSet<&str> = flag::ALL.iter().map(|flag| flag.name).collect();
    assert_eq!(names.len(), flag::ALL.len());
}
