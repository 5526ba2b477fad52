use std::time::Duration;

use clap::{CommandFactory as _, Parser as _};

use super::*;
use troupe_edge::clients::Shares;
use troupe_engine::onnx::Batching;

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
    assert_eq!((config.max_sessions, &config.default_pack), (16_384, &None));
}

#[test]
fn an_empty_name_turns_a_folder_off() {
    let config = load(&["--store", "", "--cache", ""]).unwrap();
    assert_eq!(
        (config.store_folder(), config.options.cache),
        (None, Some(PathBuf::new()))
    );
}

#[test]
fn a_shared_store_is_no_folder_and_its_server_has_an_address() {
    let config = load(&["--store", "redis://:secret@db:6379"]).unwrap();
    assert_eq!((config.store_folder(), config.styles_folder()), (None, None));
    assert_eq!(
        config.shared_store().unwrap().unwrap().to_string(),
        "redis://db:6379"
    );
    let on_all = ["--store", "redis://db", "--listen", "0.0.0.0:8080"];
    let error = load(&on_all).unwrap_err().to_string();
    assert!(
        error.contains("advertise") && error.contains("HOST:PORT"),
        "{error}"
    );
    let named = [&on_all[..], &["--advertise", "troupe-0.troupe:8080"]].concat();
    assert_eq!(
        load(&named).unwrap().advertise.as_deref(),
        Some("troupe-0.troupe:8080")
    );
    let unnamed = [&on_all[..], &["--advertise", "troupe-0"]].concat();
    assert!(load(&unnamed).is_err());
    let error = load(&["--store", "redis://:secret@a,b/1"])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("redis://a,b") && !error.contains("secret"),
        "{error}"
    );
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
    ] {
        assert!(template.contains(option), "{option} is missing in\n{template}");
    }
    let file = File::new("template", &template);
    load(&["--config", file.0.to_str().unwrap()]).unwrap();
}

#[test]
fn the_committed_template_is_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/config.toml");
    let current = Config::template() + "\n";
    if std::env::var_os("UPDATE_CONFIG").is_some() {
        std::fs::write(path, &current).unwrap();
    }
    assert!(
        std::fs::read_to_string(path).unwrap_or_default().trim_end() == current.trim_end(),
        "{path} differs from the code; `UPDATE_CONFIG=1 cargo test -p troupe-server --lib config` and \
         `scripts/docs.sh references` write it and its page",
    );
}

/// The help as a terminal of usual width shows it. Defaults of this machine's environment do not
/// show.
fn help(command: &mut clap::Command) -> String {
    command
        .clone()
        .term_width(100)
        .mut_args(|arg| arg.hide_env_values(true))
        .render_long_help()
        .to_string()
}

#[test]
fn the_help_says_what_there_is() {
    let mut command = Cli::command();
    let text = help(&mut command);
    for option in [
        "--engine <ENGINE>",
        "--workers <COUNT>",
        "--accuracy-check <MODE>",
        "doctor",
    ] {
        assert!(text.contains(option), "{option} is missing in\n{text}");
    }
    insta::assert_snapshot!(
        "doctor_help",
        help(command.find_subcommand_mut("doctor").unwrap())
    );
}

#[test]
fn the_doctor_has_flags_of_its_own_and_the_server_keeps_its() {
    let doctor = |args: &[&str]| {
        let args = ["troupe-server", "doctor"].iter().chain(args).copied();
        match Cli::try_parse_from(args).unwrap().command {
            Some(Command::Doctor(args)) => args,
            _ => panic!("this does not serve"),
        }
    };
    let args = doctor(&[
        "--json",
        "--engine",
        "openvino-bf16",
        "--workers",
        "3",
        "--packs",
        "p",
    ]);
    let config = Config::load_for_doctor(&args).unwrap();
    assert!(args.json);
    assert_eq!((config.engine, config.workers), (EngineChoice::OpenvinoBf16, 3));
    assert_eq!(config.packs, Path::new("p"));
    assert!(Cli::try_parse_from(["troupe-server", "--workers", "2", "doctor"]).is_err());
    assert_eq!(
        load(&["--engine", "cpu", "--workers", "2", "--threads", "6"])
            .unwrap()
            .workers()
            .threads,
        3
    );
}

#[test]
fn the_health_check_takes_a_url_or_the_servers_own_address() {
    let parse = |args: &[&str]| {
        let args = ["troupe-server", "health"].iter().chain(args).copied();
        Cli::try_parse_from(args).map(|cli| match cli.command {
            Some(Command::Health(args)) => args,
            _ => panic!("this does not serve"),
        })
    };
    let url = |text: &str| parse(&["--url", text]).map(|args| args.url.unwrap().to_string());
    assert_eq!(url("http://h:1").unwrap(), "http://h:1/readyz");
    assert_eq!(url("http://h:1/").unwrap(), "http://h:1/readyz");
    assert_eq!(url("https://h:1").unwrap(), "https://h:1/readyz");
    assert_eq!(url("http://h:1/healthz").unwrap(), "http://h:1/healthz");
    for wrong in ["127.0.0.1:8080", "/readyz", "ftp://h:1", "http://"] {
        let error = url(wrong).unwrap_err().to_string();
        assert!(error.contains("allowed: http://HOST:PORT"), "{error}");
    }
    let args = parse(&["--listen", "127.0.0.1:7"]).unwrap();
    assert!(args.url.is_none());
    assert_eq!(Config::load_for_health(&args).unwrap().listen.port(), 7);
    let mut command = Cli::command();
    insta::assert_snapshot!(
        "health_help",
        help(command.find_subcommand_mut("health").unwrap())
    );
}

#[test]
fn calls_stay_behind_live_plans_for_longer_than_they_should_ever_wait() {
    let limits = |args: &[&str]| load(args).unwrap().batch_limits(8);
    let usual = limits(&[]);
    assert_eq!(
        (usual.max_wait, usual.ageing),
        (Duration::from_millis(250), Duration::from_secs(2))
    );
    assert_eq!(usual.max_live, 16_384);
    assert_eq!(limits(&["--max-queue-ms", "50"]).ageing, Duration::from_secs(2));
    assert_eq!(
        limits(&["--max-queue-ms", "5000"]).ageing,
        Duration::from_secs(10)
    );
    // Without that limit, half of the time after which a call is given up.
    let unlimited = limits(&["--max-queue-ms", "0", "--request-timeout-ms", "20000"]);
    assert_eq!(
        (unlimited.max_wait, unlimited.ageing),
        (Duration::ZERO, Duration::from_secs(10))
    );
}

#[test]
fn the_largest_batch_is_the_engines_own_unless_it_is_set() {
    let batching = Batching {
        any_size: true,
        usual_most: 8,
        call_rows: 0,
    };
    let most = |args: &[&str]| load(args).unwrap().max_batch_of(batching);
    assert_eq!((most(&[]), most(&["--max-batch", "0"])), (8, 8));
    assert_eq!(most(&["--max-batch", "20"]), 20);
}

#[test]
fn mistakes_name_the_option() {
    let error = |args: &[&str]| load(args).unwrap_err().to_string();
    assert_eq!(
        error(&["--max-batch", "4097"]),
        "max_batch is 4097; allowed: 0 to 4096"
    );
    assert_eq!(error(&["--workers", "65"]), "workers is 65; allowed: 0 to 64");
    assert_eq!(
        error(&["--request-timeout-ms", "0"]),
        "request_timeout_ms is 0; allowed: 1 or more"
    );
    assert_eq!(
        error(&["--max-connections", "1000001"]),
        "max_connections is 1000001; allowed: 0 to 1000000"
    );
    assert_eq!(
        error(&["--max-streams", "0"]),
        "max_streams is 0; allowed: 1 or more"
    );
    assert_eq!(
        error(&["--max-sessions", "1000001"]),
        "max_sessions is 1000001; allowed: 1 to 1000000"
    );
    assert_eq!(
        error(&["--max-queue-ms", "3600001"]),
        "max_queue_ms is 3600001; allowed: 0 to 3600000"
    );
    assert_eq!(
        error(&["--drain-delay-ms", "3600001"]),
        "drain_delay_ms is 3600001; allowed: 0 to 3600000"
    );
    assert_eq!(
        error(&["--network-memory-mib", "1073741825"]),
        "network_memory_mib is 1073741825; allowed: 0 to 1073741824"
    );
    for (flags, text) in [
        (
            ["--tls-certificate", "a"],
            "tls_key is missing; allowed: a file, because tls_certificate is set",
        ),
        (
            ["--jwt-audience", "a"],
            "jwks is missing; allowed: a file, because jwt_audience is set",
        ),
        (
            ["--tls-key", "a"],
            "tls_certificate is missing; allowed: a file, because tls_key is set",
        ),
        (
            ["--tls-client-ca", "a"],
            "tls_certificate is missing; allowed: a file, because tls_client_ca is set",
        ),
    ] {
        assert_eq!(error(&flags), text);
    }
    assert!(error(&["--config", "/nowhere/troupe.toml"]).contains("/nowhere/troupe.toml"));
    let file = File::new("mistake", "max_bach = 8\n");
    assert!(error(&["--config", file.0.to_str().unwrap()]).contains("max_bach"));
}

#[test]
fn removed_options_get_an_error_that_says_what_replaced_them() {
    let flag = |name: &str| {
        let error = Cli::try_parse_from(["troupe-server", name, "1"]).unwrap_err();
        Cli::removed_flag(&error).map(|error| error.to_string())
    };
    for (option, instead) in removed::REMOVED {
        let said = format!("{option} is no longer an option: {instead}");
        let name = format!("--{}", option.replace('_', "-"));
        assert_eq!(flag(&name).as_deref(), Some(&*said));
        assert_eq!(flag(&format!("{name}=1")).as_deref(), Some(&*said));
        let file = File::new(option, &format!("max_batch = 8\n{option} = 1\n"));
        let error = load(&["--config", file.0.to_str().unwrap()]).unwrap_err();
        assert_eq!(error.to_string(), said);
        assert!(
            !Config::template().contains(&format!("\n#{option} =")),
            "{option}"
        );
    }
    assert_eq!(flag("--max-bach"), None);
}

#[test]
fn the_queue_grows_with_workers_and_batches() {
    let queue = |args: &[&str]| load(args).unwrap().max_queued_characters();
    assert_eq!(queue(&["--workers", "1"]), 1024);
    assert_eq!(queue(&["--workers", "8"]), 4096);
    assert_eq!(queue(&["--workers", "4", "--max-batch", "128"]), 8192);
}

#[test]
fn clients_and_addresses_get_shares() {
    let options = ["--max-streams", "8", "--transfer-memory-mib", "4"];
    let config = load(&[&options[..], &["--keys", "keys.toml"]].concat()).unwrap();
    let shares = config.shares();
    assert_eq!((shares.client.streams, shares.address.streams), (2, 4));
    assert_eq!((shares.client.bytes, shares.address.bytes), (1 << 20, 2 << 20));
    assert_eq!(config.connections_of_address(10_000), 5000);
    assert_eq!(shares.address.sessions, usize::MAX);
    assert_eq!(load(&["--max-streams", "1"]).unwrap().shares().client.streams, 1);
    // Without keys, one address has an eighth.
    let Shares { client, address, .. } = load(&options).unwrap().shares();
    for share in [client, address] {
        assert_eq!((share.streams, share.bytes, share.sessions), (1, 512 << 10, 2048));
    }
}

#[test]
fn origins_and_hosts_are_lists() {
    let file = File::new("origins", "allowed_origins = [\"https://a.example\"]\n");
    let path = file.0.to_str().unwrap();
    assert_eq!(load(&["--config", path]).unwrap().allowed_origins.len(), 1);
    let flags = [
        "--allowed-origins",
        "https://a.example,http://b.example:1",
        "--allowed-hosts",
        "a,b:1",
    ];
    let config = load(&flags).unwrap();
    assert_eq!((config.allowed_origins.len(), config.allowed_hosts.len()), (2, 2));
    let file = File::new("no-origin", "allowed_origins = [\"a.example\"]\n");
    let error = load(&["--config", file.0.to_str().unwrap()])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("allowed_origins") && error.contains("SCHEME://HOST"),
        "{error}"
    );
}

#[test]
fn traces_need_a_collector_and_a_share() {
    assert!(load(&[]).unwrap().trace_options().is_none());
    let options = load(&["--otlp-endpoint", "http://collector:4317"])
        .unwrap()
        .trace_options();
    assert_eq!(options.unwrap().sample_ratio, 0.1);
    for (option, value, allowed) in [
        ("--otlp-endpoint", "collector:4317", "http://HOST:PORT"),
        ("--otlp-endpoint", "https://collector:4317", "http://HOST:PORT"),
        ("--trace-sample-ratio", "1.5", "0 to 1"),
    ] {
        let error = load(&[option, value]).unwrap_err().to_string();
        assert!(error.contains(value) && error.contains(allowed), "{error}");
    }
}
