//! Placeholder while the stepped model is built.
