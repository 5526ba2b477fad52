//! Broken files of every format are errors, never panics.

use std::sync::OnceLock;

use proptest::prelude::*;

use super::people::{Dialect, Person};
use crate::files::{write_beyond_mimic, write_npz, write_qpos};
use crate::glb::write_glb;
use crate::read::{Agreement, Options, RestPose, Source, read, survey};
use crate::robot::testing::g1;
use crate::robot::{description, write_csv};

/// A small file of each format, with its name.
fn files() -> &'static [(&'static str, Vec<u8>)] {
    static FILES: OnceLock<Vec<(&'static str, Vec<u8>)>> = OnceLock::new();
    FILES.get_or_init(|| {
        let person = Person {
            words: 2,
            size: 1.0,
            spine: 1,
            rest: RestPose::A,
        };
        let walk = person.walk(4, 30.0, &[0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45]);
        let robot = super::robots::walk(4, 30.0, 0.5);
        let glb = write_glb(&walk).unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        vec![
            ("a.bvh", Dialect::plain().bytes(&walk)),
            ("a.gltf", glb[20..20 + length].to_vec()),
            ("a.glb", glb),
            ("a.npz", write_npz(&walk).unwrap()),
            ("b.npz", super::archives::amass(4, 72, Some("fps"), false)),
            ("c.npz", super::archives::kimodo(30).0),
            ("d.npz", write_beyond_mimic(&robot).unwrap()),
            ("a.csv", write_csv(&robot).unwrap().into_bytes()),
            ("a.npy", write_qpos(&robot).unwrap()),
        ]
    })
}

/// Reads a file as a person's and as a robot's.
fn try_all(name: &str, bytes: &[u8]) {
    let source = Source::new(name, bytes);
    let robot = Options {
        skeleton: Some(g1()),
        ..Options::default()
    };
    for options in [Options::default(), robot] {
        if let Ok(found) = read(&source, &options) {
            assert!(found.clip.root_positions.iter().all(|root| root.is_finite()));
            assert!(!found.report.rows().is_empty());
        }
        let _ = survey(&source, &options, &mut Agreement::default());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn changed_files_do_not_panic(
        which in 0..9_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        cut in proptest::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let (name, bytes) = &files()[which];
        let mut bytes = bytes.clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        try_all(name, &bytes);
    }

    #[test]
    fn changed_numbers_do_not_panic(
        which in prop_oneof![Just(0_usize), Just(1), Just(7)],
        at in any::<prop::sample::Index>(),
        number in prop_oneof![Just("1e308"), Just("-1e300"), Just("1e-320"), Just("0"), Just("99999999999"), Just("-1")],
    ) {
        // One number of a text is replaced.
        let (name, bytes) = &files()[which];
        let text = String::from_utf8(bytes.clone()).unwrap();
        let starts: Vec<usize> = text
            .char_indices()
            .filter(|&(nth, c)| c.is_ascii_digit() && !text[..nth].ends_with(|c: char| c.is_ascii_digit() || c == '.'))
            .map(|(nth, _)| nth)
            .collect();
        let start = starts[at.index(starts.len())];
        let rest = text[start..].trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        let changed = format!("{}{number}{rest}", &text[..start]);
        try_all(name, changed.as_bytes());
    }

    #[test]
    fn descriptions_do_not_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), "[a-z0-9<>\"/= .-]"), 1..6), mjcf: bool,
    ) {
        let urdf = "<robot name=\"a\"><link name=\"b\"/><link name=\"left_c\"><collision><geometry><sphere radius=\"0.1\"/>\
                    </geometry></collision></link><link name=\"right_c\"/><joint name=\"left_c\" type=\"revolute\"><parent link=\"b\"/>\
                    <child link=\"left_c\"/><limit lower=\"-1\" upper=\"1\"/></joint><joint name=\"right_c\" type=\"fixed\">\
                    <parent link=\"b\"/><child link=\"right_c\"/></joint></robot>";
        let mujoco = "<mujoco><worldbody><body name=\"b\"><freejoint/><body name=\"left_c\" euler=\"1 2 3\"><joint name=\"left_c\" \
                      range=\"-1 1\"/><geom type=\"box\" size=\"1 1 1\"/></body></body></worldbody></mujoco>";
        let mut text = if mjcf { mujoco } else { urdf }.to_owned();
        for (at, with) in changes {
            let at = at.index(text.len());
            text.replace_range(at..=at, &with);
        }
        if let Ok(read) = description::read(&text, &|_| None) {
            let _ = description::build(&read, &description::BuildOptions::default());
        }
    }
}
