//! Table: published energies of operations, from a file.

use crate::time::unit::hexadecimal;
use std::fmt;

/// The largest price that is believed, in picojoules: the tables' most expensive operation is a
/// thousand times cheaper.
const MOST_PICOJOULES: f64 = 1e6;

/// The price of one operation.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Price {
    /// Picojoules of one.
    pub picojoules: f64,
    /// Where the figure was published, or how it follows from one that was.
    pub source: String,
}

/// The price of an access of 64 bits to a static RAM of one size, read or written.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SramPrice {
    /// Bytes of the RAM.
    pub bytes: u64,
    /// Picojoules of an access.
    pub picojoules: f64,
    /// Where the figure was published.
    pub source: String,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    about: String,
    int8_multiply: Price,
    int4_multiply: Price,
    int32_multiply: Price,
    fp16_multiply: Price,
    int8_add: Price,
    int32_add: Price,
    fp32_add: Price,
    register: Price,
    dram: Price,
    sram: Vec<SramPrice>,
}

/// Prices of operations, validated: every one is there, positive, and has a source.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyTable {
    name: String,
    about: String,
    /// A multiplication of two bytes.
    pub(super) int8_multiply: Price,
    /// A multiplication of a byte by 4 bits.
    pub(super) int4_multiply: Price,
    /// A multiplication of two 32-bit integers.
    pub(super) int32_multiply: Price,
    /// A multiplication of two halves.
    pub(super) fp16_multiply: Price,
    /// An addition of bytes.
    pub(super) int8_add: Price,
    /// An addition of 32-bit integers.
    pub(super) int32_add: Price,
    /// An addition of f32.
    pub(super) fp32_add: Price,
    /// 64 bits through a register file or a queue.
    pub(super) register: Price,
    /// 64 bits from memory outside.
    pub(super) dram: Price,
    sram: Vec<SramPrice>,
}

/// Why a text is no table of energies.
#[derive(Clone, Debug, PartialEq)]
pub enum EnergyError {
    /// No TOML, or a key is missing, unknown or of another kind.
    Syntax {
        /// What the reader says, with the line.
        found: String,
    },
    /// A price is no positive number that can be believed.
    Price {
        /// The entry.
        entry: String,
        /// Its price.
        found: f64,
    },
    /// An entry does not say where it comes from.
    Source {
        /// The entry.
        entry: String,
    },
    /// The sizes of the static RAMs do not grow, or their prices fall.
    Order {
        /// The entry that is out of order.
        entry: String,
    },
    /// No built-in table has this name.
    Unknown {
        /// The name.
        found: String,
    },
}

impl fmt::Display for EnergyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EnergyError::Syntax { found } => write!(f, "no energy table: {}", found.trim_end()),
            EnergyError::Price { entry, found } => write!(
                f,
                "energy.{entry}.picojoules: found {found}; allowed: above 0, at most {MOST_PICOJOULES}"
            ),
            EnergyError::Source { entry } => {
                write!(f, "energy.{entry}.source: found none; allowed: a text")
            }
            EnergyError::Order { entry } => write!(
                f,
                "energy.{entry}: found out of order; allowed: at least one, larger ones later and not cheaper"
            ),
            EnergyError::Unknown { found } => write!(
                f,
                "energy table: found {found:?}; allowed: {}",
                EnergyTable::names().join(", ")
            ),
        }
    }
}

impl std::error::Error for EnergyError {}

const NAMES: [&str; 2] = ["energy", "energy-7nm"];

const FILES: [&str; 2] = [
    include_str!("../../../../units/energy.toml"),
    include_str!("../../../../units/energy-7nm.toml"),
];

impl EnergyTable {
    /// The table in a file's text, under a name of the caller's. Every entry is there, and no other
    /// key.
    ///
    /// # Errors
    /// When a key is missing, unknown or of another kind, a price is not positive, a source is
    /// empty, or the static RAMs are not in the order of their size and price.
    pub fn from_toml(name: impl Into<String>, text: &str) -> Result<EnergyTable, EnergyError> {
        let file: File = toml::from_str(text).map_err(|error| EnergyError::Syntax {
            found: error.to_string(),
        })?;
        let table = EnergyTable {
            name: name.into(),
            about: file.about,
            int8_multiply: file.int8_multiply,
            int4_multiply: file.int4_multiply,
            int32_multiply: file.int32_multiply,
            fp16_multiply: file.fp16_multiply,
            int8_add: file.int8_add,
            int32_add: file.int32_add,
            fp32_add: file.fp32_add,
            register: file.register,
            dram: file.dram,
            sram: file.sram,
        };
        for (entry, found, source) in table.prices() {
            if !(found > 0.0 && found <= MOST_PICOJOULES) {
                return Err(EnergyError::Price { entry, found });
            }
            if source.trim().is_empty() {
                return Err(EnergyError::Source { entry });
            }
        }
        let out_of_order = |pair: &[SramPrice]| {
            pair[0].bytes >= pair[1].bytes || pair[0].picojoules > pair[1].picojoules
        };
        let entry = match table.sram.windows(2).position(out_of_order) {
            Some(index) => format!("sram[{}]", index + 1),
            None if table.sram.first().is_none_or(|sram| sram.bytes == 0) => "sram[0]".to_owned(),
            None => return Ok(table),
        };
        Err(EnergyError::Order { entry })
    }

    /// The built-in table with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn by_name(name: &str) -> Result<EnergyTable, EnergyError> {
        match NAMES.iter().position(|n| *n == name) {
            Some(index) => EnergyTable::from_toml(name, FILES[index]),
            None => Err(EnergyError::Unknown {
                found: name.to_owned(),
            }),
        }
    }

    /// The names of the built-in tables; the first is the default.
    #[must_use]
    pub fn names() -> &'static [&'static str] {
        &NAMES
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it stands for, in a line.
    #[must_use]
    pub fn about(&self) -> &str {
        &self.about
    }

    /// Name and the first six bytes of the SHA-256 of its prices: what every result prints.
    #[must_use]
    pub fn identity(&self) -> String {
        let mut lines: Vec<String> = self
            .prices()
            .into_iter()
            .map(|(entry, picojoules, _)| format!("{entry}={picojoules}\n"))
            .collect();
        let sizes = self.sram.iter().map(|sram| format!("{}\n", sram.bytes));
        lines.extend(sizes);
        format!("{}@{}", self.name, hexadecimal(&lines.concat()))
    }

    /// Every entry: its name, its picojoules and its source.
    #[must_use]
    pub fn prices(&self) -> Vec<(String, f64, &str)> {
        let named = [
            ("int8_multiply", &self.int8_multiply),
            ("int4_multiply", &self.int4_multiply),
            ("int32_multiply", &self.int32_multiply),
            ("fp16_multiply", &self.fp16_multiply),
            ("int8_add", &self.int8_add),
            ("int32_add", &self.int32_add),
            ("fp32_add", &self.fp32_add),
            ("register", &self.register),
            ("dram", &self.dram),
        ]
        .map(|(name, price)| (name.to_owned(), price.picojoules, &*price.source));
        let sram = self.sram.iter().enumerate();
        let sram = sram.map(|(i, sram)| (format!("sram[{i}]"), sram.picojoules, &*sram.source));
        named.into_iter().chain(sram).collect()
    }

    /// One of an entry.
    pub(super) fn entry(&self, name: &str, price: &Price) -> Term {
        Term {
            times: 1.0,
            of: name.to_owned(),
            price: price.picojoules,
            source: price.source.clone(),
        }
    }

    /// An access of 64 bits to a static RAM of so many bytes.
    ///
    /// Up to the smallest size of the table it is that size's price: smaller arrays gain nothing.
    /// Between two sizes it is a power of the size that meets both. Beyond the largest the last
    /// such power goes on; a table with one size has one price.
    pub(super) fn sram_of(&self, bytes: u64) -> Term {
        let above = self.sram.iter().position(|sram| bytes <= sram.bytes);
        let index = above.unwrap_or(self.sram.len() - 1);
        let high = &self.sram[index];
        let (price, source) = match index.checked_sub(1).map(|below| &self.sram[below]) {
            Some(low) if bytes != high.bytes => {
                let steepness = (high.picojoules / low.picojoules).ln()
                    / (high.bytes as f64 / low.bytes as f64).ln();
                let price = low.picojoules * (bytes as f64 / low.bytes as f64).powf(steepness);
                let between = if above.is_some() { "between" } else { "beyond" };
                let source = format!("{between} {} and {}", low.source, high.source);
                (price, source)
            }
            Some(_) | None => (high.picojoules, high.source.clone()),
        };
        Term {
            times: 1.0,
            of: format!("sram({bytes} bytes)"),
            price,
            source,
        }
    }
}

/// So many of an entry.
#[derive(Clone, Debug)]
pub(super) struct Term {
    times: f64,
    of: String,
    price: f64,
    pub(super) source: String,
}

impl Term {
    pub(super) fn times(&self, factor: f64) -> Term {
        Term {
            times: self.times * factor,
            ..self.clone()
        }
    }

    pub(super) fn picojoules(&self) -> f64 {
        self.times * self.price
    }
}

impl fmt::Display for Term {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.times == 1.0 {
            write!(f, "{}", self.of)
        } else if self.times < 1.0 {
            write!(f, "{} / {}", self.of, 1.0 / self.times)
        } else {
            write!(f, "{} × {}", self.times, self.of)
        }
    }
}
