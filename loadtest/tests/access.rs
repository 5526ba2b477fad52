//! The load tester against a server that asks for a key and for certificates, on both sides.
//!
//! It needs the ONNX Runtime library (`make runtime` fetches it).

#![allow(clippy::unwrap_used, reason = "these are tests")]

use std::path::{Path, PathBuf};
use std::process::Output;

use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use tokio::net::TcpListener;
use tokio::process::Command;
use troupe_client::{Client, ClientCertificate, ClientError, ConnectOptions, TlsOptions};
use troupe_edge::clients::Role;
use troupe_edge::keys;
use troupe_server::config::Config;
use troupe_server::server::serve;

/// An authority's certificates: its own, the server's and a client's, each with a key beside it.
fn certificates(folder: &Path) {
    let write = |name: &str, text: String| std::fs::write(folder.join(name), text).unwrap();
    let key = KeyPair::generate().unwrap();
    let mut params = CertificateParams::new(Vec::new()).unwrap();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    write("ca.pem", params.self_signed(&key).unwrap().pem());
    let issuer = Issuer::new(params, key);
    for name in ["server", "client"] {
        let key = KeyPair::generate().unwrap();
        let params = CertificateParams::new(["127.0.0.1".to_owned()]).unwrap();
        write(
            &format!("{name}.pem"),
            params.signed_by(&key, &issuer).unwrap().pem(),
        );
        write(&format!("{name}.key"), key.serialize_pem());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn with_a_key_and_certificates_it_gets_in() {
    let folder = tempfile::tempdir().unwrap();
    certificates(folder.path());
    let file = |name: &str| -> PathBuf { folder.path().join(name) };
    let key = keys::new_key();
    std::fs::write(file("keys.toml"), keys::entry("load", Role::Admin, &key)).unwrap();

    let packs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human");
    let mut config = Config::local(&packs).unwrap();
    config.keys = Some(file("keys.toml"));
    config.tls_certificate = Some(file("server.pem"));
    config.tls_key = Some(file("server.key"));
    config.tls_client_ca = Some(file("ca.pem"));
    let listener = TcpListener::bind(config.listen).await.unwrap();
    let mut server = serve(config, listener).await.unwrap();
    server.ready().await.unwrap();
    let url = format!("https://{}", server.address());

    let run = async |more: &str, options: &[(&str, &str)]| -> (Output, String) {
        let report = file("report.json");
        let mut command = Command::new(env!("CARGO_BIN_EXE_troupe-loadtest"));
        command.args("run --warmup 0.2 --duration 1 --expect-zero-failures".split(' '));
        command.args(more.split_whitespace()).args(["--server", &url]);
        for (option, value) in options {
            match *option {
                "--key" => command.args([*option, *value]),
                _ => command.arg(option).arg(file(value)),
            };
        }
        let output = command.arg("--json").arg(&report).output().await.unwrap();
        (output, std::fs::read_to_string(&report).unwrap_or_default())
    };
    let ca = ("--ca", "ca.pem");
    let [shown, its_key] = [
        ("--client-certificate", "client.pem"),
        ("--client-key", "client.key"),
    ];
    let in_full = [ca, shown, its_key, ("--key", key.as_str())];
    for workload in [
        "--processes 2",
        "--workload json",
        "--workload step --characters 2",
    ] {
        let (output, report) = run(workload, &in_full).await;
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{workload}: {text}");
        // The key gave it the server's metrics, and is not in the report.
        assert!(report.contains("rss_peak_bytes"), "{workload}: {report}");
        assert!(!report.contains(&key), "{workload}");
    }
    let (output, _) = run("", &in_full[..3]).await;
    assert_eq!(output.status.code(), Some(4), "without a key");
    // The server refuses the client after its handshake. If the connection closes while the client
    // writes, the client does not read the reason. So the test tries several times.
    let mut reasons = String::new();
    for _ in 0..40 {
        if reasons.contains("CertificateRequired") {
            break;
        }
        let (output, _) = run("", &[ca, in_full[3]]).await;
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(3),
            "without a certificate of its own: {text}"
        );
        reasons += &text;
    }
    assert!(reasons.contains("CertificateRequired"), "{reasons}");
    let (output, _) = run("", &in_full[1..]).await;
    assert_eq!(output.status.code(), Some(3), "without the server's authority");

    // The client library, which the program and `troupe` use.
    let mut options = ConnectOptions {
        key: Some(key.into()),
        tls: TlsOptions {
            ca: Some(file("ca.pem")),
            client: Some(ClientCertificate {
                certificate: file("client.pem"),
                key: file("client.key"),
            }),
        },
        ..ConnectOptions::default()
    };
    let client = Client::connect_with(&url, options.clone()).await.unwrap();
    assert_eq!(client.packs().await.unwrap().len(), 1);
    options.tls.ca = None;
    let error = Client::connect_with(&url, options).await.unwrap_err();
    assert!(matches!(error, ClientError::Unreachable { .. }), "{error}");
    server.shut_down().await;
}
