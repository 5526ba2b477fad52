"""A store with TLS and a password: a server keeps its sessions there, and one without the right authority says why not."""

import shutil
import ssl
import subprocess

import httpx
import pytest
import redis
from processes import Process, accepts, free_ports, until
from replicas import BINARY, Replica

NEEDED = {"redis-server": shutil.which("redis-server"), "openssl": shutil.which("openssl"), BINARY: BINARY.exists()}
LACKING = [str(name) for name, is_there in NEEDED.items() if not is_there]
pytestmark = pytest.mark.skipif(
    bool(LACKING), reason=f"*** A STORE WITH TLS WAS NOT TESTED: there is no {', no '.join(LACKING)}"
)
PASSWORD = "a secret of the test"


@pytest.fixture
def store(tmp_path):
    """Port and certificate of a Redis that speaks only TLS."""
    certificate, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    request = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    names = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    names += ["-addext", "basicConstraints=critical,CA:FALSE"]
    files = ["-keyout", key, "-out", certificate, "-days", "2"]
    subprocess.run([*request, *names, *files], check=True, capture_output=True)
    (port,) = free_ports(1)
    command = ["redis-server", "--port", "0", "--tls-port", str(port), "--bind", "127.0.0.1", "--save", ""]
    command += ["--tls-cert-file", str(certificate), "--tls-key-file", str(key), "--tls-auth-clients", "no"]
    command += ["--tls-ca-cert-file", str(certificate), "--requirepass", PASSWORD, "--dir", str(tmp_path)]
    process = Process(command, tmp_path / "redis.log")
    try:
        until(lambda: accepts(port), "Redis listens")
        yield port, certificate
    finally:
        process.kill()


def test_sessions_are_kept_over_tls(store, tmp_path, monkeypatch):
    port, certificate = store
    address = f"rediss://:{PASSWORD.replace(' ', '%20')}@localhost:{port}"
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    server = Replica("troupe-0:1", address, tmp_path)
    try:
        server.wait_ready()
        made = httpx.post(f"http://{server.address}/v1/sessions", json={"sessions": [{"id": "hero"}]}, trust_env=False)
        assert made.status_code == 200, made.text
        seen = redis.Redis("localhost", port, password=PASSWORD, ssl=True, ssl_ca_certs=str(certificate))
        until(lambda: seen.hget("troupe:session:hero", "record"), "the session is in the store")
        assert seen.hget("troupe:session:hero", "owner") == b"troupe-0:1"
    finally:
        server.kill()
    # Without its authority nothing is sent there.
    monkeypatch.setenv("SSL_CERT_FILE", ssl.get_default_verify_paths().openssl_cafile)
    other = Replica("troupe-1:1", address, tmp_path)
    try:
        other.wait_ready()
        refused = httpx.post(f"http://{other.address}/v1/sessions", json={"sessions": [{"id": "b"}]}, trust_env=False)
        assert refused.status_code == 503 and "certificate" in refused.text, refused.text
        assert PASSWORD not in refused.text and PASSWORD not in other.log.read_text()
    finally:
        other.kill()
