"""Requests to a server of the protocol, and answers that the protocol's own clients check and read."""

import http.client
import json
from dataclasses import dataclass
from urllib.parse import urlsplit

import motionmcp_client.gltf_parser
import numpy as np
from motionmcp.client import parse_gltf_samples
from motionmcp.errors import STATUS_FOR
from motionmcp.schemas import GenerateRequest
from motionmcp.trajectory import fk_positions

NOTES = {"code", "severity", "message"}


@dataclass
class Server:
    """A server of the protocol."""

    url: str
    capabilities: dict

    def model(self, name: str) -> dict:
        return next(model for model in self.capabilities["models"] if model["id"] == name)

    def send(self, body, method="POST", path="/generate", headers=None) -> tuple[int, dict, dict]:
        """Status, headers and the parsed body of an answer."""
        where = urlsplit(self.url)
        connection = http.client.HTTPConnection(where.hostname, where.port, timeout=120)
        raw = body if isinstance(body, bytes) else json.dumps(body).encode()
        connection.request(method, path, raw, {"Content-Type": "application/json", **(headers or {})})
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, json.loads(text or b"{}")

    def error(self, body, **more) -> tuple[str, dict]:
        """Code and envelope of an answer that must be an error of the protocol's list, with its status."""
        status, headers, answer = self.send(body, **more)
        assert list(answer) == ["error"], (status, str(answer)[:500])
        error = answer["error"]
        assert set(error) == {"code", "message", "details"}, error
        assert STATUS_FOR[error["code"]] == status, error
        assert "json" in headers["content-type"]
        assert isinstance(error["message"], str)
        assert isinstance(error["details"], dict)
        return error["code"], error

    def make(self, body: dict) -> "Answer":
        """The answer to a request. Both must be valid in the protocol."""
        GenerateRequest.model_validate(body)
        status, headers, document = self.send(body)
        assert status == 200, document
        assert headers["content-type"] == "model/gltf+json"
        return Answer(body, document, self.model(body["model"]))


def free(frames: int, **more) -> dict:
    return {"type": "unconditioned", "duration_frames": frames, **more}


def request(model: dict, segments=None, **more) -> dict:
    """A request with a model's own skeleton."""
    body = {"protocol_version": "1.4", "model": model["id"], "skeleton": model["canonical_skeleton"]}
    if segments is not None:
        body["segments"] = segments
    return {**body, **more}


def root_path(points: dict[int, tuple[float, float]], headings=None) -> dict:
    path = {"type": "root_path", "frames": list(points), "positions_xz": [list(place) for place in points.values()]}
    return path if headings is None else {**path, "heading_radians": headings}


class Answer:
    """A document that is valid in the protocol, and its samples as both clients read them."""

    def __init__(self, body: dict, document: dict, model: dict):
        self.document = document
        self.joints = body["skeleton"]["joints"]
        self.names = [joint["name"] for joint in self.joints]
        self.extension = document["extensions"]["MMCP_motion"]
        self.fps = body.get("timing", {}).get("fps", model["fps"])
        segments = body.get("segments")
        self.frames = sum(s["duration_frames"] for s in segments) if segments else body["duration_frames"]
        self.samples = parse_gltf_samples(document)
        self._check_document(body, model)
        self._check_samples(body, model)

    def _check_document(self, body: dict, model: dict):
        document = self.document
        assert document["asset"]["version"] == "2.0"
        assert document["extensionsUsed"] == ["MMCP_motion"]
        assert [node["name"] for node in document["nodes"]] == self.names
        for node, joint in zip(document["nodes"], self.joints, strict=True):
            np.testing.assert_allclose(node.get("translation", [0, 0, 0]), joint["rest_translation"], atol=1e-5)
            children = [self.joints[child]["parent"] for child in node.get("children", [])]
            assert all(parent == joint["name"] for parent in children)
        for animation in document["animations"]:
            paths = [(c["target"]["node"], c["target"]["path"]) for c in animation["channels"]]
            roots = [i for i, joint in enumerate(self.joints) if joint["parent"] is None]
            assert sorted(paths) == sorted(
                [(i, "rotation") for i in range(len(self.joints))] + [(roots[0], "translation")]
            )
            assert {sampler["interpolation"] for sampler in animation["samplers"]} == {"LINEAR"}
        extension = self.extension
        assert extension["model"] == body["model"]
        assert extension["version"] == "1.4"
        assert extension["fps"] == self.fps
        assert set(extension) <= {"version", "model", "fps", "samples", "notes", "canonical_to_request"}
        canonical = {joint["name"] for joint in model["canonical_skeleton"]["joints"]}
        mapped = extension.get("canonical_to_request", {})
        assert set(mapped) <= canonical
        assert set(mapped.values()) <= set(self.names)
        for note in extension.get("notes", []):
            assert set(note) == NOTES
            assert note["severity"] in ("info", "warning")

    def _check_samples(self, body: dict, model: dict):
        wanted = (body.get("options") or {}).get("num_samples", 1)
        assert len(self.samples) == len(self.extension["samples"]) == wanted
        older = motionmcp_client.gltf_parser.parse_gltf_samples(self.document)
        for index, (sample, other, entry) in enumerate(
            zip(self.samples, older, self.extension["samples"], strict=True)
        ):
            assert sample["num_frames"] == other["num_frames"] == entry["num_frames"] == self.frames
            assert entry["name"] == self.document["animations"][index]["name"]
            assert sample["joint_names"] == other["joint_names"] == self.names
            assert abs(other["fps"] - self.fps) < 0.01 or self.frames == 1
            assert np.isfinite(sample["local_rot_mats"]).all()
            boundaries = entry["chunk_boundaries"]
            assert boundaries == sorted(set(boundaries))
            assert all(0 < frame < self.frames for frame in boundaries)
            contacts = set(entry.get("foot_contacts", {}))
            if self.extension.get("canonical_to_request"):
                assert contacts <= set(self.names)
            else:
                assert contacts == set(model["predicted_contact_joints"])
            trajectory = entry["trajectory"]
            assert len(trajectory["position"]) == len(trajectory["yaw"]) == self.frames
            assert trajectory["yaw"][0] == 0
            assert trajectory["loop"] == bool((body.get("options") or {}).get("loop", False))

    def notes(self) -> set[str]:
        return {note["code"] for note in self.extension.get("notes", [])}

    def quaternions(self) -> np.ndarray:
        """Local rotations, [samples, frames, joints, 4]: x, y, z, w."""
        import base64

        document = self.document
        data = base64.b64decode(document["buffers"][0]["uri"].split(",", 1)[1])
        made = np.zeros((len(self.samples), self.frames, len(self.names), 4), dtype=np.float64)
        for index, animation in enumerate(document["animations"]):
            for channel in animation["channels"]:
                if channel["target"]["path"] == "rotation":
                    accessor = document["accessors"][animation["samplers"][channel["sampler"]]["output"]]
                    view = document["bufferViews"][accessor["bufferView"]]
                    values = np.frombuffer(data, "<f4", accessor["count"] * 4, view["byteOffset"])
                    made[index, :, channel["target"]["node"]] = values.reshape(-1, 4)
        np.testing.assert_allclose(np.linalg.norm(made, axis=-1), 1, atol=1e-4)
        return made

    def roots(self) -> np.ndarray:
        """Places of the root, [samples, frames, 3]."""
        root = next(i for i, joint in enumerate(self.joints) if joint["parent"] is None)
        return np.stack([sample["posed_joints"][:, root] for sample in self.samples]).astype(np.float64)

    def positions(self) -> np.ndarray:
        """World places of all joints, [samples, frames, joints, 3], by the protocol's own kinematics."""
        return fk_positions(self.joints, self.names, self.quaternions(), self.roots())[0]

    def contacts(self, sample=0) -> np.ndarray:
        """Contacts of the joints that the answer names, [frames, contacts]."""
        return np.array(list(self.extension["samples"][sample]["foot_contacts"].values()), dtype=bool).T


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between rotations, radians."""
    dot = np.abs((a * b).sum(-1)) / (np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1))
    return 2 * np.arccos(np.clip(dot, 0, 1))
