//! Class: which part of the unit an instruction keeps busy.

/// The part of the unit that an instruction keeps busy; a column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// Address generators: a place's corners in a grid.
    Position,
    /// Cache and memory: four cells.
    Fetch,
    /// Codes to inputs, as they are.
    Unpack,
    /// Codes to inputs, interpolated.
    Interpolate,
    /// Waves, level and zeros.
    Embed,
    /// The array of multipliers, on integers.
    MultiplyInteger,
    /// The array of multipliers, on halves.
    MultiplyHalf,
    /// Between a sum and its output.
    Activate,
    /// Sums to lanes.
    Requantise,
    /// The port of the residual store.
    Skip,
    /// Sums to channel codes.
    Emit,
    /// The filter behind the decodes, and the footprint before them.
    Filter,
    /// The sequencer: an issue slot and nothing else.
    Control,
}

impl Class {
    /// Every class, in the order of a decode.
    pub const ALL: [Class; 13] = [
        Class::Position,
        Class::Fetch,
        Class::Unpack,
        Class::Interpolate,
        Class::Embed,
        Class::MultiplyInteger,
        Class::MultiplyHalf,
        Class::Activate,
        Class::Requantise,
        Class::Skip,
        Class::Emit,
        Class::Filter,
        Class::Control,
    ];

    /// The name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Class::Position => "position",
            Class::Fetch => "fetch",
            Class::Unpack => "unpack",
            Class::Interpolate => "interpolate",
            Class::Embed => "embed",
            Class::MultiplyInteger => "multiply-integer",
            Class::MultiplyHalf => "multiply-half",
            Class::Activate => "activate",
            Class::Requantise => "requantise",
            Class::Skip => "skip",
            Class::Emit => "emit",
            Class::Filter => "filter",
            Class::Control => "control",
        }
    }
}
