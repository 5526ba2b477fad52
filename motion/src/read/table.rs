//! Tables of numbers as text: a frame a row, with or without a header.

use super::error::ReadErrorKind;
use crate::clip::MAX_FRAMES;

/// A table of finite numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Table {
    /// Names of the columns, if the first line has them.
    pub(super) header: Option<Vec<String>>,
    pub(super) columns: usize,
    /// `rows * columns` numbers.
    pub(super) numbers: Vec<f64>,
    /// Line of the first row, from 1.
    pub(super) first_line: usize,
}

impl Table {
    /// Reads numbers between commas, semicolons, tabs or spaces.
    pub(super) fn parse(text: &str) -> Result<Self, ReadErrorKind> {
        let lines = (1..)
            .zip(text.lines())
            .filter(|(_, line)| !line.trim().is_empty());
        let mut lines = lines
            .filter(|(_, line)| !line.trim_start().starts_with('#'))
            .peekable();
        let Some(&(_, first)) = lines.peek() else {
            return Err(crate::clip::ClipError::Empty.into());
        };
        let separator = [',', ';', '\t'].into_iter().find(|&mark| first.contains(mark));
        let cells = |line: &'_ str| -> Vec<String> {
            match separator {
                // Some programs end each line with a separator.
                Some(mark) => (line
                    .trim_end_matches([' ', '\r'])
                    .strip_suffix(mark)
                    .unwrap_or(line))
                .split(mark)
                .map(|cell| cell.trim().trim_matches('"').to_owned())
                .collect(),
                None => line.split_whitespace().map(str::to_owned).collect(),
            }
        };
        let is_word = |cell: &String| cell.parse::<f64>().is_err() && cell.contains(char::is_alphabetic);
        let named = cells(first);
        let mut table = Self {
            columns: named.len(),
            ..Self::default()
        };
        // "nan" is a number of a broken row, not a name.
        let is_number = |cell: &String| cell.parse::<f64>().is_ok();
        if named.iter().all(|cell| is_word(cell) || cell.is_empty()) && !named.iter().any(is_number) {
            table.header = Some(named);
            lines.next();
        }
        for (line, text) in lines {
            if table.numbers.is_empty() {
                table.first_line = line;
            }
            let before = table.numbers.len();
            if before / table.columns.max(1) >= MAX_FRAMES {
                return Err(ReadErrorKind::Robot(format!("line {line}: too many frames")));
            }
            let row = cells(text);
            if row.len() != table.columns {
                let (found, expected) = (row.len(), table.columns);
                let text = format!("line {line}: {found} columns; the first row has {expected}");
                return Err(ReadErrorKind::Robot(text));
            }
            for (column, cell) in (1..).zip(&row) {
                match cell.parse::<f64>() {
                    Ok(number) if number.is_finite() => table.numbers.push(number),
                    _ => {
                        let cell: String = cell.chars().take(32).collect();
                        let text = format!("line {line}, column {column}: {cell:?} is no finite number");
                        return Err(ReadErrorKind::Robot(text));
                    }
                }
            }
        }
        match table.numbers.is_empty() {
            true => Err(crate::clip::ClipError::Empty.into()),
            false => Ok(table),
        }
    }

    pub(super) fn rows(&self) -> usize {
        self.numbers.len() / self.columns.max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_and_headers_are_found() {
        for text in [
            "1,2\n3,4\n",
            "1; 2\r\n\r\n3; 4",
            "1 2\n3   4",
            "1\t2\n3\t4",
            "# x y\n1,2\n3,4",
            "1,2,\n3,4, \n",
            "1;2;\n3;4",
            "1\t2\t\n3\t4\t",
        ] {
            let table = Table::parse(text).unwrap();
            assert_eq!(
                (&table.numbers[..], table.rows(), table.header),
                (&[1.0, 2.0, 3.0, 4.0][..], 2, None),
                "{text}"
            );
        }
        let table = Table::parse("time,\"x\"\n0.5,1e-2\n").unwrap();
        assert_eq!(
            (table.header.unwrap(), table.numbers, table.first_line),
            (vec!["time".to_owned(), "x".to_owned()], vec![0.5, 0.01], 2)
        );
    }

    #[test]
    fn errors_name_line_and_column() {
        for (text, wanted) in [
            ("1,2\n3\n", "line 2: 1 columns; the first row has 2"),
            ("1,2,,\n", "line 1, column 3: \"\" is no finite number"),
            ("1,2,3\n3,4,\n", "line 2: 2 columns; the first row has 3"),
            ("1,2\n3,x\n", "line 2, column 2: \"x\" is no finite number"),
            ("nan,2\n", "line 1, column 1: \"nan\" is no finite number"),
            ("1,inf\n", "line 1, column 2"),
            ("", "at least one frame"),
            ("a,b\n", "at least one frame"),
        ] {
            let error = Table::parse(text).unwrap_err().to_string();
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }
}
