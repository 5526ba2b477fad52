"""The manifests of deploy/kubernetes and the files of Compose fit their schemas and each other."""

import copy
import importlib.metadata
import json
import os
import shutil
import subprocess
from pathlib import Path

import jsonschema
import pytest
import rendered
import yaml

FOLDERS = ("base", "overlays/production")
COMPOSE = ("compose.yaml", "deploy/cluster/compose.yaml")

if not rendered.program():
    reason = "*** deploy/kubernetes WAS NOT CHECKED: there is neither kustomize nor kubectl"
    assert os.environ.get("CI") != "true", reason
    pytest.skip(reason, allow_module_level=True)


@pytest.fixture(scope="module", params=FOLDERS)
def manifests(request: pytest.FixtureRequest) -> list[rendered.Manifest]:
    return rendered.render(rendered.FOLDER / request.param)


def test_nothing_is_wrong(manifests: list[rendered.Manifest]):
    assert list(rendered.faults(manifests)) == []
    kinds = {manifest["kind"] for manifest in manifests}
    assert kinds >= {
        "StatefulSet",
        "Deployment",
        "Service",
        "PodDisruptionBudget",
        "HorizontalPodAutoscaler",
        "NetworkPolicy",
    }


def server(manifests: list[rendered.Manifest]) -> dict:
    pod = rendered.one(manifests, "StatefulSet", "troupe")["spec"]["template"]["spec"]
    return pod["containers"][0]


def unknown_field(manifests):
    server(manifests)["readinessProbes"] = {}


def wrong_type(manifests):
    rendered.one(manifests, "PodDisruptionBudget", "troupe")["spec"]["maxUnavailable"] = [1]


def unknown_port(manifests):
    server(manifests)["readinessProbe"]["httpGet"]["port"] = "heath"


def short_grace(manifests):
    rendered.one(manifests, "StatefulSet", "troupe")["spec"]["template"]["spec"]["terminationGracePeriodSeconds"] = 30


def many_servers(manifests):
    rendered.one(manifests, "HorizontalPodAutoscaler", "troupe")["spec"]["maxReplicas"] = 25


def unknown_metric(manifests):
    metrics = rendered.one(manifests, "HorizontalPodAutoscaler", "troupe")["spec"]["metrics"]
    metrics[0]["pods"]["metric"]["name"] = "troupe_lead"


def more_rights(manifests):
    server(manifests)["securityContext"]["readOnlyRootFilesystem"] = False


def no_such_secret(manifests):
    volumes = rendered.one(manifests, "StatefulSet", "troupe")["spec"]["template"]["spec"]["volumes"]
    volumes[1]["secret"]["secretName"] = "keys"


def selects_nothing(manifests):
    rendered.one(manifests, "Service", "router")["spec"]["selector"] = {"app": "router"}


BREAKS = {
    unknown_field: "'readinessProbes' was unexpected",
    wrong_type: "[1] is not",
    unknown_port: "unknown port heath",
    short_grace: "is killed before",
    many_servers: "may start 25",
    unknown_metric: "no metric troupe_lead",
    more_rights: "server may do more",
    no_such_secret: "unknown Secret keys",
    selects_nothing: "Service router: selects no pod",
}


@pytest.mark.parametrize("break_it", BREAKS, ids=lambda break_it: break_it.__name__)
def test_a_mistake_is_found(manifests: list[rendered.Manifest], break_it):
    broken = copy.deepcopy(manifests)
    break_it(broken)
    found = list(rendered.faults(broken))
    assert found and all(BREAKS[break_it] in fault for fault in found), found


def test_the_overlay_changes_what_it_says():
    base, overlay = (rendered.render(rendered.FOLDER / folder) for folder in FOLDERS)
    assert {manifest["metadata"].get("namespace") for manifest in overlay if manifest["kind"] != "Namespace"} == {
        "troupe"
    }
    assert server(overlay)["image"] == "registry.example.com/troupe:1.0.0"
    assert server(overlay)["resources"]["limits"]["cpu"] == "8"
    assert server(overlay)["env"] == server(base)["env"]
    assert (rendered.servers_of_router(base), rendered.servers_of_router(overlay)) == (8, 24)
    images = {each["image"] for _, pod in rendered.pods_of(overlay) for each in rendered.containers(pod)}
    assert all(":" in image for image in images), images


def test_the_router_gets_a_line_for_each_server(manifests: list[rendered.Manifest], tmp_path: Path):
    """The container's own command makes the file, and HAProxy checks it."""
    container = rendered.one(manifests, "Deployment", "router")["spec"]["template"]["spec"]["initContainers"][0]
    command = container["command"][2]
    for place, prefix in (("/etc/router", "router"), ("/etc/servers", "router-servers")):
        folder = tmp_path / prefix
        folder.mkdir()
        for name, text in rendered.config_map(manifests, prefix).items():
            (folder / name).write_text(text)
        assert place in command
        command = command.replace(place, str(folder))
    made = tmp_path / "haproxy.cfg"
    command = command.replace("/run/router/haproxy.cfg", str(made))
    servers = rendered.servers_of_router(manifests)
    subprocess.run(["sh", "-c", command], env={**os.environ, "SERVERS": str(servers), "NAMESPACE": "stage"}, check=True)
    lines = [line.split() for line in made.read_text().splitlines() if line.strip().startswith("server ")]
    names = [f"troupe-{number}" for number in range(servers)]
    wanted = [(f"{name}:8080", f"{name}.troupe.stage.svc.cluster.local:8080") for name in names]
    assert [(line[1], line[2]) for line in lines] == wanted * 2
    before = (rendered.ROOT / "deploy/cluster/haproxy.cfg").read_text().splitlines()
    after = made.read_text().splitlines()
    is_server = lambda line: line.strip().startswith("server ")  # noqa: E731
    assert [line for line in after if not is_server(line)] == [line for line in before if not is_server(line)]
    if haproxy := shutil.which("haproxy") or shutil.which("/usr/sbin/haproxy"):
        checked = subprocess.run([haproxy, "-c", "-f", made], capture_output=True, text=True, check=False)
        assert checked.returncode == 0, checked.stderr


def test_prometheus_can_read_the_queries_of_the_adapter(tmp_path: Path):
    promtool = shutil.which("promtool") or rendered.ROOT / "target/prometheus/usr/bin/promtool"
    queries = []
    for rule in rendered.adapter_rules():
        query = rule["metricsQuery"].replace("<<.LabelMatchers>>", 'namespace="troupe"').replace("<<.GroupBy>>", "pod")
        assert "<<" not in query and "{" in rule["seriesQuery"]
        queries.append({"record": rule["name"]["as"], "expr": query})
    metrics = (rendered.ROOT / "docs/metrics.md").read_text()
    for query in queries:
        for name in ("troupe_lead_time_seconds", "troupe_queue_duration_seconds"):
            assert name not in query["expr"] or f"`{name}`" in metrics
    if not Path(promtool).exists():
        pytest.skip("*** THE QUERIES WERE NOT CHECKED: there is no promtool (scripts/check-prometheus.sh gets one)")
    file = tmp_path / "rules.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "adapter", "rules": queries}]}))
    subprocess.run([promtool, "check", "rules", file], check=True)
    # Debian's promtool was built without the discovery of pods.
    config = yaml.safe_load((rendered.FOLDER / "prometheus.yml").read_text())
    for scrape in config["scrape_configs"]:
        assert scrape.pop("kubernetes_sd_configs")
    file = tmp_path / "prometheus.yml"
    file.write_text(yaml.safe_dump(config))
    subprocess.run([promtool, "check", "config", "--syntax-only", file], check=True)


def compose_schema() -> dict:
    files = importlib.metadata.files("docker-compose") or []
    spec = json.loads(next(file for file in files if file.name == "compose_spec.json").read_text())
    # It is of 2021. Files of today also have a name.
    spec["properties"]["name"] = {"type": "string"}
    return spec


@pytest.mark.parametrize("name", COMPOSE)
def test_files_of_compose_fit_their_schema(name: str):
    found = yaml.safe_load((rendered.ROOT / name).read_text())
    checker = jsonschema.Draft201909Validator(compose_schema())
    checker.validate(found)
    service = next(iter(found["services"].values()))
    service["cap_dropp"] = ["ALL"]
    with pytest.raises(jsonschema.ValidationError, match="cap_dropp"):
        checker.validate(found)


def test_compose_and_the_router_name_the_same_servers():
    services = yaml.safe_load((rendered.ROOT / "deploy/cluster/compose.yaml").read_text())["services"]
    lines = (rendered.ROOT / "deploy/cluster/haproxy.cfg").read_text().splitlines()
    of_router = {line.split()[1] for line in lines if line.strip().startswith("server ")}
    advertised = {each.get("environment", {}).get("TROUPE_ADVERTISE") for each in services.values()} - {None}
    assert advertised == of_router == {f"{name}:8080" for name in services if name.startswith("troupe-")}
    for name, service in services.items():
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
