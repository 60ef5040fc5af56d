//! Operations: what a run did, as plain counts.

use std::ops::AddAssign;

macro_rules! operations {
    ( $( $(#[doc = $doc:literal])+ $field:ident $variant:ident, )+ ) => {
        /// What a run did.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Operations {
            $( $(#[doc = $doc])+ pub $field: u64, )+
        }

        /// A kind of operation.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Operation {
            $( $(#[doc = $doc])+ $variant, )+
        }

        impl Operation {
            /// Every kind, in the order of the texel's journey.
            pub const ALL: &[Operation] = &[ $( Operation::$variant ),+ ];

            /// The name in tables and JSON, that of the field of [`Operations`].
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Operation::$variant => stringify!($field), )+ }
            }

            /// What is counted, for tables.
            #[must_use]
            pub const fn summary(self) -> &'static str {
                match self { $( Operation::$variant => concat!($( $doc ),+), )+ }
            }
        }

        impl Operations {
            /// One of every kind, whose energy is the list of prices.
            pub const ONE_OF_EACH: Operations = Operations { $( $field: 1, )+ };

            /// How many of this kind.
            #[must_use]
            pub const fn of(&self, operation: Operation) -> u64 {
                match operation { $( Operation::$variant => self.$field, )+ }
            }

            /// What this run did more of than another, each kind for itself; nothing where the other
            /// did more.
            #[must_use]
            pub const fn beyond(&self, other: &Operations) -> Operations {
                Operations { $( $field: self.$field.saturating_sub(other.$field), )+ }
            }
        }

        impl AddAssign for Operations {
            fn add_assign(&mut self, other: Operations) {
                $( self.$field += other.$field; )+
            }
        }
    };
}

operations! {
    /// Grid positions turned into addresses.
    address_steps AddressSteps,
    /// Lines looked up in the tags of the latent cache.
    tag_lookups TagLookups,
    /// Bytes read from the latent cache.
    l1_read_bytes L1ReadBytes,
    /// Bytes written into the latent cache.
    l1_fill_bytes L1FillBytes,
    /// Bytes read from the second level.
    l2_read_bytes L2ReadBytes,
    /// Bytes written into the second level.
    l2_fill_bytes L2FillBytes,
    /// Bytes of latents from memory, in whole bursts.
    memory_bytes MemoryBytes,
    /// Latents of corners unpacked.
    unpacked_latents UnpackedLatents,
    /// Latents interpolated, four corners each.
    interpolations Interpolations,
    /// Waves, levels and zeros written.
    embedded Embedded,
    /// Bytes of parameters from outside, and into the weight SRAM.
    weight_fill_bytes WeightFillBytes,
    /// Bytes of parameters from the weight SRAM to the array.
    weight_sram_read_bytes WeightSramReadBytes,
    /// Multiplications of a byte by a byte, each with its addition.
    macs_bytes MacsBytes,
    /// Multiplications by a weight of at most 4 bits, each with its addition.
    macs_narrow MacsNarrow,
    /// Multiplications of an integer of more than 8 bits by a weight, each with its addition.
    macs_wide MacsWide,
    /// Multiplications of halves, each with its f32 addition.
    macs_half MacsHalf,
    /// Accumulators rescaled to activations or codes.
    requantised Requantised,
    /// Activations of a skip path rescaled and added.
    skip_adds SkipAdds,
    /// Bytes of inputs and activations written or read between layers.
    activation_bytes ActivationBytes,
    /// Bytes of decoded texels read from their cache.
    decoded_cache_read_bytes DecodedCacheReadBytes,
    /// Bytes of decoded texels written into their cache.
    decoded_cache_fill_bytes DecodedCacheFillBytes,
    /// Codes weighted and added by the filter.
    filtered_codes FilteredCodes,
    /// Bytes that leave the unit.
    output_bytes OutputBytes,
}
