//! What commands print.

use std::io::{ErrorKind, Write as _};

use comfy_table::{ContentArrangement, Table, presets};

use crate::failure::Failure;

/// Prints a command's answer. A reader that closes the pipe, such as `head`, is no error.
///
/// # Errors
/// [`Failure::Other`] if standard output cannot be written.
pub fn print(text: &str) -> Result<(), Failure> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::Other(format!("cannot print: {e}"))),
        _ => Ok(()),
    }
}

/// A message as JSON to print.
pub(crate) fn to_json(message: &impl serde::Serialize) -> Result<String, Failure> {
    serde_json::to_string_pretty(message).map_err(|e| Failure::Other(e.to_string()))
}

/// A table as all commands print them.
pub(crate) fn table() -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic);
    if table.width().is_none() {
        // Not on a terminal: wide enough for the list, and still readable.
        table.set_width(120);
    }
    table
}
