//! Tables as CSV and Markdown.

use std::fmt::Write;

/// A value in a table.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Text(String),
    Count(usize),
    Number(f64),
    /// There is no value.
    Missing,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count)
    }
}

impl From<i32> for Cell {
    fn from(number: i32) -> Self {
        Self::Text(number.to_string())
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        if number.is_finite() { Self::Number(number) } else { Self::Missing }
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}

/// Rows under named columns.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub columns: Vec<String>,
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(crate) fn new<S: Into<String>>(columns: impl IntoIterator<Item = S>) -> Self {
        Self { columns: columns.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row; the columns' number of cells.
    pub(crate) fn push(&mut self, row: Vec<Cell>) {
        debug_assert_eq!(row.len(), self.columns.len());
        self.rows.push(row);
    }

    /// RFC 4180, numbers as the shortest decimals that read back the same.
    pub(crate) fn csv(&self) -> String {
        let mut text = String::new();
        let mut line = |cells: Vec<String>| {
            text.push_str(&cells.join(","));
            text.push_str("\r\n");
        };
        line(self.columns.iter().map(|name| quoted(name)).collect());
        for row in &self.rows {
            line(row.iter().map(csv_cell).collect());
        }
        text
    }

    /// GitHub's tables, numbers to three figures.
    pub(crate) fn markdown(&self) -> String {
        let mut text = String::new();
        let escape = |cell: &str| cell.replace('|', "\\|");
        let mut line = |cells: Vec<String>| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        };
        line(self.columns.iter().map(|name| escape(name)).collect());
        line(self.columns.iter().map(|_| "---".to_owned()).collect());
        for row in &self.rows {
            line(row.iter().map(|cell| escape(&readable(cell))).collect());
        }
        text
    }
}

fn csv_cell(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => quoted(text),
        Cell::Count(count) => count.to_string(),
        Cell::Number(number) => number.to_string(),
        Cell::Missing => String::new(),
    }
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn readable(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => text.clone(),
        Cell::Count(count) => count.to_string(),
        Cell::Number(number) => short(*number),
        Cell::Missing => "–".to_owned(),
    }
}

/// About three figures: `0.31`, `42.7`, `1140`, `1.9e-9`.
pub(super) fn short(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e5).contains(&size) => format!("{number:.1e}"),
        size if size < 0.1 => format!("{number:.4}"),
        size if size < 10.0 => format!("{number:.2}"),
        size if size < 100.0 => format!("{number:.1}"),
        _ => format!("{number:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(["name", "a, b"]);
        table.push(vec!["x \"y\" | z".into(), 0.1_f64.into()]);
        table.push(vec![Cell::Missing, 7_usize.into()]);
        table
    }

    #[test]
    fn csv_quotes_and_keeps_every_digit() {
        let expected = "name,\"a, b\"\r\n\"x \"\"y\"\" | z\",0.1\r\n,7\r\n";
        assert_eq!(table().csv(), expected);
        let third = Cell::from(1.0 / 3.0);
        assert_eq!(csv_cell(&third).parse::<f64>(), Ok(1.0 / 3.0));
    }

    #[test]
    fn markdown_escapes_what_would_split_a_cell() {
        let expected = "| name | a, b |\n| --- | --- |\n| x \"y\" \\| z | 0.10 |\n| – | 7 |\n";
        assert_eq!(table().markdown(), expected);
    }

    #[test]
    fn numbers_are_short() {
        let found = [0.0, 1.94e-9, 0.0123, 0.306, -3.0, 42.74, 1142.5, 2.5e6].map(short);
        assert_eq!(found, ["0", "1.9e-9", "0.0123", "0.31", "-3.00", "42.7", "1142", "2.5e6"]);
        assert_eq!(Cell::from(f64::NAN), Cell::Missing);
    }
}
