use super::*;

fn load(args: &[&str]) -> Result<Config, ConfigError> {
    let args = std::iter::once("troupe-server").chain(args.iter().copied());
    Config::load(Cli::try_parse_from(args).unwrap())
}

struct File(PathBuf);

impl File {
    fn new(test: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("troupe-config-{test}-{}.toml", std::process::id()));
        std::fs::write(&path, text).unwrap();
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn flags_win_over_the_file_and_the_file_over_defaults() {
    let file = File::new(
        "layers",
        "max_batch = 8\nlisten = \"127.0.0.1:1\"\nlog_format = \"json\"\n",
    );
    let config = load(&["--config", file.0.to_str().unwrap(), "--listen", "127.0.0.1:2"]).unwrap();
    assert_eq!(config.listen.port(), 2);
    assert_eq!((config.max_batch, config.log_format), (8, LogFormat::Json));
    assert_eq!((config.max_message_bytes, config.default_pack), (16 << 20, None));
    assert_eq!((config.max_sessions, config.session_ttl_ms), (16_384, 60_000));
}

#[test]
fn the_template_names_every_option_and_loads() {
    let template = Config::template();
    for option in [
        "listen",
        "packs",
        "max_batch",
        "drain_timeout_ms",
        "TROUPE_LISTEN",
        "ORT_DYLIB_PATH",
    ] {
        assert!(template.contains(option), "{option} is missing in\n{template}");
    }
    let file = File::new("template", &template);
    load(&["--config", file.0.to_str().unwrap()]).unwrap();
}

#[test]
fn mistakes_name_the_option() {
    let error = |args: &[&str]| load(args).unwrap_err().to_string();
    assert_eq!(error(&["--max-batch", "0"]), "max_batch is 0; allowed: 1 or more");
    assert_eq!(
        error(&["--max-batch", "4097"]),
        "max_batch is 4097; allowed: 1 to 4096"
    );
    assert_eq!(
        error(&["--max-connections", "0"]),
        "max_connections is 0; allowed: 1 or more"
    );
    assert_eq!(
        error(&["--max-connections", "1000001"]),
        "max_connections is 1000001; allowed: 1 to 1000000"
    );
    assert_eq!(
        error(&["--max-streams", "0"]),
        "max_streams is 0; allowed: 1 or more"
    );
    assert_eq!(
        error(&["--session-ttl-ms", "999"]),
        "session_ttl_ms is 999; allowed: 1000 to 86400000"
    );
    assert_eq!(
        error(&["--max-sessions-per-request", "16385"]),
        "max_sessions_per_request is 16385; allowed: 1 to 16384"
    );
    assert!(error(&["--max-queued-characters", "10"]).contains("max_characters_per_request (256) or more"));
    assert!(error(&["--config", "/nowhere/troupe.toml"]).contains("/nowhere/troupe.toml"));
    let file = File::new("mistake", "max_bach = 8\n");
    assert!(error(&["--config", file.0.to_str().unwrap()]).contains("max_bach"));
}
