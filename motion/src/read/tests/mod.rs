//! Tests of whole files.

mod archives;
mod dialects;
mod hostile;
mod kinds;
mod people;
mod rigs;
mod robots;
