//! What a file's name says about the maps inside it.
//!
//! A name is cut into lower-case words at `_`, `-`, `.`, blanks and inside `camelCase`; words
//! that only tell resolution or format (`2k`, `png`) are taken off the end; the longest known
//! ending wins. So `Wood063_1K_Color`, `WaterBottle_baseColor` and `ceramic_roof_01_diff_2k` are
//! all `color`. Normals are green-up unless the name says `dx`: glTF demands it, and so are the files
//! that ambientCG published as plain `_Normal` (their green follows the height map).

use super::Encoding;
use super::Encoding::{Linear, NormalDx, NormalGl, Srgb};

/// Component of an image file. A grey file has the same value in `R`, `G` and `B`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Component {
    R,
    G,
    B,
    A,
}
use Component::{A, B, G, R};

/// One map and where in its file it lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) map: String,
    pub(super) encoding: Encoding,
    /// `None`: all colour components, however many there are.
    pub(super) components: Option<Vec<Component>>,
}

/// Maps in the order in which a directory's channels are stacked; others follow by name.
const CANONICAL: [&str; 8] = [
    "color",
    "normal",
    "roughness",
    "height",
    "occlusion",
    "metallic",
    "opacity",
    "emissive",
];

/// Endings that name one map, which is the whole file.
const WHOLE: &[(&[&str], &str, Encoding)] = &[
    (&["base", "color"], "color", Srgb),
    (&["basecolor"], "color", Srgb),
    (&["base", "colour"], "color", Srgb),
    (&["color"], "color", Srgb),
    (&["colour"], "color", Srgb),
    (&["col"], "color", Srgb),
    (&["albedo"], "color", Srgb),
    (&["alb"], "color", Srgb),
    (&["diffuse"], "color", Srgb),
    (&["diff"], "color", Srgb),
    (&["normal"], "normal", NormalGl),
    (&["normal", "gl"], "normal", NormalGl),
    (&["normal", "dx"], "normal", NormalDx),
    (&["normalgl"], "normal", NormalGl),
    (&["normaldx"], "normal", NormalDx),
    (&["nor"], "normal", NormalGl),
    (&["nor", "gl"], "normal", NormalGl),
    (&["nor", "dx"], "normal", NormalDx),
    (&["nrm"], "normal", NormalGl),
    (&["roughness"], "roughness", Linear),
    (&["rough"], "roughness", Linear),
    (&["rgh"], "roughness", Linear),
    (&["height"], "height", Linear),
    (&["displacement"], "height", Linear),
    (&["disp"], "height", Linear),
    (&["ht"], "height", Linear),
    (&["ambient", "occlusion"], "occlusion", Linear),
    (&["ambientocclusion"], "occlusion", Linear),
    (&["occlusion"], "occlusion", Linear),
    (&["ao"], "occlusion", Linear),
    (&["metallic"], "metallic", Linear),
    (&["metalness"], "metallic", Linear),
    (&["metal"], "metallic", Linear),
    (&["opacity"], "opacity", Linear),
    (&["alpha"], "opacity", Linear),
    (&["emissive"], "emissive", Srgb),
    (&["emission"], "emissive", Srgb),
    (&["specular"], "specular", Linear),
    (&["spec"], "specular", Linear),
];

type PackedMap = (&'static str, Encoding, &'static [Component]);

const ALBEDO_HEIGHT: &[PackedMap] = &[("color", Srgb, &[R, G, B]), ("height", Linear, &[A])];
const NORMAL_ROUGHNESS: &[PackedMap] = &[
    ("normal", NormalGl, &[R, G, B]),
    ("roughness", Linear, &[A]),
];
const OCCLUSION_ROUGHNESS_METALLIC: &[PackedMap] = &[
    ("occlusion", Linear, &[R]),
    ("roughness", Linear, &[G]),
    ("metallic", Linear, &[B]),
];
/// glTF 2.0, `metallicRoughnessTexture`: red is not used.
const METALLIC_ROUGHNESS: &[PackedMap] = &[("roughness", Linear, &[G]), ("metallic", Linear, &[B])];

/// Endings that name several maps in one file.
const PACKED: &[(&[&str], &[PackedMap])] = &[
    (&["alb", "ht"], ALBEDO_HEIGHT),
    (&["albedo", "height"], ALBEDO_HEIGHT),
    (&["nrm", "rgh"], NORMAL_ROUGHNESS),
    (&["normal", "roughness"], NORMAL_ROUGHNESS),
    (
        &["occlusion", "roughness", "metallic"],
        OCCLUSION_ROUGHNESS_METALLIC,
    ),
    (
        &["occlusionroughnessmetallic"],
        OCCLUSION_ROUGHNESS_METALLIC,
    ),
    (&["ao", "rough", "metal"], OCCLUSION_ROUGHNESS_METALLIC),
    (&["orm"], OCCLUSION_ROUGHNESS_METALLIC),
    (&["arm"], OCCLUSION_ROUGHNESS_METALLIC),
    (&["metallic", "roughness"], METALLIC_ROUGHNESS),
    (&["metallicroughness"], METALLIC_ROUGHNESS),
];

/// The maps in a file with this stem (name without extension). Where no convention applies, the
/// file is a single map named by its stem.
pub(super) fn parts_of(stem: &str) -> Vec<Part> {
    let words = words(stem);
    let ends = |ending: &[&str]| {
        words.len() >= ending.len()
            && words[words.len() - ending.len()..]
                .iter()
                .map(String::as_str)
                .eq(ending.iter().copied())
    };
    let packed = PACKED
        .iter()
        .filter(|(e, _)| ends(e))
        .max_by_key(|(e, _)| e.len());
    let whole = WHOLE
        .iter()
        .filter(|(e, _, _)| ends(e))
        .max_by_key(|(e, _, _)| e.len());
    if let Some((ending, maps)) = packed
        && whole.is_none_or(|(other, _, _)| other.len() <= ending.len())
    {
        let parts = maps.iter().map(|(map, encoding, components)| Part {
            map: (*map).to_owned(),
            encoding: *encoding,
            components: Some(components.to_vec()),
        });
        return parts.collect();
    }
    let (map, encoding) = match whole {
        Some((_, map, encoding)) => (*map, *encoding),
        None => (stem, Linear),
    };
    vec![Part {
        map: map.to_owned(),
        encoding,
        components: None,
    }]
}

/// Encoding of a map whose manifest entry does not tell.
pub(super) fn default_encoding(map: &str) -> Encoding {
    WHOLE
        .iter()
        .find(|(_, name, _)| *name == map)
        .map_or(Linear, |(_, _, encoding)| *encoding)
}

/// Sort key that puts canonical maps first, in their order, and others by name.
pub(super) fn rank(map: &str) -> (usize, &str) {
    (
        CANONICAL
            .iter()
            .position(|name| *name == map)
            .unwrap_or(CANONICAL.len()),
        map,
    )
}

/// Name of the map that holds a file's alpha, when it is not opaque and no convention claims it.
pub(super) fn alpha_map(parts: &[Part], stem: &str) -> String {
    match parts {
        [one] if one.map == "color" => "opacity".to_owned(),
        [one] => format!("{}_alpha", one.map),
        _ => format!("{stem}_alpha"),
    }
}

fn words(stem: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut previous = '_';
    for letter in stem.chars() {
        let separator = matches!(letter, '_' | '-' | '.' | ' ');
        if separator || (previous.is_lowercase() && letter.is_uppercase()) {
            words.push(String::new());
        }
        if !separator && let Some(word) = words.last_mut() {
            word.extend(letter.to_lowercase());
        }
        previous = letter;
    }
    words.retain(|word| !word.is_empty());
    while words.len() > 1 && words.last().is_some_and(|word| tells_format(word)) {
        words.pop();
    }
    words
}

fn tells_format(word: &str) -> bool {
    let resolution = word
        .strip_suffix('k')
        .is_some_and(|n| n.parse::<u8>().is_ok());
    resolution
        || matches!(
            word,
            "png" | "jpg" | "jpeg" | "exr" | "tif" | "tiff" | "tga"
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(stem: &str) -> Vec<(String, Encoding)> {
        parts_of(stem)
            .into_iter()
            .map(|part| (part.map, part.encoding))
            .collect()
    }

    fn one(stem: &str, map: &str, encoding: Encoding) {
        assert_eq!(names(stem), [(map.to_owned(), encoding)], "{stem}");
    }

    #[test]
    fn every_convention_names_its_map() {
        one("Wood063_1K_Color", "color", Srgb);
        one("Wood063_1K_Normal", "normal", NormalGl);
        one("Wood063_1K_NormalGL", "normal", NormalGl);
        one("Wood063_1K_NormalDX", "normal", NormalDx);
        one("RoofingTiles013A_1K-PNG_Displacement", "height", Linear);
        one("Wood063_1K-JPG_AmbientOcclusion", "occlusion", Linear);
        one("Metal01_2K_Metalness", "metallic", Linear);
        one("X_Opacity", "opacity", Linear);
        one("X_Emission", "emissive", Srgb);
        one("WaterBottle_baseColor", "color", Srgb);
        one("WaterBottle_normal", "normal", NormalGl);
        one("WaterBottle_emissive", "emissive", Srgb);
        one("ceramic_roof_01_diff_2k", "color", Srgb);
        one("ceramic_roof_01_nor_gl_2k", "normal", NormalGl);
        one("ceramic_roof_01_nor_dx_2k", "normal", NormalDx);
        one("ceramic_roof_01_disp_16k", "height", Linear);
        one("ceramic_roof_01_rough_2k", "roughness", Linear);
        one("ceramic_roof_01_ao_2k", "occlusion", Linear);
        one("ceramic_roof_01_spec_2k", "specular", Linear);
        one("ceramic_roof_01_metal_2k", "metallic", Linear);
        one("albedo", "color", Srgb);
        one("diffuse", "color", Srgb);
        one("NORMAL", "normal", NormalGl);
        one("height", "height", Linear);
    }

    #[test]
    fn packed_files_are_split() {
        for stem in [
            "x_occlusionRoughnessMetallic",
            "x_orm",
            "x_arm_2k",
            "x_ao_rough_metal",
        ] {
            let expected = ["occlusion", "roughness", "metallic"].map(|m| (m.to_owned(), Linear));
            assert_eq!(names(stem), expected, "{stem}");
        }
        let parts = parts_of("ground037_alb_ht");
        assert_eq!(parts[0].components.as_deref(), Some([R, G, B].as_slice()));
        assert_eq!(
            (parts[1].map.as_str(), parts[1].components.as_deref()),
            ("height", Some([A].as_slice()))
        );
        assert_eq!(
            names("ground037_nrm_rgh"),
            [
                ("normal".to_owned(), NormalGl),
                ("roughness".to_owned(), Linear)
            ]
        );
        let parts = parts_of("x_metallicRoughness");
        assert_eq!(
            (parts[0].map.as_str(), parts[0].components.as_deref()),
            ("roughness", Some([G].as_slice()))
        );
    }

    #[test]
    fn a_name_without_convention_keeps_its_stem() {
        assert_eq!(parts_of("Wood063")[0].map, "Wood063");
        assert_eq!(
            parts_of("alarm")[0].map,
            "alarm",
            "`arm` counts as a word, not as letters"
        );
    }

    #[test]
    fn a_name_of_separators_only_is_no_convention() {
        assert_eq!(parts_of("___")[0].map, "___");
        assert_eq!(parts_of("2k")[0].map, "2k");
    }
}
