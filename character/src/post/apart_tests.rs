use super::*;

#[test]
fn easing_shortens_no_offset() {
    let ways: Vec<Vec3> = (0..40)
        .map(|frame| {
            if (15..22).contains(&frame) {
                Vec3::X * 0.05
            } else {
                Vec3::ZERO
            }
        })
        .collect();
    let eased = eased(&ways);
    assert!(
        ways.iter()
            .zip(&eased)
            .all(|(way, eased)| eased.x >= way.x - 1e-6)
    );
    let steps = eased.windows(2).map(|pair| (pair[1].x - pair[0].x).abs());
    assert!(steps.fold(0.0, f32::max) < 0.013);
    assert_eq!((eased[0], eased[39]), (Vec3::ZERO, Vec3::ZERO));
}
