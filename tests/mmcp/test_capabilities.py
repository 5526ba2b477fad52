"""The server's list of models, read with the protocol's own client and schemas."""

import numpy as np
from motionmcp import ModelSpec
from motionmcp.client import model_supported_segments, pick_model, probe_server
from motionmcp.trajectory import fk_positions
from motionmcp_client import client


def test_every_model_is_one_of_the_protocol(ours):
    capabilities = ours.capabilities
    assert capabilities["protocol_version"] == "1.4"
    ids = [model["id"] for model in capabilities["models"]]
    assert len(set(ids)) == len(ids)
    assert ids[0] == "human", "the default pack comes first: clients take the first"
    assert {"g1", "unimogen/human", "unimogen/horse", "vermo"} <= set(ids)
    for model in capabilities["models"]:
        spec = ModelSpec.model_validate(model)
        assert spec.canonical_skeleton.root.name == model["canonical_skeleton"]["joints"][0]["name"]
        segments = ["text", "motion_reference"] if model["id"] == "vermo" else ["unconditioned"]
        assert model_supported_segments(model) == segments, model["id"]


def test_the_older_client_reads_it_too(ours):
    caps = client.get_capabilities(ours.url, use_cache=False)
    assert client.pick_model(caps, wanted="G1")["id"] == "g1"
    assert pick_model(caps, "missing")["id"] == "human"
    assert probe_server(ours.url).ok


def test_the_form_is_that_of_the_null_server(ours, theirs):
    assert set(ours.capabilities) == set(theirs.capabilities)
    for model in ours.capabilities["models"]:
        twin = theirs.model(model["id"])
        assert set(model) == set(twin)
        assert set(model["limits"]) == set(twin["limits"])
        assert model["supports_batch"] == twin["supports_batch"]
        assert model["supports_trajectory"] == twin["supports_trajectory"]


def test_skeletons_stand_at_rest(ours):
    for model in ours.capabilities["models"]:
        joints = model["canonical_skeleton"]["joints"]
        names = [joint["name"] for joint in joints]
        rotations = np.array([joint["rest_rotation"] for joint in joints])[None, None]
        root = np.array(joints[0]["rest_translation"])[None, None]
        places = fk_positions(joints, names, rotations, root)[0][0, 0]
        contacts = [names.index(name) for name in model["predicted_contact_joints"]]
        if contacts:
            assert abs(places[contacts, 1].min()) < 0.2, (model["id"], places[contacts, 1])
        assert np.ptp(places, axis=0).max() > 0.3, model["id"]
