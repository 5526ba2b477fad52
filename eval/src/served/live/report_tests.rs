use super::*;

fn gait(gait: &str, off: f32, skate: Against) -> GaitRow {
    GaitRow {
        style: "calm".to_owned(),
        gait: gait.to_owned(),
        commanded_mps: 1.2,
        speed_1s_mps: 1.2 * (1.0 + off),
        speed_1s_error: off,
        steady_mps: 1.2,
        steady_error: 0.0,
        speed_1s_after_stop_mps: 0.01,
        foot_skate_mm: skate,
        acceleration_p999_mps2: Against::new(40.0, Some(32.0)),
        joint_jitter_mps2: 5.25,
        facing_error_deg: 3.0,
    }
}

fn turn(deg: f32, off: f32) -> TurnRow {
    TurnRow {
        style: "calm".to_owned(),
        turn_deg: deg,
        heading_error_deg: off,
        heading_error_with_sway_deg: off + 4.0,
        speed_1s_error: -0.02,
        acceleration_p999_mps2: Against::new(f64::from(deg.abs()), None),
    }
}

fn report() -> Report {
    let gaits = vec![
        gait("walk", -0.2, Against::new(3.0, Some(1.0))),
        gait("run", 0.01, Against::new(9.0, Some(1.0))),
    ];
    let turns = vec![turn(45.0, 1.0), turn(-45.0, 12.0), turn(90.0, 3.0)];
    let acceleration = Against::new(45.0, Some(40.0));
    Report {
        pack: "human".to_owned(),
        pack_version: "1.2.0".to_owned(),
        content_hash: "sha256:00".to_owned(),
        bars: bars(&gaits, &turns, acceleration),
        gaits,
        turns: both_sides(turns),
        turning: Turning::default(),
        acceleration,
        plans: 70,
        late_plans: 0,
        underruns: 0,
        failed_plans: 0,
    }
}

#[test]
fn the_text_is_as_documented() {
    insta::assert_snapshot!(report().to_text(None));
}

#[test]
fn both_sides_of_a_turn_give_the_worse() {
    let rows = report().turns;
    let found: Vec<_> = rows.iter().map(|r| (r.turn_deg, r.heading_error_deg)).collect();
    assert_eq!(found, [(45.0, 12.0), (90.0, 3.0)]);
}

#[test]
fn the_bar_of_skating_is_for_walks_alone() {
    let bar = &report().bars[5];
    assert_eq!(
        (bar.met, bar.of, &bar.missed[..]),
        (0, 1, &["calm walk 3.00".to_owned()][..])
    );
}

#[test]
fn nan_meets_no_bar_and_without_figures_nothing_is_measured() {
    let bar = Bar::new("b", 1.0, [("a".to_owned(), f64::NAN), ("b".to_owned(), 1.0)]);
    assert_eq!((bar.met, bar.of), (1, 2));
    assert_eq!(Bar::new("b", 1.0, []).to_string(), "not measured: b");
}
