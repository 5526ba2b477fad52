//! Tests of whole files.

mod dialects;
mod kinds;
mod people;
