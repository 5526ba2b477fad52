"""What kustomize makes of deploy/kubernetes, and what is wrong with it."""

import functools
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import kubernetes_validate
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy/kubernetes"
# The first version whose pods sleep in preStop by default, and the newest.
VERSIONS = ("1.30", "1.37")
# Secrets that people make, with the keys that are used (docs/kubernetes.md).
SECRETS = {"troupe-store": {"password"}, "troupe-keys": set()}
# A worker's running step, at the end of a drain.
STEP_MS = 10_000

Manifest = dict


def program() -> list[str] | None:
    """The command that renders a folder."""
    if shutil.which("kustomize"):
        return ["kustomize", "build"]
    return ["kubectl", "kustomize"] if shutil.which("kubectl") else None


def render(folder: Path) -> list[Manifest]:
    """The manifests of a folder with a kustomization."""
    command = program()
    assert command
    made = subprocess.run([*command, folder], capture_output=True, text=True, check=False)
    if made.returncode:
        raise AssertionError(made.stderr)
    return list(yaml.safe_load_all(made.stdout))


def faults(manifests: list[Manifest]) -> Iterator[str]:
    """Everything that is wrong with the manifests of a cluster."""
    for manifest in manifests:
        yield from (f"{name_of(manifest)}, {fault}" for fault in of_schema(json.dumps(manifest)))
    pods = list(pods_of(manifests))
    for manifest, pod in pods:
        yield from of_references(manifests, name_of(manifest), pod)
        yield from of_security(name_of(manifest), pod)
    yield from of_selectors(manifests, [pod["metadata"]["labels"] for _, pod in pods])
    yield from of_drain(one(manifests, "StatefulSet", "troupe"))
    yield from of_size(manifests)


@functools.cache
def of_schema(text: str) -> list[str]:
    """Unknown, missing and wrong fields of a manifest."""
    found = []
    for version in VERSIONS:
        try:
            kubernetes_validate.validate(json.loads(text), version, strict=True)
        except kubernetes_validate.ValidationError as error:
            found.append(f"Kubernetes {version}: {error.message}")
    return found


def pods_of(manifests: list[Manifest]) -> Iterator[tuple[Manifest, Manifest]]:
    """Each workload and its pods' template."""
    for manifest in manifests:
        if "template" in manifest.get("spec", {}):
            yield manifest, manifest["spec"]["template"]


def one(manifests: list[Manifest], kind: str, name: str) -> Manifest:
    """The manifest of this kind and name."""
    (found,) = [each for each in manifests if each["kind"] == kind and each["metadata"]["name"] == name]
    return found


def name_of(manifest: Manifest) -> str:
    """Kind and name."""
    return f"{manifest['kind']} {manifest['metadata']['name']}"


def containers(pod: Manifest) -> list[Manifest]:
    """All containers of a pod."""
    return [*pod["spec"].get("initContainers", []), *pod["spec"]["containers"]]


def of_references(manifests: list[Manifest], name: str, pod: Manifest) -> Iterator[str]:
    """ConfigMaps, Secrets, volumes and ports must be there."""
    maps = {each["metadata"]["name"] for each in manifests if each["kind"] == "ConfigMap"}
    volumes = {volume["name"] for volume in pod["spec"].get("volumes", [])}
    for volume in pod["spec"].get("volumes", []):
        if "configMap" in volume and volume["configMap"]["name"] not in maps:
            yield f"{name}: there is no ConfigMap {volume['configMap']['name']}"
        if "secret" in volume and volume["secret"]["secretName"] not in SECRETS:
            yield f"{name}: unknown Secret {volume['secret']['secretName']}"
    for container in containers(pod):
        ports = {port["name"] for port in container.get("ports", [])}
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            action = container.get(probe, {})
            port = action.get("httpGet", action.get("tcpSocket", {})).get("port")
            if port and port not in ports:
                yield f"{name}: {probe} asks an unknown port {port}"
        for mount in container.get("volumeMounts", []):
            if mount["name"] not in volumes:
                yield f"{name}: there is no volume {mount['name']}"
        for variable in container.get("env", []):
            asked = variable.get("valueFrom", {}).get("secretKeyRef")
            if asked and asked["key"] not in SECRETS.get(asked["name"], ()):
                yield f"{name}: unknown key {asked['key']} of the Secret {asked['name']}"


def of_security(name: str, pod: Manifest) -> Iterator[str]:
    """What Pod Security asks of `restricted`, and a root file system that cannot be written."""
    context = pod["spec"].get("securityContext", {})
    if not context.get("runAsNonRoot") or context.get("seccompProfile") != {"type": "RuntimeDefault"}:
        yield f"{name}: runs as root, or without a seccomp profile"
    if pod["spec"].get("automountServiceAccountToken") is not False:
        yield f"{name}: gets a token of the cluster"
    wanted = {"allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]}}
    for container in containers(pod):
        if container.get("securityContext") != wanted:
            yield f"{name}: the container {container['name']} may do more than it needs"
        if "memory" not in container.get("resources", {}).get("limits", {}):
            yield f"{name}: the container {container['name']} has no limit of memory"


def of_selectors(manifests: list[Manifest], labels: list[dict]) -> Iterator[str]:
    """Services, budgets and policies must find pods."""
    for manifest in manifests:
        spec = manifest.get("spec", {})
        selector = spec.get("podSelector", spec.get("selector", {}))
        wanted = selector if manifest["kind"] == "Service" else selector.get("matchLabels", {})
        if not any(wanted.items() <= each.items() for each in labels):
            yield f"{name_of(manifest)}: selects no pod"


def of_drain(servers: Manifest) -> Iterator[str]:
    """A pod must live until its server has stopped by itself."""
    pod = servers["spec"]["template"]["spec"]
    container = pod["containers"][0]
    values = {each["name"]: each.get("value") for each in container["env"]}
    sleep_ms = 1000 * container["lifecycle"]["preStop"]["sleep"]["seconds"]
    # Requests and then the store may take drain_timeout_ms each.
    delay_ms, timeout_ms = int(values["TROUPE_DRAIN_DELAY_MS"]), int(values["TROUPE_DRAIN_TIMEOUT_MS"])
    needed_ms = sleep_ms + delay_ms + 2 * timeout_ms + STEP_MS
    if needed_ms > 1000 * pod["terminationGracePeriodSeconds"]:
        yield f"StatefulSet troupe: stops within {needed_ms} ms, and is killed before"


def of_size(manifests: list[Manifest]) -> Iterator[str]:
    """The router must know all servers, and the adapter all metrics."""
    scaler = one(manifests, "HorizontalPodAutoscaler", "troupe")["spec"]
    servers = servers_of_router(manifests)
    if scaler["maxReplicas"] > servers:
        yield f"Deployment router: knows {servers} servers, and the autoscaler may start {scaler['maxReplicas']}"
    rules = {rule["name"]["as"] for rule in adapter_rules()}
    for metric in scaler["metrics"]:
        if metric["pods"]["metric"]["name"] not in rules:
            yield f"HorizontalPodAutoscaler troupe: the adapter has no metric {metric['pods']['metric']['name']}"


def servers_of_router(manifests: list[Manifest]) -> int:
    """How many servers the router knows."""
    pod = one(manifests, "Deployment", "router")["spec"]["template"]["spec"]
    variables = {each["name"]: each.get("value") for each in pod["initContainers"][0]["env"]}
    return int(variables["SERVERS"])


def adapter_rules() -> list[dict]:
    """Rules of the Prometheus adapter."""
    return yaml.safe_load((FOLDER / "adapter.yaml").read_text())["rules"]


def config_map(manifests: list[Manifest], prefix: str) -> dict[str, str]:
    """The files of a generated ConfigMap, whose name ends in a hash."""
    pattern = re.compile(re.escape(prefix) + r"-[a-z0-9]{10}")
    (found,) = [
        each["data"]
        for each in manifests
        if each["kind"] == "ConfigMap" and pattern.fullmatch(each["metadata"]["name"])
    ]
    return found
