use std::time::Duration;

use super::*;
use crate::figures::testing::{plan, run};

pub(super) fn report(label: &str, latency_ms: f64) -> Report {
    let began = std::time::UNIX_EPOCH + Duration::from_secs(1_800_000_000);
    let mut report = Report::new(label.to_owned(), began, plan(), vec![run(latency_ms)]);
    report.machine = Machine {
        cpus: 2,
        cpu: "a processor".to_owned(),
        os: "linux x86_64".to_owned(),
    };
    report.tool = "0.0.0".to_owned();
    report
}

fn assert_same(one: &serde_json::Value, two: &serde_json::Value) {
    use serde_json::Value::{Array, Number, Object};
    match (one, two) {
        (Object(one), Object(two)) => {
            assert!(one.keys().eq(two.keys()));
            one.values()
                .zip(two.values())
                .for_each(|(a, b)| assert_same(a, b));
        }
        (Array(one), Array(two)) => {
            assert_eq!(one.len(), two.len());
            one.iter().zip(two).for_each(|(a, b)| assert_same(a, b));
        }
        (Number(one), Number(two)) => {
            let (one, two) = (one.as_f64().unwrap(), two.as_f64().unwrap());
            assert!((one - two).abs() <= 1e-12 * one.abs(), "{one} {two}");
        }
        _ => assert_eq!(one, two),
    }
}

#[test]
fn a_report_comes_back_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.json");
    let report = report("one", 5.0);
    report.write(&path).unwrap();
    let back = Report::read(&path).unwrap();
    // Numbers come back within a last digit.
    assert_same(
        &serde_json::to_value(&back).unwrap(),
        &serde_json::to_value(&report).unwrap(),
    );
    assert_eq!(
        (back.plan, &back.runs[0].latencies),
        (report.plan, &report.runs[0].latencies)
    );

    std::fs::write(&path, r#"{"version": 99}"#).unwrap();
    let error = Report::read(&path).unwrap_err().to_string();
    assert!(error.contains("version 99; allowed: 1"), "{error}");
    std::fs::write(&path, "[]").unwrap();
    assert!(Report::read(&path).is_err());
}

#[test]
fn the_form_is_as_documented() {
    let schema = schemars::schema_for!(Report);
    insta::assert_snapshot!(serde_json::to_string_pretty(&schema).unwrap());
}

#[test]
fn the_table_is_as_documented() {
    insta::assert_snapshot!(table::report(&report("one", 5.0)));
}

#[test]
fn the_comparison_is_as_documented() {
    let text = compare::compare(&[report("before", 6.0), report("after", 3.0)]);
    insta::assert_snapshot!(text);
}

#[test]
fn the_page_needs_nothing_else() {
    let page = html::page(&report("a <label>", 5.0)).unwrap();
    for outside in ["http://", "https://", "<script", "<link", "@import", "src="] {
        let found = page
            .match_indices(outside)
            .map(|(at, _)| &page[at..(at + 60).min(page.len())])
            // XML namespaces and the address of the measured server are not fetched.
            .filter(|text| !text.contains("www.w3.org") && !text.contains("127.0.0.1:8080"))
            .collect::<Vec<_>>();
        assert!(found.is_empty(), "{outside}: {found:?}");
    }
    assert!(page.contains("a &#60;label&#62;"), "what was given is escaped");
    assert!(page.matches("<svg").count() >= 5);
}
