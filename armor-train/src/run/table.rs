//! A CSV of numbers, held in memory and written whole.

/// The table of `metrics.csv` or `speed.csv`; its first column is the training step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    header: String,
    rows: Vec<String>,
}

impl Table {
    /// A table without rows.
    pub(super) fn new<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        Self { header: names.collect::<Vec<_>>().join(","), rows: Vec::new() }
    }

    /// A table from its text; whether its rows are numbers is not looked at.
    pub fn parse(text: &str) -> Self {
        let mut lines = text.lines().map(str::to_owned);
        Self { header: lines.next().unwrap_or_default(), rows: lines.collect() }
    }

    /// Appends a row.
    pub(super) fn push(&mut self, values: &[f64]) {
        // The shortest text that reads as the same number.
        self.rows.push(values.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    }

    /// Keeps the rows up to `step`: what came after belongs to work that was lost.
    pub(super) fn keep_until(&mut self, step: u64) {
        let step_of = |row: &str| row.split(',').next().and_then(|step| step.parse::<u64>().ok());
        self.rows.retain(|row| step_of(row).is_some_and(|at| at <= step));
    }

    /// The file's content.
    pub(super) fn text(&self) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows);
        lines.flat_map(|line| [line.as_str(), "\n"]).collect()
    }

    /// Names of the columns.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.header.split(',')
    }

    /// The rows as numbers, or the number of the first line of the file that is none.
    ///
    /// # Errors
    /// That line's number, counted from 1.
    pub fn rows(&self) -> Result<Vec<Vec<f64>>, usize> {
        let columns = self.names().count();
        let parse = |(place, row): (usize, &String)| {
            let values: Option<Vec<f64>> = row.split(',').map(|value| value.parse().ok()).collect();
            values.filter(|values| values.len() == columns).ok_or(place + 2)
        };
        self.rows.iter().enumerate().map(parse).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(["step", "a"].into_iter());
        [[100.0, 0.1], [200.0, -2e-30], [300.0, 3.0]].iter().for_each(|row| table.push(row));
        table
    }

    #[test]
    fn a_table_is_read_back_with_the_same_bits() {
        let read = Table::parse(&table().text());
        assert_eq!(read, table());
        assert_eq!(read.rows().unwrap(), [[100.0, 0.1], [200.0, -2e-30], [300.0, 3.0]]);
        assert_eq!(read.names().collect::<Vec<_>>(), ["step", "a"]);
    }

    #[test]
    fn rows_beyond_the_checkpoint_are_dropped() {
        let mut table = table();
        table.keep_until(200);
        assert!(table.text().starts_with("step,a\n100,0.1\n200,-0.0"), "{}", table.text());
        assert_eq!(table.rows().unwrap().len(), 2);
    }

    #[test]
    fn a_line_that_is_no_row_of_numbers_is_named() {
        for bad in ["1,2\n3", "1,2\n3,x", "1,2\n3,4,5"] {
            assert_eq!(Table::parse(&format!("step,a\n{bad}\n")).rows(), Err(3), "{bad}");
        }
    }
}
