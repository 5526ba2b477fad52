//! Percentiles and tables of what was measured.

use std::time::Duration;

/// The value below which this share of all lies; 0 where there are none.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (share * sorted.len() as f64).ceil() as usize;
    let place = place.clamp(1, sorted.len().max(1)) - 1;
    sorted.get(place).copied().unwrap_or(0.0)
}

/// The largest value; 0 where there are none.
pub fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Milliseconds of a time.
pub fn ms(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

/// MiB of bytes.
pub fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// A Markdown table whose first `words` columns are text.
pub fn table(heads: &[&str], words: usize, rows: &[Vec<String>]) -> String {
    let rule = |nth: usize| if nth < words { "---" } else { "---:" }.to_owned();
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let heads: Vec<String> = heads.iter().map(|&head| head.to_owned()).collect();
    let rules: Vec<String> = (0..heads.len()).map(rule).collect();
    let rows = rows.iter().map(|row| line(row));
    [line(&heads), line(&rules)].into_iter().chain(rows).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_a_value_that_was_measured() {
        let values: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let found = [0.0, 0.5, 0.99, 1.0].map(|share| quantile(&values, share));
        assert_eq!(found, [1.0, 100.0, 198.0, 200.0]);
        assert_eq!((quantile(&[], 0.5), quantile(&[3.0], 0.99)), (0.0, 3.0));
    }

    #[test]
    fn a_table_has_a_rule_below_its_heads() {
        let rows = [vec!["x".to_owned(), "1".to_owned()]];
        assert_eq!(
            table(&["what", "ms"], 1, &rows),
            "| what | ms |\n| --- | ---: |\n| x | 1 |\n"
        );
    }
}
