//! The bones of a VRM file: it says which node is which.

use std::collections::BTreeMap;

use serde_json::Value;

use super::document::chunks;

/// Names of a file's nodes by the names of VRM's bones, such as `leftUpperLeg`. Of VRM 1.0 and 0.x;
/// empty for other files.
pub(crate) fn human_bones(bytes: &[u8]) -> BTreeMap<String, String> {
    found(bytes).unwrap_or_default()
}

fn found(bytes: &[u8]) -> Option<BTreeMap<String, String>> {
    let (text, _) = match bytes.starts_with(b"glTF") {
        true => chunks(bytes).ok()?,
        false => (bytes.into(), None),
    };
    let file: Value = serde_json::from_slice(&text).ok()?;
    let extensions = file.get("extensions")?;
    let bones = |name: &str| extensions.get(name)?.get("humanoid")?.get("humanBones");
    let listed: Vec<(&str, &Value)> = match (bones("VRMC_vrm"), bones("VRM")) {
        (Some(Value::Object(bones)), _) => bones.iter().map(|(bone, of)| (&**bone, of)).collect(),
        (_, Some(Value::Array(bones))) => bones
            .iter()
            .filter_map(|of| Some((of.get("bone")?.as_str()?, of)))
            .collect(),
        _ => return None,
    };
    let node = |of: &Value| {
        let node = usize::try_from(of.get("node")?.as_u64()?).ok()?;
        file.get("nodes")?.get(node)?.get("name")?.as_str()
    };
    let named = listed
        .into_iter()
        .filter_map(|(bone, of)| Some((bone.to_owned(), node(of)?.to_owned())));
    Some(named.collect())
}
