//! The `troupe-server` binary: its first words, its complaints, and how it stops.

use std::io::{BufRead as _, BufReader, Lines, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::pack_folder;

/// Far more than anything here takes.
const PATIENCE: Duration = Duration::from_secs(60);

fn server(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    command
        .args(args)
        .args(["--listen", "127.0.0.1:0", "--packs"])
        .arg(pack_folder());
    // What is tested here does not depend on the engine; this one starts at once.
    command.env("TROUPE_ENGINE", "cpu");
    command.current_dir(std::env::temp_dir());
    command
}

/// What `done` gives, once it gives something; nothing after [`PATIENCE`].
fn wait_for<T>(mut done: impl FnMut() -> Option<T>) -> Option<T> {
    let end = Instant::now() + PATIENCE;
    while Instant::now() < end {
        if let Some(result) = done() {
            return Some(result);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}

/// The exit status of a process that ends by itself, in time.
fn exit(child: &mut Child) -> ExitStatus {
    wait_for(|| child.try_wait().unwrap()).unwrap_or_else(|| {
        child.kill().unwrap();
        panic!("the server did not stop");
    })
}

fn complaint(command: &mut Command) -> String {
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    assert_eq!(exit(&mut child).code(), Some(1));
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    text
}

/// A server that serves, its address, and the rest of what it says.
fn serving(command: &mut Command) -> (Child, String, Lines<BufReader<ChildStdout>>) {
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let first = lines.next().unwrap().unwrap();
    let address = first.strip_prefix("Troupe serves gRPC and HTTP on http://");
    let address = address.unwrap_or_else(|| panic!("{first}")).to_owned();
    assert!(address.starts_with("127.0.0.1:"), "{first}");
    (child, address, lines)
}

#[cfg(unix)]
fn terminate(child: &Child) {
    let signalled = Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(signalled.success());
}

#[test]
fn a_missing_runtime_is_explained() {
    for library in [None, Some("/nowhere/libonnxruntime.so")] {
        let mut command = server(&[]);
        command.env_remove("ORT_DYLIB_PATH");
        command.envs(library.map(|library| ("ORT_DYLIB_PATH", library)));
        let text = complaint(&mut command);
        let cause = library.unwrap_or("ORT_DYLIB_PATH is not set");
        assert!(text.contains(cause) && text.contains("make runtime"), "{text}");
    }
}

#[test]
fn an_engine_that_cannot_serve_is_explained() {
    let text = complaint(server(&["--engine", "tensorrt"]).env_remove("TROUPE_ENGINE"));
    // Where a GPU library is installed it may serve.
    assert!(
        text.contains("pack human: the engine tensorrt cannot serve"),
        "{text}"
    );
    let text = complaint(&mut server(&["--workers", "65"]));
    assert!(text.contains("workers is 65; allowed: 0 to 64"), "{text}");
}

#[test]
fn the_doctor_says_what_would_serve() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    command.args(["doctor", "--json", "--engine", "cpu", "--workers", "1", "--packs"]);
    let output = command.arg(pack_folder()).output().unwrap();
    assert!(output.status.success());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let pack = &report["packs"][0];
    assert_eq!(pack["name"], "human");
    assert_eq!(pack["decision"]["engine"], "cpu");
    assert_eq!(report["problems"], serde_json::json!([]));
    let speeds = pack["trial"]["speeds"].as_array().unwrap();
    assert!(
        speeds
            .iter()
            .all(|speed| speed["plans_per_s"].as_f64() > Some(0.0))
            && !speeds.is_empty()
    );

    // What keeps the server from starting makes it fail, and is said.
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    let output = command.args(["doctor", "--packs", "/nowhere"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains("Problems\n  model pack /nowhere: cannot read"),
        "{text}"
    );
}

#[test]
fn manual_pages_have_every_command_and_option() {
    let folder = std::env::temp_dir().join(format!("troupe-server-man-{}", std::process::id()));
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    let output = command.args(["man", "--out"]).arg(&folder).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let page =
        |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(page("troupe-server.1").contains("max\\-streams"));
    for name in ["doctor", "health", "key", "key-new", "man"] {
        assert!(page(&format!("troupe-server-{name}.1")).contains(".TH"), "{name}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_missing_pack_is_named() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    let text = complaint(command.args(["--listen", "127.0.0.1:0", "--packs", "/nowhere/models"]));
    assert!(text.contains("model pack /nowhere/models: cannot read"), "{text}");
    let text = complaint(&mut server(&["--default-pack", "dragon"]));
    assert!(text.contains("default_pack is dragon; allowed: human"), "{text}");
}

#[test]
fn a_mistake_on_the_command_line_has_an_exit_code_of_its_own() {
    let mut child = server(&["--max-bach", "1"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    assert_eq!(exit(&mut child).code(), Some(2));
}

#[test]
fn a_port_in_use_is_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    let text = complaint(command.args(["--listen", &address]));
    assert!(text.contains(&format!("cannot listen on {address}")), "{text}");
}

#[test]
fn the_configuration_template_is_printed() {
    let output = Command::new(env!("CARGO_BIN_EXE_troupe-server"))
        .arg("--print-config")
        .output()
        .unwrap();
    assert!(output.status.success());
    assert!(
        String::from_utf8(output.stdout)
            .unwrap()
            .contains("#max_batch = 0")
    );
}

#[test]
fn its_output_need_not_be_read() {
    for args in [["--print-config", ""].as_slice(), &["--packs", "/nowhere/models"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
        command.args(args.iter().filter(|arg| !arg.is_empty()));
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut child = command
            .stdout(writer.try_clone().unwrap())
            .stderr(writer)
            .spawn()
            .unwrap();
        let expected = if args[0] == "--print-config" { 0 } else { 1 };
        assert_eq!(exit(&mut child).code(), Some(expected), "{args:?}");
    }
}

/// A server that writes its greeting to `stdout`. Ends when it serves.
#[cfg(unix)]
fn serving_unheard(stdout: std::io::PipeWriter, stderr: Stdio) -> Child {
    // Any port would do, but the greeting that names it is lost. This one was free a moment ago.
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap().to_string();
    drop(free);
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    command.args(["--listen", &address, "--packs"]).arg(pack_folder());
    command.env("TROUPE_ENGINE", "cpu");
    command.current_dir(std::env::temp_dir());
    let mut child = command.stdout(stdout).stderr(stderr).spawn().unwrap();
    let ready = wait_for(|| {
        let mut stream = TcpStream::connect(&address).ok()?;
        let head = "GET /readyz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n";
        stream.write_all(head.as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        answer.starts_with("HTTP/1.1 200").then_some(())
    });
    if ready.is_none() {
        child.kill().unwrap();
        panic!("it never became ready");
    }
    child
}

#[cfg(unix)]
#[test]
fn it_serves_and_stops_with_closed_outputs() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut child = serving_unheard(writer.try_clone().unwrap(), writer.into());
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(0));
}

#[cfg(unix)]
#[test]
fn a_sigterm_while_it_greets_is_not_lost() {
    let (mut reader, mut writer) = std::io::pipe().unwrap();
    // More than a pipe holds, so that the greeting has to wait.
    let stdout = writer.try_clone().unwrap();
    let full = std::thread::spawn(move || writer.write_all(&[b'.'; 1 << 20]));
    let mut child = serving_unheard(stdout, Stdio::null());
    std::thread::sleep(Duration::from_millis(200));
    terminate(&child);
    std::thread::sleep(Duration::from_millis(50));
    let heard = std::thread::spawn(move || {
        let mut text = Vec::new();
        reader.read_to_end(&mut text).map(|_| text)
    });
    assert_eq!(exit(&mut child).code(), Some(0));
    full.join().unwrap().unwrap();
    let heard = String::from_utf8(heard.join().unwrap().unwrap()).unwrap();
    assert!(heard.contains("Troupe serves gRPC and HTTP on http://"));
}

#[cfg(unix)]
#[test]
fn it_says_where_it_listens_and_stops_on_sigterm() {
    let (mut child, address, lines) = serving(server(&[]).stderr(Stdio::null()));
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(0));
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let hint = format!("  curl http://{address}/v1/packs");
    assert!(rest.contains(&hint), "{rest:?}");
    assert_eq!(
        rest[0],
        format!("Open http://{address}/ in a browser to see a crowd walk")
    );
    assert!(rest[1].starts_with("  pack human "), "{rest:?}");
}

#[cfg(unix)]
#[test]
fn at_a_hangup_it_reads_its_keys_again() {
    let keys = std::env::temp_dir().join(format!("troupe-hangup-{}.toml", std::process::id()));
    let entry = troupe_edge::keys::entry("game", troupe_edge::clients::Role::Drive, "secret");
    std::fs::write(&keys, entry).unwrap();
    let mut command = server(&["--keys", keys.to_str().unwrap()]);
    let (mut child, _, _lines) = serving(command.stderr(Stdio::piped()));
    // It listens for the signal once it has greeted.
    std::thread::sleep(Duration::from_millis(300));
    let signalled = Command::new("kill")
        .args(["-HUP", &child.id().to_string()])
        .status();
    assert!(signalled.unwrap().success());
    std::thread::sleep(Duration::from_millis(300));
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(0));
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    // The file has not changed, so only the signal makes it read.
    assert!(text.contains("keys read again"), "{text}");
    std::fs::remove_file(&keys).unwrap();
}

/// The exit code of the health check, and what it says.
fn health(args: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    command.arg("health").args(args).current_dir(std::env::temp_dir());
    let output = command.output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

#[cfg(unix)]
#[test]
fn the_health_check_says_whether_a_server_is_ready() {
    let (mut child, address, _lines) = serving(server(&[]).stderr(Stdio::null()));
    let ready = format!("http://{address}/readyz: ok\n");
    assert_eq!(health(&["--listen", &address]), (Some(0), ready.clone()));
    let url = format!("http://{address}");
    assert_eq!(health(&["--url", &url]), (Some(0), ready));
    let (code, text) = health(&["--url", &format!("{url}/v1/packs/dragon")]);
    assert_eq!(code, Some(1));
    assert!(text.contains("status 404") && text.contains("dragon"), "{text}");
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(0));
    let (code, text) = health(&["--url", &url]);
    assert_eq!(code, Some(1));
    assert!(
        text.contains(&format!("http://{address}/readyz: no answer")),
        "{text}"
    );
}

#[cfg(unix)]
#[test]
fn the_health_check_asks_the_second_port() {
    // It was free a moment ago.
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let second = free.local_addr().unwrap().to_string();
    drop(free);
    let config = std::env::temp_dir().join(format!("troupe-second-port-{}.toml", std::process::id()));
    std::fs::write(&config, format!("health_listen = \"{second}\"\n")).unwrap();
    let (mut child, _, _lines) = serving(server(&["--health-listen", &second]).stderr(Stdio::null()));
    let (code, text) = health(&["--config", config.to_str().unwrap()]);
    assert_eq!((code, text), (Some(0), format!("http://{second}/readyz: ok\n")));
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(0));
    std::fs::remove_file(&config).unwrap();
}

#[test]
fn a_key_is_made_with_its_entry() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-server"));
    let output = command
        .args(["key", "new", "--name", "game", "--role", "author"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8(output.stdout).unwrap();
    for part in [
        "shown this once: troupe_",
        "[[keys]]",
        "name = \"game\"",
        "role = \"author\"",
        "sha256 = \"",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
}

#[cfg(unix)]
#[test]
fn a_second_sigterm_ends_it_at_once() {
    let (mut child, address, _lines) = serving(server(&["--drain-delay-ms", "600000"]).stderr(Stdio::null()));
    terminate(&child);
    let head = "GET /readyz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n";
    let unready = wait_for(|| {
        let mut stream = TcpStream::connect(&address).ok()?;
        stream.write_all(head.as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        answer.starts_with("HTTP/1.1 503").then_some(())
    });
    assert!(child.try_wait().unwrap().is_none(), "it serves on");
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(3));
    assert!(unready.is_some(), "it went on saying that it is ready");
}

#[cfg(unix)]
#[test]
fn half_a_request_does_not_hold_up_a_stop() {
    let long = ["--drain-timeout-ms", "600000", "--request-timeout-ms", "600000"];
    let (mut child, address, _lines) = serving(server(&long).stderr(Stdio::null()));
    // A request whose body does not come.
    let mut stream = TcpStream::connect(&address).unwrap();
    let head = "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
                content-length: 9\r\nexpect: 100-continue\r\n\r\n";
    stream.write_all(head.as_bytes()).unwrap();
    stream.read_exact(&mut [0; 25]).unwrap();
    terminate(&child);
    assert_eq!(exit(&mut child).code(), Some(0));
}

/// A server that does not outlive its test.
#[cfg(unix)]
struct Kept(Child);

#[cfg(unix)]
impl Drop for Kept {
    fn drop(&mut self) {
        let _ = self.0.kill();
    }
}

/// A call over HTTP of a test that knows no HTTP library.
#[cfg(unix)]
fn call(address: &str, method: &str, path: &str, body: &str) -> serde_json::Value {
    let mut stream = TcpStream::connect(address).unwrap();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{body}",
        body.len()
    );
    stream.write_all(head.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200"), "{answer}");
    serde_json::from_str(body).unwrap()
}

#[cfg(unix)]
#[test]
fn a_server_that_is_killed_goes_on_where_it_was() {
    let store = std::env::temp_dir().join(format!("troupe-killed-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&store);
    let start = || serving(server(&["--workers", "1"]).arg("--store").arg(&store));
    let (child, address, _lines) = start();
    let mut child = Kept(child);
    let session = r#"{"sessions": [{"id": "hero", "style": "normal", "seed": 3}]}"#;
    call(&address, "POST", "/v1/sessions", session);
    let walk = r#"{"session_ids": ["hero"], "frames": 60, "commands": [{"session_id": "hero", "sequence": 1,
        "locomote": {"velocity": {"x": 0, "y": 0, "z": 1.2}}}]}"#;
    let walked = call(&address, "POST", "/v1/step", walk);
    let block = &walked["blocks"][0];
    let numbers = |column: &str| -> Vec<f64> {
        let column = block[column].as_array().unwrap();
        column.iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let (roots, rotations) = (numbers("root_positions"), numbers("rotations"));
    let last = roots.len() / 3 - 1;
    // Longer than the interval at which it is kept.
    std::thread::sleep(Duration::from_millis(600));
    child.0.kill().unwrap();
    child.0.wait().unwrap();

    let killed = Instant::now();
    let (child, address, _lines) = start();
    let mut child = Kept(child);
    let ready = killed.elapsed();
    let pose = &rotations[rotations.len() / (last + 1) * last..];
    let (root, frame) = (&roots[3 * last..], last + 1);
    let seen = serde_json::json!({"sessions": [{"session_id": "hero", "frame": frame, "pose": {
        "root": {"position": {"x": root[0], "y": root[1], "z": root[2]}}, "pose": {"rotations": pose}}}]});
    let resumed = call(&address, "POST", "/v1/sessions/resume", &seen.to_string());
    let one = &resumed["sessions"][0];
    assert_eq!(
        (&one["restored"], &one["session"]["last_sequence"]),
        (&true.into(), &"1".into()),
        "{resumed}"
    );
    let on = call(
        &address,
        "POST",
        "/v1/step",
        r#"{"session_ids": ["hero"], "frames": 30}"#,
    );
    println!(
        "ready again after {ready:?}, first frame after {:?}",
        killed.elapsed()
    );
    let block = &on["blocks"][0];
    assert_eq!(block["first_frames"][0], "61");
    let next: Vec<f64> = block["root_positions"].as_array().unwrap()[..3]
        .iter()
        .map(|number| number.as_f64().unwrap())
        .collect();
    let way = (0..3)
        .map(|axis| (next[axis] - root[axis]).powi(2))
        .sum::<f64>()
        .sqrt();
    assert!(way < 0.1, "{way} m from {root:?} to {next:?}");
    terminate(&child.0);
    assert_eq!(exit(&mut child.0).code(), Some(0));
    std::fs::remove_dir_all(&store).unwrap();
}

/// A store in a folder of its own, and a server that uses it.
fn server_with_store(name: &str) -> (std::path::PathBuf, Command) {
    let folder = std::env::temp_dir().join(format!("troupe-program-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let command = server(&["--store", folder.to_str().unwrap()]);
    (folder, command)
}

#[test]
fn a_damaged_store_ends_the_start_with_advice() {
    let (folder, mut command) = server_with_store("damaged");
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("troupe.redb");
    std::fs::write(&file, vec![7; 100_000]).unwrap();
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    assert_eq!(exit(&mut child).code(), Some(5));
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(
        text.contains(&format!("store: {} is damaged", file.display())),
        "{text}"
    );
    assert!(
        text.contains("put a copy of it in its place, or move it away"),
        "{text}"
    );
    std::fs::remove_dir_all(&folder).unwrap();
}

/// The shell ignores the signal of the limit of file sizes, and the server inherits that. With a
/// limit of nothing every write fails, as on a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_stop_on_a_full_disk_has_an_exit_code_of_its_own() {
    for full in [false, true] {
        let (folder, command) = server_with_store("full");
        let mut shell = Command::new("sh");
        shell.args(["-c", "trap '' XFSZ; exec \"$@\"", "sh"]);
        shell.arg(command.get_program()).args(command.get_args());
        shell
            .env("TROUPE_ENGINE", "cpu")
            .current_dir(std::env::temp_dir());
        let (mut child, address, _lines) = serving(shell.stderr(Stdio::piped()));
        if full {
            let pid = child.id().to_string();
            let limited = Command::new("prlimit")
                .args(["--fsize=0", "--pid", &pid])
                .status();
            assert!(limited.unwrap().success());
        }
        let body = r#"{"sessions": [{"id": "a"}, {"id": "b"}]}"#;
        let mut stream = TcpStream::connect(&address).unwrap();
        let length = body.len();
        let head = format!(
            "POST /v1/sessions HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-type: application/json\r\n\
             content-length: {length}\r\n\r\n{body}"
        );
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        terminate(&child);
        let expected = if full { 4 } else { 0 };
        assert_eq!(exit(&mut child).code(), Some(expected));
        let mut text = String::new();
        child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        let says = "sessions are lost: the store does not have their last changes";
        assert_eq!(text.contains(says) && text.contains("sessions=2"), full, "{text}");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
