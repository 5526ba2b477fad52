//! Medians over repetitions, figure by figure.

use serde_json::{Map, Number, Value};

use super::types::Figures;

/// The median of every figure over the repetitions. A figure that some repetitions lack, for
/// instance because a scrape failed, is the median of the others.
pub fn median(runs: &[&Figures]) -> Figures {
    let values = runs.iter().filter_map(|run| serde_json::to_value(run).ok());
    serde_json::from_value(of_values(values.collect())).unwrap_or_default()
}

fn of_values(values: Vec<Value>) -> Value {
    match values.first() {
        Some(Value::Object(_)) => {
            let mut columns: Map<String, Value> = Map::new();
            for value in values {
                let Value::Object(fields) = value else { continue };
                for (key, value) in fields {
                    let column = columns.entry(key).or_insert_with(|| Value::Array(Vec::new()));
                    if let Value::Array(column) = column {
                        column.push(value);
                    }
                }
            }
            let columns = columns.into_iter().map(|(key, column)| match column {
                Value::Array(values) => (key, of_values(values)),
                other => (key, other),
            });
            Value::Object(columns.collect())
        }
        Some(Value::Number(_)) => of_numbers(&values),
        other => other.cloned().unwrap_or(Value::Null),
    }
}

/// Counts take the lower of the two values in the middle, so that the median is a count. Other
/// numbers take their mean.
fn of_numbers(values: &[Value]) -> Value {
    let mut counts = values.iter().filter_map(Value::as_u64).collect::<Vec<_>>();
    if counts.len() == values.len() {
        counts.sort_unstable();
        return counts
            .get((counts.len() - 1) / 2)
            .map_or(Value::Null, |&n| n.into());
    }
    let mut numbers = values.iter().filter_map(Value::as_f64).collect::<Vec<_>>();
    numbers.sort_by(f64::total_cmp);
    let middle = |index: usize| numbers.get(index).copied().unwrap_or_default();
    let median = f64::midpoint(
        middle(numbers.len().saturating_sub(1) / 2),
        middle(numbers.len() / 2),
    );
    Number::from_f64(median).map_or(Value::Null, Value::Number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{ServerFigures, Throughput};

    fn run(right: u64, rate: f64, cpu: Option<f64>) -> Figures {
        let mut figures = Figures::default();
        figures.counts.right = right;
        figures.throughput = Throughput {
            requests_per_s: rate,
            ..Throughput::default()
        };
        figures.server = cpu.map(|cpu_s| ServerFigures {
            cpu_s,
            ..ServerFigures::default()
        });
        figures
    }

    #[test]
    fn each_figure_has_its_own_median() {
        let runs = [run(3, 1.5, Some(9.0)), run(1, 9.5, None), run(2, 2.5, Some(5.0))];
        let of = median(&runs.iter().collect::<Vec<_>>());
        assert_eq!((of.counts.right, of.throughput.requests_per_s), (2, 2.5));
        assert_eq!(of.server.unwrap().cpu_s, 7.0);
        let of = median(&runs[..2].iter().collect::<Vec<_>>());
        assert_eq!((of.counts.right, of.throughput.requests_per_s), (1, 5.5));
        assert_eq!(median(&[]), Figures::default());
    }
}
