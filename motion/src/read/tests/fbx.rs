//! FBX as text, in the axes and units of several programs.

use glam::{Quat, Vec3};

use crate::fk::WorldMotion;
use crate::read::{Format, Options, Source, character, read};
use crate::rotation::angle_between;

/// Ticks of FBX's clock in a second.
const SECOND: i64 = 46_186_158_000;

/// Hips that rise by 10 units in a second and turn by 90° about the file's Y, with a leg below.
/// `up` is the axis that points up: 1 for Y, 2 for Z.
fn text(up: usize, centimetres: f64, stacks: usize) -> String {
    let (front, front_sign) = if up == 1 { (2, 1) } else { (1, -1) };
    let settings = format!(
        "GlobalSettings: {{\n Version: 1000\n Properties70: {{\n\
         P: \"UpAxis\", \"int\", \"Integer\", \"\",{up}\nP: \"UpAxisSign\", \"int\", \"Integer\", \"\",1\n\
         P: \"FrontAxis\", \"int\", \"Integer\", \"\",{front}\nP: \"FrontAxisSign\", \"int\", \"Integer\", \"\",{front_sign}\n\
         P: \"CoordAxis\", \"int\", \"Integer\", \"\",0\nP: \"CoordAxisSign\", \"int\", \"Integer\", \"\",1\n\
         P: \"UnitScaleFactor\", \"double\", \"Number\", \"\",{centimetres}\nP: \"TimeMode\", \"enum\", \"\", \"\",6\n }}\n}}\n"
    );
    let place = |x: f64, height: f64, z: f64| if up == 1 { [x, height, z] } else { [x, -z, height] };
    let model = |id: i64, name: &str, [x, y, z]: [f64; 3]| {
        format!(
            "Model: {id}, \"Model::{name}\", \"LimbNode\" {{\n Version: 232\n Properties70: {{\n\
             P: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\",{x},{y},{z}\n }}\n}}\n\
             NodeAttribute: {}, \"NodeAttribute::{name}\", \"LimbNode\" {{\n TypeFlags: \"Skeleton\"\n}}\n",
            id + 100
        )
    };
    let curve = |id: i64, from: f64, to: f64| {
        format!(
            "AnimationCurve: {id}, \"AnimCurve::\", \"\" {{\n Default: 0\n KeyVer: 4008\n KeyTime: *2 {{\n a: 0,{SECOND}\n }}\n\
             KeyValueFloat: *2 {{\n a: {from},{to}\n }}\n KeyAttrFlags: *1 {{\n a: 4\n }}\n KeyAttrDataFloat: *4 {{\n a: 0,0,0,0\n }}\n\
             KeyAttrRefCount: *1 {{\n a: 2\n }}\n}}\n"
        )
    };
    let axis = ["X", "Y", "Z"][up];
    let mut objects = model(1, "Hips", place(0.0, 90.0, 0.0)) + &model(2, "Leg", place(10.0, -40.0, 0.0));
    let mut links = "C: \"OO\",1,0\nC: \"OO\",2,1\nC: \"OO\",101,1\nC: \"OO\",102,2\n".to_owned();
    for nth in 0..stacks as i64 {
        let id = 1000 * (nth + 1);
        objects += &format!(
            "AnimationStack: {id}, \"AnimStack::Take{nth}\", \"\" {{\n Properties70: {{\n\
             P: \"LocalStop\", \"KTime\", \"Time\", \"\",{SECOND}\n }}\n}}\nAnimationLayer: {}, \"AnimLayer::Base\", \"\" {{\n}}\n",
            id + 1
        );
        for (part, property) in [(2, "Lcl Translation"), (3, "Lcl Rotation")] {
            objects += &format!(
                "AnimationCurveNode: {}, \"AnimCurveNode::{part}\", \"\" {{\n}}\n",
                id + part
            );
            objects += &if part == 2 {
                curve(id + 10 + part, 90.0, 100.0)
            } else {
                curve(id + 10 + part, 0.0, 90.0)
            };
            links += &format!(
                "C: \"OO\",{0},{1}\nC: \"OP\",{0},1, \"{property}\"\nC: \"OP\",{2},{0}, \"d|{axis}\"\n",
                id + part,
                id + 1,
                id + 10 + part
            );
        }
        links += &format!("C: \"OO\",{},{id}\n", id + 1);
    }
    format!(
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\n FBXHeaderVersion: 1003\n FBXVersion: 7400\n Creator: \"made\"\n}}\n\
         {settings}Objects: {{\n{objects}}}\nConnections: {{\n{links}}}\n"
    )
}

#[test]
fn axes_and_units_of_the_file_become_troupes() {
    for (up, centimetres) in [(1, 1.0), (2, 1.0), (1, 100.0), (2, 2.54)] {
        let text = text(up, centimetres, 1);
        let source = Source::new("walk.fbx", text.as_bytes());
        let found = read(&source, &Options::default()).unwrap_or_else(|e| panic!("{up} {centimetres}: {e}"));
        let metres = centimetres as f32 / 100.0;
        assert_eq!(
            (found.report.format.value, found.clip.frames(), found.clip.fps),
            (Format::Fbx, 31, 30.0)
        );
        let names: Vec<&str> = found
            .clip
            .skeleton
            .joints
            .iter()
            .map(|joint| &*joint.name)
            .collect();
        assert_eq!(names, ["Hips", "Leg"]);
        let world = WorldMotion::from_clip(&found.clip);
        let near = |a: Vec3, b: Vec3| a.distance(b * metres) < 5e-4 * metres.max(1.0);
        assert!(
            near(world.positions_at(0)[0], Vec3::new(0.0, 90.0, 0.0)),
            "{:?}",
            world.positions_at(0)
        );
        assert!(
            near(world.positions_at(0)[1], Vec3::new(10.0, 50.0, 0.0)),
            "{:?}",
            world.positions_at(0)
        );
        assert!(near(world.positions_at(30)[0], Vec3::new(0.0, 100.0, 0.0)));
        // A quarter turn to the left takes what was at the left behind.
        assert!(
            near(world.positions_at(30)[1], Vec3::new(0.0, 60.0, -10.0)),
            "{:?}",
            world.positions_at(30)
        );
        let turn = world.rotations_at(30)[0] * world.rotations_at(0)[0].conjugate();
        let wanted = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        assert!(angle_between(turn, wanted).to_degrees() < 0.1);
    }
}

#[test]
fn one_of_several_animations_is_named_and_broken_files_are_errors() {
    let two = text(1, 1.0, 2);
    let with = |text: &str, options: &Options| read(&Source::new("a.fbx", text.as_bytes()), options);
    let error = with(&two, &Options::default()).unwrap_err().to_string();
    assert!(
        error.contains("2 animations: Take0, Take1; --animation decides"),
        "{error}"
    );
    let options = Options {
        animation: Some("Take1".to_owned()),
        ..Options::default()
    };
    assert_eq!(with(&two, &options).unwrap().clip.frames(), 31);
    let error = with(&text(1, 1.0, 0), &Options::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("it has no animation"), "{error}");
    for cut in [10, 200, 900, two.len() / 2] {
        assert!(with(&two[..cut], &Options::default()).is_err(), "{cut}");
    }
    assert!(
        read(
            &Source::new("a.fbx", b"Kaydara FBX Binary  \0"),
            &Options::default()
        )
        .is_err()
    );
}

#[test]
fn a_character_without_animation_is_read_at_rest() {
    let text = text(1, 1.0, 0);
    let source = Source::new("hero.fbx", text.as_bytes());
    assert!(
        read(&source, &Options::default())
            .unwrap_err()
            .kind
            .lacks_animation()
    );
    let found = character(&source, &Options::default()).unwrap();
    assert_eq!(found.clip.frames(), 1);
    let root = found.clip.root_positions[0];
    assert!(root.distance(Vec3::new(0.0, 0.9, 0.0)) < 1e-4, "{root}");
}

proptest::proptest! {
    #[test]
    fn changed_texts_do_not_panic(
        changes in proptest::collection::vec((proptest::prelude::any::<proptest::sample::Index>(), "[0-9A-Za-z,:{}\" -]"), 1..8),
    ) {
        let mut text = text(2, 2.54, 1);
        for (at, with) in changes {
            let at = at.index(text.len());
            text.replace_range(at..=at, &with);
        }
        let _ = read(&Source::new("a.fbx", text.as_bytes()), &Options::default());
    }
}
