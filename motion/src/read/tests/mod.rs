//! Tests of whole files.

mod archives;
mod dialects;
mod kinds;
mod people;
mod robots;
