use tempfile::TempDir;

use super::*;
use crate::config::Preset;
use crate::run::{ALARMS_FILE, COLUMNS, CONFIG_FILE, METRICS_FILE, Provenance, SPEED_FILE};
use crate::testing::recording;

/// A run's folder with some rows; every column has numbers of its own.
pub(super) fn run(rows: usize) -> (TempDir, RunFolder) {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let names: Vec<&str> = COLUMNS.iter().map(|column| column.name).collect();
    let mut metrics = names.join(",") + "\n";
    let mut speed = "step,steps_per_second\n".to_owned();
    for row in 1..=rows {
        let values = (1..names.len()).map(|column| (column * row) as f64 / 8.0);
        let values = std::iter::once(100.0 * row as f64).chain(values).map(|value| value.to_string());
        metrics += &(values.collect::<Vec<_>>().join(",") + "\n");
        speed += &format!("{},{}\n", 100 * row, 40 + row);
    }
    let mut config = Preset::Quick.config("ball-<run>", 5.0);
    (config.seed, config.eta) = (3, 0.25);
    let data = recording(2, 3, |_| 1.0, |_| 1.0);
    write(METRICS_FILE, &metrics);
    write(SPEED_FILE, &speed);
    write(ALARMS_FILE, "step 100: lambda sits at its cap: 148.4 at kappa 0 & 5; try `eta`\n");
    write(CONFIG_FILE, &config.options().to_string());
    write(Provenance::FILE, &serde_json::to_string(&Provenance::new(&config, &data)).unwrap());
    let run = RunFolder::read(folder.path());
    match run {
        Ok(run) => (folder, run),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn a_page_is_complete_in_itself() {
    let (_folder, run) = run(3);
    let page = page(&run);
    for outside in ["http:", "https:", "src=", "href=", "url(", "@import", "<script", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    assert!(page.contains("prefers-color-scheme: dark") && page.contains("name=\"viewport\""));
}

#[test]
fn every_tag_is_closed() {
    let (_folder, run) = run(3);
    let page = page(&run);
    for tag in ["figure", "figcaption", "table", "tr", "td", "th", "ul", "li", "svg", "text", "div", "h2", "h3", "p"] {
        let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert!(opened > 0, "{tag}");
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }
}

#[test]
fn a_page_tells_configuration_origin_and_alarms_with_their_special_characters() {
    let (_folder, run) = run(3);
    let page = page(&run);
    assert!(page.contains("ball-&lt;run&gt;, preset quick, cost limit 5, seed 3; 300 of 9000 steps"));
    assert!(page.contains("<li>step 100: lambda sits at its cap: 148.4 at kappa 0 &amp; 5; try <code>eta</code></li>"));
    assert!(page.contains(&"05".repeat(32)));
    assert!(page.contains("<tr class=\"changed\"><td>eta</td><td class=\"value\">0.25</td><td>1.0</td>"));
    assert_eq!(page.matches("<tr class=\"changed\">").count(), 2, "eta and seed");
    for column in COLUMNS {
        assert!(page.contains(&format!("<td>{}</td>", column.name)), "{}", column.name);
    }
}

#[test]
fn a_run_without_alarms_says_so() {
    let (_folder, mut run) = run(1);
    run.alarms.clear();
    assert!(page(&run).contains("No alarm was raised."));
}

#[test]
fn a_folder_that_gives_no_report_is_named() {
    let (folder, _) = run(3);
    let path = folder.path();
    let metrics = std::fs::read_to_string(path.join(METRICS_FILE)).unwrap();
    let error = |text: &str| {
        std::fs::write(path.join(METRICS_FILE), text).unwrap();
        RunFolder::read(path).unwrap_err()
    };
    let header = metrics.lines().next().unwrap();
    assert!(matches!(error(header), ReportError::NoRows { .. }));
    assert!(matches!(
        error(&metrics.replace("lambda_kappa_0", "l")),
        ReportError::Column { column: "lambda_kappa_0", .. }
    ));
    assert!(matches!(error(&metrics.replace("\n200,", "\n200,x")), ReportError::Row { line: 3, .. }));
    std::fs::write(path.join(METRICS_FILE), &metrics).unwrap();
    std::fs::write(path.join(Provenance::FILE), "{}").unwrap();
    assert!(matches!(RunFolder::read(path).unwrap_err(), ReportError::Origin { .. }));
    std::fs::remove_file(path.join(CONFIG_FILE)).unwrap();
    assert!(matches!(RunFolder::read(path).unwrap_err(), ReportError::File(_)));
    let empty = tempfile::tempdir().unwrap();
    let error = RunFolder::read(empty.path()).unwrap_err();
    assert!(
        error.to_string().ends_with("holds no metrics.csv; name the folder of a run, the --out of `armor-train fit`")
    );
}
