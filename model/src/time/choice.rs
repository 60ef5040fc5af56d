//! Choice: the fields of a unit that are no numbers.

macro_rules! choices {
    ($( $(#[doc = $doc:literal])+ $type:ident { $( $(#[doc = $variant_doc:literal])+ $variant:ident = $name:literal, )+ } )+) => { $(
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $type {
            $( $(#[doc = $variant_doc])+ $variant, )+
        }

        impl $type {
            /// Every choice.
            pub const ALL: &[$type] = &[ $( $type::$variant ),+ ];
            /// Their names.
            pub const NAMES: &[&str] = &[ $( $name ),+ ];

            /// The name in files, tables and JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( $type::$variant => $name, )+ }
            }

            /// The choice with this name.
            #[must_use]
            pub fn by_name(name: &str) -> Option<$type> {
                match name { $( $name => Some($type::$variant), )+ _ => None }
            }
        }
    )+ };
}

choices! {
    /// What the latent cache holds.
    CacheKind {
        /// What its sets and ways hold.
        Finite = "finite",
        /// Nothing: every line comes from behind it, once for each fetch of a group.
        None = "none",
        /// Everything it ever held: every line comes once.
        Infinite = "infinite",
    }
    /// Which line of a set is replaced.
    Replacement {
        /// The one not used for longest.
        Lru = "lru",
        /// The one that came first.
        Fifo = "fifo",
        /// One chosen by a 16-bit linear feedback shift register.
        Random = "random",
        /// The one that a binary tree of last directions points to; ways are a power of two.
        TreePlru = "tree-plru",
    }
    /// What happens behind a miss.
    Misses {
        /// Later groups are looked up while lines are under way.
        HitUnderMiss = "hit-under-miss",
        /// The tags wait until every line under way is there.
        Blocking = "blocking",
    }
    /// What stays in the MAC array while the rest passes.
    Dataflow {
        /// A tile of weights, rows × columns; texels pass.
        WeightStationary = "weight-stationary",
        /// Accumulators of rows outputs × columns texels; inputs pass, one a cycle.
        OutputStationary = "output-stationary",
    }
    /// How operands reach the array's multipliers.
    Wiring {
        /// To all in the same cycle; sums by trees of adders.
        Broadcast = "broadcast",
        /// From neighbour to neighbour: a pass is longer by rows + columns − 2 cycles, and by rows
        /// more where accumulators leave through the rows (Samajdar et al. 2018, SCALE-Sim).
        Systolic = "systolic",
    }
}
