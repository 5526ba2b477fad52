//! The command line, end to end: the code of the `troupe` binary against a running server.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use troupe_client::Pack;
use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions};
use troupe_motion::clip::Clip;

use crate::motion::{difference, walk};
use crate::real;
use crate::server::shared;
use crate::walk::Walk;

/// A folder for one test. Dropping it removes the folder.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(test: &str) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cli-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub(crate) fn write_clip(&self, name: &str, clip: &Clip) -> PathBuf {
        let path = self.file(name);
        let file = BvhFile::from_clip(clip, &BvhWriteOptions::default()).unwrap();
        std::fs::write(&path, bvh::write(&file)).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn read_clip(path: &Path, pack: &Pack) -> Clip {
    let file = bvh::parse(&std::fs::read_to_string(path).unwrap()).unwrap();
    file.to_clip_on(pack.skeleton(), &BvhOptions::default()).unwrap()
}

/// Runs `troupe` with the shared server's address in its environment.
pub async fn troupe<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    troupe_at(shared().url(), arguments).await
}

/// Runs `troupe` with the address of a server in its environment.
pub async fn troupe_at<S: AsRef<OsStr>>(url: &str, arguments: impl IntoIterator<Item = S>) -> Output {
    run(env!("CARGO_BIN_EXE_troupe-under-test"), url, arguments).await
}

/// Runs a program with the address of a server in its environment.
pub async fn run<S: AsRef<OsStr>>(
    program: &str,
    url: &str,
    arguments: impl IntoIterator<Item = S>,
) -> Output {
    let mut command = Command::new(program);
    command
        .args(arguments)
        .env("TROUPE_SERVER", url)
        .stdin(Stdio::null());
    tokio::task::spawn_blocking(move || command.output())
        .await
        .unwrap()
        .unwrap()
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The standard output of a command that must have succeeded.
pub fn printed(output: &Output) -> String {
    assert!(
        output.status.success(),
        "{}: {}",
        output.status,
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// Checks the exit code of a failed command. Its standard error must contain all of `expected`, and
/// its standard output must be empty.
pub fn failed(output: &Output, code: i32, expected: &[&str]) {
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{errors}");
    for part in expected {
        assert!(errors.contains(part), "`{part}` is not in: {errors}");
    }
    assert_eq!(text(&output.stdout), "");
}

pub(crate) fn gap_arguments(clip: &Path, from: usize, to: usize, out: &Path) -> Vec<String> {
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    [
        "inbetween",
        "--clip",
        &path(clip),
        "--from",
        &from.to_string(),
        "--to",
        &to.to_string(),
        "--out",
        &path(out),
    ]
    .map(str::to_owned)
    .to_vec()
}

pub(crate) fn with(mut arguments: Vec<String>, more: &[&str]) -> Vec<String> {
    arguments.extend(more.iter().map(|&a| a.to_owned()));
    arguments
}

#[tokio::test]
async fn a_filled_gap_keeps_the_rest_of_the_clip() {
    let folder = Folder::new("fill");
    let pack = shared().pack().await;
    let clip = walk(&pack);
    let (source, out) = (folder.write_clip("walk.bvh", &clip), folder.file("filled.bvh"));
    let output = troupe(gap_arguments(&source, 60, 95, &out)).await;
    assert_eq!(printed(&output), "");
    assert!(
        text(&output.stderr).contains("34 frames generated"),
        "{}",
        text(&output.stderr)
    );

    let filled = read_clip(&out, &pack);
    assert_eq!(filled.frames(), clip.frames());
    for part in [0..61, 95..300] {
        let error = difference(
            &filled.slice(part.clone()).unwrap(),
            &clip.slice(part.clone()).unwrap(),
        );
        assert!(error < 1e-3, "{part:?}: {error}");
    }
    let changed = difference(&filled.slice(61..95).unwrap(), &clip.slice(61..95).unwrap());
    assert!(changed > 1e-3, "the gap is generated, not copied: {changed}");
}

#[tokio::test]
async fn the_gap_alone_with_a_length_from_the_model() {
    let folder = Folder::new("gap");
    let pack = shared().pack().await;
    let (source, out) = (
        folder.write_clip("walk.bvh", &walk(&pack)),
        folder.file("gap.bvh"),
    );
    let arguments = with(
        gap_arguments(&source, 60, 95, &out),
        &["--only-gap", "--free-timing", "--json"],
    );
    let output = troupe(arguments).await;
    let said: Value = serde_json::from_str(&printed(&output)).unwrap();
    let frames = read_clip(&out, &pack).frames();
    assert_eq!(said["frames"], frames);
    assert_eq!(
        said["segment_frames"],
        frames + 5,
        "context and target are left out"
    );
    assert_eq!(said["pack"], pack.name());
    assert!(
        (frames + 5).is_multiple_of(4),
        "the model counts in tokens of four frames"
    );
}

#[tokio::test]
async fn glb_files_are_valid_and_have_the_whole_motion() {
    let folder = Folder::new("glb");
    let pack = shared().pack().await;
    let (source, out) = (
        folder.write_clip("walk.bvh", &walk(&pack)),
        folder.file("filled.glb"),
    );
    let output = troupe(with(gap_arguments(&source, 60, 95, &out), &["--quiet"])).await;
    assert_eq!(
        printed(&output) + &text(&output.stderr),
        "",
        "--quiet prints nothing"
    );

    let (document, buffers) = read_glb(&out);
    let names = document
        .nodes()
        .filter_map(|node| node.name().map(str::to_owned))
        .collect::<Vec<_>>();
    assert!(
        pack.skeleton()
            .joints
            .iter()
            .all(|joint| names.contains(&joint.name)),
        "{names:?}"
    );
    let animation = document.animations().next().expect("an animation");
    for channel in animation.channels() {
        let reader = channel.reader(|buffer| Some(&buffers[buffer.index()]));
        let times = reader.read_inputs().unwrap().collect::<Vec<_>>();
        assert_eq!(times.len(), 300);
        assert!((times[299] - 299.0 / 30.0).abs() < 1e-3);
    }
}

fn read_glb(path: &Path) -> (gltf::Document, Vec<Vec<u8>>) {
    let bytes = std::fs::read(path).unwrap();
    let gltf = gltf::Gltf::from_slice(&bytes).expect("a valid glb");
    let blob = gltf.blob.clone().expect("the numbers are inside");
    (gltf.document, vec![blob])
}

#[tokio::test]
async fn a_clip_at_another_rate_is_resampled() {
    let folder = Folder::new("rate");
    let pack = shared().pack().await;
    let fast = Walk {
        frames: 241,
        fps: 120.0,
        ..Walk::default()
    }
    .on(pack.skeleton());
    let (source, out) = (folder.write_clip("fast.bvh", &fast), folder.file("filled.bvh"));
    let output = troupe(gap_arguments(&source, 10, 40, &out)).await;
    assert!(
        text(&output.stderr).contains("resampled from 120 to 30"),
        "{}",
        text(&output.stderr)
    );
    let filled = read_clip(&out, &pack);
    assert_eq!((filled.frames(), filled.fps), (61, 30.0));
}

#[tokio::test]
async fn bad_input_gives_exit_code_2() {
    let folder = Folder::new("bad");
    let pack = shared().pack().await;
    let source = folder.write_clip("walk.bvh", &walk(&pack));
    let out = folder.file("out.bvh");
    let fill = |from, to| gap_arguments(&source, from, to, &out);
    // A gap from 60 starts its segment at 57: 12 frames end at 68, 64 frames at 120.
    failed(&troupe(fill(60, 67)).await, 2, &["12 to 64", "68 to 120"]);
    failed(&troupe(fill(60, 121)).await, 2, &["12 to 64", "68 to 120"]);
    failed(&troupe(fill(60, 300)).await, 2, &["to 300", "0 to 299"]);
    failed(&troupe(fill(2, 40)).await, 2, &["from is 2", "3 or more"]);
    failed(&troupe(fill(60, 60)).await, 2, &["must come after from"]);
    failed(
        &troupe(gap_arguments(&source, 60, 95, &folder.file("out.fbx"))).await,
        2,
        &[".bvh or .glb"],
    );
    failed(
        &troupe(gap_arguments(&folder.file("none.bvh"), 60, 95, &out)).await,
        2,
        &["none.bvh"],
    );

    std::fs::write(
        folder.file("broken.bvh"),
        "HIERARCHY\nROOT Hips\n{\n  OFFSET 0 x 0\n",
    )
    .unwrap();
    failed(
        &troupe(gap_arguments(&folder.file("broken.bvh"), 60, 95, &out)).await,
        2,
        &["broken.bvh", "line 4"],
    );

    let text = std::fs::read_to_string(&source).unwrap();
    let head = pack.skeleton().joints.last().unwrap().name.clone();
    std::fs::write(folder.file("renamed.bvh"), text.replace(&head, "Tail")).unwrap();
    failed(
        &troupe(gap_arguments(&folder.file("renamed.bvh"), 60, 95, &out)).await,
        2,
        &["lacks", &head],
    );

    failed(&troupe(["inbetween"]).await, 2, &["--clip"]);
    assert!(!out.exists(), "nothing was written");
}

#[tokio::test]
async fn a_refused_call_gives_exit_code_4() {
    let folder = Folder::new("refused");
    let pack = shared().pack().await;
    let source = folder.write_clip("walk.bvh", &walk(&pack));
    let fill = |more: &[&str]| with(gap_arguments(&source, 60, 95, &folder.file("out.bvh")), more);
    failed(
        &troupe(fill(&["--temperature", "3"])).await,
        4,
        &["characters[0].temperature", "0 to 2"],
    );
    failed(
        &troupe(fill(&["--pose-steps", "11"])).await,
        4,
        &["characters[0].pose_steps", "1 to 10"],
    );
    failed(
        &troupe(fill(&["--frame-count", "65"])).await,
        4,
        &["characters[0].frame_count", "12 to 64"],
    );
    failed(&troupe(fill(&["--pack", "missing"])).await, 4, &["missing"]);
    failed(&troupe(["packs", "missing"]).await, 4, &["missing"]);
}

#[tokio::test]
async fn a_missing_server_gives_exit_code_3() {
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let url = format!("http://127.0.0.1:{port}");
    failed(&troupe(["packs", "--server", &url]).await, 3, &[&url]);

    // This port accepts connections, but never answers.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", silent.local_addr().unwrap());
    failed(
        &troupe(["packs", "--server", &url, "--timeout", "0.5"]).await,
        3,
        &[&url],
    );
    failed(&troupe(["packs", "--server", "nonsense"]).await, 2, &["nonsense"]);
}

#[tokio::test]
async fn packs_are_listed_and_described() {
    let pack = shared().pack().await;
    let of = pack.description();
    let list = printed(&troupe(["packs"]).await);
    assert!(
        list.contains(&format!("{} (default)", of.name)) && list.contains(&of.version),
        "{list}"
    );
    let one = printed(&troupe(["packs", &of.name]).await);
    assert!(
        one.contains(&of.content_hash) && one.contains("UpperLeg_L") && one.contains(&of.licence),
        "{one}"
    );

    let json: Value = serde_json::from_str(&printed(&troupe(["packs", "--json"]).await)).unwrap();
    assert_eq!(json[0]["name"], of.name);
    let json: Value = serde_json::from_str(&printed(&troupe(["packs", &of.name, "--json"]).await)).unwrap();
    assert_eq!(json["max_frames"], 64);
}

#[tokio::test]
async fn a_picture_is_drawn() {
    let folder = Folder::new("draw");
    let pack = shared().pack().await;
    let (source, out) = (
        folder.write_clip("walk.bvh", &walk(&pack)),
        folder.file("picture.png"),
    );
    let mut arguments = gap_arguments(&source, 60, 106, &out);
    arguments[0] = "film".to_owned();
    printed(&troupe(with(arguments, &["--width", "800"])).await);
    let png = std::fs::read(&out).unwrap();
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    let number = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
    assert_eq!(
        (number(16), number(20)),
        (800, 360),
        "width and height of the header"
    );
}

#[tokio::test]
async fn real_clips_are_filled() {
    let folder = Folder::new("real");
    let pack = shared().pack().await;
    for source in real::clips() {
        let out = folder.file("filled.bvh");
        printed(&troupe(gap_arguments(source, 10, 41, &out)).await);
        let (clip, filled) = (read_clip(source, &pack), read_clip(&out, &pack));
        assert_eq!(filled.frames(), clip.frames());
        let error = difference(&filled.slice(0..11).unwrap(), &clip.slice(0..11).unwrap());
        assert!(error < 1e-3, "{}: {error}", source.display());
    }
}
