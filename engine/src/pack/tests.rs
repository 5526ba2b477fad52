use super::*;

const MANIFEST: &str = r#"
format = 1
name = "toy"
version = "1.0.0"
licence = "Apache-2.0"
credits = ["Somebody"]
fps = 30.0
frames_per_token = 4
min_tokens = 3
max_tokens = 16
heads = 4
codes = 256
context_frames = 4
max_targets = 4
parameters = 12
content_hash = "sha256:HASH"

[skeleton]
left_axis = [1.0, 0.0, 0.0]
[[skeleton.joints]]
name = "Hips"
parent = ""
offset_m = [0.0, 0.9, 0.0]
[[skeleton.joints]]
name = "Foot"
parent = "Hips"
offset_m = [0.0, -0.85, 0.0]
[skeleton.contacts]
joints = ["Foot"]
max_height_m = [0.1]
max_speed_mps = 0.3
clearance_m = [0.05]

[training]
steps = 10

[exporter]
unknown = "and ignored"
"#;

/// The hash of the toy pack's files, whose bytes are "root", "pose" and "decoder".
fn toy_hash() -> String {
    let hash: String = Sha256::digest(b"rootposedecoder")
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    hash
}

struct Folder(PathBuf);

impl Folder {
    fn new(test: &str, manifest: &str) -> Self {
        let path = std::env::temp_dir().join(format!("troupe-pack-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        for stage in Stage::ALL {
            std::fs::write(path.join(stage.file_name()), stage.name()).unwrap();
        }
        std::fs::write(path.join(MANIFEST_FILE), manifest).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn problem(test: &str, change: (&str, &str)) -> String {
    let manifest = MANIFEST.replace("HASH", &toy_hash());
    assert!(manifest.contains(change.0));
    let folder = Folder::new(test, &manifest.replace(change.0, change.1));
    let error = Pack::load(&folder.0).unwrap_err();
    assert!(
        error.to_string().contains(&folder.0.display().to_string()),
        "{error}"
    );
    error.problem.to_string()
}

#[test]
fn a_good_pack_loads() {
    let folder = Folder::new("good", &MANIFEST.replace("HASH", &toy_hash()));
    let pack = Pack::load(&folder.0).unwrap();
    assert_eq!(
        (
            pack.rig.dims.min_frames(),
            pack.rig.dims.max_frames(),
            pack.rig.dims.counts()
        ),
        (12, 64, 14)
    );
    assert_eq!(find_packs(&folder.0).unwrap(), std::slice::from_ref(&folder.0));
}

#[test]
fn a_pack_may_draw_its_roots() {
    let whole = MANIFEST.replace("HASH", &toy_hash());
    let choices = |manifest: &str| {
        let folder = Folder::new("choices", manifest);
        Pack::load(&folder.0).unwrap().rig.dims.root_choices
    };
    assert_eq!(choices(&whole), 0);
    let drawn = whole.replace("max_targets = 4", "max_targets = 4\nroot_choices = 16");
    assert_eq!(choices(&drawn), 16);
}

#[test]
fn the_hinges_of_a_robot_become_hinges_of_the_skeleton() {
    let robot = r#"
[robot]
name = "hopper"
[[robot.hinges]]
joint = "Foot"
axis = [1.0, 0.0, 0.0]
rest = [1.0, 0.0, 0.0, 0.0]
lower_rad = -0.5
upper_rad = 1.5
max_speed_rad_per_s = 9.0
"#;
    let manifest = MANIFEST.replace("HASH", &toy_hash()) + robot;
    let pack = Pack::load(&Folder::new("robot", &manifest).0).unwrap();
    let hinge = pack.rig.skeleton.robot.as_ref().unwrap().hinges()[0];
    assert_eq!((hinge.joint, hinge.lower_rad, hinge.upper_rad), (1, -0.5, 1.5));
}

#[test]
fn every_mistake_is_named() {
    let cases = [
        ("format = 1", "format = 7", "format 7 is not supported"),
        (
            "name = \"toy\"",
            "name = \"Toy Pack\"",
            "name is Toy Pack; allowed: 1 to 64 of a-z",
        ),
        ("fps = 30.0", "fps = nan", "fps is NaN"),
        ("fps = 30.0", "fps = 60.0", "fps is 60; allowed: 30"),
        (
            "max_tokens = 16",
            "max_tokens = 2",
            "max_tokens is 2; allowed: 3 to 1024",
        ),
        ("heads = 4", "heads = 0", "heads is 0; allowed: 1 to 64"),
        ("heads = 4", "", "heads is 0; allowed: 1 to 64"),
        ("max_targets = 4", "max_targets = 62", "at least 66: the frames"),
        (
            "max_targets = 4",
            "max_targets = 4\nroot_choices = 0",
            "root_choices is 0; allowed: 1 to 64",
        ),
        (
            "max_targets = 4",
            "max_targets = 4\nroot_choices = 65",
            "root_choices is 65; allowed: 1 to 64",
        ),
        (
            "max_targets = 4",
            "max_targets = 4\nroot_choices = -1",
            "root_choices",
        ),
        ("joints = [\"Foot\"]", "joints = [\"Paw\"]", "Paw"),
        ("sha256:", "md5:", "allowed: sha256: and 64"),
        ("parent = \"Hips\"", "parent = \"\"", "Foot"),
        (
            "[training]",
            "[robot]\nname = \"hopper\"\nhinges = [{ joint = \"Paw\", axis = [1.0, 0.0, 0.0], rest = [1.0, 0.0, 0.0, 0.0], lower_rad = -1.0, upper_rad = 1.0, max_speed_rad_per_s = 9.0 }]\n[training]",
            "pack.toml: robot.hinges[0].joint is \"Paw\"; allowed: a joint of the skeleton",
        ),
        (
            "[training]",
            "[robot]\nname = \"hopper\"\nhinges = []\nmass = 3\n[training]",
            "unknown field `mass`",
        ),
    ];
    for (index, (from, to, expected)) in cases.into_iter().enumerate() {
        let text = problem(&format!("mistake-{index}"), (from, to));
        assert!(text.contains(expected), "{to:?} gave {text:?}");
    }
}

#[test]
fn changed_files_are_detected() {
    let folder = Folder::new("hash", &MANIFEST.replace("HASH", &toy_hash()));
    std::fs::write(folder.0.join("pose.onnx"), "tampered").unwrap();
    let error = Pack::load(&folder.0).unwrap_err();
    assert!(
        matches!(error.problem, PackProblem::ContentHash { .. }),
        "{error}"
    );
    std::fs::remove_file(folder.0.join("decoder.onnx")).unwrap();
    assert!(
        Pack::load(&folder.0)
            .unwrap_err()
            .to_string()
            .contains("decoder.onnx")
    );
}

#[test]
fn a_folder_without_packs_is_reported() {
    let folder = Folder::new("none", "");
    std::fs::remove_file(folder.0.join(MANIFEST_FILE)).unwrap();
    assert!(matches!(
        find_packs(&folder.0).unwrap_err().problem,
        PackProblem::NoPacks
    ));
    assert!(matches!(
        find_packs(&folder.0.join("absent")).unwrap_err().problem,
        PackProblem::Read { .. }
    ));
}

#[test]
fn format_2_requires_family_and_capabilities() {
    let first = Manifest::parse(MANIFEST).unwrap();
    assert_eq!(first.family(), Some(Family::MotionBricks));
    let named = |manifest: &Manifest| -> Vec<_> {
        let all = manifest.capabilities.list();
        all.map(|able| able.name()).collect()
    };
    assert_eq!(named(&first), ["inbetween", "live"]);

    let whole = MANIFEST.replace("HASH", &"0".repeat(64));
    let second = |more: &str| whole.replace("format = 1", "format = 2") + more;
    let words = second("[capabilities]\ntext = true\n").replacen("heads = 4\ncodes = 256\n", "", 1);
    let words = words.replace("name = \"toy\"", "name = \"toy\"\nfamily = \"words\"");
    let manifest = Manifest::parse(&words).unwrap();
    assert_eq!(
        (manifest.family.as_str(), named(&manifest)),
        ("words", vec!["text"])
    );
    assert!(
        manifest.check().is_ok(),
        "only MotionBricks needs heads and codes"
    );

    for (more, said) in [
        ("", "missing field `family`"),
        ("[capabilities]\nflying = true\n", "unknown field `flying`"),
    ] {
        let text = second(more);
        let error = Manifest::parse(&text).and_then(|manifest| manifest.check().map(|_| ()));
        let error = error.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

fn tiny() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/unimogen")
}

#[test]
fn a_pack_of_many_bodies_loads_all_of_them() {
    let pack = Pack::load(&tiny()).unwrap();
    assert_eq!(pack.files(), ["denoiser.onnx"]);
    assert_eq!(pack.words, ["old", "run", "walk"]);
    let names: Vec<&str> = pack.bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["turned", "toy"]);
    assert_eq!(pack.body("").unwrap().name, "turned");
    let toy = pack.body("toy").unwrap();
    assert_eq!(
        (toy.joints(), toy.rig.dims.joints, toy.rig.dims.contacts),
        (14, 14, 4)
    );
    assert_eq!(toy.words, ["run"]);
    assert_eq!(toy.rig.skeleton.robot.as_ref().unwrap().hinges().len(), 9);
    assert!(pack.body("cat").is_none());
}

/// The tiny pack with these lines after its manifest, without the check of files.
fn with_kinds(lines: &str) -> Result<Pack, PackProblem> {
    let text = std::fs::read_to_string(tiny().join(MANIFEST_FILE)).unwrap();
    let manifest = Manifest::parse(&format!("{text}\n[unimogen.kinds]\n{lines}\n"))?;
    Pack::from_manifest(manifest, &tiny())
}

#[test]
fn bodies_of_a_kind_have_its_network() {
    let pack = with_kinds("animals = []\nrobots = [\"toy\"]").unwrap();
    assert_eq!(pack.files(), ["denoiser.onnx", "denoiser-robots.onnx"]);
    let table = pack.manifest.unimogen.as_ref().unwrap();
    let bodies = table.read_bodies(&tiny(), 30.0, &pack.rig.dims).unwrap();
    let networks: Vec<usize> = bodies.iter().map(|body| body.network).collect();
    assert_eq!(networks, [0, 1]);

    for (lines, said) in [
        (
            "people = [\"cat\"]",
            "unimogen.kinds is cat; allowed: names of unimogen.bodies",
        ),
        (
            "people = [\"toy\"]\nrobots = [\"toy\"]",
            "unimogen.kinds is toy; allowed: each name once",
        ),
        ("plants = [\"toy\"]", "unknown field `plants`"),
    ] {
        let error = with_kinds(lines).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn heights_and_sizes_follow_from_the_neutral_pose() {
    use troupe_motion::model::BodyParts;
    let trained = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/unimogen");
    for folder in [tiny(), trained] {
        let pack = Pack::load(&folder).unwrap();
        for body in &pack.bodies {
            let parts = BodyParts {
                name: body.name.clone(),
                skeleton: (*body.rig.skeleton).clone(),
                neutral: body.neutral.to_vec(),
                sides: body.sides.to_vec(),
                height_m: None,
                size_m: None,
                words: body.words.clone(),
            };
            let again = Body::new(parts, 30.0, &body.rig.dims).unwrap();
            let off = (again.height_m - body.height_m).abs() + (again.size_m - body.size_m).abs();
            assert!(
                off < 2e-5,
                "{}: {} and {}",
                body.name,
                again.height_m,
                again.size_m
            );
        }
    }
}

#[test]
fn every_mistake_in_the_table_of_bodies_is_named() {
    let text = std::fs::read_to_string(tiny().join(MANIFEST_FILE)).unwrap();
    for (from, to, said) in [
        (
            "default_body = \"turned\"",
            "default_body = \"cat\"",
            "unimogen.default_body is cat",
        ),
        (
            "\"turned\", \"toy\"",
            "\"turned\", \"turned\"",
            "unimogen.bodies is turned; allowed: each name once",
        ),
        (
            "\"turned\", \"toy\"",
            "\"turned\", \"../toy\"",
            "names of 1 to 64 of a-z",
        ),
        (
            "words = [\"old\", \"run\", \"walk\"]",
            "words = []",
            "unimogen.words is 0; allowed: 1 to 1024",
        ),
        (
            "slots = 16",
            "slots = 8",
            "unimogen.slots is 8; allowed: 16 to 16",
        ),
        (
            "diffusion_steps = 50",
            "diffusion_steps = 49",
            "unimogen.signal is 50; allowed: 49 to 49",
        ),
        (
            "sampler_steps = 4",
            "sampler_steps = 51",
            "unimogen.sampler_steps is 51; allowed: 1 to 50",
        ),
        ("signal = [0.9982", "signal = [1.9982", "falling, between 0 and 1"),
        (
            "\"bone_x\", \"bone_y\"",
            "\"bone_y\", \"bone_x\"",
            "allowed: bone_x, bone_y",
        ),
        ("root_low = [-0.2", "root_low = [0.2", "below root_high"),
        (
            "bend_gain = 2.0",
            "bend_gain = 0.0",
            "unimogen.bend_gain is 0; allowed: more than 0",
        ),
        (
            "frames_per_token = 4",
            "frames_per_token = 2",
            "frames_per_token is 2; allowed: 4 to 4",
        ),
        (
            "family = \"unimogen\"",
            "family = \"other\"",
            "unimogen is present",
        ),
        (
            "bend_gain = 2.0",
            "bend_gain = 2.0\nbend = 1",
            "unknown field `bend`",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        let changed = text.replacen(from, to, 1);
        let checked = Manifest::parse(&changed).and_then(|manifest| manifest.check());
        let error = checked.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}
