//! Which scenes are read, and the errors of those that are not.

use std::path::Path as FilePath;
use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::Vec3;

use super::testing::{boxed, place};
use super::*;
use crate::document::testing::{any_changes, changed};
use crate::document::{Format, parse};
use crate::object::{self, Definitions};
use crate::style::testing::TempFolder;

/// Uses everything that a scene can contain at least once.
const YARD: &str = r#"
format = 1
name = "yard"
ground_m = 0.25

[[colliders]]
id = "wall"
position_m = [0.0, 1.0, 5.0]
heading_deg = 90.0

[colliders.shape.box]
center_m = [0.0, 0.5, 0.0]
half_extents_m = [2.0, 1.0, 0.1]

[[colliders]]
id = "ramp"
rotation = [0.0, 0.0, 1.0, 0.0]
shape = { convex = { points_m = [[0, 0, 0], [4, 0, 0], [0, 0, 2], [4, 0, 2], [0, 1, 0], [0, 1, 2]] } }

[[colliders]]
id = "hill"
position_m = [20.0, 0.0, 0.0]

[colliders.shape.heightfield]
rows = 2
columns = 3
size_m = [4.0, 2.0]
heights_m = [0.5, 0.75, 1.0, 0.5, 0.75, 1.0]

[[objects]]
id = "crate-1"
definition = "crate"
position_m = [10.0, 0.8, 0.0]
heading_deg = 45.0

[[objects]]
id = "crate-2"
definition = "crate"
position_m = [12.0, 0.8, 0.0]
rotation = [1.0, 0.0, 0.0, 0.0]
"#;

/// Knows only crates.
struct Crates(Arc<Body>);

impl Bodies for Crates {
    fn body(&self, definition: &str) -> Option<Arc<Body>> {
        (definition == "crate").then(|| Arc::clone(&self.0))
    }

    fn names(&self) -> Vec<&str> {
        vec!["crate"]
    }
}

fn crates() -> Crates {
    Crates(boxed(0.5))
}

fn json() -> String {
    serde_json::to_string_pretty(&parse::<SceneDoc>(YARD, Format::Toml).unwrap()).unwrap()
}

fn said(text: &str, format: Format) -> String {
    NamedScene::read(text, format, &crates()).unwrap_err().to_string()
}

/// The surface under a place, and its height.
fn under(scene: &Scene, x: f32, z: f32) -> (Surface, f32) {
    let hit = scene.support(Vec3::new(x, 9.0, z), 20.0, None).unwrap();
    (hit.surface, hit.point.y)
}

#[test]
fn everything_is_read() {
    let bodies = crates();
    let toml = NamedScene::read(YARD, Format::Toml, &bodies).unwrap();
    let json = NamedScene::read(&json(), Format::Json, &bodies).unwrap();
    for NamedScene { name, scene } in [toml, json] {
        assert_eq!(
            (name.as_str(), scene.len(), scene.ground_y_m()),
            ("yard", 2, 0.25)
        );
        assert_eq!(under(&scene, -30.0, 0.0), (Surface::Ground, 0.25));
        // Turned by a quarter, so it is long along z. Its middle is half a metre over its origin.
        let (wall, height) = under(&scene, 0.0, 6.5);
        assert_eq!(wall, Surface::Collider("wall".into()));
        assert!((height - 2.5).abs() < 1e-5);
        assert_eq!(under(&scene, 1.5, 5.0).0, Surface::Ground);
        // Turned by a half, toward -X and -Z.
        let (ramp, height) = under(&scene, -2.0, -1.0);
        assert_eq!(ramp, Surface::Collider("ramp".into()));
        assert!((height - 0.5).abs() < 1e-4);
        let (hill, height) = under(&scene, 21.0, 0.5);
        assert_eq!(hill, Surface::Collider("hill".into()));
        assert!((height - 0.875).abs() < 1e-5);
        let turned = scene.instance("crate-1").unwrap();
        assert!((turned.transform.heading().to_degrees() - 45.0).abs() < 1e-4);
        assert_eq!(
            scene.instance("crate-2").unwrap().transform,
            place(12.0, 0.8, 0.0)
        );
        assert!(Arc::ptr_eq(&turned.body, &bodies.0) && scene.uses("crate") && !scene.uses("barrel"));
    }
}

#[test]
fn defaults_are_filled_in_and_written_back() {
    let empty = NamedScene::read("format = 1\nname = \"void\"", Format::Toml, &crates()).unwrap();
    assert!(empty.scene.is_empty() && empty.scene.ground_y_m() == 0.0);
    let doc: SceneDoc = parse(YARD, Format::Toml).unwrap();
    assert_eq!(
        parse::<SceneDoc>(&doc.to_toml().unwrap(), Format::Toml).unwrap(),
        doc
    );
    assert_eq!(parse::<SceneDoc>(&json(), Format::Json).unwrap(), doc);
}

/// A change of the text (from, to), and what its error contains: line, field, what is wrong, what
/// is allowed.
const WRONG: &[(&str, &str, &str)] = &[
    (
        "format = 1",
        "format = 2",
        "scene: line 2, column 10: format: is 2; allowed: 1",
    ),
    (
        "name = \"yard\"",
        "name = \"a yard\"",
        "line 3, column 8: name: has the character ' '; allowed: 1 to 64 letters",
    ),
    (
        "ground_m = 0.25",
        "ground_m = nan",
        "line 4, column 12: ground_m: is NaN; allowed: -10000 to 10000 m",
    ),
    (
        "id = \"wall\"",
        "id = \"\"",
        "line 7, column 6: colliders[0].id: is 0 bytes long; allowed: 1 to 128 bytes",
    ),
    (
        "id = \"ramp\"",
        "id = \"wall\"",
        "line 16, column 6: colliders[1].id: is \"wall\", which another of the colliders has",
    ),
    (
        "[0.0, 1.0, 5.0]",
        "[0.0, 1.0, 50000]",
        "line 8, column 25: colliders[0].position_m[2]: is 50000; allowed: -10000 to 10000",
    ),
    (
        "heading_deg = 90.0",
        "heading_deg = 400",
        "line 9, column 15: colliders[0].heading_deg: is 400; allowed: -360 to 360",
    ),
    (
        "heading_deg = 90.0",
        "heading_deg = 90.0\nrotation = [1, 0, 0, 0]",
        "line 10, column 12: colliders[0].rotation: cannot be combined with heading_deg; allowed: at most one of the two",
    ),
    (
        "[2.0, 1.0, 0.1]",
        "[2.0, 0.0, 0.1]",
        "line 13, column 24: colliders[0].shape.box.half_extents_m[1]: is 0; allowed: 0.001 to 1000 m",
    ),
    (
        "[0.0, 0.0, 1.0, 0.0]",
        "[0.0, 0.0, 1.1, 0.0]",
        "line 17, column 12: colliders[1].rotation: the rotation has length 1.1; allowed: unit length",
    ),
    (
        "[0, 1, 0], [0, 1, 2]",
        "[0, 0, 1], [2, 0, 1]",
        "line 18, column 33: colliders[1].shape.convex.points_m: are flat; allowed: points that span at least 0.001 m in every direction",
    ),
    (
        "[0, 1, 0], [0, 1, 2]",
        "[0, 1, 0], [0, inf, 2]",
        "colliders[1].shape.convex.points_m[5][1]: is inf; allowed: -1000 to 1000 m",
    ),
    (
        "rows = 2",
        "rows = 1",
        "line 25, column 8: colliders[2].shape.heightfield.rows: is 1; allowed: 2 to 512",
    ),
    (
        "columns = 3",
        "columns = -3",
        "line 26, column 11: colliders[2].shape.heightfield.columns: invalid value: integer `-3`",
    ),
    (
        "heights_m = [0.5, ",
        "heights_m = [",
        "colliders[2].shape.heightfield.heights_m: is 5 heights; allowed: rows x columns = 6 heights",
    ),
    (
        "heights_m = [0.5, 0.75",
        "heights_m = [0.5, -inf",
        "line 28, column 19: colliders[2].shape.heightfield.heights_m[1]: is -inf; allowed: -1000 to 1000 m",
    ),
    (
        "position_m = [20.0, 0.0, 0.0]",
        "rotation = [0.9950042, 0.0998334, 0.0, 0.0]",
        "line 22, column 12: colliders[2].rotation: is tilted by 11.5 degrees; allowed: a rotation about +Y alone",
    ),
    (
        "[colliders.shape.heightfield]",
        "[colliders.shape.mesh]",
        "colliders[2].shape: unknown variant `mesh`, expected one of `box`, `convex`, `heightfield`",
    ),
    (
        "definition = \"crate\"",
        "definition = \"barrel\"",
        "line 32, column 14: objects[0].definition: is \"barrel\", which is no object definition; allowed: crate",
    ),
    (
        "position_m = [10.0, 0.8, 0.0]\n",
        "",
        "objects[0].position_m: is missing",
    ),
    (
        "heading_deg = 45.0",
        "scale = 2.0",
        "line 34, column 1: objects[0].scale: unknown field `scale`, expected one of `id`, `definition`, `position_m`",
    ),
    (
        "id = \"crate-2\"",
        "id = \"crate-1\"",
        "line 37, column 6: objects[1].id: is \"crate-1\", which another of the objects has; allowed: ids that are all",
    ),
    (
        "[12.0, 0.8, 0.0]",
        "[12.0, 0.8]",
        "line 39, column 14: objects[1].position_m: invalid length 2, expected",
    ),
    ("[[objects]]", "[[things]]", "things: unknown field `things`"),
    ("[[objects]]", "[[objects]", "line 30, column"),
];

#[test]
fn errors_name_line_field_and_range() {
    for (from, to, want) in WRONG {
        assert!(YARD.contains(from), "{from:?} is not in the text");
        let said = said(&YARD.replacen(from, to, 1), Format::Toml);
        assert!(
            said.contains(want),
            "{from:?} -> {to:?}\nsays {said}\nwant {want}"
        );
        assert!(said.contains("line "), "no line in: {said}");
    }
    let good = json();
    let line = |needle: &str| good.lines().position(|line| line.contains(needle)).unwrap() + 1;
    let wrong = good.replacen("\"rows\": 2", "\"rows\": 600", 1);
    let want = format!("scene: line {}, column 19: colliders[2]", line("\"rows\""));
    assert!(
        said(&wrong, Format::Json).starts_with(&want),
        "{}",
        said(&wrong, Format::Json)
    );
}

#[test]
fn too_many_entries_are_an_error() {
    let object = |i: usize| {
        format!("[[objects]]\nid = \"{i}\"\ndefinition = \"crate\"\nposition_m = [{i}, 0.5, 0.0]\n")
    };
    let many = |count: usize| (0..count).fold(YARD.to_owned(), |text, i| text + &object(i));
    let most = NamedScene::read(&many(MAX_INSTANCES - 2), Format::Toml, &crates()).unwrap();
    assert_eq!(most.scene.len(), MAX_INSTANCES);
    assert!(
        said(&many(MAX_INSTANCES - 1), Format::Toml).contains("objects: has 4097 entries; allowed: 0 to")
    );

    let collider = |i: usize| format!("[[colliders]]\nid = \"{i}\"\nshape.box.half_extents_m = [1, 1, 1]\n");
    let text = (0..MAX_COLLIDERS).fold(YARD.to_owned(), |text, i| text + &collider(i));
    assert!(said(&text, Format::Toml).contains("colliders: has 1027 entries; allowed: 0 to 1024"));

    let heights = "0,".repeat(512 * 512);
    let tile = |i: usize| {
        format!(
            "[[colliders]]\nid = \"{i}\"\n[colliders.shape.heightfield]\nrows = 512\ncolumns = 512\n\
             size_m = [9, 9]\nheights_m = [{heights}]\n"
        )
    };
    let text = (0..4).fold(YARD.to_owned(), |text, i| text + &tile(i));
    let said_of_tiles = said(&text, Format::Toml);
    assert!(
        said_of_tiles.contains(
            "colliders[6].shape.heightfield.heights_m: brings the samples of the scene's heightfields to 1048582; \
             allowed: at most 1048576 in total"
        ),
        "{said_of_tiles}"
    );
    let long = format!("{YARD}#{}", "x".repeat(MAX_BYTES));
    assert!(said(&long, Format::Toml).ends_with("bytes long; allowed: at most 8388608 bytes"));
}

#[test]
fn files_and_folders() {
    let folder = TempFolder::new("scenes");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("yard.toml", YARD);
    write("a-hall.json", &json().replacen("\"yard\"", "\"hall\"", 1));
    let names = |scenes: Vec<NamedScene>| scenes.into_iter().map(|named| named.name).collect::<Vec<_>>();
    assert_eq!(
        names(load_folder(folder.path(), &crates()).unwrap()),
        ["hall", "yard"]
    );
    write("z.toml", YARD);
    let twice = load_folder(folder.path(), &crates()).unwrap_err().to_string();
    assert!(
        twice.contains("z.toml: name: is \"yard\", the same as the scene of another file"),
        "{twice}"
    );
    write("z.toml", &YARD.replacen("\"crate\"", "\"car\"", 1));
    let unknown = load_file(&folder.path().join("z.toml"), &crates())
        .unwrap_err()
        .to_string();
    assert!(
        unknown.contains("z.toml: line 32, column 14: objects[0].definition"),
        "{unknown}"
    );
}

#[test]
fn a_scene_is_unchanged_by_writing_and_reading() {
    let NamedScene { name, scene } = NamedScene::read(YARD, Format::Toml, &crates()).unwrap();
    let text = scene.to_doc(&name).to_toml().unwrap();
    let again = NamedScene::read(&text, Format::Toml, &crates()).unwrap();
    assert_eq!(again.name, name);
    let (was, is) = (scene.to_doc(&name), again.scene.to_doc(&name));
    assert_eq!((was.ground_m, was.objects.len()), (is.ground_m, is.objects.len()));
    for (was, is) in was.colliders.iter().zip(&is.colliders) {
        assert_eq!(
            (&was.id, was.position_m, &was.shape),
            (&is.id, is.position_m, &is.shape)
        );
    }
    for was in scene.instances() {
        let is = again.scene.instance(&was.id).unwrap();
        assert_eq!(
            (&was.object, was.transform.position),
            (&is.object, is.transform.position)
        );
        assert!(was.transform.rotation.dot(is.transform.rotation).abs() > 0.999_999);
    }
}

#[test]
fn the_examples_are_scenes() {
    let root = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let rig = troupe_engine::pack::Pack::load(&root.join("models/human"))
        .unwrap()
        .rig;
    let objects = object::load_folder(&root.join("examples/objects"), &rig).unwrap();
    let definitions = Definitions::new(objects).unwrap().snapshot();
    let scenes = load_folder(&root.join("examples/scenes"), &*definitions).unwrap();
    assert_eq!(scenes.len(), 2);
    let NamedScene { name, scene } = &scenes[0];
    assert_eq!(
        (name.as_str(), scene.len(), scene.colliders().count()),
        ("courtyard", 6, 4)
    );
    // The cups stand on the table, and stay in place if put down there.
    let cup = definitions.get("cup").unwrap().definition.clone();
    for id in ["cup-1", "cup-2"] {
        let at = scene.instance(id).unwrap().transform;
        let lies = cup.place(scene, id, at).unwrap();
        assert_eq!(lies.surface.unwrap().surface, Surface::Collider("table".into()));
        assert!((lies.transform.position - at.position).length() < 1e-4);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(800))]

    #[test]
    fn mutated_scenes_never_panic(changes in any_changes(), as_json: bool) {
        let (text, format) = match as_json {
            true => (json(), Format::Json),
            false => (YARD.to_owned(), Format::Toml),
        };
        match NamedScene::read(&changed(&text, &changes), format, &crates()) {
            Ok(named) => {
                let scene = named.scene;
                prop_assert!(scene.ground_y_m().is_finite());
                for instance in scene.instances() {
                    prop_assert!(instance.transform.checked("it").is_ok());
                }
                let trace = BoxTrace::new(place(10.0, 0.8, 0.0), Vec3::ONE, Vec3::X).unwrap();
                scene.detect(&trace);
                scene.support(Vec3::new(0.5, 90.0, 0.5), 1e3, None);
            }
            Err(error) => prop_assert!(!error.message.is_empty()),
        }
    }
}
