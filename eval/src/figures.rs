//! Percentiles, units, tables and processor times.

use std::io;
use std::time::Duration;

/// Clock ticks a second in `/proc/PID/stat`: 100 on every Linux.
const CLOCK_TICKS: f64 = 100.0;

/// The value below which a share (0 to 1) of `values` lies; NaN of none.
pub(crate) fn percentile(values: &[f64], share: f64) -> f64 {
    troupe_motion::metrics::percentile(values.to_vec(), share).unwrap_or(f64::NAN)
}

/// The largest value; 0 of none.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// NaN of none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// A time in milliseconds.
pub(crate) fn ms(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

/// A number of bytes in MiB.
pub(crate) fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// A Markdown table. Its first `texts` columns are text, the others numbers.
pub(crate) fn table(heads: &[&str], texts: usize, rows: &[Vec<String>]) -> String {
    let rule = |nth: usize| if nth < texts { "---" } else { "---:" }.to_owned();
    let row = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let heads: Vec<String> = heads.iter().map(|&head| head.to_owned()).collect();
    let rules: Vec<String> = (0..heads.len()).map(rule).collect();
    let rows = rows.iter().map(|cells| row(cells));
    [row(&heads), row(&rules)].into_iter().chain(rows).collect()
}

/// Adds a line.
pub(crate) fn line(text: &mut String, what: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = std::fmt::Write::write_fmt(text, format_args!("{what}\n"));
}

/// User and system time that a process has taken so far, seconds; `process` is a process id or
/// `self`.
///
/// # Errors
/// Those of the system, if the process is gone.
pub(crate) fn cpu_seconds(process: impl std::fmt::Display) -> io::Result<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat"))?;
    // Behind the name, which may hold spaces, they are the 12th and the 13th number.
    let rest = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let numbers = rest.split_whitespace().skip(11).take(2);
    Ok(numbers.filter_map(|n| n.parse::<f64>().ok()).sum::<f64>() / CLOCK_TICKS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_rule_below_its_heads() {
        let rows = [vec!["x".to_owned(), "1".to_owned()]];
        assert_eq!(
            table(&["what", "ms"], 1, &rows),
            "| what | ms |\n| --- | ---: |\n| x | 1 |\n"
        );
    }
}
