use super::*;

fn check(engine: EngineKind, passed: bool) -> Check {
    let accuracy = Accuracy {
        joint_mean_m: if passed { 0.0003 } else { 0.3 },
        ..Accuracy::default()
    };
    assert_eq!(accuracy.passes(), passed);
    Check {
        engine,
        accuracy,
        passed,
        took: Duration::ZERO,
    }
}

fn broken(_: EngineKind) -> Result<Check, EngineError> {
    Err(EngineError::Library("a provider is missing".into()))
}

fn here(_: EngineKind) -> Option<String> {
    None
}

fn elsewhere(_: EngineKind) -> Option<String> {
    Some("the CPU is too old".into())
}

use AccuracyCheck::{Enforce, Report};
use EngineKind::{Cpu, Cuda, OpenvinoBf16};

#[test]
fn auto_takes_bf16_if_it_passes_the_check() {
    let (engine, why, found) = best(Enforce, &[OpenvinoBf16], here, |engine| Ok(check(engine, true)));
    assert_eq!(engine, OpenvinoBf16);
    assert!(why.contains("passes"), "{why}");
    assert!(found.unwrap().passed);
}

#[test]
fn auto_falls_back_to_the_reference_with_a_reason() {
    let (engine, why, found) = best(Enforce, &[OpenvinoBf16], elsewhere, |_| {
        panic!("nothing to check")
    });
    assert_eq!((engine, found), (Cpu, None));
    assert_eq!(why, "openvino-bf16 cannot serve: the CPU is too old");

    let (engine, why, found) = best(Enforce, &[OpenvinoBf16], here, |engine| Ok(check(engine, false)));
    assert_eq!(engine, Cpu);
    assert!(
        why.contains("fails the accuracy check: joint_mean_m is 0.30000"),
        "{why}"
    );
    assert!(!found.unwrap().passed);

    let (engine, why, _) = best(Report, &[OpenvinoBf16], here, |engine| Ok(check(engine, false)));
    assert_eq!(engine, OpenvinoBf16);
    assert!(why.contains("although it fails"), "{why}");

    let (engine, why, found) = best(Report, &[OpenvinoBf16], here, broken);
    assert_eq!((engine, found), (Cpu, None));
    assert!(why.contains("a provider is missing"), "{why}");
}

#[test]
fn auto_takes_a_gpu_first_and_says_why_it_takes_another() {
    let both = [Cuda, OpenvinoBf16];
    let (engine, why, _) = best(Enforce, &both, here, |engine| Ok(check(engine, true)));
    assert_eq!(
        (engine, &*why),
        (Cuda, "there is a GPU, and the engine passes the accuracy check")
    );

    let no_cuda = |engine| (engine == Cuda).then(|| "libcudnn.so.9 is missing".to_owned());
    let (engine, why, found) = best(Enforce, &both, no_cuda, |engine| Ok(check(engine, true)));
    assert_eq!(engine, OpenvinoBf16);
    assert_eq!(found.unwrap().engine, OpenvinoBf16);
    assert!(
        why.ends_with("; cuda cannot serve: libcudnn.so.9 is missing"),
        "{why}"
    );

    let wrong = |engine| Ok(check(engine, engine != Cuda));
    let (engine, why, _) = best(Enforce, &both, here, wrong);
    assert_eq!(engine, OpenvinoBf16);
    assert!(
        why.contains("cuda fails the accuracy check: joint_mean_m"),
        "{why}"
    );

    let (engine, why, found) = best(Enforce, &both, elsewhere, |_| panic!("nothing to check"));
    assert_eq!((engine, found), (Cpu, None));
    assert!(why.contains("cuda") && why.contains("openvino-bf16"), "{why}");
}

#[test]
fn a_named_engine_serves_or_fails_with_a_reason() {
    let (engine, _, found) = named(Cpu, Enforce, here, |_| panic!("the reference needs no check")).unwrap();
    assert_eq!((engine, found), (Cpu, None));
    for mode in [Enforce, Report] {
        let (engine, _, found) = named(OpenvinoBf16, mode, here, |engine| Ok(check(engine, true))).unwrap();
        assert!(engine == OpenvinoBf16 && found.unwrap().passed);
    }

    let error = named(Cuda, Report, elsewhere, |_| panic!("nothing to check")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the engine cuda cannot serve: the CPU is too old"
    );
    let error = named(OpenvinoBf16, Report, here, broken).unwrap_err().to_string();
    assert!(
        error.contains("the engine openvino-bf16 cannot serve") && error.contains("a provider"),
        "{error}"
    );

    let poor = |engine| Ok(check(engine, false));
    let error = named(OpenvinoBf16, Enforce, here, poor).unwrap_err().to_string();
    assert!(
        error.contains("joint_mean_m") && error.contains("accuracy_check = \"report\""),
        "{error}"
    );
    let (engine, why, found) = named(OpenvinoBf16, Report, here, poor).unwrap();
    assert!(engine == OpenvinoBf16 && !found.unwrap().passed);
    assert!(why.contains("although it fails"), "{why}");
}
